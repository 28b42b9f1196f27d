"""The state of a search: the model so far, and the candidates that may still enter."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from scara_ident.arrays import Array
from scara_ident.diagnosis.candidates.candidates import Candidate
from scara_ident.diagnosis.checks.other_minima import lowest
from scara_ident.diagnosis.fitting.at_estimate import at_estimate
from scara_ident.diagnosis.fitting.correction import Correction, taken_out
from scara_ident.diagnosis.fitting.interval_fit import refined
from scara_ident.diagnosis.selection.of_all_joints import takes_in
from scara_ident.diagnosis.testing.acceptance import Decision
from scara_ident.diagnosis.testing.selection_step import SelectionStep, moved_together, observed
from scara_ident.effects import Scene
from scara_ident.estimation.least_squares import value_and_weights
from scara_ident.estimation.run_offsets import rms_of
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
    step : SelectionStep
        The model so far, which candidates are tried beside.
    value : ndarray, shape (k,)
        Parameters of that model.
    pool : tuple of Candidate
        All that may be tried.
    candidates : tuple of Candidate
        Those of them that may come in.
    steps : tuple of Step
        The effects let in and not replaced, in their order.
    correction : Correction or None
        What was taken out of the data.
    exchanges : int
        Effects replaced by others.
    asked : tuple of Candidate
        Beside which effects was last asked for some that act in intervals.
    after_correction : frozenset of str
        Effects that are tried only after a correction that leaves them.
    """

    step: SelectionStep
    value: Array
    pool: tuple[Candidate, ...]
    candidates: tuple[Candidate, ...]
    steps: tuple[Step, ...] = ()
    correction: Correction | None = None
    exchanges: int = 0
    asked: tuple[Candidate, ...] = ()
    after_correction: frozenset[str] = frozenset()

    @property
    def labels(self) -> set[str]:
        """Of the effects in the model."""
        return {item.label(self.step.scene) for item in self.step.chosen}

    def at(self, scene: Scene) -> SearchState:
        """Return the state at another estimate, members that act together as they were fitted there."""
        if scene is self.step.scene:
            return self
        return replace(self, step=replace(self.step, scene=scene, chosen=moved_together(self.step.chosen, scene)))

    def to_go_back_to(self, winner: Decision) -> SearchState:
        """Return the state without what it only keeps to save time, once an effect has come in."""
        step = replace(self.step)
        if winner.candidate.corrects_data:
            # The search goes on with other columns.
            step.columns.lean()
            step = replace(step, columns=step.columns.beside(step.observations))
        return replace(self, step=step)

    def with_more(self, more: Sequence[Candidate]) -> SearchState:
        """Return the state with further candidates."""
        if not more:
            return self
        step = replace(self.step, tried=self.step.tried + len(more))
        return replace(self, step=step, pool=(*self.pool, *more), candidates=(*self.candidates, *more))

    def exchanged(self, pairs: Sequence[tuple[Candidate, Candidate]]) -> SearchState:
        """Return the state with some candidates in the place of others."""
        if not pairs:
            return self
        old = [item for item, _ in pairs]
        pool, candidates = (tuple(item for item in items if item not in old) for items in (self.pool, self.candidates))
        more = [item for _, item in pairs if item not in pool]
        return replace(self, pool=pool, candidates=candidates).with_more(more)

    def only(self, without: Collection[str]) -> SearchState:
        """Return the state with no candidates of some labels."""
        kept = tuple(item for item in self.candidates if item.label(self.step.scene) not in without)
        return replace(self, candidates=kept)

    def giving_way(self, *places: int) -> SearchState:
        """Return the state without some of the effects chosen, in whose place one comes; their families may come in again."""
        scene = self.step.scene
        gone = {self.step.chosen[place].label(scene) for place in places}
        back = [item for item in self.pool if item.label(scene) in gone]
        chosen = tuple(item for item in self.step.chosen if item.label(scene) not in gone)
        return replace(
            self,
            step=replace(self.step, chosen=chosen),
            steps=tuple(item for item in self.steps if item.decision.label not in gone),
            candidates=(*self.candidates, *back),
            exchanges=self.exchanges + 1,
        )

    def without_its_like(self, winner: Decision) -> SearchState:
        """Return the state without the same effect of single joints, in whose place one of all joints comes into it.

        Beside it they would only say again, for each joint, what all have alike. They come in again by what they differ
        from it. What is left of a correction was found beside them and takes the place of none.
        """
        if any(item.decision.label == winner.label for item in self.steps):
            return self
        places = [k for k, item in enumerate(self.step.chosen) if takes_in(winner.candidate, item)]
        return replace(self.giving_way(*places), exchanges=self.exchanges)

    def with_effect(self, winner: Decision) -> SearchState:
        """Return the state with an effect in the model, or out of the data, and all fitted again."""
        candidate, state = winner.candidate, self
        if candidate.corrects_data:
            state = state.without_its_like(winner).corrected(candidate)
        else:
            rest = None if candidate == state.step.rest else state.step.rest
            state = replace(state, step=replace(state.step, chosen=(*state.step.chosen, candidate), rest=rest))
        settled = candidate.effect.of_each_recording or candidate.effect.settled(winner.examination.value)
        if settled or not candidate.corrects_data:
            # What each recording has of its own is taken out until nothing is left, and once more at the end.
            state = state.only({winner.label})
        # Whatever came in, effects that act together may now have another lowest minimum.
        step = refined(lowest(state.step))
        fitted = observed(step)
        value, weights = value_and_weights(fitted, step.offsets)
        step = replace(step, scene=at_estimate(step.scene, step.chosen, value), weights=weights)
        left = rms_of(value, fitted, step.offsets)
        came = Step(winner, step.scene, step.chosen, step.observations.data, value, left)
        repeated = bool(state.steps) and state.steps[-1].decision.label == winner.label
        return replace(state, step=step, value=value, steps=(*state.steps[: len(state.steps) - repeated], came))

    def corrected(self, candidate: Candidate) -> SearchState:
        """Return the state with an effect taken out of the data, beside what was taken out of them before."""
        columns, found = taken_out(self.step, candidate)
        correction = found.beside(self.correction)
        rest, band = correction.left(self.step.scene) or (None, np.inf)
        step = replace(self.step, columns=columns, rest=rest, left_band=band)
        return replace(self, step=step, correction=correction).with_rest()

    def with_rest(self) -> SearchState:
        """Return the state with the present rest of the correction: a candidate if it is an effect, or in the model if found."""
        rest, scene = self.step.rest, self.step.scene
        if rest is None or rest.effect.name not in self.after_correction:
            return self
        name = rest.label(scene)
        chosen, pool, candidates = (
            tuple(rest if item.label(scene) == name else item for item in items)
            for items in (self.step.chosen, self.pool, self.candidates)
        )
        step = replace(self.step, chosen=chosen, rest=None if rest in chosen else rest)
        state = replace(self, step=step, pool=pool, candidates=candidates)
        return state if rest in pool else state.with_more([rest])
