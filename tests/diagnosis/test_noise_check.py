"""Noise of positions that stands in the residual and in a candidate's column, and what it makes of the candidate."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from scara_ident.diagnosis.candidate_tests import Examination, examine
from scara_ident.diagnosis.candidates import Candidate
from scara_ident.diagnosis.cluster_test import significance
from scara_ident.diagnosis.fitted_model import FittedModel
from scara_ident.diagnosis.noise_check import hidden_by_swings, noise_objection, without_noise
from scara_ident.effects import Member
from scara_ident.effects.position import Spring
from scara_ident.estimation.joint_rows import JointRows
from tests.diagnosis.made import exact_runs, step_beside, with_torque

BLOCKS, ROWS = 100, 12
LENGTH = BLOCKS * ROWS


def examined(base: np.ndarray, tried: np.ndarray, torque: np.ndarray) -> Examination:
    starts = np.arange(0, LENGTH + 1, ROWS)
    rows = JointRows(np.arange(2), np.vstack([base, np.ones(LENGTH), torque]), starts, np.full(BLOCKS, float(ROWS)))
    model = FittedModel((rows,), 2, np.zeros(BLOCKS, dtype=int), np.arange(BLOCKS) * 4 // BLOCKS, np.ones(1))
    return examine(model, [{0: tried[None]}])[0]


@pytest.mark.parametrize("true", [0.0, 0.4])
def test_what_the_noise_makes_is_taken_off_and_what_the_arm_does_is_left(true: float):
    # The base column holds noise, the candidate's the same noise magnified, as derivatives of one position do.
    rng = np.random.default_rng(4)
    smooth, other = lfilter([1.0], [1.0, -0.9], rng.standard_normal((2, LENGTH)), axis=1)
    torque = 2.0 * smooth + true * other + 0.1 * rng.standard_normal(LENGTH)
    noise, again = 0.3 * rng.standard_normal((2, LENGTH))
    once = examined(smooth + noise, other + 3.0 * noise, torque)
    twice = examined(smooth + noise + again, other + 3.0 * (noise + again), torque)
    assert abs(once.value[0] - true) > 0.05
    assert once.p_value < 1e-12
    left = without_noise(once, twice.value, twice.products)
    assert abs(left[0]) == pytest.approx(true, abs=0.07)
    p_value = significance(left, once.covariance, once.freedom, once.products)
    assert (p_value < 1e-6) if true else (p_value > 1e-3)


@pytest.mark.parametrize(
    ("stiffness", "swing", "objected"), [(0.02, 0.0, False), (0.02, 20.0, True), (0.6, 20.0, False)]
)
def test_what_is_small_beside_what_the_torque_swings_by_is_not_believed(stiffness: float, swing: float, objected: bool):
    """An arm that trembled by its encoder's steps had friction that falls with speed, of 0.5 % of that torque."""
    runs = with_torque(
        exact_runs(),
        0,
        lambda motion: stiffness * motion.q[0] + swing * np.sin(2.0 * np.pi * 60.0 * motion.time),
    )
    step = step_beside(runs)
    (decision,) = step.judge([Candidate(Spring(), Member(0))])
    assert decision.accepted
    why = noise_objection(step, decision)
    assert (why is not None) == objected
    assert why is None or "the torque swings by 14 (N m or N) beyond the band" in why
    # Nor is nothing found there a sign that nothing is missing.
    assert (hidden_by_swings(step).get(0, 0.0) > 0.3) == objected
