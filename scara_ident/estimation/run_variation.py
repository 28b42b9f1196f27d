"""Run variation: how recordings differ beyond noise in friction, torque scale, offset and delay.

An arm is not quite the same from run to run and from day to day. What a run has more of than the others acts through the
whole of it, so that blocks of one run say the same and their scatter knows nothing of it. Each kind of difference has a
direction on the rows of a run, such as the friction that the model predicts; how far runs lie from one another along
these directions is a variance component (Searle, Casella and McCulloch 1992, "Variance Components"), estimated by
restricted maximum likelihood. A component that chance explains is left out.

What a model lacks of one joint may look like a delay of it, above all friction where the joint reverses. Of a delay it is said
only where all joints tell it, away from reversals: `scara_ident.estimation.shared_delays`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.estimation.days import same_day
from scara_ident.estimation.joint_rows import JointRows
from scara_ident.estimation.observations import Observations
from scara_ident.estimation.shared_delays import SharedDelays
from scara_ident.estimation.student_t import widening
from scara_ident.model.model import TorqueModel
from scara_ident.model.terms.friction import Friction, Offset
from scara_ident.model.terms.term import Term
from scara_ident.robot.robot import Robot

KINDS = ("friction", "torque scale", "offset", "delay")
SCALE, OFFSET = KINDS.index("torque scale"), KINDS.index("offset")
DELAY = KINDS.index("delay")
# A delay of one joint that the recordings as a whole do not show is called this.
LIKE_DELAY = "like a delay"
# As each is called where it differs.
_DIFFERING = (*(f"its {kind}" for kind in KINDS[:DELAY]), "what looks like a delay, which the joints do not share,")

# With fewer recordings than this none can be distinguished from the parameters.
MIN_RUNS = 3
# Differences below this share of the torque are not reported in sentences.
SPOKEN_OF = 0.01
# Delays of runs whose mean is this many of their standard deviations are a common delay, which no parameter absorbs.
COMMON_DELAY_STDS = 2.0
# Probability, by Student's t of so many runs, below which chance does not make their mean: three runs whose mean is two of their
# standard deviations, no more likely to be late than early, are had once in fourteen times.
CHANCE = 0.01
# Directions of a run below this share of the largest are not distinguished.
RANK = 1e-9


@dataclass(frozen=True, eq=False)
class JointVariation:
    """How runs differ on one joint.

    Attributes
    ----------
    directions : ndarray, shape (kinds, N)
        Rows of one unit of each kind: predicted friction, predicted torque, 1 N m, 1 s.
    std : ndarray, shape (kinds,)
        Standard deviation between runs, in these units.
    of_run : ndarray, shape (runs, kinds)
        Deviation of each run from the mean, shrunk according to its noise.
    noise : float
        Standard deviation of one row.
    bounds : ndarray of int, shape (runs + 1,)
        Where the rows of each run begin.
    unsure : ndarray, shape (runs, kinds)
        Variance of these deviations.
    memory : float
        How many times the variance of white noise the noise has along the offset: what a model lacks changes slowly.
    assumed : bool
        Whether they are no estimates of these runs but what any are taken to differ by.
    draws : float
        How many independent offsets were seen: parameters take up the others, gravity where poses differ.
    reach : float
        Seconds, a radian of the fastest within the band: what follows the slope of the torque by more is no delay.
    """

    directions: Array
    std: Array
    of_run: Array
    noise: float
    bounds: NDArray[np.intp]
    unsure: Array
    memory: float = 1.0
    assumed: bool = False
    draws: float = 1.0
    reach: float = np.inf

    @property
    def apart(self) -> Array:
        """Standard deviation of the runs about their mean, shape (kinds,): of a delay no parameter takes that up, and ``std`` has it too."""
        found = self.std.copy()
        if not self.assumed:
            found[DELAY] = np.std(self.of_run[:, DELAY], ddof=1)
        return found

    @property
    def off(self) -> Array:
        """Deviation of the rows of every run from those of the mean run, shape (N,)."""
        return np.asarray(np.sum(np.repeat(self.of_run, np.diff(self.bounds), axis=0).T * self.directions, axis=0))

    @cached_property
    def shrinking(self) -> tuple[tuple[Array, Array], ...]:
        """For each run orthonormal rows (r, N), and the share (r,) of signals along them that whitening keeps."""
        found = []
        size = self.std / self.noise
        for start, stop in zip(self.bounds[:-1], self.bounds[1:], strict=True):
            rows = size[:, None] * self.directions[:, start:stop]
            values, vectors = np.linalg.eigh(rows @ rows.T)
            kept = values > RANK * max(float(np.max(values, initial=0.0)), np.finfo(float).tiny)
            root = np.sqrt(values[kept])
            found.append(((vectors[:, kept] / root).T @ rows, 1.0 / np.sqrt(1.0 + values[kept])))
        return tuple(found)

    def whitened(self, signals: Array) -> Array:
        """Return signals on the joint's rows, shape (k, N), whitened with the differences between runs as noise."""
        result = signals.copy()
        for (rows, stays), start, stop in zip(self.shrinking, self.bounds[:-1], self.bounds[1:], strict=True):
            part = signals[:, start:stop]
            result[:, start:stop] -= ((part @ rows.T) * (1.0 - stays)) @ rows
        return result


