"""Stepwise search: one effect after another, each time the one with the largest gain in cross-validation."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeAlias

import numpy as np

from scara_ident.arrays import Array
from scara_ident.diagnosis.candidates.candidates import Candidate, CandidateColumns, columns_at_hand
from scara_ident.diagnosis.candidates.lines import line_candidates
from scara_ident.diagnosis.candidates.not_finite import without_not_finite
from scara_ident.diagnosis.criteria import CRITERIA, SelectionCriteria
from scara_ident.diagnosis.fitting.correction import Correction
from scara_ident.diagnosis.fitting.nonlinear_fit import tune
from scara_ident.diagnosis.selection.choice import choose
from scara_ident.diagnosis.selection.exchange import best_exchange, without_superfluous
from scara_ident.diagnosis.selection.search_state import SearchState, Step
from scara_ident.diagnosis.testing.acceptance import Decision
from scara_ident.diagnosis.testing.selection_step import SelectionStep, best_of_each, model_with
from scara_ident.diagnosis.work import after_rounds
from scara_ident.effects import Effect, Scene
from scara_ident.effects.catalogue import available_effects
from scara_ident.effects.links import guessed_armatures
from scara_ident.estimation import Estimate, wls
from scara_ident.estimation.observations import Observations
from scara_ident.estimation.residuals import Residuals
from scara_ident.estimation.run_variation import RunVariation
from scara_ident.model.model import TorqueModel
from scara_ident.motion.low_pass import HIGHEST_CUT
from scara_ident.motion.prepared import PreparedData
from scara_ident.progress import Work

# The label of every effect that was accepted, and the state of the search before.
Passed: TypeAlias = "tuple[tuple[str, SearchState], ...]"


@dataclass(frozen=True, eq=False)
class Search:
    """The result of a search, with its steps.

    Attributes
    ----------
    step : SelectionStep
        The model with the effects that were kept, its scene and its rows.
    uncorrected : Observations
        Of the base model, before any correction of the data.
    start : Estimate
        Of the base model.
    steps : tuple of Step
        The accepted effects, in their order.
    correction : Correction or None
        What was corrected in the data.
    decisions : tuple of Decision
        Decisions on the best member of every family at the end, including rejected ones.
    first : Scene
        The scene at the base model's estimate, at which the columns of all candidates were computed.
    doubtful : tuple of Candidate
        Candidates for which the kept effects may stand, see `Effect.doubtful`.
    passed : tuple of (str, SearchState)
        The label of every accepted effect, in their order, and the state of the search before.
    notes : tuple of str
        Effects of the catalogue that could not be tried.
    """

    step: SelectionStep
    uncorrected: Observations
    start: Estimate
    steps: tuple[Step, ...]
    correction: Correction | None
    decisions: tuple[Decision, ...]
    first: Scene
    doubtful: tuple[Candidate, ...]
    passed: Passed
    notes: tuple[str, ...] = ()

    @property
    def scene(self) -> Scene:
        """At the end."""
        return self.step.scene

    @property
    def chosen(self) -> tuple[Candidate, ...]:
        """The effects that stayed."""
        return self.step.chosen

    @property
    def tried(self) -> int:
        """Number of candidates and scan points tried."""
        return self.step.tried

    @property
    def base(self) -> TorqueModel:
        """The base model."""
        return self.start.model

    @property
    def data(self) -> PreparedData:
        """The training recordings as corrected."""
        return self.step.observations.data

    @property
    def bands(self) -> tuple[float | None, ...]:
        """Low-pass of each joint, Hz."""
        return self.data.bands

    @property
    def model(self) -> TorqueModel:
        """The base model with the effects that stayed."""
        return model_with(self.scene, self.chosen)

    def without(self, labels: Collection[str]) -> Search:
        """Return the search without some of the kept effects, the others fitted again."""
        kept = tuple(item for item in self.chosen if item.label(self.scene) not in labels)
        steps = tuple(item for item in self.steps if item.decision.label not in labels)
        return replace(self, step=tune(replace(self.step, chosen=kept)), steps=steps)

    def beside(self, offsets: RunVariation | None) -> Search:
        """Return the search with the nonlinear parameters fitted together with offsets of runs, see `Estimate.offsets`."""
        return replace(self, step=tune(replace(self.step, variation=offsets)))

    def whole(self, step: SelectionStep) -> SelectionStep:
        """Return a step of the kept effects, with the correction of the data as the last of them.

        Nothing is left of the correction, but its uncertainty is included.
        """
        if self.correction is None:
            return step
        return replace(step, chosen=(*step.chosen, self.correction.candidate))


@dataclass(frozen=True, eq=False)
class SearchTask:
    """The task of a search.

    Attributes
    ----------
    model : TorqueModel
        The base model.
    catalogue : tuple of Effect
        Families to try.
    criteria : SelectionCriteria
    progress : Work
        Called with every step that begins.
    asked_for : bool
        Whether the user chose the families; one that cannot be tried is then an error and not a note.
    """

    model: TorqueModel
    catalogue: tuple[Effect, ...] = field(default_factory=available_effects)
    criteria: SelectionCriteria = CRITERIA
    progress: Work = field(default_factory=Work)
    asked_for: bool = False


def search(task: SearchTask, columns: CandidateColumns, *, known: Search | None = None) -> Search:
    """Find what the model lacks.

    Parameters
    ----------
    task : SearchTask
    columns : CandidateColumns
        On the rows of the base model.
    known : Search, optional
        An earlier search in other bands, which gives starting points for fits.

    Raises
    ------
    ScaraIdentError
        If no member of a requested family has finite columns on a joint.
    """
    observations = columns.observations
    start = wls(observations)
    scene = scene_of(task.model, start.value, observations)
    differ = start.variation is not None and start.variation.delays is not None
    # Effects of each recording need a column for each recording: they are not made if no joint shows that the
    # recordings differ.
    families = [effect for effect in task.catalogue if differ or not effect.of_each_recording]
    everything = [Candidate(effect, member) for effect in families for member in effect.members(scene)]
    pool = tuple(dict.fromkeys([*everything, *([] if known is None else _beginnings(known))]))
    candidates = () if columns.unresolved_for(None) is not None else pool
    task.progress(f"making the columns of {len(candidates)} candidates", 0.0)
    columns.rows(scene, candidates)
    candidates, notes = without_not_finite(scene, columns, candidates, asked_for=task.asked_for)
    if notes:
        pool = tuple(item for item in pool if not columns.not_finite_on(scene, item))
    tried = max(1, len(candidates))
    step = SelectionStep(scene, columns, (), start.weights, tried, task.criteria, start.offsets)
    afterwards = frozenset(effect.name for effect in families if effect.after_correction)
    state = SearchState(step, start.value, pool, candidates, after_correction=afterwards)
    return _searched(task, _Base(start, observations, scene, notes), state, known, frozenset(), ())


def search_again(
    task: SearchTask, found: Search, without: Collection[str], instead: Sequence[tuple[Candidate, Candidate]] = ()
) -> Search:
    """Find what the model lacks without some effects, starting from the state before the first of them was accepted.

    Parameters
    ----------
    found : Search
        That found them.
    without : collection of str
        Labels of effects that must not be tried.
    instead : sequence of (Candidate, Candidate), optional
        Pairs of an effect that must not be tried and its replacement, see `in_place_of`.
    """
    gone = {*without, *(old.label(found.scene) for old, _ in instead if old in found.chosen)}
    place = next((k for k, (label, _) in enumerate(found.passed) if label in gone), 0)
    state = found.passed[place][1]
    state = state.with_more([item for item in _beginnings(found) if item not in state.pool]).exchanged(instead)
    base = _Base(found.start, found.uncorrected, found.first, found.notes)
    return _searched(task, base, state.only({*without, *state.labels}), found, frozenset(without), found.passed[:place])


@dataclass(frozen=True, eq=False)
class _Base:
    """The start of a search: the fitted base model, its rows, the scene at which all columns are computed, and what is not tried."""

    start: Estimate
    uncorrected: Observations
    first: Scene
    notes: tuple[str, ...]


def _beginnings(known: Search) -> list[Candidate]:
    """Return what an earlier search found: it may be between the grid points and not visible at any of them."""
    # The rest of a correction is added together with the correction.
    return [item for item in known.chosen if not (item.effect.fitted_first or item.effect.after_correction)]


def _searched(
    task: SearchTask, base: _Base, state: SearchState, known: Search | None, without: frozenset[str], passed: Passed
) -> Search:
    """Accept one effect after another until no further one helps."""
    criteria, near = task.criteria, None if known is None else known.step
    most = criteria.max_effects * (base.first.robot.n + 1)
    # The fit in a step is released with it; the caller holds another step.
    state = replace(state, step=replace(state.step))
    while True:
        step, scene, chosen = state.step, state.step.scene, state.step.chosen
        words = f"trying {len(state.candidates)} candidates" + (f" beside {len(chosen)} found" if chosen else "")
        task.progress(words, after_rounds(len(passed)))
        step.columns.forget_all_but(base.first, scene)
        decisions = step.judge(state.candidates, base.first)
        residuals = Residuals(step.observations.data, step.columns.predicted(scene, chosen, state.value))
        seeds = line_candidates(scene, residuals, task.catalogue, criteria)
        taken = {*without, *state.labels}
        decisions += step.judge([item for item in seeds if item.label(scene) not in taken])
        beyond = [item for item in decisions if item.as_no_arm > 0.0 and item.label not in taken]
        decisions += step.judge([item for _, item in in_place_of(task.catalogue, beyond, scene)])
        winner, refused = None, dict[str, Decision]()
        if len(state.steps) < most:
            winner, refused, scene = choose(step, decisions, near)
            if winner is None and chosen != state.asked:
                # The accepted effect may have hidden the times at which something acts.
                more = [item for item in _in_intervals(task.catalogue, state) if item.label(scene) not in taken]
                state = replace(state.with_more(more), asked=chosen)
                step = state.step
                found = step.judge(more)
                winner, unsound, scene = choose(step, found, near)
                decisions, refused = decisions + found, refused | unsound
        else:
            # The next acceptable effect is not believed, but kept in the result.
            full = f"it passed its tests, but {most} effects are in the model already and no more are believed at once"
            refused = {label: item.refused(full) for label, item in best_of_each(decisions).items() if item.accepted}
        decisions = [item for item in decisions if item.label not in refused] + list(refused.values())
        gone = None
        if winner is None:
            # Each exchange explains more, or as much with fewer effects, so the loop ends; this is a limit in any case.
            free = state.exchanges < len(state.steps)
            swap = best_exchange(step, state.pool, base.first, without, refused) if free else None
            if swap is None:
                break
            winner, scene, gone = swap.decision, swap.scene, swap.places
        passed = (*passed, (winner.label, state.to_go_back_to(winner)))
        state = (state if gone is None else state.giving_way(*gone)).at(scene).with_effect(winner)
    if state.correction is not None:
        # Effects accepted since then had changed it.
        state = state.corrected(state.correction.candidate)
    step, dropped = without_superfluous(state.step)
    decisions += dropped
    labels = {item.label(step.scene) for item in step.chosen}
    stayed = [item for item in state.steps if item.decision.label in labels or item.decision.candidate.corrects_data]
    others = [Candidate(effect, member) for effect in task.catalogue for member in effect.doubtful(base.first)]
    doubtful = tuple(item for item in others if item.label(step.scene) not in labels)
    return Search(
        step,
        base.uncorrected,
        base.start,
        tuple(stayed),
        state.correction,
        tuple(decisions),
        base.first,
        doubtful,
        passed,
        base.notes,
    )


def in_place_of(
    catalogue: Sequence[Effect], refused: Sequence[Decision], scene: Scene
) -> list[tuple[Candidate, Candidate]]:
    """Return effects that are not believed, each with its replacement, see `Effect.in_place_of`."""
    found = []
    for item in refused:
        old, value = item.candidate, item.examination.value
        members = ((effect, effect.in_place_of(scene, old.effect, old.member, value)) for effect in catalogue)
        found += [(old, Candidate(effect, member)) for effect, member in members if member is not None]
    return found


def _in_intervals(catalogue: Sequence[Effect], state: SearchState) -> list[Candidate]:
    """Return effects that act in intervals of recordings, as seen with the effects found subtracted from the torque."""
    families = [effect for effect in catalogue if effect.in_intervals]
    step, value = state.step, state.value
    if not families or any(item.effect.in_intervals for item in step.chosen):
        return []
    observations = step.observations
    start = observations.parameters
    whole = step.columns.predicted(step.scene, step.chosen, value)
    parts = zip(whole, observations.predicted(value[:start]), strict=True)
    left = {
        motion.with_torque(motion.torque - (own - base)): held
        for (motion, held), (own, base) in zip(columns_at_hand(observations).items(), parts, strict=True)
        if motion.torque is not None
    }
    beside = replace(step.scene, columns=left)
    return [Candidate(effect, member) for effect in families for member in effect.members(beside)]


def scene_of(model: TorqueModel, value: Array, observations: Observations) -> Scene:
    """Return the scene: the ranges of the recordings and the predictions of the base model."""
    data = observations.data
    travel, speed = np.zeros(model.robot.n), np.zeros(model.robot.n)
    longest = 0.0
    start: dict[str, float] = {}
    for item in data.recordings:
        time = item.recording.time
        start[item.name] = float(time[0])
        longest = max(longest, float(time[-1] - time[0]))
        travel = np.maximum(travel, np.ptp(item.recording.position, axis=1))
    for part in data.stretches:
        # The vibration of a servo that holds its joint does not count as motion.
        speed = np.maximum(speed, np.where(part.stretch.idle, 0.0, np.max(np.abs(part.motion.v), axis=1)))
    travel[speed == 0.0] = 0.0
    slowest = float(min(part.rate for part in data.stretches))
    band = max((band for band in data.bands if band is not None), default=HIGHEST_CUT * slowest)
    scene = Scene(model, value, longest, slowest, band, travel, speed, start, columns=columns_at_hand(observations))
    return replace(scene, armatures=guessed_armatures(scene))
