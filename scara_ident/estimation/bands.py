"""The band in which motion explains torque, chosen from the data joint by joint.

Differentiated twice, the noise of a position grows with the square of frequency, so above some frequency the
regressor is noise. Where that is, the torque tells: with parameters fitted at low frequency, the torque that a
hardly filtered motion predicts is compared with the recorded one, frequency by frequency. Where the prediction
leaves more than half of the torque's power, motion and torque no longer speak of the same thing, be it for noise
in the position or in the torque, and the band ends.

The first fit is in a narrow band, where noise has grown least, and the band is widened as far as that fit explains. What
a fit in the wider band says then brackets it from both sides, so that the search ends and cannot swing. A band of B Hz
needs few samples a second, so it is chosen on recordings of a low rate, and of higher ones only where the band asks for
them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from scara_ident.arrays import Array
from scara_ident.estimation.least_squares import weighted_value
from scara_ident.estimation.observations import informations, kept_rows
from scara_ident.model.model import TorqueModel
from scara_ident.motion.motion import Stretch, motion_of, torque_of
from scara_ident.motion.prepared import (
    END_PERIODS,
    REST_SHARE,
    PreparedData,
    PreparedStretch,
    fading,
    rest_speeds,
    slower,
)
from scara_ident.motion.thinning import thinned
from scara_ident.threads import side_by_side, threads_for

# Independent rows per parameter, at the least: what noise does to the estimate then adds a fifth to the noise variance of
# a prediction, p / N of it (Seber and Lee, Linear Regression Analysis, 2003, section 12.2).
ROWS_PER_PARAMETER = 5.0
# A joint that hardly moves is not given more than so many times the band that all joints together need.
MOST_ALONE = 2.0
# Independent values a second of a signal low-passed at 1 Hz (Nyquist).
ROWS_PER_HERTZ = 2.0
# The first fit is not in a narrower band, Hz: too much about turning points would be left out to fit the rest.
FIRST_BAND = 2.0
# Share of the torque's power that the motion must explain at the band's edge.
EXPLAINED = 0.5
# Highest band as a share of the sample rate, and of the position filter that shows where the noise begins.
HIGHEST_BAND = 0.2
WIDE_FILTER = 0.4
# The lowest sample rate that is looked at lets the first band widen so much; so much higher is the next.
FIRST_WIDENING = 8.0
NEXT_RATE = 16.0
# Parameters fitted in a band tell as well how far the motion explains the torque up to so many times that band.
NEAR_FIT = 4.0
# A band above this share of the highest that a sample rate allows asks for the next.
NEAR_HIGHEST = 0.5
# Frequencies are pooled into this many bins per octave.
BINS_PER_OCTAVE = 3
# Segments of the spectra, s.
SEGMENT_SECONDS = 4.0
# Samples that the choice looks at, at the most, at each rate.
ENOUGH_SAMPLES = 20_000


@dataclass(frozen=True)
class BandChoice:
    """Bands and how they came about.

    Attributes
    ----------
    bands : tuple of float
        Cut-off per joint, Hz.
    explained : tuple of float
        Share of the torque's power within the band that the fit explains, per joint.
    notes : tuple of str
        What a person should know, such as a joint whose torque the motion does not explain.
    """

    bands: tuple[float, ...]
    explained: tuple[float, ...]
    notes: tuple[str, ...]


def choose_bands(model: TorqueModel, data: PreparedData) -> BandChoice:
    """Choose the low-pass band of every joint.

    Parameters
    ----------
    model : TorqueModel
    data : PreparedData
        With effort; in any bands. The first repetition of each trajectory is looked at first.
    """
    _ = data.labels  # from the recordings as they are, before they are thinned
    edges = _edges([part.stretch for part in data.stretches])
    highest = HIGHEST_BAND * min(part.rate for part in data.stretches)
    slow_rate = FIRST_BAND * FIRST_WIDENING / HIGHEST_BAND
    slow = _thinned(data.at((FIRST_BAND,) * len(data.bands)), slow_rate)
    moving = _moving(slow)
    floor = np.minimum(narrowest_bands(model, len(data.stretches), moving), highest)
    bands = np.minimum(np.maximum(floor, FIRST_BAND), highest)
    rate = float(np.max(bands)) * FIRST_WIDENING / HIGHEST_BAND
    fit = None
    while True:
        # In the bands of the first fit where none begins wider, so that what is at rest is not looked for again.
        level = _sample(slow if rate == slow_rate else _thinned(data, rate))
        allowed = HIGHEST_BAND * min(part.rate for part in level.stretches)
        with threads_for(max(part.samples for part in level.stretches)):
            bands, fit = _widened(_Spectra(model, level, edges), bands, floor, allowed, fit)
        if allowed >= highest or np.max(bands) < NEAR_HIGHEST * allowed:
            return _told(model, bands, fit, edges, floor, moving)
        rate *= NEXT_RATE


def _widened(spectra: _Spectra, bands: Array, floor: Array, highest: float, known: _Fit | None) -> tuple[Array, _Fit]:
    """Widen bands as far as a fit in them explains the torque, until they stay, and return them with the last fit.

    Each fit leaves a joint's band between the widest that explained beyond itself and the narrowest that did not, which is
    not tried again: the bracket shrinks from bin to bin, so that this ends, whatever a fit says.
    """
    lower, upper = floor.copy(), np.full(len(bands), np.inf)
    bands = np.clip(bands, floor, highest)
    fit = spectra.fit(bands) if known is None else spectra.judged(known.bands, known.value)
    while True:
        # Where a band holds so much noise that nothing is explained, a narrower one may show what is.
        wanted = np.where(fit.explains > 0.0, np.minimum(fit.explains, highest), 0.5 * bands)
        wider = wanted >= bands
        lower, upper = np.where(wider, bands, lower), np.where(wider, upper, bands)
        bands = np.where(wider & (wanted >= upper), bands, np.maximum(wanted, lower))
        if np.all((bands >= fit.bands) & (bands <= NEAR_FIT * fit.bands)):
            return bands, fit
        fit = spectra.fit(bands)


@dataclass(frozen=True)
class _Fit:
    """What parameters fitted in some bands explain.

    Attributes
    ----------
    bands : ndarray, shape (n,)
        Of the fit, Hz.
    value : ndarray, shape (p,)
        Its parameters.
    explains : ndarray, shape (n,)
        Frequency up to which they explain each joint's torque, Hz; 0 where they explain nothing.
    shares : ndarray, shape (n, m)
        Share of the torque's power that they explain, from 0 to the end of each bin of frequency.
    """

    bands: Array
    value: Array
    explains: Array
    shares: Array


class _Spectra:
    """Power of the torque, and of what fits leave of it along a hardly filtered motion, in bins of frequency."""

    def __init__(self, model: TorqueModel, data: PreparedData, edges: Array) -> None:
        self.model, self.data, self.edges = model, data, edges
        self.parts = [part.stretch for part in data.stretches]
        self.torque = np.sum([binned_power(torque_of(part), part.rate, edges) for part in self.parts], axis=0)

        def wide(part: Stretch) -> tuple[Array, ...]:
            return model.joint_columns(motion_of(part, [WIDE_FILTER * part.rate] * model.robot.n))

        self.columns = side_by_side(wide, self.parts)

    def fit(self, bands: Array) -> _Fit:
        """Fit parameters in bands, and say how far up they explain each joint's torque."""
        data = self.data.at(tuple(bands.tolist()))
        # One that is too short for these bands, or at rest, has nothing to say.
        kept = np.flatnonzero(side_by_side(kept_rows, data.recordings)).tolist()
        return self.judged(bands, weighted_value(informations(self.model, data.of(kept) if kept else data)))

    def left(self, value: Array) -> Array:
        """Return the power of what parameters leave of the torque, shape (n, m)."""

        def of(part: Stretch, columns: tuple[Array, ...]) -> Array:
            predicted = [value[own] @ rows for own, rows in zip(self.model.active, columns, strict=True)]
            return binned_power(torque_of(part) - np.array(predicted), part.rate, self.edges)

        return np.asarray(np.sum(side_by_side(of, self.parts, self.columns), axis=0))

    def judged(self, bands: Array, value: Array) -> _Fit:
        """Say how far up parameters that were fitted in some bands explain each joint's torque."""
        error = self.left(value)
        gain = np.cumsum(self.torque * (1.0 - EXPLAINED) - error, axis=1)
        best = np.argmax(gain, axis=1)
        some = gain[np.arange(len(best)), best] > 0.0
        whole = np.maximum(np.cumsum(self.torque, axis=1), np.finfo(float).tiny)
        return _Fit(bands, value, np.where(some, self.edges[best + 1], 0.0), 1.0 - np.cumsum(error, axis=1) / whole)


