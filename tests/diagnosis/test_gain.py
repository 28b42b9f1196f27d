"""Gains against dense fits, and never above the whole."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.diagnosis.candidate_tests import examine
from scara_ident.diagnosis.fitted_model import FittedModel
from scara_ident.diagnosis.gain import gains
from scara_ident.estimation.joint_rows import JointRows
from tests.diagnosis.made import dense_rows, uneven_blocks


@pytest.mark.parametrize("seed", range(4))
def test_it_is_what_is_removed_over_that_and_what_the_joint_keeps(seed: int):
    model, candidates = uneven_blocks(seed)
    candidates = candidates[:4]
    found = examine(model, candidates)
    sizes = [rows.table.shape[1] for rows in model.joints]
    for joint in range(3):
        own = slice(sum(sizes[:joint]), sum(sizes[: joint + 1]))
        told = gains(model, candidates, [joint] * len(candidates), found)
        for candidate, item, gain in zip(candidates, found, told, strict=True):
            rows, _ = dense_rows(model, candidate)
            errors = [
                rows[:, -1] - columns @ np.linalg.lstsq(columns, rows[:, -1], rcond=1e-10)[0]
                for columns in (rows[:, : model.parameters], rows[:, :-1])
            ]
            before, after = errors
            removed = item.held_out * float(np.sum(before**2))
            lost = float(np.sum(before**2) - np.sum(after**2)) - removed
            kept = float(np.sum(after[own] ** 2)) + lost
            assert gain == pytest.approx(removed / (max(removed, 0.0) + kept), rel=1e-6, abs=1e-9)
    assert gains(model, candidates, [None] * len(candidates), found) == [item.held_out for item in found]


def test_it_is_not_above_the_whole_where_other_joints_errors_fall_too():
    """Two joints share a parameter, which what is missing on the first has pushed off: both errors fall with it."""
    rng = np.random.default_rng(3)
    shared, missing = rng.standard_normal((2, 400))
    missing += shared
    torques = (shared + missing + 0.1 * rng.standard_normal(400), shared + 0.1 * rng.standard_normal(400))
    starts, counts = np.arange(0, 401, 40), np.full(10, 40.0)
    rows = tuple(JointRows(np.array([0]), np.vstack([shared, torque]), starts, counts) for torque in torques)
    owner = np.arange(10) // 5
    model = FittedModel(rows, 1, owner, owner, np.ones(2))
    candidate = {0: missing[None]}
    (item,) = examine(model, [candidate])
    (gain,) = gains(model, [candidate], [0], [item])
    before = [float(np.sum(error**2)) for error in model.residual]
    # All that it saves, over what its joint had left.
    assert item.held_out * sum(before) / before[0] > 1.1
    assert 0.95 < gain < 1.0
