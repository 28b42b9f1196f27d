"""Up to which frequency a hardly filtered motion explains the torque: power of torque and of residual in bins."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array, runs_of
from scara_ident.estimation.observations import informations_of_each, kept_rows
from scara_ident.estimation.own_offsets import value_beside_offsets
from scara_ident.model.model import TorqueModel
from scara_ident.motion.motion import Stretch, motion_of, thinned, torque_of
from scara_ident.motion.prepared import PreparedData, PreparedStretch
from scara_ident.motion.rest import LONGEST_WIDENING, Bands, fading
from scara_ident.threads import side_by_side

# The first fit is not in a narrower band, Hz: too much about turning points would be left out to fit the rest.
FIRST_BAND = 2.0
# Share of the torque's power that the motion must explain at the band's edge.
EXPLAINED = 0.5
# Share of the sample rate of the position filter that shows where the noise begins.
WIDE_FILTER = 0.4
# Frequencies are pooled into this many bins per octave.
BINS_PER_OCTAVE = 3
# Segments of the spectra, s.
SEGMENT_SECONDS = 4.0
# Samples whose segments are transformed together: of more the memory leaves the cache, of fewer the calls take longer.
AT_ONCE = 8192
# Samples that are looked at, at the most, at each rate; and up to which repetitions are, which tell no more of a motion and only
# average noise.
ENOUGH_SAMPLES = 20_000
ENOUGH_WITH_REPETITIONS = 4_000


@dataclass(frozen=True)
class Explained:
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


class Spectra:
    """Power of the torque, and of what fits leave of it along a hardly filtered motion, in bins of frequency."""

    def __init__(self, model: TorqueModel, data: PreparedData, edges: Array) -> None:
        self.model, self.data, self.edges = model, data, edges
        self.parts = [part.stretch for part in data.stretches]
        slow = data.at((FIRST_BAND,) * model.robot.n).stretches

        def wide(part: Stretch, _: PreparedStretch) -> tuple[Array, ...]:
            return model.joint_columns(motion_of(part, [WIDE_FILTER * part.rate] * model.robot.n))

        def recorded(part: Stretch, slow: PreparedStretch) -> tuple[Array, Array]:
            fade = moving_weight(slow.rest, slow.rate, slow.bands)
            return fade, moving_power(torque_of(part), fade, part.rate, edges)

        if len(slow) == 1:
            # Its joints and its samples are what two threads share.
            made = [wide(self.parts[0], slow[0]), recorded(self.parts[0], slow[0])]
        else:
            works = [wide] * len(slow) + [recorded] * len(slow)
            made = side_by_side(lambda work, *parts: work(*parts), works, 2 * self.parts, 2 * list(slow))
        self.columns = made[: len(slow)]
        self.fades = [fade for fade, _ in made[len(slow) :]]
        self.torque = np.sum([power for _, power in made[len(slow) :]], axis=0)

    def fit(self, bands: Array) -> Explained:
        """Fit parameters in bands, and say how far up they explain each joint's torque."""
        data = self.data.at(tuple(bands.tolist()))
        # One that is too short for these bands, or at rest, has nothing to say.
        kept = np.flatnonzero(side_by_side(kept_rows, data.recordings)).tolist()
        each = informations_of_each(self.model, data.of(kept) if kept else data)
        return self.judged(bands, value_beside_offsets(self.model, each))

    def left(self, value: Array) -> Array:
        """Return the power of what parameters leave of the torque, shape (n, m)."""

        def of(part: Stretch, columns: tuple[Array, ...], fade: Array) -> Array:
            predicted = [value[own] @ rows for own, rows in zip(self.model.active, columns, strict=True)]
            # As of the torque: what a run's offset leaves is none of its motion's.
            return moving_power(torque_of(part) - np.array(predicted), fade, part.rate, self.edges)

        return np.asarray(np.sum(side_by_side(of, self.parts, self.columns, self.fades), axis=0))

    def judged(self, bands: Array, value: Array) -> Explained:
        """Say how far up parameters that were fitted in some bands explain each joint's torque."""
        error = self.left(value)
        gain = np.cumsum(self.torque * (1.0 - EXPLAINED) - error, axis=1)
        best = np.argmax(gain, axis=1)
        some = gain[np.arange(len(best)), best] > 0.0
        whole = np.maximum(np.cumsum(self.torque, axis=1), np.finfo(float).tiny)
        return Explained(
            bands, value, np.where(some, self.edges[best + 1], 0.0), 1.0 - np.cumsum(error, axis=1) / whole
        )


