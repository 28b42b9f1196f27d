"""Proxies: effects that stand for one outside the catalogue, because they remove little of a residual most of which stays."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from scara_ident.diagnosis.candidates.candidates import Candidate
from scara_ident.diagnosis.criteria import SelectionCriteria
from scara_ident.diagnosis.evidence.outcome import Outcome
from scara_ident.diagnosis.selection.search_state import Step
from scara_ident.diagnosis.testing.acceptance import Decision
from scara_ident.diagnosis.testing.moments import examine_moments
from scara_ident.diagnosis.testing.selection_step import SelectionStep, observed
from scara_ident.effects import Scene
from scara_ident.estimation.least_squares import value_and_weights
from scara_ident.estimation.noise_bias import noise_torque
from scara_ident.estimation.run_offsets import rms_of

ByJoint = tuple[float | None, ...]


@dataclass(frozen=True)
class _NotRepeating:
    """What of a joint's residual does not count as repeating.

    Attributes
    ----------
    noise : float
        Rms of what differs between repetitions, N m or N.
    differing : float
        Mean square of what runs differ by.
    of_positions : float
        Rms of what the noise of the positions makes, where nothing else is left; 0 elsewhere.
    """

    noise: float
    differing: float
    of_positions: float


@dataclass(frozen=True)
class _Removal:
    """Squares over those of the noise: what an effect removes, what repeats without it, and of that what no noise makes."""

    removed: float
    repeating: float
    beyond: float


def proxies(found: Outcome, criteria: SelectionCriteria) -> list[Decision]:
    """Return the decisions on effects that remove little of a remainder most of which stays, with why.

    Nor is one believed beside a remainder that is significant only since motions were repeated.
    """
    # Not to believe an effect less is asked than to say that something is left: it may stand for what is too small, too.
    left = found.repeating | ({found.unexplained.joint} if found.unexplained else set())
    if not left or not found.fit_after:
        return []
    search, rest = found.search, _not_repeating(found, left)
    labels = [item.label(search.scene) for item in search.chosen]
    refused = []
    # What is corrected and not counted is not believed of an arm: put back, it would only be in the parameters again.
    # Nor does what each recording has of its own take anything of what repeats.
    uncounted = search.correction is not None and (
        search.correction.of_each or search.correction.negligible(search.scene) is not None
    )
    for step, without, beside in _each_without(found, labels):
        decision = step.decision
        if uncounted and decision.candidate.corrects_data:
            continue
        owner = _asked_on(decision.candidate, search.scene)
        removal = _removal(
            rest, dict(zip(search.base.robot.joints, zip(without, beside, strict=True), strict=True)), owner
        )
        short = removal.removed < criteria.min_of_repeatable * removal.repeating
        kept = decision.label in labels
        # On a joint where nothing but what the positions' noise makes is left, no effect need remove that.
        noisy = owner is not None and owner in rest and rest[owner].of_positions > 0.0
        excused = short and noisy and removal.removed >= criteria.min_of_repeatable * removal.beyond
        if short and (owner is None or owner in left) and not (excused and kept):
            share = max(0.0, removal.removed / removal.repeating) if removal.repeating > 0.0 else 0.0
            why = f"it would remove {share:.0%} of what repeats, and most of what repeats would stay unexplained"
            refused.append(decision.refused(why))
        elif kept and (excused or (found.unexplained and owner in (None, found.unexplained.joint))):
            once = _only_repeated(search.step, labels.index(decision.label), criteria)
            refused += [decision.refused(once)] if once else []
    return refused


def _asked_on(candidate: Candidate, scene: Scene) -> str | None:
    """Return the joint of whose remainder an effect must remove its part; None where it is that of all joints.

    What moves links elsewhere than recorded is in the torque of every joint that bears them, and of a force on the tool one
    joint's part may look like it: it has to do for all of them.
    """
    effect = candidate.effect
    return None if effect.all_joints and effect.on_links else candidate.joint(scene)


def _not_repeating(found: Outcome, left: frozenset[str] | set[str]) -> Mapping[str, _NotRepeating]:
    """Return it for each joint of which repetitions tell."""
    joints, variation = found.search.base.robot.joints, found.after.variation
    if variation is not None and found.after.offsets is not None:
        variation = variation.without_offsets
    varied = np.zeros(len(joints)) if variation is None else variation.mean_squares(found.training.joints)
    differing = dict(zip(joints, varied.tolist(), strict=True))
    made = dict(zip(joints, noise_torque(found.training, found.after.value).tolist(), strict=True))
    return {
        fit.joint: _NotRepeating(
            fit.noise,
            differing[fit.joint],
            made[fit.joint] if fit.joint in left and 0.0 < fit.missing <= made[fit.joint] else 0.0,
        )
        for fit in found.fit_after
    }


def _each_without(found: Outcome, labels: list[str]) -> Iterator[tuple[Step, ByJoint, ByJoint]]:
    """Give each step with the rms of every joint without its effect, and with it.

    Of one that is still in the model that is beside all others, of which those that came later may have removed what was left
    when it came in; of one that went again, when it came in.
    """
    search = found.search
    start, after = search.start, found.after
    before = rms_of(start.value, search.uncorrected, start.offsets)
    whole = rms_of(after.value, found.training, after.offsets)
    for step in search.steps:
        fitted = None
        if step.decision.label in labels:
            fitted = observed(search.step.without(labels.index(step.decision.label)))
        elif step.decision.candidate.corrects_data:
            fitted = observed(replace(search.step, columns=search.step.columns.beside(search.uncorrected)))
        if fitted is None:
            yield step, before, step.rms
        else:
            yield step, rms_of(value_and_weights(fitted, after.offsets)[0], fitted, after.offsets), whole
        before = step.rms


def _removal(
    rest: Mapping[str, _NotRepeating], errors: Mapping[str, tuple[float | None, float | None]], owner: str | None
) -> _Removal:
    """Return what an effect removes, over its joint or all of them, by the rms without it and with it."""
    removed = repeating = beyond = 0.0
    for joint, (without, beside) in errors.items():
        if joint in rest and owner in (joint, None) and without is not None and beside is not None:
            own, square = rest[joint], rest[joint].noise ** 2
            most = (without**2 - own.differing) / square - 1.0
            repeating += max(0.0, most)
            beyond += max(0.0, most - own.of_positions**2 / square)
            removed += (without**2 - beside**2) / square
    return _Removal(removed, repeating, beyond)


def _only_repeated(step: SelectionStep, place: int, criteria: SelectionCriteria) -> str | None:
    """Say so where only repetitions make an effect significant: those of a motion prove no more than one run of it."""
    p_value = examine_moments(step.without(place), step.chosen[place]).p_value
    if p_value * step.tried <= criteria.family_error:
        return None
    return f"what is left repeats: with the repetitions of a motion counted once, p = {p_value:.1e}"