@dataclass(frozen=True, eq=False)
class RunVariation:
    """How runs differ, joint by joint; None where they do not.

    Attributes
    ----------
    delays : SharedDelays or None
        Delay of each run, pooled over all joints; None if not estimated.
    """

    joints: tuple[JointVariation | None, ...]
    delays: SharedDelays | None = None

    @property
    def kinds(self) -> tuple[str, ...]:
        """The name of each kind: a delay that joints do not share only looks like one, and is named so."""
        late = KINDS[DELAY] if self.delays is None or self.delays.differ else LIKE_DELAY
        return (*KINDS[:DELAY], late, *KINDS[DELAY + 1 :])

    def sizes(self, robot: Robot) -> dict[str, dict[str, float]]:
        """Return the standard deviation of each kind by joint and kind, of those that differ."""
        return {
            joint: {kind: float(std) for kind, std in zip(self.kinds, item.apart, strict=True) if std > 0.0}
            for joint, item in zip(robot.joints, self.joints, strict=True)
            if item is not None
        }

    def sentences(self, robot: Robot, unexplained: str | None = None) -> list[str]:
        """Return in sentences the differences of more than a hundredth of the torque.

        Parameters
        ----------
        unexplained : str, optional
            Joint with an unexplained remainder, which differs from motion to motion too.
        """
        shared = self.delays if self.delays is not None and self.delays.differ else None
        found = []
        for j, (joint, item) in enumerate(zip(robot.joints, self.joints, strict=True)):
            if item is None:
                continue
            rms = np.sqrt(np.mean(item.directions**2, axis=1))
            late, least = late_alike(item), SPOKEN_OF * rms[SCALE]
            if shared is None and abs(late) * rms[DELAY] > least:
                found.append(f"{joint} {late_words(item, late)} in all runs")
            few = 0.0 if late else late_by_few(item)
            if shared is None and abs(few) * rms[DELAY] > least:
                found.append(
                    f"{joint} {late_words(item, few)} in {len(item.of_run)} runs, which are too few to determine a delay"
                )
            units = ("{:.2g} %", "{:.2g} %", "{:.2g} " + robot.torque_unit(j), "{:.2g} ms")
            scales = (100, 100, 1, 1000)
            shown = [
                "a part in proportion to its torque's derivative that is too large for a delay"
                if what == _DIFFERING[DELAY] and std > item.reach
                else f"{what} by {'more than all of it' if scale == 100 and std > 1.0 else unit.format(std * scale)}"
                for what, std, size, unit, scale in zip(_DIFFERING, item.apart, rms, units, scales, strict=True)
                if std * size > least and not ((late or few or shared is not None) and what == _DIFFERING[DELAY])
            ]
            if shown:
                said = f"{joint} differs from run to run (standard deviation): {', '.join(shown)}"
                found.append(said + ("; the unexplained part may cause this" if joint == unexplained else ""))
        if shared is not None and shared.share > SPOKEN_OF:
            size = f"standard deviation {1e3 * shared.std:.2g} ms"
            found.append(f"effort is late on all joints alike, by a different time in each run ({size})")
        return found

    def __bool__(self) -> bool:
        return any(item is not None for item in self.joints)

    def whitened(self, joint: int, signals: Array) -> Array:
        """Return signals on a joint's rows, see `JointVariation.whitened`."""
        item = self.joints[joint]
        return signals if item is None else item.whitened(signals)

    @property
    def without_offsets(self) -> RunVariation:
        """The same without the offsets, as rows have it on which these are noise already."""
        return self.without(OFFSET)

    def without(self, kind: int) -> RunVariation:
        """Return the same without a kind."""
        determined = np.arange(len(KINDS)) != kind
        joints = [
            None if item is None else replace(item, std=item.std * determined, of_run=item.of_run * determined)
            for item in self.joints
        ]
        return replace(self, joints=tuple(joints))

    def whitened_rows(self, joints: Sequence[JointRows]) -> tuple[JointRows, ...]:
        """Return the rows of every joint, see `JointVariation.whitened`."""
        return tuple(replace(rows, table=self.whitened(joint, rows.table)) for joint, rows in enumerate(joints))

    @property
    def offsets(self) -> RunVariation | None:
        """The same of the offsets alone; None where they do not differ."""
        alone = np.arange(len(KINDS)) == OFFSET
        joints = tuple(
            None
            if item is None or item.std[OFFSET] == 0.0
            else replace(item, std=item.std * alone, noise=item.noise * np.sqrt(item.memory), memory=1.0)
            for item in self.joints
        )
        return RunVariation(joints) if any(joints) else None

    def on(self, observations: Observations, value: Array) -> RunVariation:
        """Return the differences for other runs, whose single deviations are not known.

        Parameters
        ----------
        observations : Observations
            Of the other runs.
        value : ndarray, shape (p,)
            Parameters of the same model.
        """
        firsts = np.searchsorted(observations.owner, np.arange(len(observations.data.recordings) + 1))
        nothing = np.zeros((len(firsts) - 1, len(KINDS)))
        joints = [
            None
            if item is None
            else replace(
                item,
                directions=directions_of(observations, joint, rows, value),
                of_run=nothing,
                bounds=rows.starts[firsts],
                unsure=nothing,
            )
            for joint, (item, rows) in enumerate(zip(self.joints, observations.joints, strict=True))
        ]
        return RunVariation(tuple(joints))

    def deviations(self, observations: Observations, value: Array) -> tuple[Array, ...]:
        """Return the deviation of the torque of each run from that of the mean run, on every stretch, shape (n, N) each.

        Parameters
        ----------
        observations : Observations
            With all columns of the model in which the differences were estimated.
        value : ndarray, shape (p,)
            Their parameters.
        """
        found = []
        for run, (recording, raws) in enumerate(zip(observations.data.recordings, observations.raw, strict=True)):
            for part, raw in zip(recording.stretches, raws, strict=True):
                off = np.zeros((len(self.joints), part.samples))
                for joint, item in enumerate(self.joints):
                    if item is not None:
                        columns = observations.joints[joint].columns
                        torque = value[columns] @ raw[joint]
                        rate = -np.gradient(torque, 1.0 / part.rate)
                        off[joint] = item.of_run[run] @ _of_columns(observations, columns, value, raw[joint], rate)
                found.append(off)
        return tuple(found)

    def mean_squares(self, joints: Sequence[JointRows]) -> Array:
        """Return the mean square of the deviations over the samples of each joint's rows, shape (n,)."""
        parts = zip(self.joints, joints, strict=True)
        return np.array([0.0 if item is None else np.sum(item.off**2) / np.sum(rows.counts) for item, rows in parts])

    def covariance(self, inverse: Array, joints: Sequence[JointRows], weights: Array) -> Array:
        """Return the contribution of the differences to the covariance of a least-squares estimate, shape (p, p).

        Parameters
        ----------
        inverse : ndarray, shape (p, p)
            Inverse of ``W.T @ W`` of all weighted rows.
        joints : sequence of JointRows
            The rows that it was estimated from.
        weights : ndarray, shape (n,)
        """
        total, days = np.zeros_like(inverse), self.days
        for item, rows, weight in zip(self.joints, joints, weights, strict=True):
            if item is None:
                continue
            bounds = zip(item.bounds[:-1], item.bounds[1:], strict=True)
            pulls = [rows.table[:-1, start:stop] @ item.directions[:, start:stop].T for start, stop in bounds]
            moving = weight**2 * inverse[:, rows.columns] @ np.array(pulls)
            for kind, std in enumerate(item.std):
                each = moving[:, :, kind]
                draws = len(each) - 1.0 if kind != OFFSET else item.draws
                if kind == OFFSET and std > 0.0 and days is not None:
                    # Runs of one day share an offset, and are one draw of it.
                    each = np.array([np.sum(each[days == day], axis=0) for day in np.unique(days)])
                    means = [np.mean(item.of_run[days == day, kind]) for day in np.unique(days)]
                    draws = max(1.0, len(each) - (len(days) - item.draws))
                    std = float(np.sqrt(np.var(means) * len(each) / draws))
                moved = (1.0 if item.assumed else widening(draws)) * std * each
                total += moved.T @ moved
        return total

    @cached_property
    def days(self) -> NDArray[np.intp] | None:
        """Which runs share their offsets on all joints, see `same_day`."""
        determined = [item for item in self.joints if item is not None and item.std[OFFSET] > 0.0]
        if not determined:
            return None
        offsets = np.array([item.of_run[:, OFFSET] for item in determined])
        unsure = np.array([item.unsure[:, OFFSET] for item in determined])
        return same_day(offsets, unsure, np.array([item.std[OFFSET] for item in determined]))


