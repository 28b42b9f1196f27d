"""One step of the selection: a fitted model, and candidates tested with it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.diagnosis.candidates.candidates import Candidate, CandidateColumns, Rows, columns_at_hand, with_columns
from scara_ident.diagnosis.criteria import SelectionCriteria
from scara_ident.diagnosis.testing.acceptance import Decision, decide
from scara_ident.diagnosis.testing.candidate_tests import Examination, examine, gains
from scara_ident.diagnosis.testing.fitted_model import FittedModel
from scara_ident.diagnosis.testing.row_test import examine_rows
from scara_ident.effects import Effect, Member, Scene
from scara_ident.estimation.joint_rows import JointRows
from scara_ident.estimation.observations import Observations
from scara_ident.estimation.run_offsets import offsets_on
from scara_ident.estimation.run_variation import RunVariation
from scara_ident.estimation.sample_columns import SampleColumns
from scara_ident.model.model import TorqueModel
from scara_ident.motion.prepared import PreparedData

# Points on a line from one neighbouring scan point to the other: with the middle one three on either side.
LINE_POINTS = 7
# Of what is zero in the place of columns that are not finite, which say nothing of whether it is there.
NOT_FINITE = "its columns are not finite"
# Lines, each a third as long as the last: together they narrow a scan's spacing 27 times, and `tune` does the rest.
LINE_ROUNDS = 4


@dataclass(frozen=True, eq=False)
class SelectionStep:
    """The model with which candidates are tested, and the data for the decisions.

    Attributes
    ----------
    columns : CandidateColumns
        On the rows of the base model.
    chosen : tuple of Candidate
        Effects that are in the model.
    weights : ndarray, shape (n,)
    tried : int
        Candidates and scan points tried.
    variation : RunVariation or None
        Differences between runs that all rows treat as noise: their offsets, or all of them.
    rest : Candidate or None
        What may be left in the data after a correction and is not a property of the arm, see `Correction.left`.
    left_band : float
        Band, Hz, above which that hides effects of the arm, whether it is in the model or not; infinite if nothing may be left.
    minima : tuple of tuple of Candidate
        Effects that act together, as fitted, and as other fits from other starts have them; empty if there were no
        other fits. See
        `scara_ident.diagnosis.checks.other_minima`.
    """

    scene: Scene
    columns: CandidateColumns
    chosen: tuple[Candidate, ...]
    weights: Array
    tried: int
    criteria: SelectionCriteria
    variation: RunVariation | None = None
    rest: Candidate | None = None
    left_band: float = np.inf
    minima: tuple[tuple[Candidate, ...], ...] = ()

    def __post_init__(self) -> None:
        """Tell the scene which members act together, because the columns depend on them."""
        together = together_of(self.chosen)
        if together != self.scene.together:
            object.__setattr__(self, "scene", replace(self.scene, together=together))

    @property
    def observations(self) -> Observations:
        """Of the base model."""
        return self.columns.observations

    @cached_property
    def model(self) -> FittedModel:
        """The base model with the chosen effects, fitted."""
        own = self.columns.rows(self.scene, self.chosen)
        return self.fitted(with_columns(self.observations, own), _parameters(self.observations, own))

    def fitted(self, joints: Sequence[JointRows], parameters: int) -> FittedModel:
        """Return the fitted model of some rows with columns of so many parameters."""
        model = fitted_rows(self.observations, joints, parameters, self.weights, self.criteria.parts)
        if self.variation is None:
            return model
        return replace(model, joints=self.variation.whitened_rows(model.joints))

    @cached_property
    def in_parts(self) -> FittedModel:
        """The same model with parts of every recording as folds, for effects of each recording."""
        owner = self.model.owner
        count = np.bincount(owner)[owner]
        place = np.arange(len(owner)) - np.searchsorted(owner, owner)
        return self.model.with_folds(place * self.criteria.parts // count)

    @property
    def offsets(self) -> RunVariation | None:
        """Offsets of runs, which fits always treat as noise, see `Estimate.offsets`."""
        return None if self.variation is None else self.variation.offsets

    @property
    def filled(self) -> NDArray[np.intp]:
        """Places of the blocks that have rows."""
        return filled_blocks(self.observations.joints)

    @cached_property
    def noisier(self) -> SelectionStep:
        """The same step with the noise of the positions added once more."""
        twin = self.columns.noisier
        scene = replace(self.scene, columns=columns_at_hand(twin.observations))
        return replace(self, scene=scene, columns=twin, variation=offsets_on(twin.observations, self.offsets))

    def lean(self) -> None:
        """Release the caches of the step and of its columns."""
        self.__dict__.pop("noisier", None)
        self.columns.lean()

    def rows(self, scene: Scene, candidates: Sequence[Candidate]) -> list[Rows]:
        """Return the columns of candidates as they are tested with the model."""
        found = self.columns.rows(scene, candidates)
        whole = [place for place, item in enumerate(candidates) if item.corrects_data and self.chosen]
        if whole:
            # A correction of the data also corrects the torque of effects in the model.
            value, start = self.model.root @ self.model.projected, self.observations.parameters
            value = np.concatenate([np.zeros(start), value[start:]])
            torques = self.columns.predicted(self.scene, self.chosen, value)
            for place in whole:
                added = self.columns.of_torque(scene, candidates[place], torques)
                found[place] = {j: rows + added[j] if j in added else rows for j, rows in found[place].items()}
        if self.variation is None:
            return found
        return [{joint: self.variation.whitened(joint, own) for joint, own in rows.items()} for rows in found]

    def rows_at_hand(self, first: Scene, candidates: Sequence[Candidate]) -> list[Rows]:
        """Return the columns of candidates at another scene, or at this one if effects found change them."""
        acting = {j for item in self.scene.link_torques for j in item.effect.rows(self.scene, item.member)}
        loaded = [
            (item.effect.of_load and item.effect.geared_joint(item.member) in acting)
            or (item.effect.together and bool(self.scene.together))
            or (item.corrects_data and bool(self.chosen))
            for item in candidates
        ]
        found: list[Rows | None] = [None] * len(candidates)
        for scene, own in ((first, False), (self.scene, True)):
            places = [k for k, which in enumerate(loaded) if which is own]
            for k, rows in zip(places, self.rows(scene, [candidates[k] for k in places]), strict=True):
                found[k] = rows
        return [rows for rows in found if rows is not None]

    def judge(
        self, candidates: Sequence[Candidate], first: Scene | None = None, model: FittedModel | None = None
    ) -> list[Decision]:
        """Test candidates with the model, and decide on each.

        Parameters
        ----------
        first : Scene, optional
            The scene whose available columns are used; default: the step's.
        model : FittedModel, optional
            In the place of the step's; see `scara_ident.diagnosis.fitting.linearised.freed_model`.
        """
        own = [item for item in candidates if item.effect.of_each_recording]
        if own and model is None:
            # The others first, because their model is used for both; then all in their order.
            plain = [item for item in candidates if not item.effect.of_each_recording]
            others = iter(self.judge(plain, first, self.model))
            timed = iter(self.judge(own, first, self.in_parts))
            return [next(timed if item.effect.of_each_recording else others) for item in candidates]
        model = self.model if model is None else model
        rows = self.rows(self.scene, candidates) if first is None else self.rows_at_hand(first, candidates)
        found = examine(model, rows, self.criteria)
        gained = gains(model, rows, [item.member.joint for item in candidates], found)
        for k, (result, gain) in enumerate(zip(found, gained, strict=True)):
            if self.in_doubt(result, gain):
                found[k] = examine_rows(model, rows[k], result)
        decided = [
            decide(item, result, gain, self.scene, self.tried, self.criteria, self.chosen)
            for item, result, gain in zip(candidates, found, gained, strict=True)
        ]
        return [replace(item, why=NOT_FINITE) if self._not_finite(item.candidate, first) else item for item in decided]

    def _not_finite(self, candidate: Candidate, first: Scene | None) -> bool:
        scenes = (self.scene,) if first is None else (self.scene, first)
        return any(self.columns.not_finite_on(scene, candidate) for scene in scenes)

    def in_doubt(self, found: Examination, gain: float) -> bool:
        """Whether a candidate that removes nearly all of its joint's residual is not significant by blocks of time."""
        return gain >= self.criteria.nearly_all and found.p_value * self.tried > self.criteria.family_error

    def without(self, place: int) -> SelectionStep:
        """Return the step with one of the chosen effects left out of the model."""
        return replace(self, chosen=(*self.chosen[:place], *self.chosen[place + 1 :]))

    def refine(self, leaders: Sequence[Decision]) -> list[Decision]:
        """Refine the nonlinear parameters of several candidates by line searches that narrow about the best point so far."""
        current = list(leaders)
        for round_ in range(LINE_ROUNDS):
            variants = [
                (place, item)
                for place, held in enumerate(current)
                for item in _line(self.scene, held.candidate, round_)
            ]
            found = self.judge([item for _, item in variants])
            for (place, _), decision in zip(variants, found, strict=True):
                held = current[place]
                if decision.examination.gain > held.examination.gain and (decision.accepted or not held.accepted):
                    current[place] = decision
        return current