@dataclass(frozen=True, eq=False)
class Reach:
    """How far up motion explains torque on recordings, and below which speed it is rest, to foresee those of a motion.

    Attributes
    ----------
    bands : tuple of float or None
        Of these recordings, Hz.
    edges : ndarray, shape (m + 1,)
        Of the bins, Hz.
    gain, left : ndarray, shape (n, m)
        Power of what is explained less what need not be, and of what is left.
    rate, seconds : float
        Samples per second, and length, of these recordings.
    rest : ndarray, shape (n,)
        Speeds below which joints are at rest.
    widening : bool
        Whether further recordings widen the bands.
    """

    bands: tuple[float | None, ...]
    edges: Array
    gain: Array
    left: Array
    rate: float
    seconds: float
    rest: Array
    widening: bool

    def foreseen(self, torque: Array, v: Array, rate: float) -> tuple[tuple[float | None, ...], Array]:
        """Return the bands, Hz, and the weights of samples (n, N), with a further motion of some torques and speeds (n, N)."""
        wider = self.reached(torque, rate) if self.widening else 0.0
        bands = tuple(None if band is None else max(band, wider) for band in self.bands)
        # The noise of a speed grows with its band to the power of 3/2.
        growth = [
            1.0 if old is None or new is None else (new / old) ** 1.5
            for old, new in zip(self.bands, bands, strict=True)
        ]
        speeds = np.maximum(self.rest * growth, REST_SHARE * np.max(np.abs(v), axis=1))
        return bands, fading(slower(v, speeds, rate, bands), rate, bands)

    def reached(self, torque: Array, rate: float) -> float:
        """Return the band for all joints, Hz, that further torques of the model allow, shape (n, N), with noise as it is."""
        # Power goes with the square of the rate.
        power = binned_power(torque, rate, self.edges) * (self.rate / rate) ** 2
        noise = self.left * (torque.shape[1] / rate / self.seconds)
        gain = np.cumsum(self.gain + (1.0 - EXPLAINED) * (power + noise) - noise, axis=1)
        best = np.argmax(gain, axis=1)
        some = gain[np.arange(len(best)), best] > 0.0
        return float(np.max(np.where(some, self.edges[best + 1], 0.0)))


