"""Nothing missing, 12 bits of encoder, and runs whose friction, scale, offset and delay differ."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.diagnosis.diagnose import diagnose
from scara_ident.identification.identify import identify
from scara_ident.recording.recording import Recording
from scara_ident.robot.robot import load_robot
from tests.estimation.test_run_variation import errors, runs

pytestmark = pytest.mark.slow

STEP = 2.0 * np.pi / 2**12


def coarse(seed: int) -> list[Recording]:
    return [replace(item, position=np.round(item.position / STEP) * STEP) for item in runs(np.random.default_rng(seed))]


def test_standard_deviations_cover_offsets_too():
    """Commit a6cf3ca covered 6 and 4 of 8 offsets of the two joints by two standard deviations."""
    inside = np.array([np.abs(errors(identify(load_robot(), coarse(3000 + k)).estimate)) < 2.0 for k in range(8)])
    assert np.mean(inside) > 0.93
    assert np.sum(inside[:, -2:], axis=0).min() >= 7


def test_the_scatter_is_reported_as_what_it_is_and_repetitions_are_seen_under_any_name():
    """Commit a6cf3ca: `complete`, "No trajectory was repeated", and not a word of runs that differ."""
    found = diagnose(load_robot(), coarse(1002))
    assert not found.effects
    assert any("A0_1, A4_1 have the same motion" in note for note in found.notes)
    assert any("joint1 differs from run to run" in note and "friction by" in note for note in found.notes)
    assert len(found.fit_after) == 2
