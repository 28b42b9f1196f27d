"""Candidates: members of families of effects, and their columns on the rows of observations, each made once."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.diagnosis.candidates.finite_columns import finite_or_zero, is_finite
from scara_ident.effects import Effect, EffectTerm, Member, Scene, Signals
from scara_ident.effects.links import forget_shared
from scara_ident.effects.signals import ModelledEffect
from scara_ident.estimation.joint_rows import JointRows
from scara_ident.estimation.observations import Observations, observe
from scara_ident.motion.motion import Motion
from scara_ident.motion.position_noise import forget_noisier, noisier, unresolved_joints
from scara_ident.motion.prepared import PreparedStretch
from scara_ident.motion.rest import Bands
from scara_ident.processes import halved
from scara_ident.threads import side_by_side

# Columns of a candidate, shape (k, N) on the N rows of each joint that it acts on.
Rows = dict[int, Array]
# Effect, member, and the estimate where its columns follow that.
Key = tuple[Effect, Member, Hashable]
# Members that act together, see `Scene.together`.
Together = tuple[tuple[Effect, Member], ...]

# Columns that pass the low-pass together: enough for two threads, and little memory.
AT_ONCE = 32
# Candidates whose columns take longer to make than another process to begin.
WORTH_A_PROCESS = 25


@dataclass(frozen=True)
class Candidate:
    """A member of a family that might be what the model lacks."""

    effect: Effect
    member: Member

    def joint(self, scene: Scene) -> str | None:
        """Name of the joint that it belongs to."""
        return None if self.member.joint is None else scene.robot.joints[self.member.joint]

    def label(self, scene: Scene) -> str:
        """Name of effect and joints, the same for all members that differ in nonlinear parameters only."""
        joint = self.joint(scene)
        if joint is None:
            if self.member.intervals:
                # Which these are is fitted, as nonlinear parameters are.
                return f"{self.effect.name} in intervals"
            # Members without a joint are told apart by what they are.
            several = self.member.partner is not None
            return (
                f"{self.effect.name} ({self.effect.description(scene, self.member)})" if several else self.effect.name
            )
        partner = "" if self.member.partner is None else f" by {scene.robot.joints[self.member.partner]}"
        return f"{self.effect.name} of {joint}{partner}"

    @property
    def corrects_data(self) -> bool:
        """Whether it is taken out of the recordings instead of becoming a term of the model."""
        return self.effect.corrects_data(self.member)

    def at(self, nonlinear: Sequence[float]) -> Candidate:
        """Return the member with other nonlinear parameters."""
        return replace(self, member=replace(self.member, nonlinear=tuple(float(x) for x in nonlinear)))

    def term(self, scene: Scene) -> EffectTerm:
        """Return it as a term of a model."""
        return EffectTerm(self.effect, self.member, scene)


@dataclass(frozen=True, eq=False)
class CandidateColumns:
    """The columns of candidates on the rows of observations, each made once per value of its nonlinear parameters.

    Columns that follow the estimate, such as those of a gear's load, are made again when it changes. Those that are not finite
    somewhere are zero everywhere, so that what they belong to removes nothing, see `not_finite_on`.

    Attributes
    ----------
    observations : Observations
        Of the base model.
    """

    observations: Observations
    _rows: dict[Key, Rows] = field(default_factory=dict, repr=False)
    _raw: dict[Key, tuple[Rows, ...]] = field(default_factory=dict, repr=False)
    _not_finite: dict[Key, tuple[str, ...]] = field(default_factory=dict, repr=False)
    _signals: dict[Motion, Signals] = field(default_factory=dict, init=False, repr=False)
    _at: dict[tuple[float | None, ...], CandidateColumns] = field(default_factory=dict, init=False, repr=False)

    def at(self, bands: Bands) -> CandidateColumns:
        """Return columns on the rows that the same recordings have in other bands."""
        data, wanted = self.observations.data, tuple(bands)
        if wanted == data.bands:
            return self
        if wanted not in self._at:
            self._at[wanted] = CandidateColumns(observe(self.observations.model, data.at(wanted)))
        return self._at[wanted]

    @cached_property
    def noisier(self) -> CandidateColumns:
        """Columns on the rows that positions with their noise once more on top would have given."""
        return CandidateColumns(observe(self.observations.model, noisier(self.observations.data)))

    @cached_property
    def unresolved(self) -> dict[int, str]:
        """Joints of which nothing is to be believed, and why, see `unresolved_joints`."""
        return unresolved_joints(self.observations.data)

    def unresolved_for(self, joint: int | None) -> str | None:
        """Say why nothing is to be believed of a joint; of the whole arm, for None, where that is so of all joints."""
        if joint is None and len(self.unresolved) == len(self.observations.joints):
            return next(iter(self.unresolved.values()))
        return None if joint is None else self.unresolved.get(joint)

    def beside(self, observations: Observations) -> CandidateColumns:
        """Return the same columns beside other torques on the same motion."""
        return CandidateColumns(observations, self._rows, self._raw, self._not_finite)

    def rows(self, scene: Scene, candidates: Sequence[Candidate]) -> list[Rows]:
        """Return the columns of candidates within the bands, on the rows of each joint that they act on."""
        self._make(scene, [item for item in candidates if _key(scene, item) not in self._rows], keep=False)
        return [self._rows[_key(scene, item)] for item in candidates]

    def raw(self, scene: Scene, candidates: Sequence[Candidate]) -> list[tuple[Rows, ...]]:
        """Return the columns of candidates at every sample of every stretch, not filtered."""
        self._make(scene, [item for item in candidates if _key(scene, item) not in self._raw], keep=True)
        return [self._raw[_key(scene, item)] for item in candidates]

    def not_finite_on(self, scene: Scene, candidate: Candidate) -> tuple[str, ...]:
        """Return the recordings on which columns that were made are not finite."""
        return self._not_finite.get(_key(scene, candidate), ()) if self._not_finite else ()

    def of_torque(self, scene: Scene, candidate: Candidate, torques: Sequence[Array]) -> Rows:
        """Return what torques of effects on every stretch, shape (n, N), add to a candidate's columns within the bands, see `Effect.of_torque`."""
        effect, member, found = candidate.effect, candidate.member, list[list[Array]]()
        for part, torque in zip(self.observations.data.stretches, torques, strict=True):
            if not part.usable:
                continue
            with np.errstate(all="ignore"):
                added = effect.of_torque(self._signals_of(scene, part), member, torque)
            if added is not None:
                found.append([part.rows(joint, finite_or_zero(rows)) for joint, rows in enumerate(added)])
        return {joint: np.concatenate(parts, axis=1) for joint, parts in enumerate(zip(*found, strict=True))}

    def slopes(self, scene: Scene, candidate: Candidate) -> Rows:
        """Return a tied candidate's `Effect.slopes` within the bands, shape (p + 1 + s, N) on the N rows of each joint that has some."""
        effect, member = candidate.effect, candidate.member
        tie = effect.tie(scene, member)
        assert tie is not None

        def on_stretch(part: PreparedStretch) -> dict[int, tuple[NDArray[np.intp], Array]]:
            every = part.decimation if effect.smooth else 1
            with np.errstate(all="ignore"):
                each = enumerate(effect.slopes(self._signals_of(scene, part, smooth=effect.smooth), member))
                return {
                    joint: (places, part.rows(joint, finite_or_zero(rows), every))
                    for joint, (places, rows) in each
                    if len(places)
                }

        return self._joined(on_stretch, len(tie.slopes))

    def estimate_slopes(self, scene: Scene, candidate: Candidate, value: Array) -> Rows:
        """Return an untied candidate's `Effect.estimate_slopes` within the bands, shape (p, N) on the N rows of each joint that has some."""
        effect, member = candidate.effect, candidate.member

        def on_stretch(part: PreparedStretch) -> dict[int, tuple[NDArray[np.intp], Array]]:
            with np.errstate(all="ignore"):
                each = effect.estimate_slopes(self._signals_of(scene, part), member, value)
            return {joint: (places, part.rows(joint, finite_or_zero(rows))) for joint, (places, rows) in each.items()}

        return self._joined(on_stretch, len(scene.value))

    def _joined(
        self, on_stretch: Callable[[PreparedStretch], dict[int, tuple[NDArray[np.intp], Array]]], count: int
    ) -> Rows:
        """Return what there is of so many derivatives on every stretch, one after the other: of most joints there is nothing."""
        parts = [part for part in self.observations.data.stretches if part.usable]
        made = side_by_side(on_stretch, parts)
        found: Rows = {}
        for joint in dict.fromkeys(joint for each in made for joint in each):
            found[joint] = np.zeros((count, sum(len(part.kept[joint]) for part in parts)))
            stop = 0
            for part, each in zip(parts, made, strict=True):
                start, stop = stop, stop + len(part.kept[joint])
                if joint in each:
                    places, rows = each[joint]
                    found[joint][places, start:stop] = rows
        return found

    def predicted(self, scene: Scene, chosen: Sequence[Candidate], value: Array) -> tuple[Array, ...]:
        """Return the torque that the base model with effects predicts on every stretch, shape (n, N) each."""
        start = self.observations.parameters
        torque = [part.copy() for part in self.observations.predicted(value[:start])]
        for candidate, raw in zip(chosen, self.raw(scene, chosen), strict=True):
            stop = start + len(candidate.effect.columns(scene, candidate.member))
            for part, columns in zip(torque, raw, strict=True):
                for joint, rows in columns.items():
                    part[joint] += value[start:stop] @ rows
            start = stop
        return tuple(torque)

    def _make(self, scene: Scene, candidates: Sequence[Candidate], *, keep: bool) -> None:
        wanted = list(dict.fromkeys(candidates))
        if not wanted:
            return
        stretches = self.observations.data.stretches

        def on_stretch(part: PreparedStretch) -> tuple[list[Rows], list[Rows], set[int]]:
            return self._on_stretch(scene, wanted, part, keep=keep)

        if len(wanted) < WORTH_A_PROCESS:
            made = list(map(on_stretch, stretches))
        else:
            made = halved(on_stretch, stretches, [part.samples for part in stretches])
        for k, candidate in enumerate(wanted):
            key = _key(scene, candidate)
            parts = [rows[k] for rows, _, _ in made]
            used = [part for part, stretch in zip(parts, stretches, strict=True) if stretch.usable]
            self._rows[key] = {j: np.concatenate([part[j] for part in used], axis=1) for j in parts[0]}
            if keep:
                self._raw[key] = tuple(raws[k] for _, raws, _ in made)
            places = dict.fromkeys(
                part.name for part, (_, _, lacking) in zip(stretches, made, strict=True) if k in lacking
            )
            if places:
                self._not_finite[key] = tuple(places)
                self._rows[key] = _zeros(self._rows[key])
                if keep:
                    self._raw[key] = tuple(_zeros(rows) for rows in self._raw[key])

    def _on_stretch(
        self, scene: Scene, candidates: Sequence[Candidate], part: PreparedStretch, *, keep: bool
    ) -> tuple[list[Rows], list[Rows], set[int]]:
        """Return every candidate's columns within the bands, if they are to be kept as they are, and whose are not finite."""
        kept: list[Rows] = [{} for _ in candidates]
        unfiltered: list[Rows] = [{} for _ in candidates]
        lacking: set[int] = set()
        # By how many samples one stands for: candidate, joint, and columns that have not passed the low-pass yet.
        waiting: dict[int, list[tuple[int, int, list[Array]]]] = {}

        def flush() -> None:
            for every, items in waiting.items():
                rows = iter(part.rows_of([(joint, column) for _, joint, columns in items for column in columns], every))
                for k, joint, columns in items:
                    kept[k][joint] = np.array([next(rows) for _ in columns])
            waiting.clear()

        count = 0
        for k, candidate in enumerate(candidates):
            every = part.decimation if candidate.effect.smooth and part.usable else 1
            if keep or every == 1:
                made = self._by_joint(scene, candidate, part)
                if keep:
                    unfiltered[k] = {joint: np.array(columns) for joint, columns in made.items()}
            if every > 1:
                made = self._by_joint(scene, candidate, part, smooth=True)
            if not all(is_finite(column) for column in chain(*made.values(), *unfiltered[k].values())):
                lacking.add(k)
                # What is no number would be in all that passes the low-pass with it.
                made = {joint: [np.zeros_like(column) for column in columns] for joint, columns in made.items()}
            for joint, columns in made.items():
                if part.usable:
                    waiting.setdefault(every, []).append((k, joint, columns))
                    count += len(columns)
                else:
                    kept[k][joint] = np.zeros((len(columns), 0))
            if count >= AT_ONCE:
                flush()
                count = 0
        flush()
        return kept, unfiltered, lacking

    def _by_joint(
        self, scene: Scene, candidate: Candidate, part: PreparedStretch, *, smooth: bool = False
    ) -> dict[int, list[Array]]:
        signals = self._signals_of(scene, part, smooth=smooth)
        # What divides by zero or overflows is seen in the columns.
        with np.errstate(all="ignore"):
            return candidate.effect.by_joint(signals, candidate.member)

    def _signals_of(self, scene: Scene, part: PreparedStretch, *, smooth: bool = False) -> Signals:
        """Return the signals of a stretch, or of its decimated motion; those of the last estimate are kept with all that was made."""
        motion = part.decimated if smooth else part.motion
        held = self._signals.get(motion)
        if held is None:
            # A scene knows the columns of the motions that it was made from, not with what has been corrected since.
            columns = self._at_hand[part.motion]
            if motion is not part.motion:
                columns = tuple(self._decimated(part, joint, own) for joint, own in enumerate(columns))
            held = Signals(scene, motion).with_made(columns=columns)
        elif held.scene is not scene:
            held = held.at(scene)
        self._signals[motion] = held
        return held

    def _decimated(self, part: PreparedStretch, joint: int, columns: Array) -> Array:
        """Return the base model's columns on a joint at the samples of `PreparedStretch.decimated`: friction jumps between them."""
        model = self.observations.model
        place, own = model.place(model.rigid_body), model.active[joint]
        smooth = (own >= place.start) & (own < place.stop)
        found = np.ascontiguousarray(columns[:, :: part.decimation])
        found[~smooth] = part.decimate(columns[~smooth])
        return found

    @cached_property
    def _at_hand(self) -> dict[Motion, tuple[Array, ...]]:
        return columns_at_hand(self.observations)

    def lean(self) -> None:
        """Forget what is as large as the columns and made again where it is asked for, once a search goes on with others."""
        self.__dict__.pop("noisier", None)
        self._at.clear()
        for motion in (*(part.motion for part in self.observations.data.stretches), *self._signals):
            forget_shared(motion)
        self._signals.clear()

    def leave(self) -> None:
        """Forget what only these bands have a use for, once a search goes on in others."""
        # Of a joint that stands they may share a cut-off with bands below, see `position_cuts`.
        below = [_cuts(columns.observations) - _cuts(self.observations) for columns in self._at.values()]
        self.lean()
        forget_noisier(self.observations.data)
        for part in self.observations.data.stretches:
            part.stretch.forget_filtered(set().union(*below))

    def forget_all_but(self, *scenes: Scene) -> None:
        """Forget columns that follow other estimates than those of some scenes."""
        current = {
            None,
            *(
                _estimate(scene, of, beside)
                for scene in scenes
                for of in ((), scene.link_torques)
                for beside in ((), scene.together)
            ),
        }
        for held in (self._rows, self._raw, self._not_finite):
            for key in [key for key in held if key[2] not in current]:
                del held[key]


