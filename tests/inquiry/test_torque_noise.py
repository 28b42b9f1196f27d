"""The noise that a promise stands on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, sosfilt

from scara_ident.diagnosis import diagnose
from scara_ident.inquiry.torque_noise import noise_density
from scara_ident.simulation import simulate, virtual_arm
from tests.diagnosis.made import BANDS, NOISE, multisine
from tests.inquiry.asked import COARSE_NOISE, coarse_diagnosis

SLOW = 2.0


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_noise_is_that_of_the_recordings(seed: int):
    # White noise of one sample each 4 ms, large beside what else is left of two runs of 8 s within 11 Hz: some 300 values of
    # each joint, and so a variance known to a twelfth.
    arm = replace(virtual_arm(), torque_noise=5.0 * np.array(NOISE))
    motion = multisine("small", 1, 8.0, 1.0)
    runs = [simulate(arm, motion, seed=seed, repetition=k, rate=250.0).recording for k in (1, 2)]
    found = diagnose(arm.robot, runs, bands=BANDS, catalogue=())
    assert noise_density(found) == pytest.approx(arm.torque_noise**2 / 250.0, rel=0.16)


def test_slow_noise_counts_as_blocks_of_time_show_it():
    arm, rng = replace(virtual_arm(), torque_noise=np.array(NOISE)), np.random.default_rng(1)
    filtered = butter(2, SLOW, fs=250.0, output="sos")
    size = 10.0 * np.array(NOISE)
    runs = []
    for k in (1, 2):
        quiet = simulate(arm, multisine("small", 1, 8.0, 1.0), seed=1, repetition=k, rate=250.0).recording
        noise = sosfilt(filtered, rng.standard_normal((2, len(quiet.time))), axis=1)
        effort = quiet.effort + size[:, None] * noise / np.std(noise)
        runs.append(replace(quiet, effort=effort))
    found = noise_density(diagnose(arm.robot, runs, bands=BANDS, catalogue=()))
    # All of it is below 2 Hz, where the motion is too; over the whole band it would be five times less.
    slow = size**2 / (2.0 * SLOW)
    assert np.all(found > 0.4 * slow) and np.all(found < slow)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_what_the_noise_of_positions_leaves_is_none(seed: int):
    # The difference of two variances that are known to a tenth each, the larger of them twice as large.
    assert noise_density(coarse_diagnosis(seed)) == pytest.approx(
        (COARSE_NOISE * np.array(NOISE)) ** 2 / 250.0, rel=0.4
    )