def reach_of(model: TorqueModel, data: PreparedData, value: Array, *, widening: bool = True) -> Reach:
    """Return how far up parameters explain the torque of recordings, at the rate where the choice of bands begins.

    Parameters
    ----------
    model : TorqueModel
    data : PreparedData
    value : ndarray, shape (p,)
    widening : bool, optional
        Whether further recordings widen the bands.
    """
    edges = _edges([part.stretch for part in data.stretches])
    level = _sample(_thinned(data, FIRST_BAND * FIRST_WIDENING / HIGHEST_BAND))
    spectra = _Spectra(model, level, edges)
    left, rate = spectra.left(value), min(part.rate for part in level.stretches)
    seconds = sum(part.samples / part.rate for part in level.stretches)
    rest = np.median([rest_speeds(part.stretch, part.motion, part.bands) for part in data.stretches], axis=0)
    gain = spectra.torque * (1.0 - EXPLAINED) - left
    return Reach(data.bands, edges, gain, left, rate, seconds, rest, widening)


def _told(model: TorqueModel, bands: Array, fit: _Fit, edges: Array, floor: Array, moving: Array) -> BandChoice:
    """Return the choice with what a person should know of it."""
    place = np.clip(np.searchsorted(edges, bands * (1.0 - 1e-9)) - 1, 0, fit.shares.shape[1] - 1)
    some = fit.explains > 0.0
    explained = np.where(some, fit.shares[np.arange(len(place)), place], 0.0)
    notes = []
    for j, (joint, need) in enumerate(zip(model.robot.joints, needed_rows(model), strict=True)):
        band, rows = bands[j], ROWS_PER_HERTZ * bands[j] * moving[j]
        if not some[j]:
            notes.append(
                f"{joint}: its motion explains under half of its torque at every frequency; the band is left at {band:.3g} Hz"
            )
        elif fit.explains[j] < band and band <= floor[j]:
            notes.append(
                f"{joint}: its motion explains its torque up to {fit.explains[j]:.2g} Hz, but a band below {band:.3g} Hz would "
                f"leave fewer than {ROWS_PER_PARAMETER:g} independent rows per parameter; record longer"
            )
        if moving[j] > 0.0 and rows < need:
            notes.append(
                f"{joint}: moves for {moving[j]:.2g} s in all, too little to tell its own parameters; record it moving"
            )
    return BandChoice(tuple(bands.tolist()), tuple(explained.tolist()), tuple(notes))


