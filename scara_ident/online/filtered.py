"""Rows of raw positions and torques: both sides of the equation of motion pass one filter, with one delay.

The torque of filtered states is not the filtered torque, but an equation that holds at every sample holds for any weighted sum
of samples: columns of the regressor are made of positions that are hardly filtered, and then columns and torque are
summed with the same weights (the filtered regressor of Hsu, Bodson, Sastry and Paden 1987, "Adaptive identification and
control for manipulators without using joint accelerations", and of Slotine and Li 1987; as `scara_ident.estimation.observe`
does with a whole recording). In two steps:

1. Positions pass a low-pass of three times the band and are differentiated in the same step; torques pass it too. It is symmetric, so
   that all are late by the same time at every frequency.
2. Columns and torque are summed under a pulse that is orthogonal to itself shifted by whole rows (Meyer's scaling
   function, Daubechies 1992, *Ten Lectures on Wavelets*, section 4.2): of noise that is flat within the band successive rows are
   independent, each of the variance of one raw sample.

Both are of finite length, so that all there is to remember is the last raw samples.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.model.model import TorqueModel
from scara_ident.motion.motion import Motion
from scara_ident.motion.rest import POSITION_BAND, REST_WIDEN
from scara_ident.motion.sampling import SMOOTH_PER_PERIOD, samples_per

# Highest band as a share of the sample rate: the low-pass of positions must end below half the rate.
HIGHEST_BAND = 0.1
# Half the length of that low-pass in periods of the band: it leaves the band as it is to 1e-4.
HALF_LENGTH_PERIODS = 0.95
# Power of the cosine that is its window: with it the second derivative's weights end without a step.
POWER = 6
# Rows to either side that a pulse reaches over: successive ones are then correlated by 4e-4 at the most.
SPAN = 3
# Frequencies that the integral of a pulse is a sum over; it is smooth, and all digits are there from some tens on.
FREQUENCIES = 200
# Rows of each joint in a block at the least: of fewer the causes of a change are not told apart.
BLOCK_ROWS = 4
# A row counts where the joint moves under so much of its pulse's power at least; with less, its neighbours hold most of it.
MIN_MOVING_SHARE = 0.5
# Lost samples are bridged up to this share of the period of the positions' low-pass: a straight line is then as good as noise.
BRIDGED = 0.125


@dataclass(frozen=True, eq=False)
class RowFilter:
    """From a window of raw samples to the rows of a block.

    Attributes
    ----------
    rate : float
        Raw samples per second.
    every : int
        Raw samples per sample of the filtered motion.
    step : int
        Samples of the filtered motion per row.
    cut : float
        Low-pass of the positions, Hz.
    taps : ndarray, shape (2 m + 1, 3)
        Weights of raw samples in the low-passed signal and in its first two derivatives, 1/s and 1/s^2.
    pulses : ndarray, shape (rows, I)
        Weights of the filtered motion's samples in each row; squares of a row sum to `every`.
    widen : int
        Samples of the filtered motion by which rest is widened.
    """

    rate: float
    every: int
    step: int
    cut: float
    taps: Array
    pulses: Array
    widen: int

    @property
    def new(self) -> int:
        """Raw samples that a block is later than the one before."""
        return len(self.pulses) * self.step * self.every

    @property
    def window(self) -> int:
        """Raw samples that the rows of a block need."""
        return int(self.pulses.shape[1] + 2 * self.widen - 1) * self.every + len(self.taps)

    @property
    def bridged(self) -> int:
        """Lost raw samples in a row that are bridged; after more of them the filter begins anew."""
        return int(BRIDGED * self.rate / self.cut)

    @cached_property
    def acceleration_gain(self) -> float:
        """Variance of the accelerations under a row's pulse by white noise of the positions, over that of torques by theirs, 1/s^4."""
        samples = self.pulses.shape[1]
        raw = np.zeros(((samples - 1) * self.every + len(self.taps), 2))
        for k, size in enumerate(self.pulses[0]):
            raw[k * self.every : k * self.every + len(self.taps)] += size * self.taps[:, [0, 2]]
        torque, acceleration = np.sum(raw**2, axis=0)
        return float(acceleration / torque)

    def motion(self, window: Array) -> Motion:
        """Return the filtered motion and torque of raw positions and torques, shape (2, n, `window`)."""
        parts = sliding_window_view(window, len(self.taps), axis=-1)[..., :: self.every, :]
        smooth, v, a = np.moveaxis(parts @ self.taps, -1, 0)
        time = np.arange(smooth.shape[-1]) * (self.every / self.rate)
        return Motion("online", "online", time, smooth[0], v[0], a[0], smooth[1], self.rate / self.every)

    def moving(self, motion: Motion, rest: Array) -> NDArray[np.bool_]:
        """Return where each joint moves faster than a speed, shape (n,), and does not turn; shape (n, I).

        Rest and turns are widened by the memory of the positions' low-pass, which rounds them off, see `standstill`.
        """
        slow = np.abs(motion.v) <= rest[:, None]
        turns = np.diff(np.signbit(motion.v), axis=1)
        slow[:, 1:] |= turns
        slow[:, :-1] |= turns
        return np.asarray(~np.any(sliding_window_view(slow, 2 * self.widen + 1, axis=1), axis=-1), dtype=bool)

    def rows(self, model: TorqueModel, motion: Motion, moving: NDArray[np.bool_], weight: Array) -> list[Array]:
        """Return the rows ``[W | u]`` of each joint, shape (rows that count, k + 1).

        Parameters
        ----------
        model : TorqueModel
        motion : Motion
            Of `motion`.
        moving : ndarray of bool, shape (n, I)
            Both sides are zero elsewhere: friction is unknown there.
        weight : ndarray, shape (n,)
            Of each joint's torque.
        """
        inner = motion.part(self.widen, motion.samples - self.widen)
        tables = [np.empty((len(own) + 1, inner.samples)) for own in model.active]
        model.joint_columns(inner, [table[:-1] for table in tables])
        assert inner.torque is not None
        found = []
        for table, torque, moves, size in zip(tables, inner.torque, moving, weight, strict=True):
            table[-1] = torque
            table *= np.where(moves, size, 0.0)
            # Where part of a pulse is left out, so is that part of the noise's variance.
            share = (self.pulses**2 @ moves) / self.every
            counts = share >= MIN_MOVING_SHARE
            found.append((self.pulses[counts] @ table.T) / np.sqrt(share[counts])[:, None])
        return found