def late_alike(item: JointVariation) -> float:
    """Return by how much every run is late, s, where they differ little in it, by more than chance; 0 where they do not."""
    mean = late_by_few(item)
    if not mean:
        return 0.0
    from scipy.special import stdtr

    late = item.of_run[:, DELAY]
    freedom, apart = len(late) - 1, float(np.std(late, ddof=1))
    sure = apart == 0.0 or 2.0 * stdtr(freedom, -abs(mean) * np.sqrt(len(late)) / apart) < CHANCE
    return mean if sure else 0.0


def late_by_few(item: JointVariation) -> float:
    """Return by how much runs are late in the mean, s, where they differ little in it, be that chance; 0 where they do not."""
    late = item.of_run[:, DELAY]
    mean, apart = float(np.mean(late)), float(np.std(late, ddof=1))
    return mean if abs(mean) >= COMMON_DELAY_STDS * apart else 0.0


def late_words(item: JointVariation, late: float) -> str:
    """Return in words that the torque of a joint has this delay in every run."""
    if abs(late) > item.reach:
        return "leaves a part in proportion to its torque's derivative that is too large for a delay"
    return f"{'lags' if late > 0.0 else 'leads'} by {1e3 * abs(late):.2g} ms"


def unit_of_kind(robot: Robot, joint: str, kind: str) -> str:
    """Return the unit in which runs differ by a kind on a joint; 1 for a share of what the model predicts."""
    if kind == LIKE_DELAY:
        return "s"
    units = ("1", "1", robot.torque_unit(robot.joints.index(joint)), "s")
    return units[KINDS.index(kind)]


