"""Recorded and predicted torque and residual, sample by sample: all that a report draws over time.

Motion and columns are those of the observations; nothing else in the report computes a torque or a residual.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import chain, count

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.effects import EffectTerm
from scara_ident.estimation.observations import Observations
from scara_ident.model.model import TorqueModel
from scara_ident.model.terms import Friction
from scara_ident.motion.low_pass import low_pass
from scara_ident.motion.motion import Motion
from scara_ident.motion.prepared import PreparedRecording, PreparedStretch
from scara_ident.threads import side_by_side


@dataclass(frozen=True, eq=False)
class Trace:
    """A gapless part of a recording; arrays are (n, N), torques on the side where they are recorded.

    Attributes
    ----------
    start : float
        Time at which the recording began, s.
    motion : Motion
        With the recorded torque.
    measured, predicted : ndarray
        Both within the band.
    residual : ndarray
        Recorded less predicted torque, faded out towards rest, then within the band: the rows of the estimate, which
        near rest is not quite the difference of the two above.
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
    residual: Array
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
    def recorded(self) -> Array:
        """Torque as recorded."""
        assert self.motion.torque is not None
        return self.motion.torque

    @property
    def raw_residual(self) -> Array:
        """Recorded minus predicted torque, nothing filtered."""
        return self.recorded - self.raw_predicted

    def kept(self, signal: Array, joint: int) -> Array:
        """Return a signal at the samples of a joint that the estimate uses, as many as the band leaves independent."""
        step = self.step[joint]
        return np.asarray(signal[::step][self.used[joint, ::step]])


def kept(traces: Sequence[Trace], signals: Sequence[Array], joint: int) -> Array:
    """Gather signals, one per trace, over the samples of a joint that the estimate uses; see `Trace.kept`."""
    return np.concatenate([trace.kept(signal, joint) for trace, signal in zip(traces, signals, strict=True)])


def traces(observations: Observations, value: Array) -> list[tuple[Trace, ...]]:
    """Predict the torque of recordings, stretch by stretch.

    Parameters
    ----------
    observations : Observations
        With the columns at every sample.
    value : ndarray, shape (p,)
        Parameters of their model.

    Returns
    -------
    list of tuple of Trace
        Per recording.
    """
    columns = [joint.columns for joint in observations.joints]

    def of_recording(place: int, item: PreparedRecording) -> tuple[Trace, ...]:
        return tuple(
            _trace(observations.model, value, part, columns, raw, float(item.recording.time[0]))
            for part, raw in zip(item.stretches, observations.raw[place], strict=True)
        )

    return side_by_side(of_recording, count(), observations.data.recordings)


def _trace(
    model: TorqueModel,
    value: Array,
    part: PreparedStretch,
    columns: Sequence[NDArray[np.intp]],
    raw: Sequence[Array],
    start: float,
) -> Trace:
    total, load, friction = (np.zeros_like(part.torque) for _ in range(3))
    effects: list[tuple[str, str | None, Array]] = []
    for term in model.terms:
        place = model.place(term)
        share = np.zeros_like(total)
        for j, (own, rows) in enumerate(zip(columns, raw, strict=True)):
            acts = (own >= place.start) & (own < place.stop)
            share[j] = value[own[acts]] @ rows[acts]
        total += share
        if term is model.rigid_body:
            load += share
        elif isinstance(term, Friction):
            friction += share
        elif isinstance(term, EffectTerm):
            effects.append((term.name, term.joint, _banded(part, share)))
    left = part.torque - total
    residual = np.array([part.smooth(j, row) for j, row in enumerate(left)])
    for j, row in enumerate(left) if part.usable else ():
        # The filter at the rows of the estimate leaves out what is beyond eight times the band.
        residual[j, part.kept[j]] = part.rows(j, row[None])[0] / np.sqrt(part.steps[j])
    return Trace(
        part.name,
        start,
        part.motion,
        measured=_banded(part, part.torque),
        predicted=_banded(part, total),
        residual=residual,
        raw_predicted=total,
        load=load,
        friction=friction,
        used=part.used & part.usable,
        step=part.steps,
        trim=part.trim,
        effects=tuple(effects),
    )


def _banded(part: PreparedStretch, rows: Array) -> Array:
    return np.array([low_pass(row, part.rate, band) for row, band in zip(rows, part.bands, strict=True)])


class FittedContext(ABC):
    """What reports of fitted models draw from: the traces of their recordings by role, those held out first."""

    @property
    @abstractmethod
    def groups(self) -> dict[str, list[tuple[Trace, ...]]]:
        """Traces of each recording, by role."""

    @property
    def parts(self) -> list[tuple[str, tuple[Trace, ...]]]:
        """Traces of every recording by its name and role, those held out first."""
        return [(f"{found[0].recording} ({role})", found) for role, group in self.groups.items() for found in group]

    @property
    def sets(self) -> dict[str, list[Trace]]:
        """Traces of the recordings that were fitted and of those held out."""
        return {role: list(chain.from_iterable(group)) for role, group in reversed(self.groups.items())}
