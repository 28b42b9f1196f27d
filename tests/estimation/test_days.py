"""Runs of one day share the zero of their sensors, and few days tell little of where it is on average."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scara_ident.estimation.days import same_day

NOISE = 0.01


def offsets(seed: int, days: list[int]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Offsets of two joints in runs of these days, far apart beside their noise, its variance, and how far apart."""
    rng = np.random.default_rng(seed)
    zero = np.array([[0.3, -0.2], [-0.4, 0.1], [0.1, 0.5]])[days].T
    return zero + NOISE * rng.standard_normal(zero.shape), np.full(zero.shape, NOISE**2), np.array([0.3, 0.3])


def partition(labels: np.ndarray) -> set[frozenset[int]]:
    """The runs of each day, whatever the days are called."""
    return {frozenset(np.flatnonzero(labels == day)) for day in labels}


@given(st.integers(0, 20), st.permutations([0, 0, 1, 1, 1, 2]), st.floats(1e-6, 1e6))
def test_days_are_reported_in_any_order_and_unit(seed: int, days: list[int], unit: float):
    off, unsure, std = offsets(seed % 3, days)
    told = same_day(unit * off, unit**2 * unsure, unit * std)
    assert told is not None
    assert partition(told) == partition(np.array(days))


@pytest.mark.parametrize("days", [[0, 0, 0, 0], [0, 1, 2], [0, 1]])
def test_nothing_is_said_where_all_are_of_one_day_or_no_two(days: list[int]):
    assert same_day(*offsets(0, days)) is None


def test_what_is_unsure_keeps_no_days_apart():
    off, unsure, std = offsets(0, [0, 0, 1, 1])
    assert same_day(off, 1e4 * unsure, std) is None


def test_runs_that_lie_near_beside_the_days_are_of_one_whatever_their_noise():
    # Friction that differs moved these by a fifth of what lies between the days, ten times their noise.
    off, _, std = offsets(0, [0, 0, 0, 1, 1, 1])
    moved = off + 0.2 * std[:, None] * np.array([[0, 1, -1, 0, 1, 0], [1, 0, 0, -1, 0, 1]]) * 0.5
    told = same_day(moved, np.zeros(off.shape), std)
    assert told is not None
    assert partition(told) == partition(np.array([0, 0, 0, 1, 1, 1]))


def test_draws_of_their_own_are_seldom_taken_for_days():
    rng = np.random.default_rng(0)
    days = []
    for _ in range(200):
        told = same_day(rng.standard_normal((6, 8)), np.full((6, 8), 1e-4), np.ones(6))
        days.append(8 if told is None else told.max())
    assert np.mean(days) > 6.5
