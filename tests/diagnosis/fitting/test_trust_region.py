"""Least squares within limits, against those of scipy and against what an optimum must be."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize

from scara_ident.diagnosis.fitting.trust_region import (
    RADIUS_TOLERANCE,
    least_squares,
    length,
    within_radius,
    within_room,
)

problems = st.integers(0, 2**32 - 1).map(np.random.default_rng)


def made(rng: np.random.Generator, parameters: int = 4) -> tuple[np.ndarray, np.ndarray]:
    """Columns of very different sizes, some nearly alike, and a target."""
    columns = rng.standard_normal((parameters + 3, parameters))
    columns[:, 1] = columns[:, 0] + 0.05 * columns[:, 1]
    return columns * 10.0 ** rng.uniform(-3.0, 3.0, parameters), rng.standard_normal(parameters + 3)


@given(problems)
def test_least_squares_are_those_of_numpy_with_their_covariance(rng: np.random.Generator) -> None:
    columns, target = made(rng)
    value, root, basis = least_squares(columns, target)
    size = np.linalg.norm(columns, axis=0)
    assert size * value == pytest.approx(size * (np.linalg.lstsq(columns / size, target)[0] / size), abs=1e-9)
    scaled = columns / size
    assert np.outer(size, size) * (root @ root.T) == pytest.approx(np.linalg.inv(scaled.T @ scaled), rel=1e-6)
    assert columns @ value == pytest.approx(basis @ (basis.T @ target), abs=1e-9)


def test_a_column_of_zeros_takes_no_step_and_two_alike_share_it() -> None:
    columns = np.array([[1.0, 0.0, 2.0], [1.0, 0.0, 2.0], [0.0, 0.0, 0.0]])
    value, root, basis = least_squares(columns, np.array([3.0, 3.0, 1.0]))
    assert value[1] == 0.0 and np.all(root[1] == 0.0) and basis.shape == (3, 1)
    assert value == pytest.approx([1.5, 0.0, 0.75])
    assert within_room(columns, np.array([3.0, 3.0, 1.0]), [(-1.0, 1.0)] * 3)[1] == 0.0
    value, root, basis = least_squares(np.zeros((2, 0)), np.ones(2))
    assert value.shape == (0,) and basis.shape == (2, 0)


@given(problems)
def test_within_rooms_it_is_the_least_that_any_other_way_finds(rng: np.random.Generator) -> None:
    columns, target = made(rng)
    size = np.linalg.norm(columns, axis=0)
    # Some rooms hold the least squares, some do not, and one parameter may not move at all.
    rooms = [(-float(a) / s, float(b) / s) for a, b, s in zip(*rng.exponential(1.0, (2, 4)), size, strict=True)]
    rooms[3] = (0.1 / size[3],) * 2
    value = within_room(columns, target, rooms)
    assert all(low <= own <= high for own, (low, high) in zip(value, rooms, strict=True))
    other = minimize(
        lambda x: float(np.sum((target - columns @ (x / size)) ** 2)),
        np.clip(np.zeros(4), *np.array(rooms).T) * size,
        jac=lambda x: -2.0 * (columns / size).T @ (target - columns @ (x / size)),
        bounds=[(low * s, high * s) for (low, high), s in zip(rooms, size, strict=True)],
        method="L-BFGS-B",
        options={"maxiter": 1000, "ftol": 1e-15, "gtol": 1e-10},
    )
    assert np.sum((target - columns @ value) ** 2) <= other.fun + 1e-7


@given(problems, st.floats(0.05, 2.0))
def test_within_a_radius_it_is_as_long_as_it_may_be_and_leaves_least(rng: np.random.Generator, share: float) -> None:
    columns, target = made(rng)
    rooms = [(-np.inf, np.inf)] * 4
    whole = within_room(columns, target, rooms)
    radius = share * length(columns, whole)
    value = within_radius(columns, target, rooms, radius)
    if share >= 1.0:
        assert np.array_equal(value, whole)
        return
    assert length(columns, value) == pytest.approx(radius, rel=2.0 * RADIUS_TOLERANCE)
    # The slope of what is left points along the scaled parameters: no other of this length leaves less.
    size = np.linalg.norm(columns, axis=0)
    slope, own = (columns / size).T @ (target - columns @ value), size * value
    assert slope == pytest.approx(own * (slope @ own) / (own @ own), abs=1e-6 * np.linalg.norm(slope) + 1e-9)
    assert slope @ own >= -1e-9


def test_units_change_nothing() -> None:
    columns, target = made(np.random.default_rng(5))
    units = np.array([1e3, 1e-3, 1.0, 57.3])
    rooms = [(-0.2, 0.2), (-np.inf, np.inf), (-1.0, 0.5), (0.0, 2.0)]
    radius = 0.4 * length(columns, within_room(columns, target, rooms))
    scaled = [(low * unit, high * unit) for (low, high), unit in zip(rooms, units, strict=True)]
    one, other = within_radius(columns, target, rooms, radius), within_radius(columns / units, target, scaled, radius)
    assert other == pytest.approx(units * one, rel=1e-6)
