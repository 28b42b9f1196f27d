"""Observations: a model's columns on prepared data, joint by joint and block by block of time.

A joint's rows hold only the columns that act on it. Each row is weighted to stand for all samples that the band makes
dependent on it, so that `Information.rows` counts samples. All that an estimate needs follows from triangular factors
of these rows, by block, recording, fold or joint.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.errors import RecordingError
from scara_ident.estimation.information import Information, merge
from scara_ident.estimation.joint_rows import JointRows, joined
from scara_ident.estimation.residuals import Residuals
from scara_ident.estimation.sample_columns import Raw, SampleColumns, few_enough
from scara_ident.manners import Frozen
from scara_ident.model.model import TorqueModel
from scara_ident.model.terms.friction import Friction
from scara_ident.motion.position_noise import coarse_positions
from scara_ident.motion.prepared import PreparedData, PreparedRecording, PreparedStretch
from scara_ident.threads import THREADS, side_by_side


@dataclass(frozen=True, eq=False, repr=False)
class Observations(Frozen):
    """The rows of a model on recordings.

    Attributes
    ----------
    model : TorqueModel
    data : PreparedData
    joints : tuple of JointRows
    owner : ndarray of int, shape (blocks,)
        Recording of each block.
    raw : SampleColumns
        For every recording, stretch and joint the unfiltered columns at every sample.
    kept : Observations or None
        If the rows are of all samples of longer files: the observations of the samples in `data` alone; otherwise None.
    counts : tuple of int, or None
        Number of samples of each recording in the rows; None if they are those in `data`.
    """

    model: TorqueModel
    data: PreparedData
    joints: tuple[JointRows, ...]
    owner: NDArray[np.intp]
    raw: SampleColumns
    kept: Observations | None = None
    counts: tuple[int, ...] | None = None

    @property
    def in_memory(self) -> Observations:
        """The observations whose rows are those of `data` and `raw`."""
        return self if self.kept is None else self.kept

    @property
    def parameters(self) -> int:
        """Number of parameters p."""
        return len(self.model.columns)

    @property
    def blocks(self) -> int:
        """Number of blocks of time."""
        return len(self.owner)

    @cached_property
    def each(self) -> tuple[Observations, ...]:
        """The observations of each recording alone."""
        if len(self.data.recordings) == 1:
            return (self,)
        return tuple(self.of([k]) for k in range(len(self.data.recordings)))

    def of(self, places: Sequence[int]) -> Observations:
        """Return the observations of some recordings."""
        blocks = np.concatenate([np.flatnonzero(self.owner == k) for k in places])
        owner = np.concatenate([np.full(np.count_nonzero(self.owner == k), i) for i, k in enumerate(places)])
        found = replace(
            self,
            data=self.data.of(places),
            joints=tuple(joint.part(blocks) for joint in self.joints),
            owner=owner.astype(np.intp),
            raw=self.raw.of(places),
            kept=None if self.kept is None else self.kept.of(places),
            counts=None if self.counts is None else tuple(self.counts[k] for k in places),
        )
        if "_predicted" in self.__dict__:
            value, torque = self.__dict__["_predicted"]
            parts = iter(torque)
            by_recording = [[next(parts) for _ in item.stretches] for item in self.data.recordings]
            found.__dict__["_predicted"] = value, tuple(chain.from_iterable(by_recording[k] for k in places))
        return found

    @cached_property
    def by_joint(self) -> tuple[Information, ...]:
        """All rows of each joint within its band."""
        return tuple(side_by_side(lambda joint: joint.information(self.parameters), self.joints))

    def unfiltered_rms(self, value: Array) -> Array:
        """Return the rms of the unfiltered residual torque of parameters, shape (n,).

        Over all samples of a joint that are neither at rest nor at the ends; NaN if there are none.
        """
        predicted = zip(self.data.stretches, self.predicted(value), strict=True)
        torque = [own for part, own in predicted if part.usable]
        return self._unfiltered(lambda part, place, j: part.torque[j] - torque[place][j])

    @cached_property
    def unfiltered_torque_rms(self) -> Array:
        """The rms of the recorded torque over the same samples, shape (n,)."""
        return self._unfiltered(lambda part, place, j: part.torque[j])

    def _unfiltered(self, signal: Callable[[PreparedStretch, int, int], Array]) -> Array:
        def mean_square(j: int) -> float:
            used = [signal(part, place, j)[part.used[j]] for place, part in enumerate(self._usable)]
            count = sum(len(part) for part in used)
            return sum(float(part @ part) for part in used) / count if count else np.nan

        return np.sqrt(side_by_side(mean_square, range(len(self.joints))))

    def block(self, place: int) -> tuple[Information, ...]:
        """Return the rows of every joint in one block of time."""
        return tuple(joint.information(self.parameters, slice(place, place + 1)) for joint in self.joints)

    @property
    def name(self) -> str:
        """Name of the recording, or of the first of several."""
        return self.data.recordings[0].name

    @property
    def trajectory(self) -> str:
        """Trajectory of the recording, or of the first of several."""
        return self.data.labels[0]

    @property
    def samples(self) -> int:
        """Samples on the uniform time grids, including those of long files."""
        return sum(part.samples for part in self.data.stretches) if self.counts is None else sum(self.counts)

    @property
    def left_out_ends(self) -> float:
        """Seconds left out at the ends of stretches."""
        return sum(min(2 * part.trim, part.samples) / part.rate for part in self.data.stretches)

    @cached_property
    def left_out_rest(self) -> tuple[float, ...]:
        """For each joint the share of the remaining samples that is left out because the joint stood still."""
        used, rested = np.zeros(len(self.joints)), np.zeros(len(self.joints))
        for part in self._usable:
            used += np.count_nonzero(part.used, axis=1)
            rest = part.rest & np.logical_not(part.left_out | part.stretch.clipped)
            rested += np.count_nonzero(rest[:, part.trim : part.samples - part.trim], axis=1)
        return tuple(float(share) for share in rested / np.maximum(used + rested, 1.0))

    def faded(self, shares: Array) -> Observations:
        """Return the observations with each block weighted by a share of its samples, shares of shape (blocks,)."""
        return replace(self, joints=tuple(joint.faded(shares) for joint in self.joints))

    def with_torque(self, data: PreparedData) -> Observations:
        """Return observations of the same motion with the torque of other data."""
        joints = []
        for j, joint in enumerate(self.joints):
            parts = [part.rows(j, part.torque[j : j + 1]) for part in data.stretches if part.usable]
            joints.append(replace(joint, table=np.concatenate([joint.table[:-1], np.concatenate(parts, axis=1)])))
        return replace(self, data=data, joints=tuple(joints))

    def predicted(self, value: Array) -> tuple[Array, ...]:
        """Return the torque that parameters predict on every stretch, shape (n, N) each, not filtered.

        The result for the last parameters is cached and read-only.
        """
        columns = [joint.columns for joint in self.joints]

        def of_recording(place: int) -> list[Array]:
            found = [
                np.array([value[own] @ row for own, row in zip(columns, raw, strict=True)]) for raw in self.raw[place]
            ]
            for torque in found:
                torque.flags.writeable = False
            return found

        return self._of_last(
            "_predicted",
            value,
            lambda: tuple(chain.from_iterable(side_by_side(of_recording, range(len(self.raw))))),
        )

    def late(self, value: Array) -> tuple[Array, ...]:
        """Return for each joint the derivative of the predicted torque on its rows by a delay, shape (N,).

        That of the last parameters is kept.
        """
        return self._of_last("_late", value, lambda: self._lacking(self.predicted(value)))

    def late_reversals(self, value: Array) -> tuple[Array, ...]:
        """Return the same for Coulomb friction alone, which changes where a joint reverses: with presliding it is late too.

        That of the last parameters is kept.
        """

        def made() -> tuple[Array, ...]:
            raws = chain.from_iterable(self.raw)
            return self._lacking([np.array([self.dry(j, value, row) for j, row in enumerate(raw)]) for raw in raws])

        return self._of_last("_late_reversals", value, made)

    def dry(self, joint: int, value: Array, columns: Array) -> Array:
        """Return the Coulomb friction of a joint by parameters and its columns (k, N) at every sample, shape (N,)."""
        dry = self.of_speed(joint, 0)
        return np.asarray(value[self.joints[joint].columns[dry]] @ columns[dry])

    def of_speed(self, joint: int, power: int) -> NDArray[np.bool_]:
        """Return which columns of a joint are of friction with a power of speed, shape (k,)."""
        found = [
            self.model.place(term).start + np.flatnonzero(term.of_power(power))
            for term in self.model.terms
            if isinstance(term, Friction)
        ]
        return np.isin(self.joints[joint].columns, np.concatenate([np.zeros(0, dtype=np.intp), *found]))

    def _lacking(self, torques: Sequence[Array]) -> tuple[Array, ...]:
        """Return for each joint the error on its rows of a torque on every stretch (n, N) per second of delay."""
        parts = [(part, torque) for part, torque in zip(self.data.stretches, torques, strict=True) if part.usable]

        def of_joint(joint: int) -> Array:
            # A torque that comes late lacks so much of its rate.
            rates = ((part, -np.gradient(torque[joint], 1.0 / part.rate)) for part, torque in parts)
            return np.concatenate([part.rows(joint, rate[None])[0] for part, rate in rates])

        return tuple(side_by_side(of_joint, range(len(self.joints))))

    def _of_last(self, name: str, value: Array, made: Callable[[], tuple[Array, ...]]) -> tuple[Array, ...]:
        """Return the cached result for the last parameters, computed again if these differ."""
        known = self.__dict__.get(name)
        if known is None or not np.array_equal(known[0], value):
            known = self.__dict__[name] = value.copy(), made()
        return known[1]

    def residuals(self, value: Array) -> Residuals:
        """Return the residual torque of parameters at every sample."""
        return Residuals(self.data, self.predicted(value))

    @property
    def _usable(self) -> list[PreparedStretch]:
        """The stretches that are long enough."""
        return [part for part in self.data.stretches if part.usable]


def observe(model: TorqueModel, data: PreparedData, known: Observations | None = None) -> Observations:
    """Compute a model's rows on prepared data.

    Parameters
    ----------
    model : TorqueModel
    data : PreparedData
        With effort.
    known : Observations, optional
        Observations of the same model; recordings that it contains with the same bands and the same parts left out are
        reused.

    Returns
    -------
    Observations

    Raises
    ------
    RecordingError
        If no row of a recording is left.
    """
    held = (
        {}
        if known is None or known.data.bands != data.bands
        else {_key(item.data.recordings[0]): item for item in known.each}
    )
    items = [held[_key(item)].data.recordings[0] if _key(item) in held else item for item in data.recordings]
    if held:
        data = replace(data, recordings=tuple(items))

    few = few_enough(data)

    def of_recording(item: PreparedRecording) -> tuple[tuple[Raw, ...] | None, Sequence[JointRows]]:
        same = held.get(_key(item))
        raw, rows = _observed(model, item) if same is None else (same.raw.held[0], same.joints)
        return raw if few else None, rows

    parts = side_by_side(of_recording, data.recordings)
    joints, owner = joined([part for _, part in parts], model.active)
    raw = SampleColumns(model, data.recordings, tuple(raw for raw, _ in parts))
    return Observations(model, data, joints, owner, raw)


def _key(item: PreparedRecording) -> tuple[int, ...]:
    """Return the key of a recording in given bands: which one it is, and the parts left out."""
    return (id(item.recording), *(id(part.left_out) for part in item.stretches))


def kept_rows(item: PreparedRecording) -> int:
    """Return how many rows of all joints a recording has in its bands."""
    return sum(len(kept) for part in item.stretches if part.usable for kept in part.kept)


def informations(model: TorqueModel, data: PreparedData) -> tuple[Information, ...]:
    """Return `Observations.by_joint` of the result of `observe`, without keeping any row.

    Parameters
    ----------
    model : TorqueModel
    data : PreparedData
        With effort.

    Raises
    ------
    RecordingError
        If no row of a recording is left.
    """
    each = informations_of_each(model, data)
    nothing = [[Information.empty(len(own)) for own in model.active]]
    return tuple(
        merge(parts).embed(own, len(model.columns))
        for own, parts in zip(model.active, zip(*(each or nothing), strict=True), strict=True)
    )


def informations_of_each(model: TorqueModel, data: PreparedData) -> list[list[Information]]:
    """Return of each recording the rows of every joint, in the columns that act on it; see `informations`."""
    longest = max((part.samples for part in data.stretches), default=0)

    def of_some(items: Sequence[PreparedRecording]) -> list[list[Information]]:
        # The same memory for all: to ask the system for it takes as long as to fill it.
        memory = [np.empty((len(own) + 1) * longest) for own in model.active]
        return [[rows.information(len(rows.columns)) for rows in _observed(model, item, memory)[1]] for item in items]

    count = min(THREADS, len(data.recordings))
    turns = side_by_side(of_some, [data.recordings[k::THREADS] for k in range(count)])
    return [turns[k % count][k // count] for k in range(len(data.recordings))]


def _observed(
    model: TorqueModel, item: PreparedRecording, memory: Sequence[Array] | None = None
) -> tuple[tuple[Raw, ...], Sequence[JointRows]]:
    """Return the columns of a recording at every sample, and its rows; the columns are overwritten if memory is given."""
    raws, parts = [], []
    for part in item.stretches:
        shapes = [(len(own) + 1, part.samples) for own in model.active]
        if memory is None:
            tables = [np.empty(shape) for shape in shapes]
        else:
            tables = [own[: shape[0] * shape[1]].reshape(shape) for own, shape in zip(memory, shapes, strict=True)]
        raw = model.joint_columns(part.motion, [table[:-1] for table in tables])
        for table, torque in zip(tables, part.torque, strict=True):
            table[-1] = torque
        raws.append(raw)
        if part.usable:
            # Made once, and not in two threads.
            _ = part.fade, part.kept
            parts.append((part, side_by_side(part.rows, range(len(tables)), tables)))
    return tuple(raws), _recording_rows(item, parts, model.robot.position_unit)


def _recording_rows(
    item: PreparedRecording, parts: Sequence[tuple[PreparedStretch, list[Array]]], unit: Callable[[int], str]
) -> list[JointRows]:
    """Return the rows of a recording from those of its usable stretches, joint by joint."""
    if not any(len(kept) for part, _ in parts for kept in part.kept):
        samples = sum(part.samples for part in item.stretches)
        raise RecordingError(
            f"{item.recording.path or item.name}: none of {samples} samples can be used, because the ends and the "
            f"times at rest are left out; {coarse_positions(item, unit) or 'record longer or moving data'}"
        )
    found = []
    for j in range(len(item.bands)):
        starts, counts, total = [], [], 0
        for part, _ in parts:
            begin = part.block_starts(j)
            starts.append(begin[:-1] + total)
            counts.append(part.steps[j] * np.diff(begin).astype(float))
            total += int(begin[-1])
        tables = [tables[j] for _, tables in parts]
        found.append(
            JointRows(
                np.arange(tables[0].shape[0] - 1),
                tables[0] if len(tables) == 1 else np.concatenate(tables, axis=1),
                np.concatenate([*starts, [total]]),
                np.concatenate(counts),
            )
        )
    return found
