"""Which constraints hold an estimate, and in which directions it can still move."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scara_ident.estimation.consistent.bodies import pack, unpack
from scara_ident.estimation.consistent.prior import null_space
from scara_ident.estimation.consistent.programme import MARGIN, Point
from scara_ident.estimation.consistent.unknowns import Unknowns

Array = NDArray[np.float64]


def active(unknowns: Unknowns, point: Point) -> tuple[Array, tuple[str, ...]]:
    """Find the constraints that hold a solution.

    A constraint holds it where its multiplier is larger than its slack: of two numbers whose product the solver
    brings to zero, the one that stays.

    Parameters
    ----------
    unknowns : Unknowns
    point : Point

    Returns
    -------
    rows : ndarray, shape (k, size + auxiliary)
        Directions of [x; aux] that these constraints forbid, to first order.
    labels : tuple of str
        What they are about, each once.
    """
    whole = np.concatenate([point.x, point.auxiliary])
    cones, total = unknowns.cones, len(whole)
    rows: list[Array] = []
    labels: list[str] = []
    slack = cones.nonnegative(whole) - MARGIN
    for k in np.flatnonzero(point.dual_nonnegative > slack).tolist():
        rows.append(cones.nonnegative.matrix[k])
        labels.append(unknowns.labels[0][k])
    values, duals = cones.small(whole).reshape(-1, 3), point.dual_small.reshape(-1, 3)
    for k, ((d, e, f), (z0, z1, z2)) in enumerate(zip(values, duals, strict=True)):
        found = _face(np.array([[d, e], [e, f]]), np.array([[z0 + z1, z2], [z2, z0 - z1]]))
        triple = cones.small.matrix[3 * k : 3 * k + 3]
        for a in range(found.shape[1]):
            for b in range(a, found.shape[1]):
                u, v = found[:, a], found[:, b]
                rows.append(np.array([u[0] * v[0], u[0] * v[1] + u[1] * v[0], u[1] * v[1]]) @ triple)
                labels.append(unknowns.labels[1][k])
    values, duals = cones.ball(whole).reshape(-1, 4), point.dual_ball.reshape(-1, 4)
    for k, (value, dual) in enumerate(zip(values, duals, strict=True)):
        if np.linalg.norm(dual) > value[0] - np.linalg.norm(value[1:]):
            rows.append(dual @ cones.ball.matrix[4 * k : 4 * k + 4])
            labels.append(unknowns.labels[2][k])
    bodies = unpack(point.x[: 10 * unknowns.n].reshape(unknowns.n, 10)) - MARGIN * np.eye(4)
    for i, (body, dual) in enumerate(zip(bodies, point.dual_bodies, strict=True)):
        found = _face(body, dual)
        for a in range(found.shape[1]):
            for b in range(a, found.shape[1]):
                row = np.zeros(total)
                outer = np.outer(found[:, a], found[:, b])
                row[10 * i : 10 * i + 10] = pack(0.5 * (outer + outer.T))
                rows.append(row)
        if found.shape[1]:
            labels.append(f"inertia of {unknowns.model.robot.links[i]}")
    return (np.array(rows) if rows else np.zeros((0, total))), tuple(dict.fromkeys(labels))


def _face(value: Array, dual: Array) -> Array:
    """Directions in which a matrix is held at zero, as columns."""
    multipliers, vectors = np.linalg.eigh(dual)
    slack = np.einsum("ik,ij,jk->k", vectors, value, vectors)
    return np.asarray(vectors[:, multipliers > slack])


def tangent(unknowns: Unknowns, rows: Array) -> Array:
    """Return the directions in which the parameters can still move, as columns, shape (p, k)."""
    free = null_space(rows)[: unknowns.size]
    if len(unknowns.held):
        free = free @ null_space(unknowns.held @ free)
    return unknowns.to_parameters @ free
