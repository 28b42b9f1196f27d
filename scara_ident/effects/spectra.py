"""Spectra of a residual over motor angle and over time, and which of their lines stand out of their surroundings.

The sums over samples are formed on a uniform grid of angle or time and transformed at once, so that a thousand
orders cost as much as one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array

# Share of the sample rate above which a sampled sine is another one.
HIGHEST_FREQUENCY_SHARE = 0.4
# Points of the angle grid per period of twice the highest order; each sample is shared by its two neighbours.
GRID_POINTS = 8
# Points of the transform per line width: between them it is interpolated linearly.
FINENESS = 16
# Of residuals that have nothing above a frequency so many samples in its period are enough: what folds lies beyond it twice.
SAMPLES_PER_PERIOD = 4.0
# The noise floor at a line is taken from this many line widths on either side, without the nearest few. Noise changes
# faster over frequency, where the loop and the trajectory shape it, than over order.
NEIGHBOURS = 40.0
# The same over frequency.
NEIGHBOURS_IN_TIME = 12.0
# Line widths left out on either side: the Hann window spreads a line over two.
GUARD = 3.0
# The largest of a spectrum between its independent positions is that of this many per line width.
TRIALS_PER_WIDTH = 3.0
# At angles of which the samples do not tell cosine and sine apart a line cannot be seen.
SMALLEST_DETERMINANT = 1e-3


@dataclass(frozen=True)
class Line:
    """A line of a spectrum that stands out.

    Attributes
    ----------
    position : float
        Order or frequency, between the points of the spectrum.
    power : float
        In the spectrum's unit.
    floor : float
        Mean power of the noise around it.
    p_value : float
        Probability that noise alone has such a line anywhere in the spectrum.
    """

    position: float
    power: float
    floor: float
    p_value: float


def order_spectrum(residual: Array, motor_angle: Array, orders: Array) -> Array:
    """Return how much of a residual each order of an angle explains.

    Parameters
    ----------
    residual : ndarray, shape (N,)
        Of one joint; recordings whose angles have one origin are put behind each other.
    motor_angle : ndarray, shape (N,)
        rad, continuous over turns.
    orders : ndarray, shape (K,)
        Periods per turn, positive.

    Returns
    -------
    ndarray, shape (K,)
        Fall of the mean square when a constant, cosine and sine of ``order * motor_angle`` are fitted instead of a
        constant: half the squared amplitude of a line.
    """
    wanted = np.atleast_1d(np.asarray(orders, dtype=np.float64))
    centred = np.asarray(residual, dtype=np.float64) - np.mean(residual)
    low, high = float(np.min(motor_angle)), float(np.max(motor_angle))
    if not high > low:
        return np.zeros_like(wanted)
    # The sums are also needed at twice the orders, for the products of cosine and sine.
    step = 2.0 * np.pi / (GRID_POINTS * 2.0 * float(np.max(wanted)))
    first = _transform(centred, motor_angle - low, step, wanted)
    both = _transform(np.ones_like(centred), motor_angle - low, step, np.concatenate([wanted, 2.0 * wanted]))
    once, twice = both[: len(wanted)], both[len(wanted) :]
    count = float(len(centred))
    # Normal equations of cosine and sine once their means are taken out.
    cc = 0.5 * (count + twice.real) - once.real**2 / count
    ss = 0.5 * (count - twice.real) - once.imag**2 / count
    cs = 0.5 * twice.imag - once.real * once.imag / count
    c, s = first.real, first.imag
    determinant = cc * ss - cs**2
    seen = determinant > SMALLEST_DETERMINANT * (0.5 * count) ** 2
    explained = np.divide(ss * c**2 - 2.0 * cs * c * s + cc * s**2, determinant, out=np.zeros_like(c), where=seen)
    return np.asarray(np.maximum(explained, 0.0) / count)


def frequency_spectrum(
    residuals: Sequence[Array], rate: float, frequencies: Array, *, highest: float | None = None
) -> Array:
    """Return the power of lines at frequencies, whatever their phase in each recording.

    Parameters
    ----------
    residuals : sequence of ndarray, each of shape (N_r,)
        Of one joint, one per stretch of uniform samples.
    rate : float
        Samples per second.
    frequencies : ndarray, shape (K,)
        Hz.
    highest : float, optional
        Hz above which the residuals have nothing, see `whitened`: then they need not be transformed at their full rate.

    Returns
    -------
    ndarray, shape (K,)
        Half the squared amplitude of a line, averaged over the stretches by their lengths. A Hann window keeps what
        is strong at low frequency from leaking, and doubles the width of a line.
    """
    from scipy.fft import next_fast_len

    wanted = np.atleast_1d(np.asarray(frequencies, dtype=np.float64))
    power, samples = np.zeros_like(wanted), 0
    for residual in residuals:
        count = len(residual)
        window = 0.5 - 0.5 * np.cos(2.0 * np.pi * (np.arange(count) + 0.5) / count)
        length = next_fast_len(FINENESS * count)
        most = 1 if highest is None else max(1, int(rate / (SAMPLES_PER_PERIOD * highest)))
        # Of as many samples the frequencies are the same.
        step = next(step for step in range(most, 0, -1) if length % step == 0)
        shape = np.asarray(residual, dtype=np.float64) - np.average(residual, weights=window)
        spectrum = np.abs(np.fft.rfft((window * shape)[::step], length // step)) * 2.0 * step / np.sum(window)
        amplitude = np.interp(wanted, np.arange(len(spectrum)) * (rate / length), spectrum)
        power += 0.5 * count * amplitude**2
        samples += count
    return np.asarray(power / max(samples, 1))


def whitened(
    residuals: Sequence[Array], rate: float, *highest: float | None, smoothing: float = 1.0
) -> list[list[Array]]:
    """Divide residuals by the smooth part of their common amplitude spectrum, without phase.

    Noise that grows with frequency otherwise hides a line in the motor's angle, which passes many frequencies. The
    result has the same lines, weighted by where they stand out of the noise, and no unit.

    Parameters
    ----------
    residuals : sequence of ndarray, each of shape (N_r,)
    rate : float
        Samples per second.
    *highest : float or None
        Hz above which nothing is kept, such as the residual's own low-pass; None keeps all.
    smoothing : float
        Hz on either side over which the spectrum's median is taken, which a line does not move.

    Returns
    -------
    list of list of ndarray
        For each highest frequency the residuals, of shapes as given.
    """
    from scipy.fft import next_fast_len

    length = next_fast_len(max(len(residual) for residual in residuals))
    spectra = [np.fft.rfft(np.asarray(residual) - np.mean(residual), length) for residual in residuals]
    frequency = np.fft.rfftfreq(length, 1.0 / rate)
    kept = [len(frequency) if most is None else int(np.searchsorted(frequency, most, "right")) for most in highest]
    reach = max(1, round(smoothing * length / rate))
    # What a median and a mean of these reach above the highest frequency.
    within = slice(max(kept) + 2 * reach)
    power = np.sum([np.abs(spectrum[within]) ** 2 for spectrum in spectra], axis=0) / sum(map(len, residuals))
    middle = np.median(around(power, reach), axis=1) / np.log(2.0)
    smooth = np.mean(around(middle, reach), axis=1)
    gain = np.divide(1.0, np.sqrt(smooth), out=np.zeros_like(smooth), where=smooth > 0.0)
    return [
        [
            np.fft.irfft(spectrum[:count] * gain[:count], length)[: len(residual)]
            for spectrum, residual in zip(spectra, residuals, strict=True)
        ]
        for count in kept
    ]


def around(values: Array, reach: int) -> Array:
    """Return values with as many neighbours on either side, those at the ends repeated, shape (K, 2 reach + 1)."""
    return np.lib.stride_tricks.sliding_window_view(np.pad(values, reach, mode="edge"), 2 * reach + 1)


def order_width(motor_angle: Array) -> float:
    """Return how far apart orders must be to be told apart: one over the turns covered."""
    return float(2.0 * np.pi / max(float(np.ptp(motor_angle)), 1e-12))


def frequency_width(residuals: Sequence[Array], rate: float) -> float:
    """Return how far apart frequencies must be to be told apart under the Hann window, Hz."""
    return 2.0 * rate / max(len(residual) for residual in residuals)


def lines(
    positions: Array,
    power: Array,
    width: float,
    *,
    degrees: int = 2,
    neighbours: float = NEIGHBOURS,
    significance: float = 0.01,
) -> list[Line]:
    """Find the lines that noise of a smooth spectrum would not have.

    Around a position the power of noise in ``degrees`` degrees of freedom is chi-squared about a local mean, taken
    from the median of the neighbours, which a few other lines do not move; with what that mean is unsure by, their
    ratio is F-distributed. The largest over all positions is judged: the p-value is for `TRIALS_PER_WIDTH` independent
    positions per line width.

    Parameters
    ----------
    positions : ndarray, shape (K,)
        Increasing, a few per line width.
    power : ndarray, shape (K,)
    width : float
        Line width in the unit of the positions.
    degrees : int
        2 for a sum over all samples, 2 R for an average over R recordings of about the same length.
    neighbours : float
        Line widths on either side that give the mean.

    Returns
    -------
    list of Line
        The most significant first. A strong line has lesser ones beside it that go when it is fitted; one at a time.
    """
    from scipy.special import fdtrc

    spacing = float(np.median(np.diff(positions)))
    floor = noise_floor(positions, power, width, degrees=degrees, neighbours=neighbours)
    reach = max(1, round(width / spacing))
    ratio = np.divide(power, floor, out=np.zeros_like(power), where=floor > 0.0)
    top = np.flatnonzero((power == np.max(around(power, reach), axis=1)) & (power > 0.0))
    trials = 1.0 + TRIALS_PER_WIDTH * (positions[-1] - positions[0]) / width
    # A median says as much as a mean of half as many.
    freedom = degrees * max(neighbours - GUARD, 1.0)
    found = []
    for k in top:
        if k in (0, len(power) - 1):
            # The edge of a slope is no line.
            continue
        single = float(fdtrc(degrees, freedom, ratio[k]))
        p_value = float(-np.expm1(trials * np.log1p(-min(single, 1.0 - 1e-16))))
        if p_value <= significance:
            found.append(Line(_between(positions, power, int(k)), float(power[k]), float(floor[k]), p_value))
    return sorted(found, key=lambda line: (line.p_value, -line.power / line.floor))


def noise_floor(
    positions: Array, power: Array, width: float, *, degrees: int = 2, neighbours: float = NEIGHBOURS
) -> Array:
    """Return the mean power of noise around every position, shape (K,), from the median of its neighbours."""
    from scipy.special import gammaincinv

    spacing = float(np.median(np.diff(positions)))
    guard, reach = round(GUARD * width / spacing), round(neighbours * width / spacing)
    # Every half line width is enough for a median.
    stride = max(1, round(0.5 * width / spacing))
    # Median over mean of chi-squared with that many degrees of freedom.
    to_mean = 0.5 * degrees / float(gammaincinv(0.5 * degrees, 0.5))
    floor = np.empty_like(power)
    grid = np.arange(0, len(power), stride)
    below, above = np.arange(-reach, -guard, stride), np.arange(guard + 1, reach + 1, stride)
    inner = (grid >= reach) & (grid < len(power) - reach)
    around = np.concatenate([below, above])
    if np.any(inner) and len(around):
        floor[grid[inner]] = np.median(power[grid[inner][:, None] + around], axis=1) * to_mean
    edge = grid[~inner | (len(around) == 0)]
    first = np.maximum(0, edge - reach)[:, None]
    lower = first + stride * np.arange(-(-reach // stride))
    places = np.concatenate([np.where(lower < edge[:, None] - guard, lower, len(power)), edge[:, None] + above], axis=1)
    floor[edge] = _median_of_some(power, np.minimum(places, len(power))) * to_mean
    held = np.isfinite(floor[grid])
    return np.interp(np.arange(len(power)), grid[held], floor[grid][held]) if np.any(held) else np.zeros_like(power)


def _median_of_some(power: Array, places: NDArray[np.intp]) -> Array:
    """Return the median of power at places (K, m), shape (K,); one beyond its end does not count, and none of any is NaN."""
    near = np.sort(np.append(power, np.inf)[places], axis=1)
    count = np.count_nonzero(places < len(power), axis=1)
    row, some = np.arange(len(near)), np.maximum(count, 1)
    if not near.shape[1]:
        return np.full(len(near), np.nan)
    return np.where(count > 0, 0.5 * (near[row, (some - 1) // 2] + near[row, some // 2]), np.nan)


def _transform(weights: Array, angle: Array, step: float, orders: Array) -> NDArray[np.complex128]:
    """Return ``sum weights exp(i order angle)`` for angles from zero on."""
    from scipy.fft import next_fast_len

    place = angle / step
    left = np.floor(place).astype(np.intp)
    share = place - left
    size = int(left.max()) + 2
    grid = np.bincount(left, weights * (1.0 - share), size) + np.bincount(left + 1, weights * share, size)
    length = next_fast_len(FINENESS * size)
    # Turned to the middle of the angles the transform is smooth enough to interpolate.
    spacing = 2.0 * np.pi / (length * step)
    top = int(np.ceil(np.max(orders) / spacing)) + 2
    spectrum = np.conj(np.fft.rfft(grid, length)[:top])
    own = np.arange(len(spectrum)) * spacing
    middle = 0.5 * (size - 1) * step
    smooth = spectrum * np.exp(-1j * own * middle)
    value = np.interp(orders, own, smooth.real) + 1j * np.interp(orders, own, smooth.imag)
    # Sharing a sample between two points smooths by a triangle.
    return np.asarray(value * np.exp(1j * orders * middle) / np.sinc(orders * step / (2.0 * np.pi)) ** 2)


def _between(positions: Array, power: Array, k: int) -> float:
    """Return the top of the parabola through a point and its neighbours."""
    if not 0 < k < len(power) - 1:
        return float(positions[k])
    below, here, above = power[k - 1 : k + 2]
    bend = below - 2.0 * here + above
    shift = 0.5 * (below - above) / bend if bend < 0.0 else 0.0
    return float(positions[k] + np.clip(shift, -0.5, 0.5) * (positions[k + 1] - positions[k]))
