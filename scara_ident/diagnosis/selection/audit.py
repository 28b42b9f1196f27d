"""The audit of a selection: each effect is tested again with all others in the model, and removed if it fails."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from scara_ident.arrays import Array
from scara_ident.diagnosis.candidates.candidates import Candidate
from scara_ident.diagnosis.checks.imitation_check import imitation_objection, imitators
from scara_ident.diagnosis.checks.noise_check import BY_NOISE, made_by_noise, noise_objection, within_a_step
from scara_ident.diagnosis.checks.remainder_check import remainder_objection
from scara_ident.diagnosis.checks.same_errors import same
from scara_ident.diagnosis.checks.variation_check import variation_objection
from scara_ident.diagnosis.fitting.effect_parameters import Coefficients, physical_parameters, size_is_determined
from scara_ident.diagnosis.selection.choice import fitted_with
from scara_ident.diagnosis.selection.search import Search
from scara_ident.diagnosis.testing.acceptance import Decision, hopeless
from scara_ident.diagnosis.testing.candidate_tests import Examination
from scara_ident.diagnosis.testing.cluster_test import significance
from scara_ident.diagnosis.testing.moments import examine_moments
from scara_ident.diagnosis.testing.selection_step import SelectionStep, best_of_each
from scara_ident.effects import Parameter
from scara_ident.estimation.noise_bias import noisy
from scara_ident.estimation.run_variation import MIN_RUNS


def unsettled(found: Search, weights: Array) -> list[Decision]:
    """Return the decisions on effects in the model that fail with all others in the model, with the reasons.

    When an effect was accepted, later ones were still missing, and it may have stood for their torque.

    Parameters
    ----------
    weights : ndarray, shape (n,)
        Weights of each joint's rows in the last fit.
    """
    step = replace(found.step, weights=weights)
    if not step.chosen:
        return []
    # Differences between runs are tested for each effect separately, on rows that treat them as noise.
    coefficients = physical_parameters(step, of_runs=False, of_noise=False).coefficients
    noise = noisy(step.observations.data)
    free = [noise and bool(item.effect.nonlinear) and not item.effect.together for item in step.chosen]
    moved = physical_parameters(step, of_runs=False).coefficients if any(free) else coefficients
    # One of several that act together may correct the errors of another; then its scatter underestimates its
    # uncertainty.
    sizes = physical_parameters(step).effects if len(step.scene.together) > 1 else ()
    result = []
    for place, (candidate, own) in enumerate(zip(step.chosen, coefficients, strict=True)):
        beside = step.without(place)
        (decision,) = beside.judge([candidate])
        why = None if decision.accepted else decision.why
        least, essential = step.criteria.min_final_size, candidate.effect.essential(step.scene, candidate.member)
        why = why or uncertain(own, decision.examination, essential, least)
        if why is None and free[place]:
            why = _moved_by_noise(moved[place], decision.examination, essential, least)
        if why is None and sizes and candidate.effect.together:
            why = _unsized(step, candidate, sizes[place])
        small = candidate.effect.negligible(step.scene, candidate.member, own.at_least(least))
        why = why or (small and f"within its uncertainty {small}")
        why = why or noise_objection(beside, decision)
        why = why or variation_objection(beside, decision, step.criteria.min_gain)
        why = why or remainder_objection(beside, decision)
        why = why or imitation_objection(beside, decision)
        why = why or _repeated(beside, decision)
        if why is not None:
            result.append(decision.refused(why))
    return result


def _moved_by_noise(own: Coefficients, examination: Examination, essential: slice, least: float) -> str | None:
    """Return the reason if the bias by the noise of the positions is as large as an effect, with all its parameters free.

    With these parameters held, `noise_objection` underestimates the bias: the part of a size that no row determines,
    such as friction near rest with a coarse encoder, changes freely with them.

    Parameters
    ----------
    own : Coefficients
        With the bias by the noise in their covariance.
    examination, essential, least
        See `uncertain`.
    """
    p_value = _chance(own, examination, essential)
    if p_value <= _of_normal(least):
        return None
    return f"{BY_NOISE} changes its size by as much when its other parameters are free: p = {p_value:.1e}"


def _unsized(step: SelectionStep, candidate: Candidate, sizes: Mapping[str, Parameter]) -> str | None:
    """Return the reason if the size of one of several effects that act together is not determined: it may only correct another's error."""
    if size_is_determined(candidate.effect, sizes, step.criteria.min_size):
        return None
    return "its size is within its uncertainty beside the effects that it acts with: it may only correct their errors"


