"""Which candidate enters next: the best families refined, and none that noise or differences between runs produce."""

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
        On all that may come in.
    known : SelectionStep or None
        See `fitted_beside`.

    Returns
    -------
    tuple of (Decision or None, dict, Scene)
        The best acceptable member that is sound, those better that are not by their labels, and the scene to go on with.
    """
    # Families of one name each: which of them is better is seen once they are refined.
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
        # What no fit was spent on would come in by its grid points: where nothing better does it is fitted after all.
        found = fitted_beside(step, [item for item in first if item.accepted and item.label not in fitted], 0.0, None)
        if not found:
            return None, refused, step.scene
        fitted |= {item.label for _, item in found}
        refused |= {item.label: item for _, item in found if not item.accepted}
        open_ = [(own, item) for own, item in found if item.accepted]


def _soundest(
    step: SelectionStep, open_: Sequence[tuple[SelectionStep, Decision]], refused: dict[str, Decision]
) -> tuple[SelectionStep, Decision] | None:
    """Return the best of some decisions to which nothing is objected, refined; those better are added to the refused."""
    criteria = step.criteria
    open_ = sorted(open_, key=lambda pair: -pair[1].examination.held_out)
    # Where the best are refused, the next best may still be sound.
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
    """Return those of some fits by another law of the last effect that are accepted: a law changes what all else is fitted to."""
    pairs = [
        (own, replace(item.candidate, effect=law)) for own, item in found for law in item.candidate.effect.other_laws()
    ]
    fitted = [fitted_with(own, candidate, coarse=True) for own, candidate in pairs]
    return [(own, item) for own, item in fitted if _if_more(step, item).accepted]


def _plainer_first(order: Sequence[tuple[SelectionStep, Decision]]) -> list[tuple[SelectionStep, Decision]]:
    """Put the plainer of two of the same effect first where the other leaves no less than chance makes, see `_is_plainer`."""
    left, put = list(order), []
    while left:
        plainer = [pair for pair in left[1:] if _is_plainer(pair[1], left[0][1]) and same(left[0], pair)]
        first = plainer or left[:1]
        put += first
        left = [pair for pair in left if not any(pair is item for item in first)]
    return put


def _is_plainer(one: Decision, other: Decision) -> bool:
    """Whether one of two of the same effect is without intervals, or by the law of its name.

    Where intervals begin and end all rows determined, those held out among them, so that what they remove there says too much. A
    law is given, and has to be determined.
    """
    effect, more = one.candidate.effect, other.candidate.effect
    if effect.name != more.name:
        return False
    by_name = one.label == other.label and bool(more.law()) and not effect.law()
    return by_name or (more.in_intervals and not effect.in_intervals)


def _sure_once_refined(step: SelectionStep, best: Sequence[Decision], enough: float) -> list[Decision]:
    """Return those worth a look that are sure beside their grid point, which may lose most of their significance.

    Every point on the way there is one more that was tried.
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
    """Fit those of some candidates that promise something, all else with them, and judge them there.

    Parameters
    ----------
    candidates : sequence of Decision
        Grid points of families that are fitted first.
    best : float
        Largest gain among the other families.
    known : SelectionStep or None
        Where an earlier search in other bands ended: fits may begin there.

    Returns
    -------
    list of (SelectionStep, Decision)
        With the step at the estimate that goes with the candidate.
    """
    criteria = step.criteria
    enough = max(criteria.min_gain, criteria.near_best * best)
    return _each_fitted(step, _worth_fitting(candidates, enough, step.tried, criteria), candidates, known)


