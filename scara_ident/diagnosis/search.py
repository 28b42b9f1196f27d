"""The search: one effect after another, the one that helps most on data that it was not fitted to."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from scara_ident.arrays import Array
from scara_ident.diagnosis.acceptance import Decision
from scara_ident.diagnosis.candidates import Candidate, CandidateColumns, columns_at_hand
from scara_ident.diagnosis.choice import choose
from scara_ident.diagnosis.correction import Correction, taken_out
from scara_ident.diagnosis.criteria import CRITERIA, SelectionCriteria
from scara_ident.diagnosis.exchange import best_exchange, needed
from scara_ident.diagnosis.interval_fit import refined
from scara_ident.diagnosis.lines import line_candidates
from scara_ident.diagnosis.nonlinear_fit import tune
from scara_ident.diagnosis.selection_step import SelectionStep, model_with, observed
from scara_ident.diagnosis.work import after_rounds
from scara_ident.effects import Effect, Scene
from scara_ident.effects.catalogue import available_effects
from scara_ident.effects.links import guessed_armatures
from scara_ident.estimation import Estimate, wls
from scara_ident.estimation.least_squares import value_and_weights
from scara_ident.estimation.observations import Observations
from scara_ident.estimation.residuals import Residuals
from scara_ident.estimation.run_offsets import rms_of
from scara_ident.estimation.run_variation import RunVariation
from scara_ident.model.model import TorqueModel
from scara_ident.motion.low_pass import HIGHEST_CUT
from scara_ident.motion.prepared import PreparedData
from scara_ident.progress import Work


@dataclass(frozen=True, eq=False)
class Step:
    """One effect let in.

    Attributes
    ----------
    decision : Decision
    scene : Scene
    chosen : tuple of Candidate
        The effects in the model so far.
    data : PreparedData
        As corrected so far.
    value : ndarray, shape (k,)
        Parameters of the model with the effects so far.
    rms : tuple of float or None
        Error of each joint over the training recordings, within the band.
    """

    decision: Decision
    scene: Scene
    chosen: tuple[Candidate, ...]
    data: PreparedData
    value: Array
    rms: tuple[float | None, ...]


@dataclass(frozen=True, eq=False)
class Search:
    """How the search went.

    Attributes
    ----------
    step : SelectionStep
        The model with the effects that stayed, its scene, its rows.
    uncorrected : Observations
        Of the base model, before any correction of the data.
    start : Estimate
        Of the base model.
    steps : tuple of Step
        The effects let in, in their order.
    correction : Correction or None
        What was taken out of the data.
    decisions : tuple of Decision
        On the best member of every family at the end, rejected ones included.
    first : Scene
        At the base model's estimate, which the columns of all candidates were made at.
    doubtful : tuple of Candidate
        What those that stayed may stand for, see `Effect.doubtful`.
    """

    step: SelectionStep
    uncorrected: Observations
    start: Estimate
    steps: tuple[Step, ...]
    correction: Correction | None
    decisions: tuple[Decision, ...]
    first: Scene
    doubtful: tuple[Candidate, ...]

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
        """Candidates and scan points tried."""
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
        """Return it without some of the effects that stayed, the others fitted again."""
        kept = tuple(item for item in self.chosen if item.label(self.scene) not in labels)
        step = self.step
        std, offsets = step.criteria.rotor_inertia_std, step.offsets
        scene, kept = tune(self.scene, step.columns, step.weights, kept, std, offsets=offsets)
        steps = tuple(item for item in self.steps if item.decision.label not in labels)
        return replace(self, step=replace(step, scene=scene, chosen=kept), steps=steps)

    def beside(self, offsets: RunVariation | None) -> Search:
        """Return it with the nonlinear parameters fitted beside offsets of runs, see `Estimate.offsets`."""
        step, std = self.step, self.step.criteria.rotor_inertia_std
        scene, chosen = tune(self.scene, step.columns, step.weights, self.chosen, std, offsets=offsets)
        return replace(self, step=replace(step, scene=scene, chosen=chosen, variation=offsets))

    def whole(self, step: SelectionStep) -> SelectionStep:
        """Return a step of the effects that stayed, with what was taken out of the data as the last of them.

        Of that nothing is left to find, but how sure it is follows.
        """
        if self.correction is None:
            return step
        return replace(step, chosen=(*step.chosen, self.correction.candidate))


@dataclass(frozen=True, eq=False)
class SearchTask:
    """What is to be searched.

    Attributes
    ----------
    model : TorqueModel
        The base model.
    catalogue : tuple of Effect
        Families to try.
    criteria : SelectionCriteria
    progress : Work
        Told every step that begins.
    """

    model: TorqueModel
    catalogue: tuple[Effect, ...] = field(default_factory=available_effects)
    criteria: SelectionCriteria = CRITERIA
    progress: Work = field(default_factory=Work)


def search(
    task: SearchTask, columns: CandidateColumns, *, without: Collection[str] = (), known: Search | None = None
) -> Search:
    """Find what the model lacks.

    Parameters
    ----------
    task : SearchTask
    columns : CandidateColumns
        On the rows of the base model, with what is known already from an earlier search on them.
    without : collection of str, optional
        Labels of candidates that are not to be tried.
    known : Search, optional
        An earlier one in other bands, where fits may begin.
    """
    criteria = task.criteria
    observations = uncorrected = columns.observations
    start = wls(observations)
    first = scene = scene_of(task.model, start.value, observations)
    everything = [Candidate(effect, member) for effect in task.catalogue for member in effect.members(scene)]
    # What was found in other bands may lie between the points that are tried, and show itself at none of them in these.
    everything += [] if known is None else [item for item in known.chosen if not item.effect.fitted_first]
    candidates = [item for item in dict.fromkeys(everything) if item.label(scene) not in without]
    if columns.unresolved_for(None) is not None:
        candidates = []
    tried = max(1, len(candidates))
    task.progress(f"making the columns of {len(candidates)} candidates", 0.0)
    columns.rows(first, candidates)
    chosen: tuple[Candidate, ...] = ()
    steps: list[Step] = []
    correction: Correction | None = None
    weights, value, offsets = start.weights, start.value, start.offsets
    rounds = exchanges = 0
    asked: tuple[Candidate, ...] = ()
    while True:
        words = f"trying {len(candidates)} candidates" + (f" beside {len(chosen)} found" if chosen else "")
        task.progress(words, after_rounds(rounds))
        rounds += 1
        columns.forget_all_but(first, scene)
        step = SelectionStep(scene, columns, chosen, weights, tried, criteria, offsets, _rest(correction, scene))
        decisions = step.judge(candidates, first)
        residuals = Residuals(observations.data, columns.predicted(scene, chosen, value))
        seeds = line_candidates(scene, residuals, task.catalogue, criteria)
        taken = {*without, *(item.label(scene) for item in chosen)}
        decisions += step.judge([item for item in seeds if item.label(scene) not in taken])
        winner, refused = None, dict[str, Decision]()
        if len(steps) < criteria.most_effects:
            winner, refused, scene = choose(step, decisions, None if known is None else known.step)
        decisions = [item for item in decisions if item.label not in refused] + list(refused.values())
        if winner is None and chosen != asked:
            # What came in may have hidden when something acts.
            asked = chosen
            more = _in_intervals(task.catalogue, columns, scene, chosen, value)
            more = [item for item in more if item.label(scene) not in taken]
            if more:
                everything, candidates = everything + more, candidates + more
                tried += len(more)
                continue
        if winner is None:
            # Each explains more than what it replaces, or as much with fewer: there is an end, and this is one in any case.
            swap = best_exchange(step, everything, first, (*without, *refused)) if exchanges < len(steps) else None
            if swap is None:
                break
            exchanges += 1
            winner, scene, gone = swap.decision, swap.scene, chosen[swap.place].label(scene)
            chosen = tuple(item for item in chosen if item.label(scene) != gone)
            steps = [item for item in steps if item.decision.label != gone]
            candidates += [item for item in everything if item.label(scene) == gone]
        candidate, found = winner.candidate, winner.examination
        if candidate.corrects_data:
            columns, value = taken_out(
                SelectionStep(scene, columns, chosen, weights, tried, criteria, offsets), candidate
            )
            observations = columns.observations
            correction = Correction(candidate, value + (correction.value if correction else 0.0))
        else:
            chosen = (*chosen, candidate)
        if not candidate.corrects_data or candidate.effect.settled(found.value):
            candidates = [item for item in candidates if item.label(scene) != winner.label]
        scene, chosen = tune(scene, columns, weights, chosen, criteria.rotor_inertia_std, offsets=offsets)
        if candidate.effect.in_intervals:
            chosen = refined(SelectionStep(scene, columns, chosen, weights, tried, criteria, offsets))
        fitted = observed(SelectionStep(scene, columns, chosen, weights, tried, criteria, offsets))
        value, weights = value_and_weights(fitted, offsets)
        scene = replace(scene, value=value[: len(task.model.columns)])
        repeated = bool(steps) and steps[-1].decision.label == winner.label
        left = rms_of(value, fitted, offsets)
        steps[len(steps) - repeated :] = [Step(winner, scene, chosen, observations.data, value, left)]
    if correction is not None:
        # What came in since had moved it.
        columns, value = taken_out(
            SelectionStep(scene, columns, chosen, weights, tried, criteria, offsets), correction.candidate
        )
        correction = replace(correction, value=value + correction.value)
    kept = needed(SelectionStep(scene, columns, chosen, weights, tried, criteria, offsets))
    scene, kept = tune(scene, columns, weights, kept, criteria.rotor_inertia_std, offsets=offsets)
    kept = refined(SelectionStep(scene, columns, kept, weights, tried, criteria, offsets))
    labels = {item.label(scene) for item in kept}
    stayed = [item for item in steps if item.decision.label in labels or item.decision.candidate.corrects_data]
    final = SelectionStep(scene, columns, kept, weights, tried, criteria, offsets, _rest(correction, scene))
    others = [Candidate(effect, member) for effect in task.catalogue for member in effect.doubtful(first)]
    doubtful = tuple(item for item in others if item.label(scene) not in labels)
    return Search(final, uncorrected, start, tuple(stayed), correction, tuple(decisions), first, doubtful)


def _in_intervals(
    catalogue: Sequence[Effect], columns: CandidateColumns, scene: Scene, chosen: Sequence[Candidate], value: Array
) -> list[Candidate]:
    """Return effects that act in intervals of recordings, as they are seen with those found taken off the torque."""
    families = [effect for effect in catalogue if effect.in_intervals]
    if not families or any(item.effect.in_intervals for item in chosen):
        return []
    observations = columns.observations
    start = observations.parameters
    parts = zip(columns.predicted(scene, chosen, value), observations.predicted(value[:start]), strict=True)
    left = {
        replace(motion, torque=motion.torque - (whole - base)): held
        for (motion, held), (whole, base) in zip(columns_at_hand(observations).items(), parts, strict=True)
        if motion.torque is not None
    }
    beside = replace(scene, columns=left)
    return [Candidate(effect, member) for effect in families for member in effect.members(beside)]


def _rest(correction: Correction | None, scene: Scene) -> Candidate | None:
    left = None if correction is None else correction.left(scene)
    return None if left is None else left[0]


def scene_of(model: TorqueModel, value: Array, observations: Observations) -> Scene:
    """Return how far recordings reach, and what the base model says of them."""
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
        speed = np.maximum(speed, np.max(np.abs(part.motion.v), axis=1))
    slowest = float(min(part.rate for part in data.stretches))
    band = max((band for band in data.bands if band is not None), default=HIGHEST_CUT * slowest)
    scene = Scene(model, value, longest, slowest, band, travel, speed, start, columns=columns_at_hand(observations))
    return replace(scene, armatures=guessed_armatures(scene))
