"""Held-out recordings that are explained much worse: another payload is called one, and a good one is not named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.identification.events import Event
from scara_ident.identification.identify import identify
from scara_ident.identification.recording_check import own_uncertainty, quiet_blocks, without_stretches
from scara_ident.robot.robot import load_robot
from tests.arms import PLANAR_2R, SWING_FRICTION, noisy, recorded_torque, recording, sines, ur5, write_urdf
from tests.estimation.test_run_offsets import zeroed_runs
from tests.truth.pushes import pushed
from tests.truth.scenes import formula_run

ROBOT = ur5()


def run(name: str, seed: int, payload: float = 0.0):
    """15 s of a UR5; a payload of so many kg at 0.1 m from the last joint, by a second arm's bodies."""
    if not payload:
        return formula_run(ROBOT, name, [31, seed], seconds=15.0, rate=125.0, bits=18)
    import pinocchio as pin

    loaded = load_robot("ur5")
    last = loaded.model.njoints - 1
    body = pin.Inertia(payload, np.array([0.0, 0.0, 0.1]), np.diag([0.01, 0.01, 0.01]))
    loaded.model.inertias[last] = loaded.model.inertias[last] + body
    return formula_run(loaded, name, [31, seed], seconds=15.0, rate=125.0, bits=18)


@pytest.mark.slow
def test_a_loaded_held_out_recording_is_named():
    training = [run(f"run{k}", k) for k in range(4)]
    found = identify(ROBOT, training, validation=[run("plain", 8), run("loaded", 9, 3.0)])
    (event,) = found.events
    assert (event.recording, event.kind, event.held_out) == ("loaded", "other payload", True)
    assert any("loaded is explained much worse" in note for note in found.notes)


@pytest.mark.slow
def test_a_sensor_that_was_zeroed_in_a_held_out_recording_is_no_other_payload(tmp_path):
    """Of a small motion its weight is all but constant, and so is an offset."""
    robot = load_robot(write_urdf(tmp_path / "arm.urdf", PLANAR_2R))
    training = zeroed_runs(robot, 0.0)
    time = np.arange(2400) / 200.0
    q, v, a = (0.1 * signal for signal in sines(np.random.default_rng(7), time, 2))
    torque = recorded_torque(robot, q, v, a, SWING_FRICTION)
    small = noisy(recording(robot, "zeroed_1", time, q, torque), np.random.default_rng(8), 0.05)
    for offset, kinds in ((np.zeros((2, 1)), []), (np.array([[3.0], [1.0]]), ["unknown"])):
        found = identify(robot, training, validation=[replace(small, effort=small.effort + offset)], model="basic")
        assert [event.kind for event in found.events] == kinds


def test_errors_larger_than_the_torque_itself_are_said(tmp_path):
    """Two fitted runs of one motion told nothing of a third, whose errors were up to 35 times the torque."""
    robot = load_robot(write_urdf(tmp_path / "arm.urdf", PLANAR_2R))
    training = zeroed_runs(robot, 0.0)
    other = replace(training[0], name="other", effort=training[0].effort * np.array([[-1.0], [0.6]]))
    found = identify(robot, training[1:], validation=[other], model="basic")
    (event,) = found.events
    assert set(event.joints) == {"j1", "j2"}
    assert event.beyond == ("j1",)
    assert "beyond" not in event.entry


@pytest.mark.slow
def test_a_push_in_a_held_out_recording_is_no_other_payload():
    training = [run(f"run{k}", k) for k in range(4)]
    held_out = pushed(ROBOT, run("pushed", 8), np.array([20.0, 0.0, -15.0]), 6.0, 7.5)
    found = identify(ROBOT, training, validation=[held_out])
    (event,) = found.events
    assert event.held_out
    assert abs(event.start - 6.0) < 0.1
    assert abs(event.stop - 7.5) < 0.1
    rest = without_stretches(found.validation, found.events)
    value = found.estimate.value
    assert rest.joints[0].rms(value) < 0.5 * found.validation.joints[0].rms(value)
    # Its blocks stay where they were, and count for nothing.
    quiet = quiet_blocks(found.validation.data, found.events)
    assert np.array_equal(rest.owner, found.validation.owner)
    assert np.array_equal(rest.joints[0].counts, quiet * found.validation.joints[0].counts)
    assert 0.8 < np.mean(quiet) < 1.0
    assert without_stretches(found.validation, ()) is found.validation


def test_what_parameters_err_by_or_runs_differ_by_is_no_event_of_a_recording():
    whole = Event("run", 0.0, 9.0, ("joint2", "joint1"), 18.4, "unknown", held_out=True)
    unsure, alike = {"joint1": 0.0, "joint2": 15.7}, {"joint1": 9.0, "joint2": 0.0}
    assert own_uncertainty(whole, unsure, alike).kind == "parameters unsure"
    known = {**unsure, "joint2": 5.0}
    assert own_uncertainty(whole, known, alike) == whole
    # `complete` stood beside an unknown event of all of a recording, of an arm whose friction differed by 5 % from run to run.
    assert own_uncertainty(whole, known, {**alike, "joint2": 8.0}).kind == "runs differ"
    for other in (replace(whole, kind="other payload"), replace(whole, score=2.0)):
        assert own_uncertainty(other, unsure, {**alike, "joint2": 20.0}) == other
