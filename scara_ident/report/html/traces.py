"""Measured and predicted torque of a recording, sample by sample, with the signals that a residual may follow."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from scara_ident.effects.effect import EffectTerm
from scara_ident.model.model import TorqueModel
from scara_ident.model.terms import Friction
from scara_ident.motion.motion import Motion, Stretch, low_pass, motion_of, stretches, torque_of
from scara_ident.motion.prepared import position_cuts, row_step, standstill, trim_of
from scara_ident.recording.recording import Recording

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Trace:
    """A gapless part of a recording; arrays are (n, N), torques on the side where they are recorded.

    Attributes
    ----------
    recording : str
    start : float
        Time at which the recording began, s.
    motion : Motion
        With the recorded torque.
    measured, predicted : ndarray
        Both within the band.
    raw_predicted : ndarray
        From the same motion, without the low-pass of torques.
    load : ndarray
        Predicted torque of links and rotors.
    friction : ndarray
        Predicted friction.
    used : ndarray of bool
        Samples that the estimate uses: without ends and standstill.
    step : tuple of int
        Per joint, samples that the band makes dependent on each other.
    trim : int
        Samples at either end where the filter's continuation is a guess.
    effects : tuple of (str, str or None, ndarray)
        Name, joint and predicted torque within the band of every effect in the model, in the order in which they came
        in.
    """

    recording: str
    start: float
    motion: Motion
    measured: Array
    predicted: Array
    raw_predicted: Array
    load: Array
    friction: Array
    used: NDArray[np.bool_]
    step: tuple[int, ...]
    trim: int
    effects: tuple[tuple[str, str | None, Array], ...] = field(default=())

    @property
    def time(self) -> Array:
        """Seconds since the recording began, shape (N,)."""
        return self.motion.time - self.start

    @property
    def core(self) -> slice:
        """Samples without the ends; empty where there are too few."""
        return slice(self.trim, max(self.trim, self.motion.samples - self.trim))

    @property
    def residual(self) -> Array:
        """Measured minus predicted torque within the band."""
        return self.measured - self.predicted

    @property
    def raw_residual(self) -> Array:
        """Recorded minus predicted torque, nothing filtered."""
        return self.recorded - self.raw_predicted

    def kept(self, signal: Array, joint: int) -> Array:
        """Return a signal at the samples of a joint that the estimate uses, as many as the band leaves independent."""
        step = self.step[joint]
        return np.asarray(signal[::step][self.used[joint, ::step]])

    @property
    def recorded(self) -> Array:
        """Torque as recorded."""
        assert self.motion.torque is not None
        return self.motion.torque


def kept(traces: Sequence[Trace], signals: Sequence[Array], joint: int) -> Array:
    """Gather signals, one per trace, over the samples of a joint that the estimate uses; see `Trace.kept`."""
    return np.concatenate([trace.kept(signal, joint) for trace, signal in zip(traces, signals, strict=True)])


def traces(model: TorqueModel, value: Array, recording: Recording, bands: Sequence[float | None]) -> tuple[Trace, ...]:
    """Predict the torque of a recording, part by part.

    Parameters
    ----------
    model : TorqueModel
    value : ndarray, shape (p,)
        Its parameters.
    recording : Recording
        With effort.
    bands : sequence of float or None, one per joint
        Low-pass on both sides of each joint's equation, Hz.
    """
    start = float(recording.time[0])
    return tuple(_trace(model, value, part, bands, start) for part in stretches(recording))


def _trace(model: TorqueModel, value: Array, part: Stretch, bands: Sequence[float | None], start: float) -> Trace:
    torque = torque_of(part)
    motion = motion_of(part, position_cuts(part.rate, bands))
    total, load, friction = (np.zeros_like(motion.q) for _ in range(3))
    own: list[tuple[str, str | None, Array]] = []
    for term in model.terms:
        share = np.einsum("jpn,p->jn", term.regressor(motion), value[model.place(term)])
        total += share
        if term is model.rigid_body:
            load += share
        elif isinstance(term, Friction):
            friction += share
        elif isinstance(term, EffectTerm):
            own.append((term.name, term.joint, share))

    def banded(rows: Array) -> Array:
        return np.array([low_pass(row, part.rate, band) for row, band in zip(rows, bands, strict=True)])

    measured, predicted = banded(torque), banded(total)
    effects = tuple((name, joint, banded(share)) for name, joint, share in own)
    used = ~standstill(part, motion, bands)
    trim = trim_of(part, bands)
    used[:, :trim] = used[:, -trim:] = False
    steps = tuple(row_step(part.rate, band) for band in bands)
    return Trace(part.name, start, motion, measured, predicted, total, load, friction, used, steps, trim, effects)
