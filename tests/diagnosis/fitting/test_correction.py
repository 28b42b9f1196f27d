"""A delay taken out of the data: the torque of the recording corrected, and nothing of it left."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from scara_ident.diagnosis.candidates.candidates import Candidate
from scara_ident.diagnosis.fitting import correction
from scara_ident.diagnosis.fitting.correction import Correction, corrected, drawn_together, taken_out
from scara_ident.effects import Member
from scara_ident.effects.measurement import DELAY_STEP, TimeDelay, shifted
from scara_ident.effects.recording_delays import DelayOfEachRecording
from scara_ident.estimation import wls
from scara_ident.estimation.run_offsets import rms_of
from scara_ident.model.model import TorqueModel
from scara_ident.motion.motion import Motion
from tests.diagnosis.made import exact_runs, observed, step_beside


def test_corrected_torque_is_that_of_the_recording_corrected():
    late = [shifted(run, -0.004) for run in exact_runs()[:2]]
    candidate = Candidate(TimeDelay(), Member(None))
    data = observed(late).data
    mended = corrected(data, Correction(candidate, np.array([0.004]), ("A_1", "A_2")))
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
    own, found = taken_out(step, candidate)
    assert found.value[0] == pytest.approx(0.025, abs=2e-4)
    own.rows(replace(step.scene, value=1.01 * step.scene.value), [candidate])
    assert not made


def test_a_long_delay_is_taken_out_until_nothing_is_left():
    candidate = Candidate(TimeDelay(), Member(None))
    step = step_beside([shifted(run, -0.025) for run in exact_runs()[:2]])
    (first,) = step.judge([candidate])
    columns, found = taken_out(step, candidate)
    # Of first order, beside friction and inertia that stand for some of it, it is far off.
    assert abs(first.examination.value[0] - 0.025) > 1e-3
    assert found.value[0] == pytest.approx(0.025, abs=2e-4)
    clean = step_beside(exact_runs()[:2]).observations
    left, without = (rms_of(wls(item).value, item) for item in (columns.observations, clean))
    assert left == pytest.approx(without, rel=0.02)


def test_what_noise_of_positions_hides_of_a_delay_is_taken_out_too(monkeypatch: pytest.MonkeyPatch):
    """Each estimate sees half of what is left: six steps of that size end a fiftieth short."""
    rng, asked = np.random.default_rng(5), []
    late = [shifted(run, -0.008) for run in exact_runs()]
    step = step_beside(
        [replace(run, position=run.position + 7e-5 * rng.standard_normal(run.position.shape)) for run in late]
    )
    candidate, ask = Candidate(TimeDelay(), Member(None)), correction.still_there

    def count(*of) -> np.ndarray:
        asked.append(ask(*of))
        return asked[-1]

    monkeypatch.setattr(correction, "still_there", count)
    _, found = taken_out(step, candidate)
    assert asked[0][0] < 0.5 * 0.008
    # As sure as twice the first estimate.
    (first,) = step.judge([candidate])
    std = found.value[0] / first.examination.value[0] * float(np.sqrt(first.examination.covariance[0, 0]))
    assert found.value[0] == pytest.approx(0.008, abs=2.0 * std)
    assert abs(asked[-1][0]) < DELAY_STEP and len(asked) <= 5


def test_each_recording_is_corrected_by_its_own_and_what_all_have_alike_counts_for_each():
    late = (0.004, 0.0, -0.002, 0.006)
    step = step_beside([shifted(run, -own) for run, own in zip(exact_runs(), late, strict=True)])
    columns, found = taken_out(step, Candidate(DelayOfEachRecording(), Member(None)))
    assert found.recordings == ("A_1", "A_2", "B_1", "B_2")
    (first,) = step.judge([Candidate(DelayOfEachRecording(), Member(None))])
    std = np.sqrt(np.diag(first.examination.covariance))
    assert np.all(std < 1e-3)
    assert np.all(np.abs(found.value - late) < 3.0 * std)
    assert found.of("B_2") == found.value[3:]
    left, without = (
        rms_of(wls(item).value, item) for item in (columns.observations, step_beside(exact_runs()).observations)
    )
    assert left == pytest.approx(without, rel=0.02)
    alike = Correction(Candidate(TimeDelay(), Member(None)), np.array([0.001]), found.recordings)
    for both in (found.beside(alike), alike.beside(found)):
        assert both.of_each
        assert_allclose(both.value, found.value + 0.001)
    assert alike.of("B_2") == alike.value
    assert alike.beside(None) is alike


def test_a_torque_scale_of_a_run_is_not_taken_for_its_delay():
    """Of a short motion the rate of the torque is no stranger to the torque: delays of 4.5 ms came out as 5.6."""
    runs = [replace(run, effort=run.effort * (1.0 + 0.03 * k)) for k, run in enumerate(exact_runs())]
    step, candidate = step_beside(runs), Candidate(DelayOfEachRecording(), Member(None))
    _, found = taken_out(step, candidate)
    assert_allclose(found.value, 0.0, atol=1e-3)
    (first,) = step.judge([candidate])
    assert np.max(np.abs(first.examination.value)) > 5e-3


def test_what_a_controller_answers_the_noise_of_positions_with_is_no_delay():
    """Runs that were late alike came out 5.6 ms apart, as one of them moved little and its controller damped by coarse positions."""
    rng, runs = np.random.default_rng(5), list(exact_runs())
    noise = 3e-5 * rng.standard_normal(runs[0].position.shape)
    answer = -20.0 * np.gradient(noise, runs[0].time, axis=1)
    runs[0] = replace(runs[0], position=runs[0].position + noise, effort=runs[0].effort + answer)
    step, candidate = step_beside(runs), Candidate(DelayOfEachRecording(), Member(None))
    (whole,) = step.judge([candidate])
    _, found = taken_out(step, candidate)
    # Surely apart in the whole band, and by nothing in its lower part.
    assert np.ptp(whole.examination.value) > 3e-3 > 4.0 * np.sqrt(np.max(np.diag(whole.examination.covariance)))
    assert np.ptp(found.value) < 2e-4


def test_what_is_unsure_is_drawn_to_the_others_and_what_all_share_draws_none():
    value, std = np.array([0.0, 4.0, 1.0, 3.0, 12.0]), np.array([0.01, 0.01, 0.01, 0.01, 20.0])
    alone = drawn_together(value, np.diag(std**2))
    assert_allclose(alone[:4], value[:4], atol=0.01)
    assert alone[4] == pytest.approx(2.0, abs=0.2)
    assert_allclose(drawn_together(value, np.diag(std**2) + 100.0), alone)
    # One that tells nothing has the mean of the others, and where chance may make them differ all have it.
    assert drawn_together(value, np.diag([*std[:4] ** 2, 0.0]))[4] == pytest.approx(2.0, abs=1e-3)
    assert np.ptp(drawn_together(value[:4], 9.0 * np.eye(4))) == 0.0
    assert drawn_together(value[:2], np.diag([1.0, 0.0])).tolist() == [0.0, 0.0]
