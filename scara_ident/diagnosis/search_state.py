"""Where a search stands: the model so far, and what may still come in."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

from scara_ident.arrays import Array
from scara_ident.diagnosis.acceptance import Decision
from scara_ident.diagnosis.candidates import Candidate, CandidateColumns
from scara_ident.diagnosis.correction import Correction, taken_out
from scara_ident.diagnosis.criteria import SelectionCriteria
from scara_ident.diagnosis.interval_fit import refined
from scara_ident.diagnosis.nonlinear_fit import tune
from scara_ident.diagnosis.selection_step import SelectionStep, observed
from scara_ident.effects import Scene
from scara_ident.estimation.least_squares import value_and_weights
from scara_ident.estimation.run_offsets import rms_of
from scara_ident.estimation.run_variation import RunVariation
from scara_ident.motion.prepared import PreparedData


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
class SearchState:
    """Where a search stands between two effects that come in.

    Attributes
    ----------
    columns : CandidateColumns
        On the rows of the base model, as corrected so far.
    scene : Scene
    weights : ndarray, shape (n,)
    offsets : RunVariation or None
        Offsets of runs, which fits take for noise, see `Estimate.offsets`.
    value : ndarray, shape (k,)
        Parameters of the model with the effects so far.
    pool : tuple of Candidate
        All that may be tried.
    candidates : tuple of Candidate
        Those of them that may come in.
    tried : int
        Candidates and scan points tried.
    criteria : SelectionCriteria
    chosen : tuple of Candidate
        Effects that are in the model.
    steps : tuple of Step
        The effects let in and not replaced, in their order.
    correction : Correction or None
        What was taken out of the data.
    exchanges : int
        Effects replaced by others.
    asked : tuple of Candidate
        Beside which effects was last asked for some that act in intervals.
    """

    columns: CandidateColumns
    scene: Scene
    weights: Array
    offsets: RunVariation | None
    value: Array
    pool: tuple[Candidate, ...]
    candidates: tuple[Candidate, ...]
    tried: int
    criteria: SelectionCriteria
    chosen: tuple[Candidate, ...] = ()
    steps: tuple[Step, ...] = ()
    correction: Correction | None = None
    exchanges: int = 0
    asked: tuple[Candidate, ...] = ()

    def step(self) -> SelectionStep:
        """Return the step of the selection that candidates are tried in."""
        left = None if self.correction is None else self.correction.left(self.scene)
        rest = None if left is None else left[0]
        held = (self.scene, self.columns, self.chosen, self.weights, self.tried, self.criteria)
        return SelectionStep(*held, self.offsets, rest)

    def with_more(self, more: Sequence[Candidate]) -> SearchState:
        """Return the state with further candidates."""
        pool, candidates = (*self.pool, *more), (*self.candidates, *more)
        return replace(self, pool=pool, candidates=candidates, tried=self.tried + len(more))

    def only(self, without: Collection[str]) -> SearchState:
        """Return the state with no candidates of some labels."""
        kept = tuple(item for item in self.candidates if item.label(self.scene) not in without)
        return replace(self, candidates=kept)

    def giving_way(self, place: int) -> SearchState:
        """Return the state without one of the effects chosen, whose family may come in again."""
        gone = self.chosen[place].label(self.scene)
        back = [item for item in self.pool if item.label(self.scene) == gone]
        return replace(
            self,
            chosen=tuple(item for item in self.chosen if item.label(self.scene) != gone),
            steps=tuple(item for item in self.steps if item.decision.label != gone),
            candidates=(*self.candidates, *back),
            exchanges=self.exchanges + 1,
        )

    def with_effect(self, winner: Decision) -> SearchState:
        """Return the state with an effect in the model, or out of the data, and all fitted again."""
        candidate, state = winner.candidate, self
        if candidate.corrects_data:
            state = state.corrected(candidate)
        else:
            state = replace(state, chosen=(*state.chosen, candidate))
        if not candidate.corrects_data or candidate.effect.settled(winner.examination.value):
            state = state.only({winner.label})
        state = state.tuned()
        fitted = observed(state.step())
        value, weights = value_and_weights(fitted, state.offsets)
        scene = replace(state.scene, value=value[: len(state.scene.model.columns)])
        state = replace(state, scene=scene, value=value, weights=weights)
        data = state.columns.observations.data
        came = Step(winner, scene, state.chosen, data, value, rms_of(value, fitted, state.offsets))
        repeated = bool(self.steps) and self.steps[-1].decision.label == winner.label
        return replace(state, steps=(*self.steps[: len(self.steps) - repeated], came))

    def tuned(self) -> SearchState:
        """Return the state with the nonlinear parameters of its effects fitted, and the intervals that they act in."""
        step = refined(tune(self.step()))
        return replace(self, scene=step.scene, chosen=step.chosen)

    def corrected(self, candidate: Candidate) -> SearchState:
        """Return the state with an effect taken out of the data, beside what was taken out of them before."""
        columns, value = taken_out(self.step(), candidate)
        whole = value + (0.0 if self.correction is None else self.correction.value)
        return replace(self, columns=columns, correction=Correction(candidate, whole))