def together_of(chosen: Sequence[Candidate]) -> tuple[tuple[Effect, Member], ...]:
    """Return the effects of a model whose members act together, see `Scene.together`."""
    found = [(item.effect, item.member) for item in chosen if item.effect.together]
    return tuple(sorted(found, key=lambda item: item[1].place))


def moved_together(chosen: Sequence[Candidate], scene: Scene) -> tuple[Candidate, ...]:
    """Return the effects of a model with those whose members act together as a scene has them."""
    known = {(effect, member.place): member for effect, member in scene.together}
    return tuple(
        replace(item, member=known.get((item.effect, item.member.place), item.member)) if item.effect.together else item
        for item in chosen
    )


def filled_blocks(joints: Sequence[JointRows]) -> NDArray[np.intp]:
    """Return the places of the blocks that have rows of any joint."""
    return np.flatnonzero(sum(np.diff(rows.starts) for rows in joints))


def fitted_model(observations: Observations, chosen: Sequence[Rows], weights: Array, parts: int) -> FittedModel:
    """Return the base model with further columns, for testing candidates; blocks without any row are left out."""
    joints = with_columns(observations, chosen)
    return fitted_rows(observations, joints, _parameters(observations, chosen), weights, parts)


def _parameters(observations: Observations, chosen: Sequence[Rows]) -> int:
    return observations.parameters + sum(len(next(iter(rows.values()))) for rows in chosen)


