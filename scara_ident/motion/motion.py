"""From recorded positions to motion: uniform time, zero-phase low-pass, velocities and accelerations.

One filter serves all: the squared magnitude of a fourth-order Butterworth low-pass, 1 / (1 + (f/fc)^8), applied
in the frequency domain to the signal continued by odd reflection. It has no phase, and derivatives are taken in
the same step, exactly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import pairwise

import numpy as np

from scara_ident.arrays import Array
from scara_ident.errors import RecordingError
from scara_ident.motion.spline import cubic_spline
from scara_ident.recording.audit.samples import GAP_STEPS
from scara_ident.recording.recording import Recording

# Longer parts are cut, so that memory does not grow with the length of a recording.
MOST_SAMPLES = 60_000
# Cut-off over sample rate above which a low-pass is left out: it would take off next to nothing.
HIGHEST_CUT = 0.45
# A time step that differs by less than this share from the median is not jitter.
UNIFORM_TOLERANCE = 1e-3
# The filter's memory in periods of its cut-off: 4 of them leave under 1e-4 of a step.
MEMORY_PERIODS = 4.0
# A low-passed signal has nothing beyond this many times its cut-off, where the filter would leave 6e-8.
HIGHEST = 8.0
# Signals that are transformed together: more of them leave the cache.
ROWS_AT_ONCE = 8


@dataclass(frozen=True, eq=False)
class Motion:
    """A stretch of motion without gaps, at uniform time steps.

    Attributes
    ----------
    name, trajectory : str
        The recording it belongs to, and that recording's trajectory.
    time : ndarray, shape (N,)
        s.
    q, v, a : ndarray, shape (n, N)
        Position, velocity and acceleration in the order of the robot's joints.
    torque : ndarray, shape (n, N) or None
        Recorded torque, as it was recorded (not filtered).
    rate : float
        Samples per second.
    """

    name: str
    trajectory: str
    time: Array
    q: Array
    v: Array
    a: Array
    torque: Array | None
    rate: float

    @property
    def samples(self) -> int:
        """Number of samples."""
        return len(self.time)

    def part(self, start: int, stop: int) -> Motion:
        """Return the samples from ``start`` to before ``stop``."""
        window = slice(start, stop)
        return Motion(
            self.name,
            self.trajectory,
            self.time[window],
            self.q[:, window],
            self.v[:, window],
            self.a[:, window],
            None if self.torque is None else self.torque[:, window],
            self.rate,
        )


@dataclass(frozen=True, eq=False)
class Stretch:
    """A gapless part of a recording on a uniform time grid, before any filter.

    Attributes
    ----------
    name, trajectory : str
        The recording it belongs to, and that recording's trajectory.
    time : ndarray, shape (N,)
        s.
    position : ndarray, shape (n, N)
    torque : ndarray, shape (n, N) or None
    rate : float
        Samples per second.
    source : slice
        Samples of the recording that it was made of.
    """

    name: str
    trajectory: str
    time: Array
    position: Array
    torque: Array | None
    rate: float
    source: slice
    _filtered: dict[tuple[int, float | None], tuple[Array, Array, Array]] = field(default_factory=dict, repr=False)
    _thinned: dict[int, Stretch] = field(default_factory=dict, repr=False)

    def filtered(self, joint: int, cut: float | None) -> tuple[Array, Array, Array]:
        """Return position, velocity and acceleration of a joint, low-passed at ``cut`` Hz, made once."""
        if (joint, cut) not in self._filtered:
            self._filtered[joint, cut] = differentiate(self.position[joint], self.rate, cut)
        return self._filtered[joint, cut]


def stretches(recording: Recording) -> tuple[Stretch, ...]:
    """Cut a recording at its gaps and put each part on a uniform time grid.

    Jittered positions are interpolated by a cubic spline, torque linearly, at the rate of the samples, those dropped counted in.

    Parameters
    ----------
    recording : Recording

    Returns
    -------
    tuple of Stretch
        At least one; parts of fewer than four samples are left out.

    Raises
    ------
    RecordingError
        If no part is long enough.
    """
    step = np.diff(recording.time)
    median = float(np.median(step))
    # Nothing is interpolated across a gap.
    cuts = np.flatnonzero(step > GAP_STEPS * median) + 1
    bounds = _cut_long([0, *cuts.tolist(), len(recording.time)])
    found = []
    for start, stop in pairwise(bounds):
        if stop - start < 4:
            continue
        found.append(_uniform(recording, start, stop, median))
    if not found:
        raise RecordingError(f"{recording.path or recording.name}: no four samples in a row without a gap in time")
    return tuple(found)


def _cut_long(bounds: Sequence[int]) -> list[int]:
    """Divide parts that are too long into equal ones."""
    found = [bounds[0]]
    for start, stop in pairwise(bounds):
        pieces = -(-(stop - start) // MOST_SAMPLES)
        found += [start + (stop - start) * k // pieces for k in range(1, pieces + 1)]
    return found


def _uniform(recording: Recording, start: int, stop: int, median: float) -> Stretch:
    source = slice(start, stop)
    time, position = recording.time[source], recording.position[:, source]
    count = len(time)
    ideal = time[0] + (time[-1] - time[0]) / (count - 1) * np.arange(count)
    if np.max(np.abs(time - ideal)) > UNIFORM_TOLERANCE * median:
        # The median of jittered steps is off by up to a per cent; the number of steps is not.
        steps = int(np.sum(np.maximum(np.rint(np.diff(time) / median), 1.0)))
        ideal = np.linspace(time[0], time[-1], steps + 1)
        position = cubic_spline(time, position, ideal)
    rate = (len(ideal) - 1) / (ideal[-1] - ideal[0])
    torque = _torque_at(recording, source, ideal, median)
    return Stretch(recording.name, recording.trajectory, ideal, position, torque, float(rate), source)


def _torque_at(recording: Recording, source: slice, grid: Array, median: float) -> Array | None:
    """Return the effort of a part of a recording on a uniform grid, as it is where the samples lie on it."""
    if recording.effort is None:
        return None
    time, effort = recording.time[source], recording.effort[:, source]
    if len(time) == len(grid) and np.max(np.abs(time - grid)) <= UNIFORM_TOLERANCE * median:
        return effort
    return np.array([np.interp(grid, time, row) for row in effort])


def with_effort_of(stretch: Stretch, recording: Recording) -> Stretch:
    """Return a stretch with the effort of another recording of the same samples; the motion is shared."""
    median = float(np.median(np.diff(recording.time)))
    return replace(stretch, torque=_torque_at(recording, stretch.source, stretch.time, median))


def torque_of(stretch: Stretch) -> Array:
    """Return the recorded torque of a stretch, shape (n, N).

    Raises
    ------
    RecordingError
        If no effort was recorded.
    """
    if stretch.torque is None:
        raise RecordingError(f"{stretch.name}: no effort was recorded; it is needed to identify")
    return stretch.torque


def low_pass(signal: Array, rate: float, cut: float | None, step: int = 1) -> Array:
    """Low-pass a signal without phase.

    Parameters
    ----------
    signal : ndarray, shape (..., N)
    rate : float
        Samples per second.
    cut : float or None
        Frequency in Hz where half the amplitude is left; None leaves the signal as it is.
    step : int, optional
        Of `low_pass_every`, to continue the signal to the same length, so that both agree to rounding.

    Returns
    -------
    ndarray, shape (..., N)
    """
    if cut is None:
        return signal
    return _filtered(signal, rate, cut, (0,), HIGHEST * cut, step)[0]


def low_pass_every(signal: Array, rate: float, cut: float | None, step: int) -> Array:
    """Return every ``step``-th sample of `low_pass`, from the first on, without computing the others.

    The spectrum is folded at the lower rate, which is what leaving out samples does to it, so that the result is the
    same to rounding if `low_pass` is told the step.

    Parameters
    ----------
    signal : ndarray, shape (k, N)
    rate : float
        Samples per second.
    cut : float or None
        Frequency in Hz where half the amplitude is left; None filters nothing.
    step : int

    Returns
    -------
    ndarray, shape (k, ceil(N / step))
    """
    if cut is None or step == 1:
        return low_pass(signal, rate, cut)[..., ::step]
    count = signal.shape[-1]
    kept = -(-count // step)
    reach = min(count - 1, int(np.ceil(MEMORY_PERIODS * rate / cut)) + 1)
    # The first sample must fall on the lower grid.
    lead = -(-reach // step) * step
    closed = _closed_length(count, reach, step)
    low = closed // step
    half = low // 2 + 1
    frequency = np.arange(min(closed // 2, int(HIGHEST * cut * closed / rate)) + 1) * (rate / closed)
    gain = 1.0 / (1.0 + (frequency / cut) ** 8)
    # Half the rate is its own mirror image.
    gain[2 * np.arange(len(frequency)) == closed] *= 0.5
    result = np.empty((signal.shape[0], kept))
    line = np.arange(count + 2 * reach, dtype=float)
    buffer = np.zeros((min(ROWS_AT_ONCE, len(signal)), closed))
    whole = np.empty((len(buffer), closed // 2 + 1), dtype=complex)
    for begin in range(0, signal.shape[0], ROWS_AT_ONCE):
        rows = signal[begin : begin + ROWS_AT_ONCE]
        start, stop = 2.0 * rows[:, :1] - rows[:, reach : reach + 1], 2.0 * rows[:, -1:] - rows[:, -1 - reach, None]
        slope = (stop - start) / (count - 1 + 2 * reach)
        flat = buffer[: len(rows)]
        # The chord of the continued signal, which then closes on itself.
        chord = flat[:, lead - reach : lead + count + reach]
        np.multiply(slope, line, out=chord)
        middle = chord[:, reach : reach + count]
        np.subtract(rows, middle, out=middle)
        middle -= start
        head, tail = chord[:, :reach], chord[:, reach + count :]
        np.subtract(2.0 * rows[:, :1] - start - rows[:, reach:0:-1], head, out=head)
        np.subtract(2.0 * rows[:, -1:] - start - rows[:, -2 : -reach - 2 : -1], tail, out=tail)
        np.fft.rfft(flat, axis=1, out=whole[: len(rows)])
        spectrum = whole[: len(rows), : len(frequency)]
        spectrum *= gain
        folded = np.zeros((len(rows), half), dtype=complex)
        for first in range(0, len(frequency), low):
            part = spectrum[:, first : first + half]
            folded[:, : part.shape[1]] += part
            # Frequencies just below a multiple of the lower rate mirror those just below zero.
            mirrored = spectrum[:, first + low - half + 1 : first + low + 1][:, ::-1]
            folded[:, half - mirrored.shape[1] :] += np.conj(mirrored)
        smooth = np.fft.irfft(folded, low, axis=1) / step
        ramp = start + slope * (reach + step * np.arange(kept))
        result[begin : begin + len(rows)] = smooth[:, lead // step : lead // step + kept] + ramp
    return result


def differentiate(signal: Array, rate: float, cut: float | None) -> tuple[Array, Array, Array]:
    """Low-pass a signal and take its first two derivatives in the same step.

    Parameters
    ----------
    signal : ndarray, shape (..., N)
    rate : float
        Samples per second.
    cut : float or None
        Frequency in Hz where half the amplitude is left; None filters nothing.

    Returns
    -------
    tuple of ndarray, each of shape (..., N)
        The filtered signal, its derivative in 1/s and its second derivative in 1/s^2.
    """
    smooth, first, second = _filtered(signal, rate, cut, (0, 1, 2))
    return smooth, first, second


def _filtered(
    signal: Array, rate: float, cut: float | None, orders: Sequence[int], highest: float = np.inf, step: int = 1
) -> list[Array]:
    """Return derivatives of a low-passed signal, with nothing beyond the highest frequency, Hz."""
    count = signal.shape[-1]
    periods = rate / cut if cut is not None else 32.0
    reach = min(count - 1, int(np.ceil(MEMORY_PERIODS * periods)) + 1)
    head = 2.0 * signal[..., :1] - signal[..., reach:0:-1]
    tail = 2.0 * signal[..., -1:] - signal[..., -2 : -reach - 2 : -1]
    extended = np.concatenate([head, signal, tail], axis=-1)
    length = extended.shape[-1]
    # Without its chord the continued signal closes on itself; the chord is put back after.
    slope = (extended[..., -1:] - extended[..., :1]) / (length - 1)
    ramp = extended[..., :1] + slope * np.arange(length)
    flat = extended - ramp
    if cut is None:
        # No filter would stop the kink where the ends meet from ringing through the derivatives.
        fade = np.sin(0.5 * np.pi * np.arange(reach) / reach) ** 2
        flat[..., :reach] *= fade
        flat[..., -reach:] *= fade[::-1]
    closed = _closed_length(count, reach, step)
    spectrum = np.fft.rfft(_close(flat, closed), axis=-1)
    frequency = np.arange(closed // 2 + 1) * (rate / closed)
    gain = np.ones_like(frequency) if cut is None else 1.0 / (1.0 + (frequency / cut) ** 8)
    gain[frequency > highest] = 0.0
    keep = slice(reach, reach + count)
    results = []
    for order in orders:
        factor = gain * (2j * np.pi * frequency) ** order
        part = np.fft.irfft(spectrum * factor, closed, axis=-1)[..., keep]
        if order == 0:
            part = part + ramp[..., keep]
        elif order == 1:
            part = part + slope * rate
        results.append(part)
    return results


def _close(signal: Array, length: int) -> Array:
    # The ends are zero, so zeros continue the signal.
    missing = length - signal.shape[-1]
    return signal if missing == 0 else np.concatenate([signal, np.zeros((*signal.shape[:-1], missing))], axis=-1)


def _closed_length(count: int, reach: int, step: int) -> int:
    """Return how long a signal is, continued at both ends, that is transformed fast and falls on every step-th sample."""
    lead = -(-reach // step) * step
    return step * _fast_length(-(-(lead + count + reach) // step))


@lru_cache(maxsize=1024)
def _fast_length(length: int) -> int:
    """Return the next length whose only prime factors are 2, 3 and 5."""
    best = 1 << (length - 1).bit_length()
    five = 1
    while five < best:
        three = five
        while three < best:
            two = three
            while two < length:
                two *= 2
            best = min(best, two)
            three *= 3
        five *= 5
    return best


def motion_of(stretch: Stretch, cuts: Sequence[float | None]) -> Motion:
    """Filter and differentiate the positions of a stretch.

    Parameters
    ----------
    stretch : Stretch
    cuts : sequence of float or None, one per joint
        Cut-off frequency of each joint's position in Hz; None filters nothing.

    Returns
    -------
    Motion
        On the stretch's whole time grid; its ends carry the continuation's guess.
    """
    parts = [stretch.filtered(j, cut) for j, cut in zip(range(len(stretch.position)), cuts, strict=True)]
    q, v, a = (np.array([part[k] for part in parts]) for k in range(3))
    return Motion(stretch.name, stretch.trajectory, stretch.time, q, v, a, stretch.torque, stretch.rate)