def _repeated(step: SelectionStep, decision: Decision) -> str | None:
    """Return the reason if only repetitions make an effect significant: a missing effect repeats with the motion too."""
    data, criteria = step.observations.data, step.criteria
    motions = len(data.trajectories)
    if motions == len(data.recordings) and not any(data.periods):
        return None
    # A single motion counts as recorded once, because no other motion can contradict it. Otherwise an effect that
    # leaves almost nothing cannot stand for something that repeats.
    if motions > 1 and decision.gain >= criteria.nearly_all:
        return None
    p_value = examine_moments(step, decision.candidate).p_value
    if p_value <= (criteria.significant if motions > 1 else criteria.family_error / step.tried):
        return None
    return f"a missing effect repeats with the motion: with repetitions counted once, p = {p_value:.1e}"


def outdone(found: Search, weights: Array, refused: Sequence[Decision]) -> list[Decision]:
    """Return the decisions on effects that a refused effect, or an imitation that is no effect, explains as well, with the reasons.

    A refused effect may be there after all, and an effect that is found without it then stands for it; for imitations
    see `imitators`.

    Parameters
    ----------
    found : Search
        The search without the effects that are not believed.
    weights : ndarray, shape (n,)
        See `unsettled`.
    refused : sequence of Decision
        Decisions on the effects that are not believed.
    """
    step = replace(found.step, weights=weights)
    # An effect within a step of the encoder is not real: it corrects the sign of friction, as some real effects do too.
    alternatives = [item.candidate for item in refused if within_a_step(step, item.candidate) is None]
    tried = [item.candidate for item in best_of_each(found.decisions).values()]
    listed_nowhere = imitators(replace(step, chosen=()), tried) if step.chosen else []
    alternatives += listed_nowhere
    result = []
    for place, candidate in enumerate(step.chosen if alternatives else ()):
        beside = step.without(place)
        own, *others = beside.judge([candidate, *alternatives])
        saved = own.examination.held_out
        for other in sorted(others, key=lambda item: -item.examination.held_out):
            unlisted = other.candidate in listed_nowhere
            # A refused effect need not explain all of it; an imitation that is no effect must.
            if other.examination.held_out >= (1.0 if unlisted else step.criteria.min_share) * saved:
                what = other.candidate.effect.summary if unlisted else f"{other.label}, which is not believed,"
                result.append(own.refused(f"{what} explains as much in its place"))
                break
    return result


def beaten_by_its_like(found: Search, weights: Array) -> list[Decision]:
    """Return the decisions on effects for which the same effect on another joint explains significantly more, with the reasons.

    Of effects that act together one may stand for another, and a search accepts the one that passes its tests, by
    however little. Coarse fits hardly distinguish them, so all are fitted completely here.

    Parameters
    ----------
    weights : ndarray, shape (n,)
        See `unsettled`.
    """
    step, criteria = replace(found.step, weights=weights), found.step.criteria
    labels = {item.label(step.scene) for item in step.chosen}
    result = []
    for place, candidate in enumerate(step.chosen):
        alike = [
            item.candidate
            for item in found.decisions
            if item.candidate.effect == candidate.effect and item.label not in labels
        ]
        if not candidate.effect.together or not alike:
            continue
        beside = step.without(place)
        own, *others = beside.judge([candidate, *alike])
        enough = criteria.near_confounder * own.examination.held_out
        near = [item for item in best_of_each(others).values() if item.examination.held_out > enough]
        near.sort(key=lambda item: -item.examination.held_out)
        for item in near[: criteria.max_fitted]:
            alternative, decision = fitted_with(beside, item.candidate)
            less = float(np.sum(own.examination.left) - np.sum(decision.examination.left))
            if less > 0.0 and not same((beside, own), (alternative, decision)):
                result.append(own.refused(f"{item.label} explains more in its place"))
                break
    return result


def beaten_by_impossible(found: Search, weights: Array) -> list[Decision]:
    """Return the decisions on effects for which an impossible effect explains more, with the reasons.

    It explains much in addition to them too: the arm has something similar that is not in the catalogue, and they stand
    for it.

    Parameters
    ----------
    weights : ndarray, shape (n,)
        See `unsettled`.
    """
    step, criteria = replace(found.step, weights=weights), found.step.criteria
    alternatives = [
        item
        for item in best_of_each(found.decisions).values()
        if item.examination.p_value * found.tried <= criteria.family_error
        and item.gain >= criteria.min_gain
        and hopeless(item, found.scene, criteria) is not None
    ]
    result = []
    for place, candidate in enumerate(step.chosen if alternatives else ()):
        near = [item.candidate for item in alternatives if item.candidate.member.joint == candidate.member.joint]
        if near:
            beside = step.without(place)
            own, *others = beside.judge([candidate, *near])
            # The effects in the model have their best nonlinear parameters.
            best = max(beside.refine(others), key=lambda item: item.examination.held_out)
            if best.examination.held_out > own.examination.held_out:
                result.append(own.refused(f"{best.label} explains more in its place, but is impossible: {best.why}"))
    return result


