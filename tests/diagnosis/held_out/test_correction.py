"""What is taken out of held-out recordings where each has its own: told by the first part, beside what runs differ by."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from numpy.testing import assert_allclose

from scara_ident.diagnosis.diagnose import Diagnosis, diagnose
from scara_ident.effects import effects_named
from scara_ident.effects.measurement import shifted
from scara_ident.estimation.run_offsets import rms_of
from scara_ident.paper import table5_parameters
from scara_ident.recording.recording import Recording
from scara_ident.robot.robot import load_robot
from tests.arms import noisy, recorded_torque, recording
from tests.diagnosis.made import BANDS, NOISE, RATE, multisine

pytestmark = pytest.mark.slow

TRUTH = table5_parameters("OJD")
FRICTION = [(*TRUTH[5 + 4 * j : 9 + 4 * j], 0.0) for j in range(2)]
# s, of six recordings, of two held out, and of one that is too short to say.
LATE, HELD_OUT, SHORT = (0.001, 0.005, 0.012, 0.003, 0.009, 0.0), (0.011, 0.002), 0.004


def runs(late: Sequence[float], first: int = 0, seconds: float = 12.0, scale: float = 0.0) -> list[Recording]:
    """Runs of one motion each, every one late by its own time; with other torque scales if asked."""
    robot, rng = load_robot(), np.random.default_rng(first)
    found = []
    for k, own in enumerate(late, first):
        # Sampled at twice the rate and delayed there: what is recorded is no shift of what is recorded without.
        motion = multisine(f"R{k}", 40 + k, 12.0).at(np.arange(round(2.0 * seconds * RATE)) / (2.0 * RATE))
        torque = recorded_torque(robot, motion.position, motion.velocity, motion.acceleration, FRICTION)
        torque = torque * (1.0 + scale * rng.standard_normal((2, 1)))
        whole = shifted(recording(robot, f"R{k}_1", motion.time, motion.position, torque), -own)
        part = replace(whole, time=whole.time[::2], position=whole.position[:, ::2], effort=whole.effort[:, ::2])
        found.append(noisy(part, np.random.default_rng([first, k]), NOISE))
    return found


@lru_cache(maxsize=2)
def result(scale: float) -> Diagnosis:
    validation = [*runs(HELD_OUT, 10, scale=scale), *runs([SHORT], 20, seconds=1.0)]
    return diagnose(
        load_robot(), runs(LATE, scale=scale), validation=validation, bands=BANDS, catalogue=effects_named("time_delay")
    )


@pytest.mark.parametrize("scale", [0.0, 0.01])
def test_delays_of_recordings_are_found_and_corrected_each_by_its_own(scale: float):
    found = result(scale).search.correction
    assert found is not None
    assert found.of_each
    (said,) = [note for note in result(scale).notes if "with a different delay in each recording: delay " in note]
    told = re.findall(r"delay_R(\d)_1 (\S+) \+- (\S+) s", said)
    assert [int(place) for place, _, _ in told] == list(range(len(LATE)))
    value, std = np.array([[float(x) for x in each[1:]] for each in told]).T
    assert_allclose(found.value, value, rtol=1e-3)
    assert np.all(std <= 2e-3)
    # Of six within three standard deviations, that these are said with one digit included.
    assert np.all(np.abs(value - LATE) < 3.0 * std)


@pytest.mark.parametrize("scale", [0.0, 0.01])
def test_a_held_out_recording_says_by_its_first_third_how_late_it_is(scale: float):
    said = [note for note in result(scale).notes if "by its first third" in note]
    assert [note.partition(":")[0] for note in said[:2]] == ["R10_1", "R11_1"]
    # Four seconds of slow motion: drawn to the mean by up to a half of the 4.7 ms that recordings differ by.
    assert_allclose([float(note.split()[2]) for note in said[:2]], HELD_OUT, atol=2e-3)
    assert any(
        note.startswith("R20_1: its first third is too short to determine its delay") for note in result(scale).notes
    )
    assert "held-out errors are of the other two thirds" in result(scale).notes


def test_with_all_delays_corrected_what_is_left_of_held_out_recordings_is_noise():
    found = result(0.0)
    after, before = (
        rms_of(estimate.value, rows)
        for estimate, rows in ((found.after, found.validation_after), (found.before, found.validation_before))
    )
    training = rms_of(found.after.value, found.training_after)
    for joint in range(2):
        # The first third leaves a delay unsure by some 0.5 ms, a tenth of what was there, and noise is more than that makes.
        assert after[joint] < 1.3 * training[joint]
        assert before[joint] > 1.3 * after[joint]


def test_that_they_differ_is_said_and_is_no_effect_of_the_arm():
    notes = result(0.0).notes
    (said,) = [note for note in notes if "with a different delay in each recording" in note]
    assert "delay_R2_1 0.01" in said
    assert "corrected in the data" in said or result(0.0).effects
    assert not any("is late on" in note or "looks like a delay" in note for note in notes)
