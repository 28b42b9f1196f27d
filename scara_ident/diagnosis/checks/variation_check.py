"""Whether differences between runs, rather than an effect of the arm, produce an effect."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from scara_ident.diagnosis.candidates.candidates import with_columns
from scara_ident.diagnosis.fitting.correction import correction_step
from scara_ident.diagnosis.testing.acceptance import Decision
from scara_ident.diagnosis.testing.candidate_tests import examine, gains
from scara_ident.diagnosis.testing.row_test import examine_rows
from scara_ident.diagnosis.testing.selection_step import SelectionStep
from scara_ident.errors import RecordingError
from scara_ident.estimation.assumed_variation import (
    ASSUMED_DELAY,
    ASSUMED_FRICTION,
    ASSUMED_OFFSET,
    ASSUMED_SCALE,
    assumed_variation,
)
from scara_ident.estimation.run_variation import MIN_RUNS, RunVariation
from scara_ident.estimation.variation_between import run_variation


def variation_objection(step: SelectionStep, decision: Decision, min_gain: float = 0.0) -> str | None:
    """Say so where an effect is not significant, or removes too little, beside what runs differ by.

    That is what they differ by with the effect in the model, for without it they seem to differ more. Only of an effect
    that acts in some recordings it is what they differ by without: they may differ by it, or by what runs differ by.

    Nothing is said of what is taken out of the data: there is a mean of these runs whatever they differ by, and left in it
    others would stand for it. Whether it is more than that is asked where it is named (`found_effect`).

    Parameters
    ----------
    step : SelectionStep
        The model that the candidate was tried beside.
    decision : Decision
        That lets it in.
    min_gain : float, optional
        What it must remove there, unless that is far more than runs differ by: what all runs have alike, such as the delay of
        a joint, removes little of what is left beside differences of the same kind. While others are missing runs seem to
        differ more, and nothing is asked.
    """
    if decision.candidate.corrects_data:
        return _alike(step, decision) if decision.candidate.effect.of_each_recording else None
    variation = _variation_beside(step, decision)
    if not variation:
        return None
    beside = replace(step, variation=variation)
    rows = beside.rows(step.scene, [decision.candidate])
    (again,) = examine(beside.model, rows, step.criteria)
    (gain,) = gains(beside.model, rows, [decision.candidate.member.joint], [again])
    # Whether it leaves little but noise is seen where what runs differ by takes no part in it.
    if step.in_doubt(again, max(gain, decision.gain)):
        again = examine_rows(beside.model, rows[0], again)
    why = "runs differ from one another by as much: with these differences counted as noise"
    if len(step.observations.data.recordings) < MIN_RUNS:
        scale = f"{ASSUMED_SCALE:.0%} in torque scale, " if decision.candidate.effect.by_recording else ""
        each = f"runs may differ by {ASSUMED_FRICTION:.0%} in friction, {scale}{ASSUMED_OFFSET:.0%} of the torque in offset, "
        why = f"{each}{ASSUMED_DELAY * 1e3:g} ms in delay, which may look the same: with these differences counted as noise"
    if again.p_value * step.tried > step.criteria.family_error:
        return f"{why} p = {again.p_value:.1e}"
    if gain < min_gain and not _dwarfs(step, decision, variation):
        return f"{why} it removes {max(gain, 0.0):.1%} of the squared residual, {min_gain:.0%} is required"
    return None


def _alike(step: SelectionStep, decision: Decision) -> str | None:
    """Say so where joints do not agree that recordings are late by other times, or what else runs differ by may do as much."""
    joints = with_columns(step.observations, step.columns.rows(step.scene, step.chosen))
    variation = run_variation(step.observations, joints, step.model.root @ step.model.projected)
    shared = variation.delays
    if shared is None or not shared.differ:
        chance = "" if shared is None else f" (p = {shared.p_value:.1e})"
        return f"the difference between recordings may be chance, because the joints disagree about it{chance}"
    try:
        beside = correction_step(step, decision.candidate)
    except RecordingError as error:
        return f"the lower part of the band does not determine it: {error}"
    (again,) = beside.judge([decision.candidate])
    return None if again.accepted else f"with the other differences between runs counted as noise, {again.why}"


def _dwarfs(step: SelectionStep, decision: Decision, variation: RunVariation) -> bool:
    """Whether an effect removes far more of its joint's residual than what runs differ by with it in the model."""
    joint = decision.candidate.member.joint
    if joint is None or decision.candidate.effect.by_recording:
        return False
    joints = with_columns(step.observations, step.columns.rows(step.scene, step.chosen))
    if step.offsets is not None:
        joints, variation = step.offsets.whitened_rows(joints), variation.without_offsets
    rows, value = joints[joint], step.model.root @ step.model.projected
    left = rows.left(value)
    removed = decision.gain * float(left @ left) / rows.samples
    return removed >= step.criteria.alike**2 * float(variation.mean_squares(joints)[joint])