def needed_rows(model: TorqueModel) -> Array:
    """Return how many parameters the rows of each joint have to tell, shape (n,).

    A parameter that acts on several joints is shared equally by them. With at least so many rows on every joint, no
    set of joints has fewer rows than there are parameters that act on no other joint (Hall's condition), and all
    together have as many as the model has parameters.
    """
    pattern = model.pattern
    share = 1.0 / np.maximum(np.sum(pattern, axis=0), 1)
    return np.asarray(pattern @ share, dtype=float)


def narrowest_bands(model: TorqueModel, stretches: int, moving: Array) -> Array:
    """Return the bands below which there are too few independent rows for the parameters, Hz, shape (n,).

    A signal low-passed at B Hz has 2 B independent values a second, less those of a period at both ends of every stretch.

    Parameters
    ----------
    model : TorqueModel
    stretches : int
        Their number.
    moving : ndarray, shape (n,)
        Time in which each joint moves, s.
    """
    if not np.any(moving > 0.0):
        return np.zeros(len(moving))
    need = ROWS_PER_PARAMETER * needed_rows(model) / ROWS_PER_HERTZ + 2.0 * END_PERIODS * stretches
    together = float(np.sum(need) / np.sum(moving))
    alone = np.divide(need, moving, out=np.full(len(need), np.inf), where=moving > 0.0)
    return np.asarray(np.clip(alone, together, MOST_ALONE * together))


def _moving(slow: PreparedData) -> Array:
    """Return the time in which each joint moves, s, shape (n,)."""
    with threads_for(max(part.samples for part in slow.stretches)):
        times = side_by_side(lambda part: np.count_nonzero(~part.rest, axis=1) / part.rate, slow.stretches)
    return np.asarray(np.sum(times, axis=0))


def _thinned(data: PreparedData, rate: float) -> PreparedData:
    """Return recordings at the lowest rate that is not below a given one and a whole part of their own."""
    made = []
    for item in data.recordings:
        parts = (thinned(part.stretch, max(1, int(part.rate / rate))) for part in item.stretches)
        made.append(replace(item, stretches=tuple(PreparedStretch(part, data.bands) for part in parts)))
    return replace(data, recordings=tuple(made))


def _sample(data: PreparedData) -> PreparedData:
    """Take one repetition of each trajectory, then more, until there is enough to look at."""
    seen: dict[str, int] = {}
    ranked = []
    for place, label in enumerate(data.labels):
        turn = seen.get(label, 0)
        seen[label] = turn + 1
        ranked.append((turn, place))
    chosen: list[int] = []
    total = 0
    for _, place in sorted(ranked):
        count = sum(part.samples for part in data.recordings[place].stretches)
        if chosen and total + count > ENOUGH_SAMPLES:
            continue
        chosen.append(place)
        total += count
    return data.of(chosen)


def _edges(parts: Sequence[Stretch]) -> Array:
    longest = max(len(part.time) / part.rate for part in parts)
    lowest = 1.0 / min(SEGMENT_SECONDS, longest)
    highest = 0.5 * max(part.rate for part in parts)
    count = max(2, int(np.ceil(BINS_PER_OCTAVE * np.log2(highest / lowest))))
    return np.concatenate([[0.0], np.geomspace(1.5 * lowest, highest, count)])


def binned_power(signals: Array, rate: float, edges: Array) -> Array:
    """Return the power of signals in bins of frequency, mean removed.

    Parameters
    ----------
    signals : ndarray, shape (k, N)
    rate : float
        Samples per second.
    edges : ndarray, shape (m + 1,)
        Hz.

    Returns
    -------
    ndarray, shape (k, m)
        Sum of squares times samples, so that recordings add up. Hann windows with half overlap.
    """
    count = signals.shape[1]
    length = min(count, max(8, int(SEGMENT_SECONDS * rate)))
    starts = range(0, count - length + 1, max(1, length // 2))
    window = np.hanning(length)
    centred = signals - np.mean(signals, axis=1, keepdims=True)
    power = sum(np.abs(np.fft.rfft(centred[:, s : s + length] * window, axis=1)) ** 2 for s in starts)
    frequency = np.fft.rfftfreq(length, 1.0 / rate)
    place = np.clip(np.searchsorted(edges, frequency, side="right") - 1, 0, len(edges) - 2)
    result = np.zeros((signals.shape[0], len(edges) - 1))
    np.add.at(result.T, place, np.asarray(power).T)
    return np.asarray(result * (count / (len(starts) * length)))