def fitted_rows(
    observations: Observations, joints: Sequence[JointRows], parameters: int, weights: Array, parts: int
) -> FittedModel:
    """Return the model of some rows with columns of so many parameters; blocks without any row are left out."""
    filled = filled_blocks(joints)
    owner = observations.owner[filled]
    # No column of a row is lost: only empty blocks go.
    joints = tuple(
        JointRows(rows.columns, rows.table, np.append(rows.starts[:-1][filled], rows.starts[-1]), rows.counts[filled])
        for rows in joints
    )
    fold = folds_of(observations.data, owner, filled, parts)
    return FittedModel(joints, parameters, owner, fold, weights)


def model_with(scene: Scene, chosen: Sequence[Candidate]) -> TorqueModel:
    """Return the base model with effects as further terms."""
    if not chosen:
        return scene.model
    terms = tuple(candidate.term(scene) for candidate in chosen)
    return TorqueModel(scene.model.name, scene.robot, (*scene.model.terms, *terms))


def observed(step: SelectionStep) -> Observations:
    """Return the rows of the base model with the chosen effects."""
    joints = with_columns(step.observations, step.columns.rows(step.scene, step.chosen))
    return replace(
        step.observations, model=model_with(step.scene, step.chosen), joints=joints, raw=step.observations.raw.of(())
    )


def observed_at_every_sample(step: SelectionStep) -> Observations:
    """Return the rows of the base model with the chosen effects, and the unfiltered columns."""
    if not step.chosen:
        return step.observations
    added = step.columns.raw(step.scene, step.chosen)
    raws, place = [], 0
    for recording in step.observations.raw:
        found = []
        for raw in recording:
            more = [item[place] for item in added]
            own = [[item[j] for item in more if j in item] for j in range(len(raw))]
            # Rows on which no effect acts are shared, because they are large.
            found.append(
                tuple(
                    np.concatenate([rows, *beside]) if beside else rows for rows, beside in zip(raw, own, strict=True)
                )
            )
            place += 1
        raws.append(tuple(found))
    rows = observed(step)
    return replace(rows, raw=SampleColumns(rows.model, rows.data.recordings, tuple(raws)))