def _each_fitted(
    step: SelectionStep, worth: Sequence[Decision], candidates: Sequence[Decision], known: SelectionStep | None
) -> list[tuple[SelectionStep, Decision]]:
    """Return what `fitted_beside` does of those of the candidates that are worth it."""
    begins = {item.label: (step, item.candidate) for item in worth}
    if known is not None:
        # Found in another band: from there it is near.
        scene = replace(step.scene, value=known.scene.value, armatures=known.scene.armatures)
        labels = {item.label for item in candidates}
        for item in (item for item in known.chosen if item.label(scene) in labels):
            # One of several that act together may be sure only beside the others.
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
    """Return of several fits of the same effects the one that leaves the least.

    What the last gains beside the others does not say which: beside others in a wrong minimum it may gain all.
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
    """Return a decision on what was fitted with the model of a step, refused where both leave as much as that alone."""
    before, left = float(np.sum(step.model.squares)), _left(decision)
    if decision.accepted and before - left < step.criteria.min_gain * before / step.scene.robot.n:
        return replace(decision, accepted=False, why="takes the place of an effect in the model")
    return decision


def fitted_with(step: SelectionStep, candidate: Candidate, *, coarse: bool = False) -> tuple[SelectionStep, Decision]:
    """Fit a candidate with all else, and judge it beside the others as they are fitted with it.

    Parameters
    ----------
    step : SelectionStep
        The model without it.
    coarse : bool, optional
        See `scara_ident.diagnosis.fitting.nonlinear_fit.tune`.
    """
    fitted = tune(replace(step, chosen=(*step.chosen, candidate)), coarse=coarse)
    own = fitted.without(len(step.chosen))
    # What it is judged by is as large as all rows, and of several fits one is asked again: it goes with the copy.
    (decision,) = replace(own).judge([fitted.chosen[-1]])
    return own, decision


def objection(step: SelectionStep, decision: Decision) -> str | None:
    """Say why a candidate that its tests let in does not come in all the same; None where it does.

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
    """Whether a grid point may stand for something, so that work on its family may be worth it.

    Where few blocks hold most of a column, as those of a jerk at the end of a dwell do, chance may do as well whatever it
    removes; the fit, which has to be sure, then decides.
    """
    return point.gain > 0.0 and (point.examination.p_value * tried <= 1.0 or point.gain >= criteria.dominant)


def _worth_fitting(
    points: Sequence[Decision], enough: float, tried: int, criteria: SelectionCriteria
) -> list[Decision]:
    """Return the best points of those that promise so much gain and what they may stand for, the most promising first."""
    # A fit is dear. Of a resonance with little damping a grid point loses most, or is unsure where it removes most, as its
    # waves are others in every run; a point beside it, or the same of another joint, may be more than chance would bring.
    sure = {item.candidate.effect.name for item in points if more_than_chance(item, tried, criteria)}
    best = [item for item in best_of_each(points).values() if item.candidate.effect.name in sure]
    large = {item.candidate.effect.name for item in best if item.gain >= enough}
    best.sort(key=lambda item: -item.gain)
    return [item for item in best if item.candidate.effect.name in large][: criteria.max_fitted]


def _promising(step: SelectionStep, points: Sequence[Decision]) -> list[Decision]:
    """Return the best points, more than chance would bring, of those that act together with effects in the model.

    These were fitted as if there were no others: what a candidate would add is seen once they may give way. How much that is
    the fit says.
    """
    if not points:
        return []
    judged = step.judge([item.candidate for item in points], model=freed_model(step))
    sure = [item for item in judged if more_than_chance(item, step.tried, step.criteria)]
    best = sorted(best_of_each(sure).values(), key=lambda item: -item.gain)
    return best[: step.criteria.max_fitted]


def _in_place_of_the_last(step: SelectionStep, points: Sequence[Decision]) -> list[tuple[SelectionStep, Decision]]:
    """Fit two effects that act together in the place of the last that came in, which may stand for both; see `Effect.instead`."""
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
    """Say so where much of a correction is left once it was made: of one that is there it is a term of third order.

    The noise of positions in its column makes the first estimate too small by its share of the column's square, and what is left
    as much larger (Fuller, Measurement Error Models, 1987).
    """
    candidate, first = decision.candidate, decision.examination.value
    if not candidate.corrects_data:
        return None
    if candidate.effect.of_each_recording:
        first, hidden = still_there(correction_step(step, candidate), candidate, np.zeros_like(first)), 0.0
    else:
        hidden = min(max(noise_of_column(step, decision), 0.0), 1.0 - MIN_RELIABILITY)
    whole = taken_out(step, candidate)[1].value
    # Between what the first says and what it would be without that noise, which is known roughly, all is as good.
    expected = np.clip(whole, *np.sort([first, first / (1.0 - hidden)], axis=0))
    if np.max(np.abs(whole - expected)) <= step.criteria.lower_change * np.max(np.abs(expected)):
        return None
    name, unit = candidate.effect.coefficients[0].name, candidate.effect.coefficients[0].unit
    place = int(np.argmax(np.abs(whole - first)))
    return f"{name} would be {first[place]:.2g} {unit}, but {whole[place]:.2g} {unit} when it is removed from the data until nothing of it is left"


def _insignificant(step: SelectionStep, candidate: Candidate) -> str | None:
    """Say so where the size of an effect is within its uncertainty, that of its nonlinear parameters included."""
    if not candidate.effect.nonlinear:
        return None
    if size_is_determined(candidate.effect, parameters_beside(step, candidate), step.criteria.min_size):
        return None
    return "its size is within its uncertainty when its other parameters are free"
