"""Oscillation of links behind elastic gears: how torques drive it, and its initial state in a recording.

The lags x of m links behind their motors obey ``inertia x'' + damping x' + stiffness x = torque`` with matrices of shape
(m, m): a link that swings loads the gears of the others by its inertia.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from scara_ident.arrays import Array
from scara_ident.effects.matrices import inverse, times
from scara_ident.motion.low_pass import low_pass

# Radians of the free swing per sample up to which the scheme of fourth order is taken; it is stable up to 2.45.
FINE_STEP = 2.0
# Torques that are solved for together: what is made of more of them on the way leaves the processor's cache.
ROWS_AT_ONCE = 4
# A swing at the beginning that is seen with less than this share of the other ones' strength is not looked for.
UNSEEN = 1e-3

Lag = tuple[Array, Array, Array]


def _differences(x: Array, step: float, result: Array) -> None:
    """Put the derivatives of signals (..., N) in their place: of second order, and of first at the ends."""
    np.subtract(x[..., 2:], x[..., :-2], out=result[..., 1:-1])
    result[..., 1:-1] /= 2.0 * step
    for end, (one, other) in ((0, (1, 0)), (-1, (-1, -2))):
        result[..., end] = (x[..., one] - x[..., other]) / step


@dataclass(frozen=True, eq=False)
class Swing:
    """The equations ``inertia x'' + damping x' + stiffness x = torque`` at uniform samples.

    Attributes
    ----------
    inertia, damping, stiffness : ndarray, shape (m, m, N)
    step : float
        s per sample.
    """

    inertia: Array
    damping: Array
    stiffness: Array
    step: float

    def solve(self, torque: Array, start: Array | None = None) -> Lag:
        """Return x, its derivative and its second derivative.

        Parameters
        ----------
        torque : ndarray, shape (..., m, N)
            N at least 3; may be of the first samples alone.
        start : ndarray, shape (..., m, 2), optional
            x at the first two samples, by default the static x.

        Returns
        -------
        tuple of ndarray, each of that shape

        Notes
        -----
        Newmark's method as one banded triangular system: the scheme of Fox and Goodwin, of fourth order in the frequency,
        where it is stable, else the constant mean acceleration, which always is (Hughes, The Finite Element Method, 2000,
        section 9.1).
        """
        from scipy.linalg.lapack import dtbtrs

        shape, (beta, mobility, bands) = np.shape(torque), self._system
        m, count = shape[-2:]
        rows = np.reshape(torque, (-1, m, count))
        first_two = self.static(rows[..., :2]) if start is None else np.reshape(start, (-1, m, 2))
        x, first, second = (np.empty(rows.shape) for _ in range(3))
        for some in (slice(k, k + ROWS_AT_ONCE) for k in range(0, len(rows), ROWS_AT_ONCE)):
            own, mean = rows[some], np.add(rows[some, :, 2:], rows[some, :, :-2])
            mean *= beta
            mean += (1.0 - 2.0 * beta) * own[..., 1:-1]
            right = np.empty((len(own), count, m))
            right[:, :2] = first_two[some].transpose(0, 2, 1)
            right[:, 2:] = times(mobility, mean).transpose(0, 2, 1)
            # Row after row: a solver that exchanges rows takes five times as long and loses digits to the length of the run.
            flat = right.reshape(len(own), -1).T
            flat = np.asarray(dtbtrs(bands[:, : m * count], flat, uplo="L", diag="U", overwrite_b=True)[0]).T
            x[some] = flat.reshape(-1, count, m).transpose(0, 2, 1)
            _differences(x[some], self.step, first[some])
            left = own - times(self.damping, first[some])
            left -= times(self.stiffness, x[some])
            times(self._free_mobility, left, second[some])
        return x.reshape(shape), first.reshape(shape), second.reshape(shape)

    def static(self, torque: Array) -> Array:
        """Return x under torques (..., m, M) that last, at the first M samples."""
        return times(inverse(self.stiffness[..., : torque.shape[-1]]), torque)

    def memory(self, share: float) -> int:
        """Return after how many samples no more than a share is left of a free swing; all if it does not fade so far."""
        inertia, damping, stiffness = (
            np.einsum("iin->in", part) for part in (self.inertia, self.damping, self.stiffness)
        )
        # An overdamped link creeps back at no less than the stiffness over the damping.
        swinging, creeping = damping * stiffness, 2.0 * inertia * stiffness
        with np.errstate(divide="ignore"):
            # The slowest of several that swing together is no slower than the sum of these times.
            fading = 1.0 / np.sum(np.maximum(creeping, damping**2) / swinging, axis=0)
        return int(np.searchsorted(np.cumsum(fading) * self.step, -np.log(share)))

    @cached_property
    def _free_mobility(self) -> Array:
        return inverse(self.inertia)

    @cached_property
    def _system(self) -> tuple[float, Array, Array]:
        """Newmark's beta, the inverse of what multiplies a new sample (m, m, N - 2), and the unit triangular system's diagonals.

        The latter are of shape (3 m, m N), the lags of one sample after another.
        """
        m, count = self.inertia.shape[1:]
        # The trace is no less than the fastest of the free swings, squared.
        fastest = float(np.max(np.einsum("abn,ban->n", self._free_mobility, self.stiffness))) * self.step**2
        beta = 1.0 / 12.0 if fastest < FINE_STEP**2 else 0.25
        heavy, slow = self.inertia[..., 1:-1] / self.step**2, self.damping[..., 1:-1] / (2.0 * self.step)
        spring = self.stiffness[..., 1:-1]
        mobility = inverse(heavy + slow + beta * spring)
        last = _products(mobility, -2.0 * heavy + (1.0 - 2.0 * beta) * spring)
        before = _products(mobility, heavy - slow + beta * spring)
        bands = np.zeros((3 * m, m * count), order="F")
        for a in range(m):
            for b in range(m):
                bands[m + a - b, m + b : m * (count - 1) + b : m] = last[a, b]
                bands[2 * m + a - b, b : m * (count - 2) + b : m] = before[a, b]
        return beta, mobility, bands


def _products(left: Array, right: Array) -> Array:
    """Return the products of matrices (m, m, N)."""
    return np.stack([times(left, right[:, b]) for b in range(len(right))], axis=1)


@dataclass(frozen=True, eq=False)
class InitialState:
    """How links swung when a recording began, as far as the torques of their joints say.

    Attributes
    ----------
    free : tuple of ndarray, each of shape (2 m, m, M)
        x and its derivatives after a unit of each x at the first sample, then of each derivative; after M samples it has faded.
    torque : ndarray, shape (2 m, m, M)
        What they add to the torques of the joints.
    weights : ndarray, shape (m,)
        Of the rows of each joint's torque.
    fade : ndarray, shape (m, M)
        Weight of every sample of each joint's torque, 0 where friction is unknown, which would be taken for a swing.
    rate, band : float
        Hz; the torque is looked at within the band.
    used : slice
        Samples away from the ends, where the continuation of filtered signals is a guess.
    """

    free: Lag
    torque: Array
    weights: Array
    fade: Array
    rate: float
    band: float
    used: slice

    @property
    def count(self) -> int:
        """Samples M."""
        return int(self.torque.shape[-1])

    @cached_property
    def _seen(self) -> Array:
        return self._rows(self.fade * self.torque)

    @cached_property
    def _strength(self) -> Array:
        """Square of what each unit would show were nothing faded out, shape (2 m,)."""
        return np.asarray(np.sum(self._rows(self.torque) ** 2, axis=1))

    def _rows(self, torque: Array) -> Array:
        """Return what is seen of torques (..., m, N), shape (..., rows)."""
        shown = low_pass(torque[..., : self.count], self.rate, self.band)[..., self.used] * self.weights[:, None]
        return np.asarray(shown.reshape(*shown.shape[:-2], -1))

    def state(self, torque: Array, lag: tuple[Array, Array]) -> Array:
        """Return each x, then each derivative, beside those assumed, that explain torques of the joints.

        Parameters
        ----------
        torque : ndarray, shape (..., m, N)
            Of which the first M samples are taken.
        lag : tuple of ndarray, shape (m, N)
            x and its derivative, as large as which a swing at the beginning may be.

        Returns
        -------
        ndarray, shape (..., 2 m)
        """
        left = self._rows(self.fade * torque[..., : self.count])
        sizes = np.mean(np.concatenate(lag) ** 2, axis=1)
        normal = self._seen @ self._seen.T
        # What cannot be seen stays as assumed.
        normal += np.diag(UNSEEN * (self._strength @ sizes) / sizes)
        normal_inverse = np.linalg.inv(normal)
        # Once more on what that leaves: of what is seen a thousandth would stay as assumed, for as long as it swings.
        once = left @ self._seen.T @ normal_inverse
        return np.asarray(once + (left - once @ self._seen) @ self._seen.T @ normal_inverse)

    def added(self, lag: Lag, state: Array) -> Lag:
        """Return x and its derivatives with the swing that a state at the first sample makes."""
        x, first, second = (part.copy() for part in lag)
        for part, own in zip((x, first, second), self.free, strict=True):
            part[..., : self.count] += np.tensordot(state, own, 1)
        return x, first, second


def free_swings(swing: Swing, count: int) -> Lag:
    """Return x and its derivatives, shape (2 m, m, M), after a unit of each x at the first sample, then of each derivative."""
    m = len(swing.inertia)
    start = np.zeros((2, m, m, 2))
    for a in range(m):
        start[:, a, a] = [[1.0, 1.0], [0.0, swing.step]]
    return swing.solve(np.zeros((2 * m, m, count)), start.reshape(2 * m, m, 2))
