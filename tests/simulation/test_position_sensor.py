"""Positions after a filter of first order: gain and phase of a tone, a straight line late by the time constant."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.simulation.position_sensor import recorded_position
from tests.simulation.made import scara

PERIOD, TIME_CONSTANT = 1e-3, 7e-3


def test_tones_and_lines_are_late_as_closed_forms_say():
    draft = scara().draft()
    time = PERIOD * np.arange(600)
    measured = np.array([1.0 + np.sin(40.0 * time), 0.3 - 2.0 * time])
    assert recorded_position(draft, measured, PERIOD) is measured
    draft.position_lag = TIME_CONSTANT
    seen = recorded_position(draft, measured, PERIOD)
    late = 20 * round(TIME_CONSTANT / PERIOD)
    tone = 1.0 + np.imag(np.exp(40.0j * time) / (1.0 + 40.0j * TIME_CONSTANT))
    assert seen[0, late:] == pytest.approx(tone[late:], abs=(40.0 * PERIOD) ** 2 / 12.0)
    # The arm moved before as it does at first, so that a line is late from the start.
    assert seen[1] == pytest.approx(measured[1] + 2.0 * TIME_CONSTANT, abs=1e-12)
    assert np.max(np.abs(seen[0, :late] - tone[:late])) < 40.0 * TIME_CONSTANT * 40.0 * TIME_CONSTANT
