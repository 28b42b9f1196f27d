"""Up to which frequency the motion would explain the torque once a further motion is recorded."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scara_ident.arrays import Array
from scara_ident.estimation.bands import FIRST_WIDENING, HIGHEST_BAND, NEAR_HIGHEST, NEXT_RATE
from scara_ident.estimation.explained_power import (
    EXPLAINED,
    FIRST_BAND,
    WIDE_FILTER,
    Spectra,
    bin_edges,
    moving_power,
    moving_weight,
    sample,
    thinned_to,
)
from scara_ident.model.model import TorqueModel
from scara_ident.motion.prepared import PreparedData
from scara_ident.motion.rest import REST_SHARE, fading, rest_speeds, slower


@dataclass(frozen=True, eq=False)
class Level:
    """What recordings of one sample rate say of how far up motion explains torque.

    Attributes
    ----------
    gain, left : ndarray, shape (n, m)
        Power of what is explained less what need not be, and of what is left, in bins of frequency.
    rate, seconds : float
        Samples per second, and length.
    """

    gain: Array
    left: Array
    rate: float
    seconds: float


@dataclass(frozen=True, eq=False)
class Reach:
    """How far up motion explains torque on recordings, and below which speed it is rest, to foresee those of a motion.

    Attributes
    ----------
    bands : tuple of float or None
        Of these recordings, Hz.
    edges : ndarray, shape (k + 1,)
        Of the bins, Hz, up to half the sample rate of the recordings; a level has the first m of them, which its rate shows.
    levels : tuple of Level
        Of rising rates, as the choice of bands looks at them.
    rest : ndarray, shape (n,)
        Speeds below which joints are at rest.
    widening : bool
        Whether further recordings widen the bands.
    """

    bands: tuple[float | None, ...]
    edges: Array
    levels: tuple[Level, ...]
    rest: Array
    widening: bool

    def foreseen(self, torque: Array, v: Array, rate: float) -> tuple[tuple[float | None, ...], Array]:
        """Return the bands, Hz, and the weights of samples (n, N), with a further motion of some torques and speeds (n, N)."""
        least = REST_SHARE * np.max(np.abs(v), axis=1)
        bands = self.bands
        if self.widening:
            rest = slower(v, np.maximum(self.rest, least), rate, bands)
            wider = self.reached(torque, moving_weight(rest, rate, bands), rate)
            bands = tuple(None if band is None else max(band, wider) for band in bands)
        # The noise of a speed grows with its band to the power of 3/2.
        growth = [
            1.0 if old is None or new is None else (new / old) ** 1.5
            for old, new in zip(self.bands, bands, strict=True)
        ]
        return bands, fading(slower(v, np.maximum(self.rest * growth, least), rate, bands), rate, bands)

    def reached(self, torque: Array, fade: Array, rate: float) -> float:
        """Return the band for all joints, Hz, that further torques of the model allow, with noise as it is.

        Parameters
        ----------
        torque, fade : ndarray, shape (n, N)
            And the weights of their samples, see `moving_weight`.
        rate : float
            Samples per second.
        """
        all_power, reached = moving_power(torque, fade, rate, self.edges), 0.0
        for level in self.levels:
            # Power goes with the square of the rate.
            power = all_power[:, : level.left.shape[1]] * (level.rate / rate) ** 2
            noise = level.left * (torque.shape[1] / rate / level.seconds)
            gain = np.cumsum(level.gain + (1.0 - EXPLAINED) * (power + noise) - noise, axis=1)
            best = np.argmax(gain, axis=1)
            some = gain[np.arange(len(best)), best] > 0.0
            allowed = HIGHEST_BAND * level.rate
            reached = max(reached, min(allowed, float(np.max(np.where(some, self.edges[best + 1], 0.0)))))
            if reached < NEAR_HIGHEST * allowed:
                break
        return reached


def reach_of(model: TorqueModel, data: PreparedData, value: Array, *, widening: bool = True) -> Reach:
    """Return how far up parameters explain the torque of recordings, at the rates that the choice of bands looks at.

    Parameters
    ----------
    value : ndarray, shape (p,)
    widening : bool, optional
        Whether further recordings widen the bands.
    """
    edges = bin_edges([part.stretch for part in data.stretches])
    highest, asked = min(part.rate for part in data.stretches), FIRST_BAND * FIRST_WIDENING / HIGHEST_BAND
    levels: list[Level] = []
    while not levels or levels[-1].rate < highest:
        level = sample(thinned_to(data, asked))
        spectra = Spectra(model, level, edges)
        left, rate = spectra.left(value), min(part.rate for part in level.stretches)
        seconds = sum(part.samples / part.rate for part in level.stretches)
        # Above, a motion has torque, and what is thinned out of these recordings is no noise that they lack.
        shown = slice(max(1, int(np.sum(edges[1:] <= WIDE_FILTER * rate))))
        gain = spectra.torque * (1.0 - EXPLAINED) - left
        levels.append(Level(gain[:, shown], left[:, shown], rate, seconds))
        asked *= NEXT_RATE
    rest = np.median([rest_speeds(part.stretch, part.motion, part.bands) for part in data.stretches], axis=0)
    return Reach(data.bands, edges, tuple(levels), rest, widening)
