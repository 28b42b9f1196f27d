"""How much a candidate removes beside what it leaves on its joint."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from scara_ident.arrays import Array
from scara_ident.diagnosis.candidate_tests import Examination
from scara_ident.diagnosis.candidates import Rows
from scara_ident.diagnosis.fitted_model import FittedModel


def gains(
    model: FittedModel, candidates: Sequence[Rows], joints: Sequence[int | None], found: Sequence[Examination]
) -> list[float]:
    """Return what each candidate removes on rows that it was not fitted to, as a share of that and what its joint keeps.

    It is near the share of its joint's squared residual where it removes little, and never above 1, though what a candidate
    removes on other joints, through its columns there and through the model's parameters, may be more than its joint has.

    Parameters
    ----------
    model : FittedModel
    candidates : sequence of mapping of int to ndarray, shape (k, N)
    joints : sequence of int or None
        Whose each is; None counts all joints.
    found : sequence of Examination
        Of each candidate.
    """
    result = np.array([item.held_out for item in found])
    total = float(np.sum(model.squares))
    for joint in {joint for joint in joints if joint is not None}:
        own = [k for k, place in enumerate(joints) if place == joint]
        whole = total * np.array([found[k].gain for k in own])
        removed = total * result[own]
        # What holding out costs counts as left.
        left = _left(model, joint, [candidates[k] for k in own], [found[k] for k in own]) + whole - removed
        result[own] = removed / np.maximum(np.maximum(removed, 0.0) + left, np.finfo(float).tiny)
    return [float(gain) for gain in result]


def _left(model: FittedModel, joint: int, candidates: Sequence[Rows], found: Sequence[Examination]) -> Array:
    """Return the weighted squared residual of one joint with each candidate, on the rows they were fitted to."""
    rows = model.joints[joint]
    values = np.array([item.model_value[rows.columns] for item in found])
    left = rows.table[-1] - values @ rows.table[:-1]
    for error, columns, item in zip(left, candidates, found, strict=True):
        if joint in columns:
            error -= item.value @ columns[joint]
    return np.asarray(model.weights[joint] ** 2 * np.sum(left**2, axis=1))
