"""A delay taken out of the data: the torque of the recording corrected, and nothing of it left."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.diagnosis.candidates import Candidate
from scara_ident.diagnosis.correction import corrected, taken_out
from scara_ident.effects import Member
from scara_ident.effects.measurement import TimeDelay, shifted
from scara_ident.estimation import wls
from scara_ident.estimation.run_offsets import rms_of
from scara_ident.model.model import TorqueModel
from scara_ident.motion.motion import Motion
from tests.diagnosis.made import exact_runs, observed, step_beside


def test_corrected_torque_is_that_of_the_recording_corrected():
    late = [shifted(run, -0.004) for run in exact_runs()[:2]]
    candidate = Candidate(TimeDelay(), Member(None))
    data = observed(late).data
    mended = corrected(data, candidate, np.array([0.004]))
    for part, old, run in zip(mended.stretches, data.stretches, late, strict=True):
        whole = candidate.effect.corrected(run, candidate.member, np.array([0.004]))
        assert np.array_equal(part.torque, whole.effort)
        assert part.motion.torque is part.torque
        # The motion is the same, and so is all that it decides.
        assert all(getattr(part.motion, name) is getattr(old.motion, name) for name in ("q", "v", "a"))
        assert all(getattr(part, name) is getattr(old, name) for name in ("rest", "fade", "kept", "blocks"))


def test_no_column_of_the_model_is_made_again_beside_another_torque(monkeypatch: pytest.MonkeyPatch):
    candidate = Candidate(TimeDelay(), Member(None))
    step = step_beside([shifted(run, -0.025) for run in exact_runs()[:2]])
    made: list[Motion] = []
    joint_columns = TorqueModel.joint_columns

    def columns(model, motion, *into):
        made.append(motion)
        return joint_columns(model, motion, *into)

    monkeypatch.setattr(TorqueModel, "joint_columns", columns)
    own, value = taken_out(step, candidate)
    assert value[0] == pytest.approx(0.025, abs=2e-4)
    own.rows(replace(step.scene, value=1.01 * step.scene.value), [candidate])
    assert not made


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