@lru_cache(maxsize=8)
def row_filter(rate: float, band: float, block: int) -> RowFilter:
    """Return the filter of a band.

    Parameters
    ----------
    rate : float
        Samples per second.
    band : float
        Hz where the pulse leaves half the power, to the rounding of a row to whole samples; nothing is left from twice of it on.
    block : int
        Raw samples that a block is to have at the least.
    """
    every = samples_per(rate, (band,), SMOOTH_PER_PERIOD)
    step = max(1, round(rate / (2.0 * band * every)))
    rows = max(BLOCK_ROWS, -(-block // (step * every)))
    pulses, one = np.zeros((rows, (rows - 1 + 2 * SPAN) * step + 1)), np.sqrt(every) * pulse(step)
    for k, row in enumerate(pulses):
        row[k * step : k * step + len(one)] = one
    cut = POSITION_BAND * band
    widen = max(1, round(REST_WIDEN * rate / (cut * every)))
    return RowFilter(rate, every, step, cut, derivatives(rate, cut, HALF_LENGTH_PERIODS / band), pulses, widen)


def pulse(step: int) -> Array:
    """Return Meyer's scaling function at so many samples per row, of unit length, shape (2 SPAN step + 1,)."""
    time = np.arange(-SPAN * step, SPAN * step + 1) / step
    # Up to one cycle per row, in the middle of each bin.
    frequency = (np.arange(FREQUENCIES) + 0.5) / FREQUENCIES
    rise = frequency**4 * (35.0 - 84.0 * frequency + 70.0 * frequency**2 - 20.0 * frequency**3)
    found = np.cos(2.0 * np.pi * np.outer(time, frequency)) @ np.cos(0.5 * np.pi * rise)
    return np.asarray(found / np.linalg.norm(found))


def derivatives(rate: float, cut: float, reach: float) -> Array:
    """Return a sinc under a window and its first two derivatives, as weights of the samples about the middle.

    The window is a power of a cosine, which ends so smoothly that the derivatives' weights end so too.

    Parameters
    ----------
    rate : float
        Samples per second.
    cut : float
        Hz where half the amplitude is left.
    reach : float
        Half the length of the window, s.

    Returns
    -------
    ndarray, shape (2 m + 1, 3)
        Exact for polynomials of second degree.
    """
    most = int(np.ceil(reach * rate)) - 1
    t, pace, omega = np.arange(-most, most + 1) / rate, 0.5 * np.pi / reach, 2.0 * np.pi * cut
    # The middle is a limit.
    safe = np.where(t == 0.0, 1.0, t)
    s0 = np.sinc(2.0 * cut * t)
    s1 = np.where(t == 0.0, 0.0, (np.cos(omega * t) - s0) / safe)
    s2 = np.where(t == 0.0, -(omega**2) / 3.0, -(omega**2) * s0 - 2.0 * s1 / safe)
    cosine, sine = np.cos(pace * t), np.sin(pace * t)
    w0, w1 = cosine**POWER, -POWER * pace * cosine ** (POWER - 1) * sine
    w2 = pace**2 * POWER * cosine ** (POWER - 2) * ((POWER - 1) * sine**2 - cosine**2)
    value, first, second = s0 * w0, -(s1 * w0 + s0 * w1), s2 * w0 + 2.0 * s1 * w1 + s0 * w2
    value /= np.sum(value)
    first /= first @ t
    # What sampling leaves of a constant is 1e-4 of the derivative of a signal at the low-pass's frequency.
    second -= np.sum(second) * value
    second *= 2.0 / (second @ t**2)
    return np.column_stack([value, first, second])
