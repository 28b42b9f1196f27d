"""Torque that is late in all runs alike is no noise, though it counts as what runs differ by."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.diagnosis import diagnose
from scara_ident.diagnosis.evidence.evidence import Evidence
from scara_ident.diagnosis.evidence.late_evidence import late_evidence
from scara_ident.estimation import wls
from scara_ident.recording.recording import Recording
from scara_ident.robot.robot import load_robot
from tests.diagnosis.made import BANDS, exact_runs, observed

SHOWN = tuple(Evidence(joint, True, "repetition", "", 0.1) for joint in ("joint1", "joint2"))


def late(delays: list[float]) -> list[Recording]:
    """Runs whose efforts are recorded so much later than their positions."""
    made = []
    for run, delay in zip(exact_runs(2, 3), delays, strict=True):
        assert run.effort is not None
        made.append(replace(run, effort=np.array([np.interp(run.time - delay, run.time, own) for own in run.effort])))
    return made


@pytest.mark.parametrize(
    ("delays", "passes"),
    [
        ([0.012] * 6, False),
        ([-0.012] * 6, False),
        # Less than a sample, and as runs differ.
        ([0.001] * 6, True),
        ([0.012, -0.012, 0.01, -0.01, 0.008, -0.008], True),
        ([0.0] * 6, True),
    ],
)
def test_a_delay_of_all_runs_is_no_noise(delays: list[float], passes: bool):
    training = observed(late(delays))
    shown = late_evidence(SHOWN, wls(training), training)
    assert [item.shown for item in shown] == [passes, passes]
    if not passes:
        word = "lags" if delays[0] > 0.0 else "leads"
        assert shown[0].why.startswith(f"it {word} by 1") and "in all runs" in shown[0].why


def test_without_an_effect_that_stands_for_it_nothing_is_complete():
    """`complete` was said beside "joint1 lags by 12 ms in all runs alike" where the catalogue has no delay."""
    found = diagnose(load_robot(), late([0.012] * 6), bands=BANDS, catalogue=())
    assert found.verdict != "complete"