def _zeros(rows: Rows) -> Rows:
    return {joint: np.zeros_like(own) for joint, own in rows.items()}


def _cuts(observations: Observations) -> set[float | None]:
    return {cut for part in observations.data.stretches for cut in part.cuts}


def columns_at_hand(observations: Observations) -> dict[Motion, tuple[Array, ...]]:
    """Return the base model's columns on the motions of observations."""
    raws = [raw for recording in observations.raw for raw in recording]
    return {part.motion: raw for part, raw in zip(observations.data.stretches, raws, strict=True)}


def _estimate(scene: Scene, on_links: tuple[ModelledEffect, ...], together: Together) -> Hashable:
    return scene.value.tobytes(), tuple(sorted(scene.armatures.items())), on_links, together


def _key(scene: Scene, candidate: Candidate) -> Key:
    effect, member = candidate.effect, candidate.member
    if not effect.follows_estimate:
        return effect, member, None
    loaded = effect.geared_joint(member) is not None
    on_links = scene.link_torques if loaded else ()
    # The only one in the model acts as it does beside it.
    follows = effect.together or effect.beside_together
    alone = not follows or set(scene.together) <= {(effect, member)}
    together = () if alone else scene.together
    return effect, member, _estimate(scene, on_links, together)


def with_columns(observations: Observations, added: Sequence[Rows]) -> tuple[JointRows, ...]:
    """Return the rows of every joint with further columns, numbered on from those of the model."""
    found = []
    for joint, rows in enumerate(observations.joints):
        places, tables, start = [rows.columns], [rows.table[:-1]], observations.parameters
        for item in added:
            size = len(next(iter(item.values())))
            if joint in item:
                places.append(np.arange(start, start + size))
                tables.append(item[joint])
            start += size
        table = np.concatenate([*tables, rows.table[-1:]]) if len(tables) > 1 else rows.table
        found.append(JointRows(np.concatenate(places), table, rows.starts, rows.counts))
    return tuple(found)