def best_first(pairs: Sequence[tuple[SelectionStep, Decision]]) -> list[tuple[SelectionStep, Decision]]:
    """Return candidates in the order of what they remove on rows that they were not fitted to.

    The best is compared with those that do nearly as well in its place and hardly anything beside it, with what runs
    differ by counted as noise: of two models the wrong one may fit more of that.

    Parameters
    ----------
    pairs : sequence of (SelectionStep, Decision)
        Candidates, each with the step that it was tried beside.
    """
    order = sorted(pairs, key=lambda pair: -pair[1].examination.held_out)
    if len(order) < 2 or _of_the_runs(order[0][1]):
        return order
    step, best = order[0]
    enough = step.criteria.min_share * best.examination.held_out
    near = [pair for pair in order[1:] if pair[1].examination.held_out >= enough and not _of_the_runs(pair[1])]
    beside = replace(step, chosen=(*step.chosen, best.candidate))
    again = beside.judge([item.candidate for _, item in near]) if near else []
    little = 1.0 - step.criteria.min_share
    alternatives = [
        pair for pair, item in zip(near, again, strict=True) if _saved(beside, item) < little * _saved(*pair)
    ]
    variation = counted(step, best).variation if alternatives else None
    if variation is None:
        return order

    def removed(pair: tuple[SelectionStep, Decision]) -> float:
        (again,) = replace(pair[0], variation=variation).judge([pair[1].candidate])
        return again.examination.held_out

    first = max([order[0], *alternatives], key=removed)
    return [first, *(pair for pair in order if pair is not first)]


def _saved(step: SelectionStep, decision: Decision) -> float:
    return decision.examination.held_out * float(np.sum(step.model.squares))


def counted(step: SelectionStep, decision: Decision) -> SelectionStep:
    """Return a step beside which effects are compared with what runs differ by counted as noise.

    Parameters
    ----------
    step : SelectionStep
        The model that an effect was tried beside.
    decision : Decision
        On the effect: with it runs differ by less. Nothing is counted where it may itself be what they differ by.
    """
    variation = None if _of_the_runs(decision) else _variation_beside(step, decision)
    return replace(step, variation=variation) if variation else step


def _of_the_runs(decision: Decision) -> bool:
    return decision.candidate.corrects_data or decision.candidate.effect.by_recording


def _variation_beside(step: SelectionStep, decision: Decision) -> RunVariation:
    """Return what runs differ by, or might where they are too few to say, beside a model with an effect."""
    found, chosen = decision.examination, step.columns.rows(step.scene, step.chosen)
    value, added = step.model.root @ step.model.projected, chosen
    if not decision.candidate.effect.by_recording:
        value = np.concatenate([found.model_value, found.value])
        added = [*chosen, *step.columns.rows(step.scene, [decision.candidate])]
    joints = with_columns(step.observations, added)
    if len(step.observations.data.recordings) >= MIN_RUNS:
        return run_variation(step.observations, joints, value)
    scale = ASSUMED_SCALE if decision.candidate.effect.by_recording else 0.0
    return assumed_variation(step.observations, joints, value, scale)
