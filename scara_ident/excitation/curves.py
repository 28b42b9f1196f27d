"""Curves of joint motion: linear in their coefficients, at rest at both ends.

A basis gives position, velocity and acceleration at any time as matrices, so that what an optimiser does with a
motion is linear algebra. That the motion starts and ends at rest, with no velocity and no acceleration, is built
into the basis by the null space of these conditions, and so holds whatever the coefficients are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from scara_ident.arrays import Array
from scara_ident.errors import UsageError
from scara_ident.motion.motion import Motion

Family = Literal["fourier", "spline"]

# Splines of this degree have a continuous third derivative of acceleration.
DEGREE = 5
# Times that are worked on at once, so that hours of motion fit into memory.
CHUNK = 20_000
# Conditions whose singular value is below this share of the largest are implied by the others.
IMPLIED = 1e-12


@dataclass(frozen=True, eq=False)
class Basis:
    """Functions of time whose sums are at rest at both ends.

    Attributes
    ----------
    family : {"fourier", "spline"}
        Harmonics of ``2 pi / duration`` (Swevers et al. 1997), or B-splines on equal intervals.
    duration : float
        s.
    orders : tuple of int
        The harmonics; for splines the number of intervals alone.
    projection : ndarray, shape (r, m)
        From the m free coefficients to those of the r functions of the family.
    """

    family: Family
    duration: float
    orders: tuple[int, ...]
    projection: Array

    @property
    def size(self) -> int:
        """Number m of free coefficients per joint."""
        return int(self.projection.shape[1])

    @property
    def periodic(self) -> bool:
        """Whether the motion may be repeated without a break."""
        return self.family == "fourier"

    @property
    def bandwidth(self) -> float:
        """Highest frequency, Hz; of splines about half the rate of their intervals."""
        top = self.orders[-1] if self.family == "fourier" else 0.5 * self.orders[-1]
        return top / self.duration

    def rows(self, time: Array, derivative: int = 0) -> Array:
        """Return the functions, or a derivative of them, at given times.

        Parameters
        ----------
        time : ndarray, shape (N,)
            s, from 0 to the duration.

        Returns
        -------
        ndarray, shape (N, m)
        """
        return _raw(self.family, self.duration, self.orders, np.asarray(time, dtype=float), derivative) @ (
            self.projection
        )


def make_basis(
    duration: float, harmonics: int | Sequence[int], family: Family = "fourier", *, fixed_start: bool = False
) -> Basis:
    """Build a basis.

    Parameters
    ----------
    duration : float
        s.
    harmonics : int or sequence of int
        How many harmonics, or which. For splines ``2 harmonics`` intervals, about as many coefficients.
    family : {"fourier", "spline"}
    fixed_start : bool, optional
        Whether all functions are zero at time zero, so that the posture at the start is given.

    Raises
    ------
    UsageError
        If the duration is not positive, there are too few harmonics to start and end at rest, or no such family.
    """
    if family not in get_args(Family):
        raise UsageError(f"family {family!r}: expected one of {', '.join(get_args(Family))}")
    if not (np.isfinite(duration) and duration > 0.0):
        raise UsageError(f"duration {duration:g} s: expected a positive number of seconds")
    wanted = tuple(range(1, harmonics + 1)) if isinstance(harmonics, int) else tuple(sorted(set(harmonics)))
    if len(wanted) < 3 or wanted[0] < 1:
        said = ", ".join(map(str, wanted)) or "none" if not isinstance(harmonics, int) else str(harmonics)
        raise UsageError(f"harmonics {said}: expected at least 3 positive ones; fewer cannot start and end at rest")
    if family == "spline":
        wanted = (2 * len(wanted),)
    conditions = [_raw(family, duration, wanted, np.array([0.0, duration]), order) for order in (1, 2)]
    # A periodic motion at rest at its start is at rest at its end.
    rest = np.vstack([rows[:1] if family == "fourier" else rows for rows in conditions])
    if fixed_start:
        rest = np.vstack([rest, _raw(family, duration, wanted, np.zeros(1), 0)])
    rest = rest / np.linalg.norm(rest, axis=1)[:, None]
    _, singular, right = np.linalg.svd(rest, full_matrices=True)
    rank = int(np.count_nonzero(singular > IMPLIED * singular[0]))
    return Basis(family, float(duration), wanted, np.ascontiguousarray(right[rank:].T))


def _raw(family: Family, duration: float, orders: tuple[int, ...], time: Array, derivative: int) -> Array:
    if family == "spline":
        return _splines(duration, orders[0], time, derivative)
    omega = 2.0 * np.pi / duration * np.array(orders, dtype=float)
    # Scaled by 1/omega, coefficients are amplitudes of velocity, which have one size whatever the harmonic.
    size = omega ** (derivative - 1)
    phase = np.outer(time, omega) + 0.5 * np.pi * derivative
    constant = np.full((len(time), 1), 1.0 if derivative == 0 else 0.0)
    return np.hstack([constant, np.cos(phase) * size, np.sin(phase) * size])


def _splines(duration: float, intervals: int, time: Array, derivative: int) -> Array:
    from scipy.interpolate import BSpline

    knots = np.concatenate([np.zeros(DEGREE), np.linspace(0.0, duration, intervals + 1), np.full(DEGREE, duration)])
    spline = BSpline(knots, np.eye(len(knots) - DEGREE - 1), DEGREE)
    return np.asarray(spline.derivative(derivative)(time) if derivative else spline(time))


@dataclass(frozen=True, eq=False)
class ExcitationTrajectory:
    """A designed motion of all joints.

    Attributes
    ----------
    posture : ndarray, shape (n,)
        Positions about which the coefficients move the joints, rad or m.
    coefficients : ndarray, shape (n, m)
    """

    name: str
    joints: tuple[str, ...]
    basis: Basis
    posture: Array
    coefficients: Array

    @property
    def duration(self) -> float:
        """Length, s."""
        return self.basis.duration

    def at(self, time: Array) -> tuple[Array, Array, Array]:
        """Return position, velocity and acceleration, each of shape (n, N), at times (N,) in s."""
        time = np.asarray(time, dtype=float)
        found = np.empty((3, len(self.joints), len(time)))
        for first in range(0, len(time), CHUNK):
            part = slice(first, first + CHUNK)
            for order in range(3):
                found[order, :, part] = self.coefficients @ self.basis.rows(time[part], order).T
        q, v, a = found
        return q + self.posture[:, None], v, a

    def motion(self, samples: int) -> Motion:
        """Return equally spaced samples, both ends included, as the paper counts its 2500."""
        time = np.linspace(0.0, self.duration, samples)
        return Motion(self.name, self.name, time, *self.at(time), None, (samples - 1) / self.duration)

    def series(self) -> tuple[dict[str, list[float]], ...]:
        """Return every joint's coefficients in plain terms.

        For harmonics ``offset``, ``cosine`` and ``sine`` with
        ``q(t) = offset + sum_k cosine_k cos(2 pi h_k t / T) + sine_k sin(2 pi h_k t / T)``; for splines the
        ``control`` points of clamped B-splines of degree 5 on equal intervals. rad or m.
        """
        raw = self.coefficients @ self.basis.projection.T
        if self.basis.family == "spline":
            return tuple({"control": list(row)} for row in raw + self.posture[:, None])
        count = len(self.basis.orders)
        omega = 2.0 * np.pi / self.duration * np.array(self.basis.orders, dtype=float)
        return tuple(
            {
                "offset": [float(row[0] + start)],
                "cosine": (row[1 : 1 + count] / omega).tolist(),
                "sine": (row[1 + count :] / omega).tolist(),
            }
            for row, start in zip(raw, self.posture, strict=True)
        )