def moving_weight(rest: NDArray[np.bool_], rate: float, bands: Bands) -> Array:
    """Return the weight of every sample, shape (n, N), 0 in a standstill: friction is anything there, and no fit sees it.

    A reversal is shorter than a period of the band, and counts: noise turns the sign of friction there, which ends a band.

    Parameters
    ----------
    rest : ndarray of bool, shape (n, N)
        Where joints are at rest.
    rate : float
        Samples per second.
    bands : tuple of float or None
        Hz.
    """
    still = np.zeros_like(rest)
    # Where a joint begins and ends to move friction is hard to tell, and fits see it: of a standstill twice their fade counts
    # with that.
    margin = round(2.0 * LONGEST_WIDENING * rate)
    for inner, row in zip(still, rest, strict=True):
        for start, stop in runs_of(row):
            if stop - start >= rate / FIRST_BAND:
                inner[start + margin : stop - margin] = True
    return fading(still, rate, bands)


def thinned_to(data: PreparedData, rate: float) -> PreparedData:
    """Return recordings at the lowest rate that is not below a given one and a whole part of their own."""
    made = []
    for item in data.recordings:
        parts = (thinned(part.stretch, max(1, int(part.rate / rate))) for part in item.stretches)
        made.append(replace(item, stretches=tuple(PreparedStretch(part, data.bands) for part in parts)))
    return replace(data, recordings=tuple(made))


def sample(data: PreparedData) -> PreparedData:
    """Take one repetition of each trajectory, then more where these are few, until there is enough to look at."""
    seen: dict[str, int] = {}
    ranked = []
    for place, label in enumerate(data.labels):
        turn = seen.get(label, 0)
        seen[label] = turn + 1
        ranked.append((turn, place))
    chosen: list[int] = []
    total = 0
    for turn, place in sorted(ranked):
        count = sum(part.samples for part in data.recordings[place].stretches)
        if chosen and total + count > (ENOUGH_WITH_REPETITIONS if turn else ENOUGH_SAMPLES):
            continue
        chosen.append(place)
        total += count
    return data.of(chosen)


def bin_edges(parts: Sequence[Stretch]) -> Array:
    """Return the edges of the bins of frequency for some stretches, shape (m + 1,), Hz."""
    longest = max(len(part.time) / part.rate for part in parts)
    lowest = 1.0 / min(SEGMENT_SECONDS, longest)
    highest = 0.5 * max(part.rate for part in parts)
    count = max(2, int(np.ceil(BINS_PER_OCTAVE * np.log2(highest / lowest))))
    return np.concatenate([[0.0], np.geomspace(1.5 * lowest, highest, count)])


def moving_power(torque: Array, fade: Array, rate: float, edges: Array) -> Array:
    """Return `binned_power` of torques (n, N) less their means, with weights of samples (n, N)."""
    mean = np.sum(fade * torque, axis=1) / np.maximum(np.sum(fade, axis=1), 1.0)
    return binned_power(fade * (torque - mean[:, None]), rate, edges)


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
    # Torques cut out of a recording with gaps lie in memory sample by sample; the view of the spectra wants signal by signal.
    signals = np.ascontiguousarray(signals)
    centred = signals - np.mean(signals, axis=1, keepdims=True)
    segments = np.lib.stride_tricks.sliding_window_view(centred, length, axis=1)[:, :: max(1, length // 2)]
    window = np.hanning(length)
    frequency = np.fft.rfftfreq(length, 1.0 / rate)
    squares = np.zeros((len(signals), 2 * len(frequency)))
    many = max(1, AT_ONCE // length)
    for start in range(0, segments.shape[1], many):
        parts = np.fft.rfft(segments[:, start : start + many] * window).view(float)
        squares += np.add.reduce(np.square(parts, out=parts), axis=1)
    power = squares[:, ::2] + squares[:, 1::2]
    place = np.clip(np.searchsorted(edges, frequency, side="right") - 1, 0, len(edges) - 2)
    result = np.zeros((len(signals), len(edges) - 1))
    np.add.at(result.T, place, power.T)
    return np.asarray(result * (count / (segments.shape[1] * length)))