def suspected(found: Search, weights: Array) -> list[Decision]:
    """Return the decisions on effects that would be accepted in addition if the recordings excited them enough.

    Parameters
    ----------
    weights : ndarray, shape (n,)
        See `unsettled`.
    """
    step = replace(found.step, weights=weights, tried=found.tried + len(found.doubtful))
    best = best_of_each([item for item in step.judge(found.doubtful) if item.accepted])
    return [item for item in best.values() if not (noise_objection(step, item) or variation_objection(step, item))]


def left_open(found: Search, weights: Array, demoted: Sequence[Decision] = ()) -> list[Decision]:
    """Return the decisions on effects that are not believed although they are more than noise, with a sentence.

    With the effects found in the model it has the required gain and is worth a look, and it is not caused by the noise
    of the positions, by differences between runs or by the rest of a correction. So the residual is not shown to be
    noise, whatever its spectrum.

    Parameters
    ----------
    weights : ndarray, shape (n,)
        See `unsettled`.
    demoted : sequence of Decision, optional
        Decisions on effects that the search had found and removed in the end; later effects may have replaced them.
    """
    # To excuse an effect, noise or runs need only be able to cause it; this need not be significant.
    of_one = replace(found.step.criteria, family_error=found.step.criteria.significant)
    step = replace(found.step, weights=weights, criteria=of_one)
    differing = len(step.observations.data.recordings) >= MIN_RUNS
    labels = {item.label(found.scene) for item in found.chosen}
    gone = [item for item in demoted if item.label not in labels]
    again = step.judge([item.candidate for item in gone])
    open_ = [now.refused(item.why) for item, now in zip(gone, again, strict=True) if now.accepted or now.tentative]
    others = {item.label: item for item in best_of_each(found.decisions).values() if item.tentative}
    result = []
    for item in (others | {item.label: item for item in open_}).values():
        p_value = item.examination.p_value * found.tried
        if p_value > step.criteria.significant:
            continue
        if within_a_step(step, item.candidate) or made_by_noise(step, item) or remainder_objection(step, item):
            continue
        if not (differing and variation_objection(step, item)):
            result.append(
                item.refused(
                    f"{item.label} would remove {item.gain:.0%} of it (p = {p_value:.1e} over all tried): {item.why}"
                )
            )
    return result


def superfluous(found: Search, weights: Array, others: Sequence[Decision]) -> list[Decision]:
    """Return the decisions on effects for which a suspected effect explains more, so that they add nothing, with the reasons.

    Parameters
    ----------
    weights : ndarray, shape (n,)
        See `unsettled`.
    others : sequence of Decision
        Of what is suspected, see `suspected`.
    """
    step, result = replace(found.step, weights=weights), []
    for other in others:
        what = other.candidate.effect.description(step.scene, other.candidate.member)
        with_it = replace(step, chosen=(*step.chosen, other.candidate))
        for place, candidate in enumerate(step.chosen):
            own, alternative = step.without(place).judge([candidate, other.candidate])
            (left,) = with_it.without(place).judge([candidate])
            if alternative.examination.held_out > own.examination.held_out and not left.accepted:
                result.append(
                    own.refused(f"{what} explains more in its place, but the recordings excite it too little")
                )
    return result


def uncertain(own: Coefficients, examination: Examination, essential: slice, least: float) -> str | None:
    """Return the reason if an effect's coefficients are within their final uncertainty.

    That is the uncertainty with all effects found in the model and nonlinear parameters free. The coefficients are
    tested together, by Wald's statistic with the degrees of freedom of blocks (`significance`). The null hypothesis is
    that all are zero, whatever the physical parameters are then; phases, orders and times are not tested.

    Parameters
    ----------
    examination : Examination
        Of the effect beside all others.
    essential : slice
        The coefficients that are tested, see `Effect.essential`.
    least : float
        Standard deviations from zero that are required of one coefficient with many blocks.
    """
    p_value = _chance(own, examination, essential)
    if p_value <= _of_normal(least):
        return None
    return f"with all effects found in the model, its size is within its uncertainty: p = {p_value:.1e}"


def _chance(own: Coefficients, examination: Examination, essential: slice) -> float:
    """Return the probability that coefficients whose true value is zero would be as large, see `uncertain`."""
    value, covariance = own.value[essential], own.covariance[essential, essential]
    if not np.array_equal(examination.tested, examination.value):
        # The degrees of freedom are those of weighted blocks, which are fewer.
        covariance = covariance + examination.covariance[essential, essential]
    return significance(value, covariance, examination.freedom, examination.products[essential, essential])


def _of_normal(stds: float) -> float:
    """Return the two-sided probability that a normal variable is so many standard deviations from its mean."""
    from scipy.special import erfc

    return float(erfc(stds / 2.0**0.5))
