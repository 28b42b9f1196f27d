"""More samples than a diagnosis holds: recordings evenly over all, with their repetitions, and parts of long ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.diagnosis import diagnose
from scara_ident.identification import held_at_once as module
from scara_ident.identification.held_at_once import held_at_once
from scara_ident.motion.prepared import PreparedData, prepare
from scara_ident.recording.recording import Recording
from scara_ident.robot.robot import Robot, load_robot
from tests.arms import recorded_torque, recording, sines

FRICTION = ((2.0, 1.0, 0.0, 0.0, 0.1), (1.0, 0.5, 0.0, 0.0, -0.1))
RATE, SECONDS = 200.0, 6.0
SAMPLES = round(RATE * SECONDS)


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot()


def run(robot: Robot, name: str, seed: int, repetition: int = 0, seconds: float = SECONDS) -> Recording:
    time = np.arange(round(seconds * RATE)) / RATE
    q, v, a = sines(np.random.default_rng(seed), time, robot.n)
    torque = recorded_torque(robot, q, v, a, FRICTION)
    noise = 0.05 * np.random.default_rng([seed, repetition]).standard_normal(q.shape)
    return recording(robot, name, time, q, torque + noise)


def repeated(robot: Robot, motions: int) -> PreparedData:
    return prepare([run(robot, f"m{k}_{turn}", k, turn) for k in range(motions) for turn in (1, 2)])


def names(data: PreparedData) -> list[str]:
    return [item.name for item in data.recordings]


def hold(monkeypatch: pytest.MonkeyPatch, recordings: float) -> None:
    monkeypatch.setattr(module, "MAX_VALUES", int(2 * SAMPLES * recordings))


def test_what_is_not_too_much_stays_as_it_is(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    data, held_out = repeated(robot, 1), prepare([run(robot, "b_1", 2)])
    hold(monkeypatch, 3.0)
    assert held_at_once(data, held_out) == (data, held_out, [])


def test_motions_are_taken_evenly_with_all_repetitions(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    data, held_out = repeated(robot, 6), prepare([run(robot, f"h{k}_1", 10 + k) for k in range(4)])
    hold(monkeypatch, 9.0)
    found, kept, (note,) = held_at_once(data, held_out)
    assert names(found) == [f"m{k}_{turn}" for k in (1, 3, 5) for turn in (1, 2)]
    assert names(kept) == ["h1_1", "h3_1"]
    assert all(new is data.recordings[place] for new, place in zip(found.recordings, (2, 3, 6, 7, 10, 11), strict=True))
    assert note.startswith(
        f"{16 * SAMPLES} samples of 2 joints are more than a diagnosis can hold at once ({9 * SAMPLES})"
    )
    assert "6 of 12 recordings and 2 of 4 recordings held out, evenly over all" in note


def test_of_one_motion_repetitions_are_taken_evenly(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    data = prepare([run(robot, f"m_{turn}", 1, turn) for turn in range(9)])
    hold(monkeypatch, 3.5)
    found, _, (note,) = held_at_once(data, PreparedData((), data.bands))
    assert names(found) == ["m_1", "m_4", "m_7"]
    assert "uses 3 of 9 recordings, evenly" in note


def test_parts_of_a_long_recording_are_taken_evenly(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = run(robot, "long_1", 1, seconds=10.0 * SECONDS)
    data = prepare([replace(whole, cuts=tuple(range(SAMPLES, 10 * SAMPLES, SAMPLES)))])
    hold(monkeypatch, 3.0)
    found, _, (note,) = held_at_once(data, PreparedData((), data.bands))
    assert [round(part.stretch.time[0] / SECONDS) for part in found.stretches] == [1, 5, 8]
    assert "30% of the samples of 1 of 1 recordings" in note


def test_two_recordings_at_least_are_looked_at(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    data = prepare([run(robot, "a_1", 1), run(robot, "b_1", 2), run(robot, "c_1", 3)])
    hold(monkeypatch, 0.1)
    found, _, _ = held_at_once(data, PreparedData((), data.bands))
    assert names(found) == ["a_1", "b_1"]


def test_a_diagnosis_says_what_it_did_not_look_at(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    runs = [item.recording for item in repeated(robot, 4).recordings]
    hold(monkeypatch, 4.0)
    found = diagnose(robot, runs, catalogue=())
    assert [item.name for item in found.training_after.each] == ["m1_1", "m1_2", "m3_1", "m3_2"]
    assert any("4 of 8 recordings" in note for note in found.notes)


def test_where_nothing_can_be_left_out_nothing_is_said(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    """One short recording, of a single stretch, is more than is held at once."""
    data, held_out = prepare([run(robot, "a_1", 1)]), prepare([])
    hold(monkeypatch, 0.1)
    found, kept, notes = held_at_once(data, held_out)
    assert (names(found), names(kept), notes) == (["a_1"], [], [])
