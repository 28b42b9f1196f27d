"""How far up the motion would explain the torque once a further motion is recorded."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scara_ident.arrays import Array
from scara_ident.estimation.bands import FIRST_WIDENING, HIGHEST_BAND
from scara_ident.estimation.explained_power import (
    EXPLAINED,
    FIRST_BAND,
    Spectra,
    bin_edges,
    binned_power,
    sample,
    thinned_to,
)
from scara_ident.model.model import TorqueModel
from scara_ident.motion.prepared import REST_SHARE, PreparedData, fading, rest_speeds, slower


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
    edges = bin_edges([part.stretch for part in data.stretches])
    level = sample(thinned_to(data, FIRST_BAND * FIRST_WIDENING / HIGHEST_BAND))
    spectra = Spectra(model, level, edges)
    left, rate = spectra.left(value), min(part.rate for part in level.stretches)
    seconds = sum(part.samples / part.rate for part in level.stretches)
    rest = np.median([rest_speeds(part.stretch, part.motion, part.bands) for part in data.stretches], axis=0)
    gain = spectra.torque * (1.0 - EXPLAINED) - left
    return Reach(data.bands, edges, gain, left, rate, seconds, rest, widening)
