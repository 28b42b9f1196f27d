"""The shape of friction that the data allow: the test's size and power, and what is chosen."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from scara_ident.estimation import ConsistentOptions, consistent, wls
from scara_ident.estimation.consistent.problem import declared
from scara_ident.estimation.consistent.shape import (
    SIGNIFICANCE_LEVEL,
    ShapeChoice,
    block_shares,
    choose_shapes,
    distance_to_cone,
    lubricated_p_value,
)
from scara_ident.estimation.joint_rows import JointRows
from scara_ident.estimation.observations import Observations
from scara_ident.motion.prepared import PreparedData
from tests.arms import motion
from tests.estimation.consistent.arms import moving, observed, scara, stroke, truth

MODEL = scara()
OPTIONS = ConsistentOptions()
FIRST, SECOND = declared(MODEL, OPTIONS)[1]


def friction(**parameters: float) -> np.ndarray:
    value = truth(MODEL)
    for name, number in parameters.items():
        value[MODEL.names.index(name)] = number
    return value


def choices(item: Observations, options: ConsistentOptions = OPTIONS) -> tuple[ShapeChoice, ...]:
    return choose_shapes(declared(item.model, options)[1], options, item, wls(item))


def test_the_distance_to_a_cone_is_that_of_its_nearest_point():
    quadrant = np.eye(2)
    assert distance_to_cone(quadrant, np.array([1.0, 2.0]), np.eye(2)) == 0.0
    assert distance_to_cone(quadrant, np.array([-1.0, 2.0]), np.diag([0.25, 1.0])) == pytest.approx(4.0)
    assert distance_to_cone(quadrant, np.array([-1.0, -2.0]), np.eye(2)) == pytest.approx(5.0)
    # Where the two are correlated the nearest point moves along both: 1 / (V_11 alone), as the second is free.
    correlated = np.array([[1.0, 0.8], [0.8, 1.0]])
    assert distance_to_cone(quadrant[:1], np.array([-1.0, 0.0]), correlated) == pytest.approx(1.0)


def test_what_is_not_known_contradicts_nothing():
    rows, value = np.array([[1.0, 1.0]]), np.array([-1.0, 0.0])
    assert distance_to_cone(rows, value, np.diag([0.01, 0.01])) == pytest.approx(50.0)
    assert distance_to_cone(rows, value, np.diag([0.01, np.inf])) < 1e-9


def test_blocks_count_by_their_share():
    item = observed(MODEL, moving(MODEL.robot, count=4000), truth(MODEL), 0.05)
    plain = wls(item)
    whole = block_shares(item, plain, FIRST.columns).effective
    assert 4.0 < whole < item.blocks == 20
    # A block that moves ten times as fast as the others decides alone.
    single = replace(item, joints=tuple(rows.faded(np.append(1e4, np.ones(19))) for rows in item.joints))
    assert block_shares(single, wls(single), FIRST.columns).effective < 2.0 < whole


def runs(*items: Observations, names: tuple[str, ...]) -> Observations:
    """Runs of some trajectories as if observed together."""
    joints = []
    for rows in zip(*(item.joints for item in items), strict=True):
        ends = np.cumsum([0, *(part.starts[-1] for part in rows)])
        starts = [part.starts[:-1] + end for part, end in zip(rows, ends[:-1], strict=True)]
        table = np.concatenate([part.table for part in rows], axis=1)
        counts = np.concatenate([part.counts for part in rows])
        joints.append(JointRows(rows[0].columns, table, np.concatenate([*starts, ends[-1:]]), counts))
    owner = np.repeat(np.arange(len(items)), items[0].blocks)
    data = SimpleNamespace(recordings=[SimpleNamespace(trajectory=name) for name in names], labels=names)
    return replace(items[0], joints=tuple(joints), owner=owner, data=data)


def test_runs_that_repeat_what_they_leave_count_once():
    moved = moving(MODEL.robot)
    again = runs(*[observed(MODEL, moved, truth(MODEL), 0.05, seed=1)] * 4, names=("A",) * 4)
    noisy = runs(*(observed(MODEL, moved, truth(MODEL), 0.05, seed) for seed in range(4)), names=("A",) * 4)
    other = replace(again, data=runs(*[again] * 4, names=("A", "B", "C", "D")).data)
    # The estimate is that of one long run: what differs between runs stands in its covariance, which takes no part here.
    same, fresh, apart = (
        block_shares(item, wls(replace(item, data=PreparedData((), ()), owner=0 * item.owner)), FIRST.columns)
        for item in (again, noisy, other)
    )
    # Four runs with the same residuals know no more than one.
    assert same.repetition == pytest.approx(4.0)
    assert fresh.repetition < 2.0
    assert apart.repetition == 1.0
    assert apart.effective == pytest.approx(4.0 * same.effective)


@pytest.mark.slow
def test_true_shapes_are_seldom_contradicted():
    """At the shape's edge, where friction is linear, noise breaks it in most draws; the test's size holds there."""
    value = friction(a21=0.0, a22=0.0, a31=0.0, a32=0.0)
    found = []
    for seed in range(100):
        item = observed(MODEL, moving(MODEL.robot), value, 0.05, seed)
        plain = wls(item)
        found += [lubricated_p_value(polynomial, item, plain) for polynomial in (FIRST, SECOND)]
    assert np.mean(np.array(found) < 1.0) > 0.5
    # Of 200 p-values 20 are expected below 0.1 at most, with a standard deviation of 4.2.
    assert np.count_nonzero(np.array(found) < 0.1) <= 33


@pytest.mark.parametrize(
    "wrong", [{"a21": 0.05}, {"a11": -0.03, "a21": 0.02}], ids=["grows ever faster", "falls with speed"]
)
def test_a_joint_whose_data_contradict_the_shape_is_let_go_and_the_others_are_not(wrong: dict[str, float]):
    item = observed(MODEL, moving(MODEL.robot), friction(**wrong), 0.05)
    first, second = choices(item)
    assert (first.shape, second.shape) == ("dissipative", "lubricated")
    assert first.p_value < SIGNIFICANCE_LEVEL < second.p_value
    assert first.why == "the data contradict the lubricated shape"
    assert consistent(item).shapes == (first, second)


def test_a_short_stroke_contradicts_nothing():
    item = observed(MODEL, stroke(MODEL.robot), friction(a21=0.05), 0.3)
    assert [choice.shape for choice in choices(item)] == ["lubricated", "lubricated"]


def test_a_joint_that_never_moves_contradicts_nothing():
    moved = moving(MODEL.robot)
    one = np.array([[1.0], [0.0]])
    item = observed(MODEL, motion(moved.q * one, moved.v * one, moved.a * one, rate=200.0), truth(MODEL), 0.02)
    assert choices(item)[1].shape == "lubricated"


def test_a_shape_can_be_asked_for_joint_by_joint():
    item = observed(MODEL, moving(MODEL.robot), friction(a21=0.05), 0.05)
    first, second = choices(item, ConsistentOptions(friction={"joint1": "lubricated"}))
    assert (first.shape, first.p_value, first.why) == ("lubricated", None, "as asked for")
    assert second.p_value is not None


def test_without_a_velocity_limit_friction_only_takes_energy_out():
    item = observed(MODEL, moving(MODEL.robot), truth(MODEL), 0.05)
    endless = replace(FIRST, speed=np.inf)
    (found,) = choose_shapes([endless], OPTIONS, item, wls(item))
    assert (found.shape, found.p_value) == ("dissipative", None)
    assert "no velocity limit" in found.why
