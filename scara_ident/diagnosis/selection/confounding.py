"""Effects that these recordings cannot distinguish."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from scara_ident.diagnosis.candidates.candidates import Candidate
from scara_ident.diagnosis.checks.same_errors import same
from scara_ident.diagnosis.checks.variation_check import counted
from scara_ident.diagnosis.selection.choice import fitted_beside
from scara_ident.diagnosis.selection.exchange import near_in_place
from scara_ident.diagnosis.testing.acceptance import Decision
from scara_ident.diagnosis.testing.selection_step import SelectionStep, observed
from scara_ident.effects import Scene
from scara_ident.estimation.least_squares import value_and_weights
from scara_ident.processes import halved


@dataclass(frozen=True)
class Confounder:
    """An effect that would explain nearly as much as one that was found.

    Attributes
    ----------
    label, effect : str
    joint : str or None
    gain : float
        Gain in the place of the effect found; see `gains`.
    candidate : Candidate
    value : tuple of float
        Its coefficients in the place of the effect found; empty if it is also in the model.
    """

    label: str
    effect: str
    joint: str | None
    gain: float
    candidate: Candidate
    value: tuple[float, ...]


def confounders(
    step: SelectionStep, decisions: Sequence[Decision], first: Scene, doubtful: Sequence[Candidate] = ()
) -> list[tuple[Confounder, ...]]:
    """Return for each chosen effect those that these recordings cannot distinguish from it.

    Parameters
    ----------
    step : SelectionStep
        The model with the kept effects.
    decisions : sequence of Decision
        Decisions on the candidates that were tried with it.
    first : Scene
        The scene at which the columns of all of them are available.
    doubtful : sequence of Candidate, optional
        See `Effect.doubtful`.
    """
    pool = [decision.candidate for decision in decisions]

    def of_one(place: int) -> tuple[Confounder, ...]:
        return _confounders_of(step.without(place), step.chosen[place], pool, first, doubtful)

    found = halved(of_one, range(len(step.chosen)), [1.0] * len(step.chosen))
    return [(*others, *against) for others, against in zip(found, _cancelling(step), strict=True)]


def _cancelling(step: SelectionStep) -> list[tuple[Confounder, ...]]:
    """Return for each chosen effect those on its joint that cancel most of its torque.

    Two that nearly cancel stand for their difference, a curve that neither has: x cubed is the difference of x and its
    sine, each several times as large. A constant part, which an offset absorbs, does not count.
    """
    found: list[tuple[Confounder, ...]] = [() for _ in step.chosen]
    if len({item.member.joint for item in step.chosen}) == len(step.chosen):
        return found
    value, _ = value_and_weights(observed(step), step.offsets)
    torques, start = [], step.observations.parameters
    for rows in step.rows(step.scene, step.chosen):
        count = len(next(iter(rows.values())))
        torque = {joint: value[start : start + count] @ columns for joint, columns in rows.items()}
        torques.append({joint: own - np.mean(own) for joint, own in torque.items()})
        start += count
    for place, (own, candidate) in enumerate(zip(torques, step.chosen, strict=True)):
        for other, other_effect in zip(torques, step.chosen, strict=True):
            joint = candidate.member.joint
            if (
                other is own
                or joint is None
                or joint != other_effect.member.joint
                or not set(own) == set(other) == {joint}
            ):
                continue
            least = min(np.linalg.norm(own[joint]), np.linalg.norm(other[joint]))
            if np.linalg.norm(own[joint] + other[joint]) < step.criteria.cancels * least:
                label, name = other_effect.label(step.scene), other_effect.effect.name
                found[place] += (Confounder(label, name, other_effect.joint(step.scene), 0.0, other_effect, ()),)
    return found


def _confounders_of(
    step: SelectionStep, found: Candidate, pool: Sequence[Candidate], first: Scene, doubtful: Sequence[Candidate]
) -> tuple[Confounder, ...]:
    # Confounders are tested once, not in every round of a search, and need not be believed themselves: the number of
    # other candidates does not matter for distinguishing these two. One of the whole arm need not remove as much as all
    # joints leave.
    scene, of_one = step.scene, replace(step.criteria, family_error=step.criteria.significant)
    criteria = replace(of_one, min_gain=of_one.min_gain / scene.robot.n)
    step = replace(step, criteria=criteria, tried=1)
    # Fitting differences between runs is no evidence for an effect.
    step = counted(step, step.judge([found])[0])
    own = step.judge([found])[0]
    twins = [Candidate(*twin) for twin in found.effect.same_columns(scene, found.member)]
    # For all joints together, because candidates of different joints are compared. Most candidates remove too little
    # and need no test.
    saved = own.examination.held_out
    judged = near_in_place(step, own, list(dict.fromkeys([*pool, *twins, *doubtful])), first)
    to_fit = [item for item in judged if item.candidate.effect.fitted_first]
    # Candidates that were chosen by a fit are compared by a fit, because their grid points lose most of the gain.
    fitted = fitted_beside(replace(step, criteria=of_one), to_fit, 0.0, None)
    near = [item for item in judged if item.accepted and item.examination.held_out > criteria.near_confounder * saved]
    # After refinement a doubtful candidate fits almost anything over its few data.
    refined = step.refine(
        [item for item in near if not (item.candidate.effect.fitted_first or item.candidate in doubtful)]
    )
    near = [*refined, *(item for item in near if item.candidate in doubtful)]
    others = []
    for beside, decision in [*((step, item) for item in near), *fitted]:
        better = decision.examination.held_out >= saved
        able = better or decision.examination.held_out >= criteria.min_share * saved
        if decision.accepted and able and (better or same((step, own), (beside, decision))):
            candidate = decision.candidate
            name, joint = candidate.effect.name, candidate.joint(scene)
            value = tuple(float(x) for x in decision.examination.value)
            others.append(Confounder(decision.label, name, joint, decision.gain, candidate, value))
    return tuple(sorted(others, key=lambda item: -item.gain))