def directions_of(observations: Observations, joint: int, rows: JointRows, value: Array) -> Array:
    """Return one unit of each kind on the rows of a joint, shape (kinds, N); zero if it has no influence."""
    late = observations.late(value[: observations.parameters])[joint]
    return _of_columns(observations, rows.columns, value, rows.table[:-1], late)


def offset_direction(model: TorqueModel, rows: JointRows) -> Array:
    """Return an offset of one unit on the rows of a joint, shape (N,)."""
    return np.asarray(np.sum(rows.table[:-1][_of_terms(model, rows.columns, Offset)], axis=0))


def _of_terms(model: TorqueModel, columns: NDArray[np.intp], kind: type[Term]) -> NDArray[np.bool_]:
    """Return which columns are of terms of a kind."""
    found = np.zeros(len(columns), dtype=bool)
    for term in model.terms:
        if isinstance(term, kind):
            place = model.place(term)
            found |= (columns >= place.start) & (columns < place.stop)
    return found


def _of_columns(
    observations: Observations, columns: NDArray[np.intp], value: Array, signals: Array, rate: Array
) -> Array:
    """Return one unit of each kind, from the columns (k, N) of a joint and from the change by one second of delay."""
    friction, offset = (_of_terms(observations.model, columns, kind) for kind in (Friction, Offset))
    own_value = value[columns]
    return np.array(
        [own_value[friction] @ signals[friction], own_value @ signals, np.sum(signals[offset], axis=0), rate]
    )
