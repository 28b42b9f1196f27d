"""A mass at one point: its column against Pinocchio, where it is tried, and what a search makes of it."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from scara_ident.diagnosis import model_selection
from scara_ident.diagnosis.diagnose import Diagnosis, diagnose
from scara_ident.effects import Member, effects_named
from scara_ident.effects.compact_payload import CompactPayload
from scara_ident.effects.links import tool_of
from scara_ident.effects.payload import SHORTEST_ARM, PayloadChange, PayloadOfRecordings
from scara_ident.model.base_parameters import size_of
from scara_ident.recording.recording import Recording
from scara_ident.robot.robot import load_robot
from tests.arms import rnea, ur5
from tests.effects.scenes import columns, moving, scene_of
from tests.effects.test_payload import laden
from tests.truth.scenes import formula_run, payload_torque

POINT = np.array([0.03, -0.02, 0.14])


def test_its_column_is_the_torque_of_a_ball_where_it_sits():
    robot = ur5()
    item, scene = moving(robot, 1.0), scene_of(robot, start={"other": -1.0, "m": 0.0})
    body = PayloadOfRecordings().in_recordings(scene, Member(None), frozenset(["m"]))
    value = np.zeros(10)
    value[[1, 3]] = -0.03, 0.04
    member = CompactPayload().in_place_of(scene, PayloadOfRecordings(), body, value)
    assert member is not None
    # As its tool is near the last joint, farther out than that: a share of the arm.
    out = SHORTEST_ARM * size_of(robot)
    assert out > np.linalg.norm(tool_of(robot).point)
    np.testing.assert_allclose(member.nonlinear, out * np.array([-0.6, 0.0, 0.8]))
    placed = Member(None, tuple(POINT), body.partner)
    state = (item.q, item.v, item.a)
    added = (rnea(laden(robot, 0.7, POINT), *state) - rnea(robot, *state)) * robot.row_scale[:, None]
    column = columns(CompactPayload(), scene, item, placed)
    assert column.shape[1] == 1
    assert np.abs(0.7 * column[:, 0] - added).max() < 1e-9 * np.abs(added).max()
    elsewhere = Member(None, tuple(POINT), 1)
    assert not np.any(columns(CompactPayload(), scene, item, elsewhere))
    assert "negative" in str(CompactPayload().inadmissible(scene, placed, np.array([-0.5]), np.array([0.1])))


def test_it_takes_the_place_of_a_body_mounted_anyhow_alone_and_where_torque_tells_where_it_sits():
    scene = scene_of(ur5(), start={"m": 0.0})
    member = Member(None, (), 1)
    for other in (PayloadChange(), CompactPayload(), PayloadOfRecordings(at_tool=True)):
        assert CompactPayload().in_place_of(scene, other, member, np.ones(10)) is None
    # Behind vertical axes alone no torque tells how high it is.
    assert (
        CompactPayload().in_place_of(
            scene_of(load_robot(), start={"m": 0.0}), PayloadOfRecordings(), member, np.ones(10)
        )
        is None
    )
    assert CompactPayload().members(scene) == ()


@pytest.fixture(scope="module")
def runs() -> list[Recording]:
    robot = ur5()
    carried = payload_torque(robot, pin.Inertia(1.2, POINT, np.zeros((3, 3))))
    return [
        formula_run(robot, f"run_{k}", [31, k], seconds=10.0, rate=100.0, added=carried if k in (1, 2, 5) else None)
        for k in range(6)
    ]


def found_in(runs: list[Recording]) -> Diagnosis:
    found = diagnose(ur5(), runs[:5], validation=runs[5:], catalogue=effects_named("payload_change"))
    (effect,) = found.effects
    assert effect.description == "a payload in run_1, run_2 and not in the others"
    told = {"mass": 1.2, **{f"com_{axis}": x for axis, x in zip("xyz", POINT, strict=True)}}
    assert set(effect.parameters) == set(told)
    for name, true in told.items():
        parameter = effect.parameters[name]
        assert parameter.value == pytest.approx(true, abs=4.0 * parameter.std), name
        assert parameter.std < 0.02
    return found


@pytest.mark.slow
def test_it_is_found_where_a_body_would_be_none(runs: list[Recording], monkeypatch: pytest.MonkeyPatch):
    """An Airbot with 0.48 kg in its gripper: ten parameters made -0.23 ± 0.07 kg of it, and nothing was found; now 0.23 ± 0.1 kg."""
    admissible = PayloadOfRecordings.inadmissible

    def none(self, scene, member, value, std):
        return admissible(self, scene, member, value, std) if len(value) == 1 else "no body"

    monkeypatch.setattr(PayloadOfRecordings, "inadmissible", none)
    found = found_in(runs)
    assert any("run_5: its first third shows payload_change" in note for note in found.notes)


@pytest.mark.slow
def test_it_is_found_where_a_body_that_came_in_is_none_in_the_end(
    runs: list[Recording], monkeypatch: pytest.MonkeyPatch
):
    """The same arm in five parts: the body came in with -0.22 kg, hardly told, and went; now 0.24 ± 0.07 kg stay."""
    settled = model_selection.unsettled

    def unsettled(search, weights):
        bodies = [k for k, item in enumerate(search.chosen) if type(item.effect) is PayloadOfRecordings]
        gone = [search.step.without(k).judge([search.chosen[k]])[0].refused("no body") for k in bodies]
        return gone or settled(search, weights)

    monkeypatch.setattr(model_selection, "unsettled", unsettled)
    found = found_in(runs)
    # What stands in its place is found, so that it is not said to be missing.
    assert not any("is not counted" in note for note in found.notes)
