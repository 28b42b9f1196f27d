"""Groups of recordings: told by torque, not by names; none where nothing differs, and none of what is known to be bare."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin
import pytest

from scara_ident.diagnosis.selection.search import scene_of
from scara_ident.effects import Scene
from scara_ident.effects.payload import PayloadOfRecordings
from scara_ident.effects.recording_groups import groups_by_torque, inverse_of
from scara_ident.estimation.least_squares import wls
from scara_ident.estimation.observations import observe
from scara_ident.model.model import build_model
from scara_ident.motion.prepared import prepare
from tests.arms import ur5
from tests.truth.scenes import formula_run, payload_torque

FIRST_MOMENTS = (0, 1, 2, 3)
BOX = pin.Inertia.FromBox(0.6, 0.1, 0.15, 0.05)
HEAVY = pin.Inertia(1.5, np.array([0.05, -0.03, 0.1]), np.diag([0.004, 0.005, 0.006]))


def scene(carried: Sequence[pin.Inertia | None], noise: float = 0.02) -> Scene:
    """Recordings of a UR5, one for each payload."""
    robot = ur5()
    runs = [
        formula_run(
            robot, f"r_{k}", [3, k], seconds=10.0, rate=100.0, noise=noise,
            added=None if body is None else payload_torque(robot, body),
        )
        for k, body in enumerate(carried)
    ]  # fmt: skip
    observations = observe(build_model(robot), prepare(runs, (5.0,) * robot.n))
    return scene_of(observations.model, wls(observations).value, observations)


def groups(found: Scene, unloaded: Sequence[str] = ()) -> list[set[str]]:
    return [set(group) for group in groups_by_torque(found, FIRST_MOMENTS, frozenset(unloaded))]


@pytest.fixture(scope="module")
def some() -> Scene:
    return scene([BOX, None, None, BOX, None])


def test_recordings_with_a_payload_are_recognised_by_their_torque(some: Scene):
    assert groups(some)[0] == {"r_0", "r_3"}


def test_what_is_known_to_be_bare_is_in_no_group(some: Scene):
    assert groups(some, ["r_1", "r_4"])[0] == {"r_0", "r_3"}
    # Told the wrong way round, the others carry less: the effect then says so, or that it is no body, as where friction grows
    # with load: of an Airbot's loaded run, whose torques are up to twice as large, it was said to carry less.
    assert groups(some, ["r_0", "r_3"])[0] == {"r_1", "r_2", "r_4"}
    family = PayloadOfRecordings().knowing(frozenset(["r_0", "r_3"]))
    member = family.members(some)[0]
    assert family.description(some, member) == "a payload in r_1, r_2, r_4 and not in the others"
    size = len(family.columns(some, member))
    body, std = np.array([-1.0, *[-0.1] * (size - 1)]), 0.01 * np.ones(size)
    why = family.inadmissible(some, member, body, std)
    assert (
        why
        == "its mass would be negative: these recordings carry less than the others, or the difference is not a body"
    )


def test_two_payloads_make_three_groups():
    found = groups(scene([None, BOX, HEAVY, None, HEAVY, BOX]))
    assert found[0] in ({"r_2", "r_4"}, {"r_1", "r_2", "r_4", "r_5"})
    assert {"r_2", "r_4"} in found


def test_where_all_carry_the_same_there_is_no_group():
    assert groups(scene([BOX] * 4)) == []
    assert groups(scene([None] * 2, noise=0.05)) == []


def test_the_inverse_is_that_of_the_directions_determined():
    """Columns of very different sizes, one of them zero, and two the same."""
    rng = np.random.default_rng(5)
    columns = rng.standard_normal((2, 3, 20)) * np.array([1e-4, 1.0, 1e3])[:, None]
    found = inverse_of(columns @ columns.swapaxes(1, 2))
    assert np.allclose(found @ (columns @ columns.swapaxes(1, 2)), np.eye(3), atol=1e-6)
    column = columns[0, :1]
    twice = np.concatenate([column, np.zeros_like(column), column])
    assert inverse_of(twice @ twice.T) == pytest.approx(
        np.array([[1, 0, 1], [0, 0, 0], [1, 0, 1]]) / (4.0 * np.sum(column**2))
    )
