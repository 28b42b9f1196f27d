"""Which candidate is accepted next: the best families are refined, and none that noise or differences between runs cause is accepted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from scara_ident.diagnosis.candidates.candidates import Candidate
from scara_ident.diagnosis.checks.imitation_check import imitation_objection
from scara_ident.diagnosis.checks.noise_check import noise_objection, noise_of_column
from scara_ident.diagnosis.checks.remainder_check import remainder_objection
from scara_ident.diagnosis.checks.same_errors import same
from scara_ident.diagnosis.checks.setpoints import setpoint_objection
from scara_ident.diagnosis.checks.variation_check import best_first, variation_objection
from scara_ident.diagnosis.criteria import SelectionCriteria
from scara_ident.diagnosis.fitting.correction import MIN_RELIABILITY, correction_step, still_there, taken_out
from scara_ident.diagnosis.fitting.effect_parameters import parameters_beside, size_is_determined
from scara_ident.diagnosis.fitting.linearised import freed_model
from scara_ident.diagnosis.fitting.nonlinear_fit import tune
from scara_ident.diagnosis.testing.acceptance import Decision
from scara_ident.diagnosis.testing.selection_step import SelectionStep, best_of_each, points_of_lines
from scara_ident.effects import Effect, Scene


def choose(
    step: SelectionStep, decisions: Sequence[Decision], known: SelectionStep | None
) -> tuple[Decision | None, dict[str, Decision], Scene]:
    """Refine the best families, and choose among them.

    Parameters
    ----------
    step : SelectionStep
        The model so far.
    decisions : sequence of Decision
        Decisions on all candidates that may be accepted.
    known : SelectionStep or None
        See `fitted_beside`.

    Returns
    -------
    tuple of (Decision or None, dict, Scene)
        The best acceptable member without an objection, the better ones with an objection by their labels, and the
        scene for the next step.
    """
    # Several families of one name: which of them is better is known after refinement.
    by_family: dict[Effect, list[Decision]] = {}
    for item in decisions:
        by_family.setdefault(item.candidate.effect, []).append(item)
    best = [item for family in by_family.values() for item in best_of_each(family).values()]
    first = [item for item in decisions if item.candidate.effect.fitted_first]
    accepted = [item for item in best if item.accepted and not item.candidate.effect.fitted_first]
    beside = [item for item in first if item.candidate.effect.together and step.scene.together]
    best_gain = max((item.gain for item in accepted), default=0.0)
    found = fitted_beside(step, [item for item in first if item not in beside], best_gain, known)
    found += _min_left(
        _each_fitted(step, _promising(step, beside), beside, known) + _in_place_of_the_last(step, beside)
    )
    fitted = {item.label for _, item in found}
    refused = {item.label: item for _, item in found if not item.accepted}
    accepted += _sure_once_refined(step, best, max((item.examination.held_out for item in accepted), default=0.0))
    open_ = [(step, item) for item in accepted] + [(own, item) for own, item in found if item.accepted]
    while True:
        winner = _soundest(step, open_, refused)
        if winner is not None:
            return winner[1], refused, winner[0].scene
        # A family that was not fitted would be accepted by its grid point: if nothing is better, it is fitted now.
        found = fitted_beside(step, [item for item in first if item.accepted and item.label not in fitted], 0.0, None)
        if not found:
            return None, refused, step.scene
        fitted |= {item.label for _, item in found}
        refused |= {item.label: item for _, item in found if not item.accepted}
        open_ = [(own, item) for own, item in found if item.accepted]


def _soundest(
    step: SelectionStep, open_: Sequence[tuple[SelectionStep, Decision]], refused: dict[str, Decision]
) -> tuple[SelectionStep, Decision] | None:
    """Return the best decision without an objection, refined; better ones are added to the refused."""
    criteria = step.criteria
    open_ = sorted(open_, key=lambda pair: -pair[1].examination.held_out)
    # If the best are refused, the next best may have no objection.
    while open_:
        enough = criteria.near_best * open_[0][1].examination.held_out
        leaders = [pair for pair in open_ if pair[1].examination.held_out >= enough][: criteria.max_refined]
        refined = step.refine([item for own, item in leaders if own is step])
        sure = [item.candidate for item in refined if item.accepted]
        refined += step.judge(
            [replace(item, effect=full) for item in sure if (full := item.effect.in_full()) is not None]
        )
        others = [replace(item, effect=other) for item in sure for other in item.effect.other_laws()]
        refined += step.refine(step.judge(others)) if others else []
        fitted = [pair for pair in leaders if pair[0] is not step]
        fitted += _by_other_laws(step, fitted)
        pairs = [(step, item) for item in refined if item.accepted] + fitted
        for own, decision in _plainer_first(best_first(pairs)):
            why = objection(own, decision)
            if why is not None and decision.candidate.effect.together and own.scene.together:
                # Beside others that it acts with a coarse fit ends early: what they took up of it goes back to it slowly.
                own, decision = fitted_with(own, decision.candidate)
                why = objection(own, decision) if decision.accepted else decision.why
            if why is None:
                return own, decision
            refused[decision.label] = decision.refused(why)
        open_ = open_[len(leaders) :]
    return None


def _by_other_laws(
    step: SelectionStep, found: Sequence[tuple[SelectionStep, Decision]]
) -> list[tuple[SelectionStep, Decision]]:
    """Return the accepted fits with another law of the last effect: a law influences all other parameters."""
    pairs = [
        (own, replace(item.candidate, effect=law)) for own, item in found for law in item.candidate.effect.other_laws()
    ]
    fitted = [fitted_with(own, candidate, coarse=True) for own, candidate in pairs]
    return [(own, item) for own, item in fitted if _if_more(step, item).accepted]


def _plainer_first(order: Sequence[tuple[SelectionStep, Decision]]) -> list[tuple[SelectionStep, Decision]]:
    """Put the simpler of two of the same effect first if the other does not leave significantly less, see `_is_plainer`."""
    left, put = list(order), []
    while left:
        plainer = [pair for pair in left[1:] if _is_plainer(pair[1], left[0][1]) and same(left[0], pair)]
        first = plainer or left[:1]
        put += first
        left = [pair for pair in left if not any(pair is item for item in first)]
    return put


def _is_plainer(one: Decision, other: Decision) -> bool:
    """Whether one of two of the same effect has no intervals, or has the standard law of its name.

    The begin and end of intervals were determined by all rows, including the held-out ones, so their gain is too large.
    The standard law needs no such choice; another law must be determined by the data.
    """
    effect, more = one.candidate.effect, other.candidate.effect
    if effect.name != more.name:
        return False
    by_name = one.label == other.label and bool(more.law()) and not effect.law()
    return by_name or (more.in_intervals and not effect.in_intervals)


def _sure_once_refined(step: SelectionStep, best: Sequence[Decision], enough: float) -> list[Decision]:
    """Return those worth a look that become significant near their grid point, which may lose most of their significance.

    Every point of the refinement counts as tried.
    """
    criteria = step.criteria
    worth = [
        item
        for item in best
        if item.tentative
        and item.candidate.effect.nonlinear
        and not item.candidate.effect.fitted_first
        and item.examination.held_out >= criteria.near_best * enough
    ]
    worth.sort(key=lambda item: -item.examination.held_out)
    worth = worth[: criteria.max_refined]
    points = sum(points_of_lines(item.candidate) for item in worth)
    return [item for item in replace(step, tried=step.tried + points).refine(worth) if item.accepted]


def fitted_beside(
    step: SelectionStep, candidates: Sequence[Decision], best: float, known: SelectionStep | None
) -> list[tuple[SelectionStep, Decision]]:
    """Fit the promising candidates together with everything else, and judge them there.

    Parameters
    ----------
    candidates : sequence of Decision
        Grid points of families that need a fit first.
    best : float
        Largest gain among the other families.
    known : SelectionStep or None
        The end of an earlier search in other bands, as a starting point of fits.

    Returns
    -------
    list of (SelectionStep, Decision)
        Each with the step at the estimate that was fitted with the candidate.
    """
    criteria = step.criteria
    enough = max(criteria.min_gain, criteria.near_best * best)
    return _each_fitted(step, _worth_fitting(candidates, enough, step.tried, criteria), candidates, known)


def _each_fitted(
    step: SelectionStep, worth: Sequence[Decision], candidates: Sequence[Decision], known: SelectionStep | None
) -> list[tuple[SelectionStep, Decision]]:
    """Return the result of `fitted_beside` for the candidates that are worth a fit."""
    begins = {item.label: (step, item.candidate) for item in worth}
    if known is not None:
        # It was found in another band, so its fit starts near the solution.
        scene = replace(step.scene, value=known.scene.value, armatures=known.scene.armatures)
        labels = {item.label for item in candidates}
        for item in (item for item in known.chosen if item.label(scene) in labels):
            # One of several that act together may be significant only with the others in the model.
            others = [other for other in known.chosen if other.effect.together and other.label(scene) in labels]
            beside = [other for other in others if item.effect.together and other is not item]
            begins[item.label(scene)] = replace(step, scene=scene, chosen=(*step.chosen, *beside)), item
    found = []
    for begun, candidate in begins.values():
        own, decision = fitted_with(begun, candidate, coarse=True)
        if candidate.effect.together and own.scene.together and not _if_more(step, decision).accepted:
            # Beside others that it acts with a coarse fit ends early: what they took up of it goes back to it slowly.
            own, decision = fitted_with(own, decision.candidate)
        found.append((own, _if_more(step, decision)))
    return found


def _min_left(found: Sequence[tuple[SelectionStep, Decision]]) -> list[tuple[SelectionStep, Decision]]:
    """Return the fit with the smallest residual of several fits of the same effects.

    The gain of the last effect does not decide: with the others in a wrong minimum it may gain everything.
    """
    best: dict[frozenset[str], tuple[SelectionStep, Decision]] = {}
    for own, decision in found:
        effects = frozenset((*(item.label(own.scene) for item in own.chosen), decision.label))
        held = best.get(effects)
        if held is None or _left(decision) < _left(held[1]):
            best[effects] = (own, decision)
    return list(best.values())


def _left(decision: Decision) -> float:
    return float(np.sum(decision.examination.left))


def _if_more(step: SelectionStep, decision: Decision) -> Decision:
    """Return a decision on what was fitted with the model of a step, refused if both leave as much as that model alone."""
    before, left = float(np.sum(step.model.squares)), _left(decision)
    if decision.accepted and before - left < step.criteria.min_gain * before / step.scene.robot.n:
        return replace(decision, accepted=False, why="takes the place of an effect in the model")
    return decision


def fitted_with(step: SelectionStep, candidate: Candidate, *, coarse: bool = False) -> tuple[SelectionStep, Decision]:
    """Fit a candidate with everything else, and judge it with the others as they are fitted with it.

    Parameters
    ----------
    step : SelectionStep
        The model without it.
    coarse : bool, optional
        See `scara_ident.diagnosis.fitting.nonlinear_fit.tune`.
    """
    fitted = tune(replace(step, chosen=(*step.chosen, candidate)), coarse=coarse)
    own = fitted.without(len(step.chosen))
    # The data for this decision are as large as all rows, and only one of several fits is used again, so they are
    # released with the copy.
    (decision,) = replace(own).judge([fitted.chosen[-1]])
    return own, decision


def objection(step: SelectionStep, decision: Decision) -> str | None:
    """Return the objection to a candidate that passed its tests; None if there is none.

    Parameters
    ----------
    step : SelectionStep
        The model that it was tried beside.
    """
    return (
        _insignificant(step, decision.candidate)
        or setpoint_objection(step, decision)
        or noise_objection(step, decision)
        or variation_objection(step, decision)
        or remainder_objection(step, decision)
        or imitation_objection(step, decision)
        or _left_again(step, decision)
    )


def more_than_chance(point: Decision, tried: int, criteria: SelectionCriteria) -> bool:
    """Whether a grid point is significant enough to refine its family.

    If few blocks contain most of a column, such as those of a jerk at the end of a dwell, it may be chance whatever it
    removes; the fit, which must be significant, then decides.
    """
    return point.gain > 0.0 and (point.examination.p_value * tried <= 1.0 or point.gain >= criteria.dominant)


def _worth_fitting(
    points: Sequence[Decision], enough: float, tried: int, criteria: SelectionCriteria
) -> list[Decision]:
    """Return the best points with a promising gain, and those that they may stand for, the most promising first."""
    # A fit is expensive. For a resonance with little damping a grid point loses most of the gain, or is not significant
    # where it removes most, because its waves differ in every run; a neighbouring point, or the same on another joint,
    # may be significant.
    sure = {item.candidate.effect.name for item in points if more_than_chance(item, tried, criteria)}
    best = [item for item in best_of_each(points).values() if item.candidate.effect.name in sure]
    large = {item.candidate.effect.name for item in best if item.gain >= enough}
    best.sort(key=lambda item: -item.gain)
    return [item for item in best if item.candidate.effect.name in large][: criteria.max_fitted]


def _promising(step: SelectionStep, points: Sequence[Decision]) -> list[Decision]:
    """Return the best significant points of those that act together with effects in the model.

    The effects in the model were fitted as if there were no others: the gain of a candidate is known only after they
    are fitted again.
    """
    if not points:
        return []
    judged = step.judge([item.candidate for item in points], model=freed_model(step))
    sure = [item for item in judged if more_than_chance(item, step.tried, step.criteria)]
    best = sorted(best_of_each(sure).values(), key=lambda item: -item.gain)
    return best[: step.criteria.max_fitted]


def _in_place_of_the_last(step: SelectionStep, points: Sequence[Decision]) -> list[tuple[SelectionStep, Decision]]:
    """Fit two effects that act together in the place of the last accepted one, which may stand for both; see `Effect.instead`."""
    last = step.chosen[-1] if step.chosen else None
    labels = {item.label for item in points}
    if last is None or not last.effect.together or not points:
        return []
    pairs = [(one, replace(last, member=other)) for one, other in last.effect.instead(step.scene, last.member)]
    pairs = [(one, other) for one, other in pairs if other.label(step.scene) in labels]
    found = []
    for one, other in pairs[: step.criteria.max_fitted]:
        begun = replace(step, chosen=(*step.chosen[:-1], replace(last, member=one)))
        own, decision = fitted_with(begun, other, coarse=True)
        found.append((own, _if_more(step, decision)))
    return found


def _left_again(step: SelectionStep, decision: Decision) -> str | None:
    """Return the reason if much of a correction is left after it was made: for a true one only a term of third order is left.

    The noise of positions in its column makes the first estimate too small by its share of the column's square, and the
    rest larger by as much (Fuller, Measurement Error Models, 1987).
    """
    candidate, first = decision.candidate, decision.examination.value
    if not candidate.corrects_data:
        return None
    if candidate.effect.of_each_recording:
        first, hidden = still_there(correction_step(step, candidate), candidate, np.zeros_like(first)), 0.0
    else:
        hidden = min(max(noise_of_column(step, decision), 0.0), 1.0 - MIN_RELIABILITY)
    whole = taken_out(step, candidate)[1].value
    # Any value between the first estimate and its value without that noise, which is known roughly, is acceptable.
    expected = np.clip(whole, *np.sort([first, first / (1.0 - hidden)], axis=0))
    if np.max(np.abs(whole - expected)) <= step.criteria.lower_change * np.max(np.abs(expected)):
        return None
    name, unit = candidate.effect.coefficients[0].name, candidate.effect.coefficients[0].unit
    place = int(np.argmax(np.abs(whole - first)))
    return f"{name} would be {first[place]:.2g} {unit}, but {whole[place]:.2g} {unit} when it is removed from the data until nothing of it is left"


def _insignificant(step: SelectionStep, candidate: Candidate) -> str | None:
    """Return the reason if the size of an effect is within its uncertainty, including that of its nonlinear parameters."""
    if not candidate.effect.nonlinear:
        return None
    if size_is_determined(candidate.effect, parameters_beside(step, candidate), step.criteria.min_size):
        return None
    return "its size is within its uncertainty when its other parameters are free"
