"""The band in which motion explains torque, chosen from the data joint by joint.

Differentiated twice, the noise of a position grows with the square of frequency, so above some frequency the
regressor is noise. Where that is, the torque tells: with parameters fitted at low frequency, the torque that a
hardly filtered motion predicts is compared with the recorded one, frequency by frequency. Where the prediction
leaves more than half of the torque's power, motion and torque no longer speak of the same thing, be it for noise
in the position or in the torque, and the band ends.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from scara_ident.arrays import Array
from scara_ident.estimation.information import merge
from scara_ident.estimation.observations import Observations, observe
from scara_ident.model.model import TorqueModel
from scara_ident.motion.motion import Stretch, motion_of, torque_of
from scara_ident.motion.prepared import PreparedData
from scara_ident.threads import side_by_side

# The first fit uses the band that holds this share of the torque's power.
FIRST_POWER = 0.95
# It is not narrower than this many periods in the longest recording.
FIRST_PERIODS = 10.0
# Nor than this, Hz: in a narrower one too much about turning points would be left out to fit the rest.
FIRST_BAND = 2.0
# The fit and the choice of its band are repeated until they agree, at the most so often.
MOST_ROUNDS = 3
MOST_HALVINGS = 4
# Share of the torque's power that the motion must explain at the band's edge.
EXPLAINED = 0.5
# Highest band as a share of the sample rate, and of the position filter that shows where the noise begins.
HIGHEST_BAND = 0.2
WIDE_FILTER = 0.4
# Frequencies are pooled into this many bins per octave.
BINS_PER_OCTAVE = 3
# Segments of the spectra, s.
SEGMENT_SECONDS = 4.0
# Samples that the choice looks at, at the most.
ENOUGH_SAMPLES = 60_000


@dataclass(frozen=True)
class BandChoice:
    """Bands and how they came about.

    Attributes
    ----------
    bands : tuple of float
        Cut-off per joint, Hz.
    explained : tuple of float
        Share of the torque's power within the band that the first fit explains, per joint.
    notes : tuple of str
        What a person should know, such as a joint whose torque the motion does not explain.
    observations : Observations or None
        Of the recordings that were looked at, in the bands of the last fit.
    """

    bands: tuple[float, ...]
    explained: tuple[float, ...]
    notes: tuple[str, ...]
    observations: Observations | None = None


def choose_bands(model: TorqueModel, data: PreparedData) -> BandChoice:
    """Choose the low-pass band of every joint.

    Parameters
    ----------
    model : TorqueModel
    data : PreparedData
        With effort; in any bands. The first repetition of each trajectory is looked at first.
    """
    chosen = _sample(data)
    parts = [part.stretch for part in chosen.stretches]
    edges = _edges(parts)
    highest = HIGHEST_BAND * min(part.rate for part in parts)
    start = _first_bands(parts, edges, model.robot.n)
    spectra = _Spectra(model, parts, edges)
    choice = _refined(chosen, spectra, start, highest)
    # Where the first band holds so much noise that nothing is explained, a narrower one may show what is.
    for _ in range(MOST_HALVINGS):
        if any(share > 0.0 for share in choice.explained):
            break
        start = [0.5 * band for band in start]
        choice = _refined(chosen, spectra, start, highest)
    return choice


def _refined(data: PreparedData, spectra: _Spectra, start: Sequence[float], highest: float) -> BandChoice:
    """Repeat fit and choice of bands from a first band on until they agree."""
    n = spectra.model.robot.n
    choice = BandChoice((max(start),) * n, (0.0,) * n, ())
    for _ in range(MOST_ROUNDS):
        before = choice.bands
        observations = observe(spectra.model, data.at(before))
        value = merge(observations.by_joint).solve().value
        choice = replace(_explained_bands(spectra, value, start, highest), observations=observations)
        if choice.bands == before:
            break
    return choice


class _Spectra:
    """Power of the torque, and of the columns of a hardly filtered motion, in bins of frequency."""

    def __init__(self, model: TorqueModel, parts: Sequence[Stretch], edges: Array) -> None:
        self.model, self.parts, self.edges = model, parts, edges
        self.torque = np.sum([binned_power(torque_of(part), part.rate, edges) for part in parts], axis=0)

        def wide(part: Stretch) -> tuple[Array, ...]:
            return model.joint_columns(motion_of(part, [WIDE_FILTER * part.rate] * model.robot.n))

        self.columns = side_by_side(wide, parts)

    def error(self, value: Array) -> Array:
        """Return the power that parameters leave of the torque, shape (n, bins)."""

        def of_part(part: Stretch, columns: tuple[Array, ...]) -> Array:
            predicted = [value[own] @ rows for own, rows in zip(self.model.active, columns, strict=True)]
            return binned_power(torque_of(part) - np.array(predicted), part.rate, self.edges)

        return np.asarray(np.sum(side_by_side(of_part, self.parts, self.columns), axis=0))


def _explained_bands(spectra: _Spectra, value: Array, start: Sequence[float], highest: float) -> BandChoice:
    """Return the bands up to which parameters explain the torque."""
    model, edges = spectra.model, spectra.edges
    torque, error = spectra.torque, spectra.error(value)
    bands, explained, notes = [], [], []
    for j, joint in enumerate(model.robot.joints):
        gain = np.cumsum(torque[j] * (1.0 - EXPLAINED) - error[j])
        best = int(np.argmax(gain))
        if gain[best] <= 0.0:
            bands.append(min(start[j], highest))
            explained.append(0.0)
            notes.append(
                f"{joint}: its motion explains under half of its torque at every frequency; "
                f"the band of {bands[-1]:.3g} Hz holds {FIRST_POWER:.0%} of the torque"
            )
            continue
        bands.append(float(min(edges[best + 1], highest)))
        explained.append(float(1.0 - np.sum(error[j, : best + 1]) / np.sum(torque[j, : best + 1])))
    return BandChoice(tuple(bands), tuple(explained), tuple(notes))


def _sample(data: PreparedData) -> PreparedData:
    """Take one repetition of each trajectory, then more, until there is enough to look at."""
    seen: dict[str, int] = {}
    ranked = []
    for place, item in enumerate(data.recordings):
        turn = seen.get(item.trajectory, 0)
        seen[item.trajectory] = turn + 1
        ranked.append((turn, place))
    chosen: list[int] = []
    total = 0
    for _, place in sorted(ranked):
        count = len(data.recordings[place].recording.time)
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


def _first_bands(parts: Sequence[Stretch], edges: Array, n: int) -> list[float]:
    power = np.zeros((n, len(edges) - 1))
    for part in parts:
        power += binned_power(torque_of(part), part.rate, edges)
    longest = max(len(part.time) / part.rate for part in parts)
    slowest = max(FIRST_BAND, FIRST_PERIODS / longest)
    fastest = max(slowest, HIGHEST_BAND * min(part.rate for part in parts))
    share = np.cumsum(power, axis=1) / np.maximum(np.sum(power, axis=1, keepdims=True), np.finfo(float).tiny)
    first = [float(edges[int(np.argmax(row >= FIRST_POWER)) + 1]) for row in share]
    return [float(np.clip(band, slowest, fastest)) for band in first]


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
