"""The base class: what a short effect gets from it, and what every effect of the catalogue keeps to."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from scara_ident.effects import (
    CATALOGUE,
    Coefficient,
    Effect,
    EffectTerm,
    Member,
    NonlinearParameter,
    Signals,
    SpectralLine,
)
from scara_ident.errors import ScaraIdentError
from scara_ident.robot.robot import load_robot
from scara_ident.simulation import EFFECTS
from tests.arms import example_urdf
from tests.effects.scenes import columns, moving, scene_of
from tests.simulation.made import tree

EVERY = pytest.mark.parametrize("effect", CATALOGUE, ids=lambda effect: type(effect).__name__)


class Hook(Effect):
    """As short as an effect can be."""

    name = "hook"
    summary = "a hook on {joint} that bends at {bend:g}"
    coefficients = (Coefficient("size", "{torque}/{position}", "hook of {joint}", "it would push", 2.0, "{value:g} is a lot"),)  # fmt: skip
    nonlinear = (NonlinearParameter("bend", "rad", 0.01, 100.0),)

    def signal_columns(self, signals, member):
        return [np.maximum(signals.motion.q[member.place] - member.nonlinear[0], 0.0)]


@lru_cache(maxsize=1)
def scene_of_ur5():
    return scene_of(load_robot(example_urdf("ur5_robot.urdf")), start={"m": 0.0, "other_1": 5.0, "other_2": 9.0})


def members(effect, scene):
    if effect.by_recording:
        # Which, the torque of recordings would tell.
        own = Member(None, (0.1,) * len(effect.nonlinear))
        return (effect.in_recordings(scene, own, frozenset(["m"])),)
    if effect.after_correction:
        return (Member(None),)
    line = SpectralLine(effect.seeded_by or "order", 3.0)
    return effect.members(scene)[::5] or effect.seeds(scene, 0, line)


def test_a_short_effect_acts_on_each_moving_joint_at_spaced_values():
    scene = scene_of(load_robot())
    tried = Hook().members(replace(scene, speed=np.array([0.0, 2.0])))
    assert {member.joint for member in tried} == {1}
    bends = [member.nonlinear[0] for member in tried]
    assert bends == pytest.approx(10.0 ** np.array([-4 / 3, -2 / 3, 0.0, 2 / 3, 4 / 3]))
    item = moving(scene.robot, 0.2)
    found = columns(Hook(), scene, item, Member(1, (0.1,)))
    assert np.array_equal(found[1, 0], np.maximum(item.q[1] - 0.1, 0.0))
    assert np.any(found[1])


def test_a_short_effect_is_described_in_the_words_of_its_joint(tmp_path):
    scene, member = scene_of(tree(tmp_path)), Member(1, (0.1,))
    (column,) = Hook().columns(scene, member)
    assert scene.robot.prismatic[1]
    unit = f"{scene.robot.torque_unit(1)}/m"
    assert (column.name, column.joint, column.unit) == ("size", scene.robot.joints[1], unit)
    assert column.meaning == f"hook of {scene.robot.joints[1]}"
    assert column.nonnegative
    assert Hook().description(scene, member) == f"a hook on {scene.robot.joints[1]} that bends at 0.1"
    found = Hook().parameters(scene, member, np.array([0.7]), np.array([[0.04]]))["size"]
    assert (found.value, found.std, found.unit) == (0.7, pytest.approx(0.2), unit)


def test_limits_are_said_with_the_coefficient():
    scene, member, std = scene_of(load_robot()), Member(0, (0.1,)), np.array([0.1])
    assert Hook().inadmissible(scene, member, np.array([-0.21]), std) == "it would push"
    assert Hook().inadmissible(scene, member, np.array([2.5]), std) == "2.5 is a lot"
    assert [Hook().inadmissible(scene, member, np.array([x]), std) for x in (-0.19, 0.0, 2.19)] == [None] * 3


@pytest.mark.parametrize(
    ("made", "said"),
    [
        (lambda time: [time, time], "effect hook: 1 coefficients, but 2 columns"),
        (lambda time: [time[1:]], r"effect hook: column 0 has shape \(9,\); expected \(10,\)"),
        (lambda time: [time[None]], r"effect hook: column 0 has shape \(1, 10\); expected .* or \(2, 10\)"),
    ],
)
def test_columns_that_do_not_fit_are_an_error(made, said):
    class Torn(Hook):
        def signal_columns(self, signals, member):
            return made(signals.time)

    scene, item = scene_of(load_robot()), moving(load_robot(), 0.02)
    with pytest.raises(ScaraIdentError, match=said):
        Torn().by_joint(Signals(scene, item), Member(0, (0.1,)))


def test_effects_are_equal_by_class():
    assert Hook() == Hook()
    assert len({*CATALOGUE, *(type(effect)() for effect in CATALOGUE)}) == len(CATALOGUE)


@EVERY
def test_every_member_has_words_columns_and_rows_that_agree(effect):
    scene = scene_of_ur5()
    item = moving(scene.robot, 0.1)
    for member in members(effect, scene):
        found = columns(effect, scene, item, member)
        term = EffectTerm(effect, member, scene)
        rows = [np.full((np.count_nonzero(row), item.samples), np.nan) for row in term.pattern]
        term.fill(item, rows)
        for dense, row, active in zip(found, rows, term.pattern, strict=True):
            assert np.array_equal(dense[active], row)
        assert "{" not in term.effect.description(scene, member) + repr(term.columns)
        assert (member.joint is None) == (term.joint is None)
        resolution = effect.resolution(scene, member)
        assert resolution is None or len(resolution) == len(effect.nonlinear)
        assert effect.geared_joint(member) in (None, member.joint)


@EVERY
def test_the_columns_follow_the_estimate_only_where_the_effect_says_so(effect):
    scene = scene_of_ur5()
    item = moving(scene.robot, 0.2)
    moved = [
        replace(scene, value=1.1 * scene.value + 0.01),
        replace(scene, armatures={joint: 0.3 for joint in range(scene.robot.n)}),
    ]
    tried = members(effect, scene)
    follows = any(
        not np.array_equal(effect.regressor(Signals(scene, item), member), effect.regressor(Signals(other, item), member))
        for member in tried
        for other in moved
    )  # fmt: skip
    assert follows == (effect.follows_estimate and bool(tried))
    # Intervals are told by a torque, which this scene is without; and no joint of it goes up and down.
    assert tried or effect.in_intervals or effect.name in ("inertia_coupling", "rope_weight")


@EVERY
def test_the_virtual_arm_has_it_or_it_says_why_not(effect):
    assert (effect.name in EFFECTS) == (not effect.not_simulated)


@EVERY
def test_data_are_corrected_only_where_the_effect_says_so(effect):
    scene = scene_of_ur5()
    for member in members(effect, scene):
        if not effect.corrects_data(member) and effect.name != "time_delay":
            value = np.ones(len(effect.columns(scene, member)))
            recording = object()
            assert effect.corrected(recording, member, value) is recording
            assert effect.settled(value)
            assert effect.negligible(scene, member, value) is None


@pytest.mark.slow
@EVERY
def test_what_is_an_angle_on_a_turning_joint_is_a_length_on_a_sliding_one(effect, tmp_path):
    """Angles of the motor and phases stay angles: they have names of their own."""
    scene = scene_of(tree(tmp_path))
    for joint, slides in enumerate(scene.robot.prismatic):
        for member in (item for item in effect.members(scene) if item.joint == joint and item.partner is None):
            words = effect.words(scene, member)
            units = [item.unit.format(**words) for item in effect.nonlinear]
            units += [column.unit for column in effect.columns(scene, member)]
            assert not any("rad" in unit for unit in units) or not slides, units


@pytest.mark.parametrize(
    "effect", [item for item in CATALOGUE if item.on_links], ids=lambda effect: type(effect).__name__
)
def test_what_acts_on_links_is_the_columns_times_the_coefficients(effect):
    scene = scene_of_ur5()
    item = moving(scene.robot, 0.05)
    for member in members(effect, scene)[:2]:
        table = effect.regressor(Signals(scene, item), member)
        value = np.linspace(1.0, 2.0, table.shape[1])
        found = effect.torque_on_links(Signals(scene, item), member, value)
        expected = np.einsum("jkn,k->jn", table, value)
        # A spring says where it rests by the offset of its joint.
        change = found - expected
        assert np.allclose(change, change[:, :1], rtol=0.0, atol=1e-9 * np.max(np.abs(expected), initial=1.0))
        assert effect.geared_joint(member) is None
