"""A delay taken out of the data: the torque of the recording corrected, and nothing of it left."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.diagnosis.candidates import Candidate
from scara_ident.diagnosis.correction import corrected, taken_out
from scara_ident.diagnosis.model_selection import rms_of
from scara_ident.effects import Member
from scara_ident.effects.measurement import TimeDelay, shifted
from scara_ident.estimation import wls
from tests.diagnosis.made import exact_runs, observed, step_beside


def test_corrected_torque_is_that_of_the_recording_corrected():
    late = [shifted(run, -0.004) for run in exact_runs()[:2]]
    candidate = Candidate(TimeDelay(), Member(None))
    data = observed(late).data
    mended = corrected(data, candidate, np.array([0.004]))
    for part, old, run in zip(mended.stretches, data.stretches, late, strict=True):
        whole = candidate.effect.corrected(run, candidate.member, np.array([0.004]))
        assert np.array_equal(part.torque, whole.effort)
        assert part.motion.q is not old.motion.q
        assert np.array_equal(part.motion.a, old.motion.a)


def test_a_long_delay_is_taken_out_until_nothing_is_left():
    candidate = Candidate(TimeDelay(), Member(None))
    step = step_beside([shifted(run, -0.025) for run in exact_runs()[:2]])
    (first,) = step.judge([candidate])
    columns, value = taken_out(step, candidate)
    # Of first order, beside friction and inertia that stand for some of it, it is far off.
    assert abs(first.examination.value[0] - 0.025) > 1e-3
    assert value[0] == pytest.approx(0.025, abs=2e-4)
    clean = step_beside(exact_runs()[:2]).observations
    left, without = (rms_of(wls(item).value, item) for item in (columns.observations, clean))
    assert left == pytest.approx(without, rel=0.02)