def moments_of(data: PreparedData) -> NDArray[np.intp]:
    """Return which moment of its recording's motion each block is, shape (blocks,): the same in all periods that repeat it."""
    found = []
    for item, periods in zip(data.recordings, data.periods, strict=True):
        numbers: list[NDArray[np.intp]] = []
        blocks = sum(len(part.blocks) - 1 for part in item.stretches if part.usable)
        for part in (part for part in item.stretches if part.usable):
            own = np.arange(len(part.blocks) - 1) + sum(map(len, numbers))
            if periods is not None and part.stretch is item.longest.stretch:
                middle = 0.5 * (part.blocks[1:] + part.blocks[:-1])
                starts = np.array(periods.starts)
                since = middle - starts[np.maximum(np.searchsorted(starts, middle, side="right") - 1, 0)]
                length = (part.blocks[-1] - part.blocks[0]) / len(own)
                # Other numbers than those of the blocks before and after.
                phase = blocks + (since / length).astype(np.intp)
                own = np.where((since >= 0.0) & (since < periods.length), phase, own)
            numbers.append(own)
        found.append(np.concatenate([np.zeros(0, dtype=np.intp), *numbers]))
    return np.concatenate(found)


def folds_of(data: PreparedData, owner: NDArray[np.intp], filled: NDArray[np.intp], parts: int) -> NDArray[np.intp]:
    """Return the fold of each block: its trajectory, or its part of the only one.

    Repetitions are divided in the same way, because they repeat the same moments of the motion.

    Parameters
    ----------
    owner, filled : ndarray of int, shape (blocks,)
        Recording of each block, and its place among all blocks.
    """
    names = data.trajectories
    if len(names) == 1:
        fold, moments = np.zeros(len(owner), dtype=np.intp), moments_of(data)[filled]
        for recording in np.unique(owner):
            own = owner == recording
            place = np.unique(moments[own], return_inverse=True)[1].reshape(-1)
            fold[own] = place * parts // (place.max() + 1)
        return fold
    place = np.array([names.index(label) for label in data.labels], dtype=np.intp)
    return np.asarray(place[owner], dtype=np.intp)


def best_of_each(decisions: Sequence[Decision]) -> dict[str, Decision]:
    """Return the best scan point of every family and joint, acceptable ones first."""
    best: dict[str, Decision] = {}
    for decision in decisions:
        held = best.get(decision.label)
        if held is None or (decision.accepted, decision.gain) > (held.accepted, held.gain):
            best[decision.label] = decision
    return best


def points_of_lines(candidate: Candidate) -> int:
    """Return at most how many points `SelectionStep.refine` tries of a candidate."""
    return LINE_ROUNDS * (LINE_POINTS - 1) * len(candidate.effect.nonlinear)


def _line(scene: Scene, candidate: Candidate, round_: int) -> list[Candidate]:
    """Return variants of a candidate on a line for each nonlinear parameter, a third as long every round."""
    variants = []
    limits = candidate.effect.limits(scene, candidate.member)
    for k, (parameter, (lower, upper)) in enumerate(zip(candidate.effect.nonlinear, limits, strict=True)):
        value = candidate.member.nonlinear[k]
        reach = _spacing(scene, candidate, k) * (2.0 / (LINE_POINTS - 1)) ** round_
        offsets = np.linspace(-reach, reach, LINE_POINTS)
        points = value * np.exp(offsets) if parameter.logarithmic else value + offsets
        for point in points:
            if abs(point - value) > 1e-12 * abs(value) and lower <= point <= upper:
                nonlinear = list(candidate.member.nonlinear)
                nonlinear[k] = float(point)
                variants.append(candidate.at(nonlinear))
    return variants


def _spacing(scene: Scene, candidate: Candidate, k: int) -> float:
    """Distance to the next scan point of a nonlinear parameter of a joint, in its logarithm where it is scanned so.

    A family gives the distance at which two values can be distinguished by ``resolution``.
    """
    parameter = candidate.effect.nonlinear[k]
    widths = candidate.effect.resolution(scene, candidate.member)
    if widths is not None:
        return widths[k] / candidate.member.nonlinear[k] if parameter.logarithmic else widths[k]
    own = candidate.member
    # Joints scan different values, and some are very near to each other.
    others = (
        item for item in candidate.effect.members(scene) if (item.joint, item.partner) == (own.joint, own.partner)
    )
    grid = np.array(sorted({member.nonlinear[k] for member in others}))
    if parameter.logarithmic:
        return float(np.min(np.diff(np.log(grid)))) if len(grid) > 1 else float(np.log(2.0))
    return float(np.min(np.diff(grid))) if len(grid) > 1 else 0.1 * (parameter.upper - parameter.lower)
