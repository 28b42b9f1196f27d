"""Which of several searches is believed: the band, whether the residual is noise, which effects are proxies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from scara_ident.diagnosis.candidates.candidates import Candidate, CandidateColumns
from scara_ident.diagnosis.checks.noise_check import noise_objection
from scara_ident.diagnosis.checks.other_minima import quieter
from scara_ident.diagnosis.criteria import SelectionCriteria
from scara_ident.diagnosis.evidence.outcome import Outcome, outcome_of, undetermined, with_parameters
from scara_ident.diagnosis.proxies import proxies
from scara_ident.diagnosis.selection.audit import (
    beaten_by_impossible,
    beaten_by_its_like,
    outdone,
    superfluous,
    unsettled,
)
from scara_ident.diagnosis.selection.better_law import by_better_law
from scara_ident.diagnosis.selection.choice import fitted_beside, more_than_chance
from scara_ident.diagnosis.selection.other_bands import in_bands_of
from scara_ident.diagnosis.selection.search import Search, SearchTask, in_place_of, scene_of, search, search_again
from scara_ident.diagnosis.testing.acceptance import Decision, hopeless
from scara_ident.diagnosis.testing.selection_step import SelectionStep
from scara_ident.diagnosis.work import first, next_of
from scara_ident.estimation import wls
from scara_ident.estimation.bands import HIGHEST_BAND, choose_bands
from scara_ident.estimation.explained_power import EXPLAINED, sample
from scara_ident.estimation.observations import Observations, observe
from scara_ident.motion.prepared import PreparedData

# Reason for a suspected effect for which others may stand.
TOO_LITTLE = "{0.label} would remove {0.gain:.0%} of what is left, but the recordings excite it too little to distinguish it from other effects"


def select_model(task: SearchTask, observations: Observations, *, free: bool) -> Outcome:
    """Search for what a model lacks, in a band that determines it.

    Parameters
    ----------
    observations : Observations
        Of the base model, in the first bands.
    free : bool
        Whether another band may be chosen.
    """
    criteria = task.criteria
    data = observations.data
    now, left = first(task.progress)
    found, looked = search(replace(task, progress=now), CandidateColumns(observations)), False
    narrower: Search | None = None
    for _ in range(criteria.max_widenings if free else 0):
        left("choosing the band again")
        # The missing effect had hidden how far up the motion explains the torque, and with it other effects.
        explains = max(choose_bands(found.model, found.data).bands) if found.chosen else 0.0
        asked = _asked_band(found)
        promised = max(asked, _promised_band(found, criteria))
        if not looked and max(explains, promised) < criteria.wider * _widest(found.data):
            looked, promised = True, _band_beyond(task, found)
        wider = min(max(explains, promised), _corrected_band(found))
        if wider < criteria.wider * _widest(found.data):
            break
        more = CandidateColumns(observe(task.model, data.at((wider,) * len(data.bands))))
        found.step.lean()
        now, left = next_of(left)
        again = search(replace(task, progress=now), more, known=found)
        confirmed = asked >= criteria.wider * _widest(found.data) and _asked_band(again) > 0.0
        if promised > explains and not confirmed and not _new(again, found):
            # So far up the motion determines less, and nothing was found.
            break
        found.step.columns.leave()
        # The band is wide for the effect found there, not for the motion or for the effects in the model.
        narrower = found if promised > explains and not confirmed else None
        found = again
    left("testing what is left")
    outcome = _without_proxies(replace(task, progress=left), outcome_of(task, found))
    if narrower is None or not narrower.chosen or _labels(outcome.search) != _labels(narrower):
        return outcome
    # The effect that required the wider band was not accepted.
    back = _without_proxies(replace(task, progress=left), outcome_of(task, narrower))
    return replace(back, demoted=(*outcome.demoted, *back.demoted))


def below_position_noise(task: SearchTask, outcome: Outcome) -> Outcome:
    """Return the outcome of a search, estimated in the lower part of the band if the noise of positions biases the effects found.

    Effects that act together show this, see `quieter`, and everything that was fitted with them changes too. The
    outcome is unchanged if something is left over, or if an effect is not accepted there.
    """
    found, after = outcome.search, outcome.after
    if outcome.unexplained is not None:
        return outcome
    below = quieter(replace(found.step, weights=after.weights, variation=after.offsets))
    if below is None:
        return outcome
    task.progress("fitting below the noise of the positions", 1.0)
    moved = outcome_of(task, in_bands_of(found, below))
    if moved.unexplained is not None or _unstable(moved, outcome.demoted):
        return outcome
    return replace(moved, demoted=outcome.demoted, suspected=outcome.suspected)


def _promised_band(found: Search, criteria: SelectionCriteria) -> float:
    """Return the band that would determine effects that may be missing in the model, Hz; 0 if there are none."""
    chosen, left = _labels(found), float(np.sum(found.step.model.squares))
    promising = [
        item
        for item in found.decisions
        if item.label not in chosen
        # A fit with everything else may have ended where it gains much but made others worse.
        and float(np.sum(item.examination.left)) < left
        and item.candidate.effect.band(item.candidate.member) > 0.0
        and more_than_chance(item, found.tried, criteria)
        # A grid point loses the rest of the gain.
        and item.gain >= criteria.near_best * criteria.min_gain
        and hopeless(item, found.scene, criteria) is None
    ]
    if not promising:
        return 0.0
    # Significant effects show better how wide the band must be.
    best = max(promising, key=lambda item: (item.examination.p_value * found.tried <= 1.0, item.gain)).candidate
    return _within(best.effect.band(best.member), found)


def _band_beyond(task: SearchTask, found: Search) -> float:
    """Return a wider band that determines effects that this one does not, Hz; 0 if it shows none.

    Below a resonance little shows it, and where it begins the model without it explains no torque, so the band ends
    there.
    """
    band = _within(task.criteria.beyond * _widest(found.data), found)
    if band < task.criteria.wider * _widest(found.data):
        return 0.0
    # One repetition of each motion is enough to show large effects.
    columns = CandidateColumns(observe(task.model, sample(found.data.at((band,) * len(found.bands)))))
    start = wls(columns.observations)
    scene = replace(scene_of(task.model, start.value, columns.observations), armatures=found.scene.armatures)
    # Every band shows effects in intervals, and effects within the present band were tried there.
    families = [effect for effect in task.catalogue if not effect.in_intervals]
    members = [Candidate(effect, item) for effect in families for item in effect.members(scene)]
    needing = [item for item in members if item.effect.band(item.member) > _widest(found.data)]
    tried = found.tried + len(needing)
    step = SelectionStep(scene, columns, found.chosen, start.weights, tried, task.criteria, start.offsets)
    # The band ends where the motion explains less than half: above it at least that much must be this effect.
    seen = [item for item in step.judge(needing) if item.accepted and item.gain >= task.criteria.near_best * EXPLAINED]
    fitted = [(own, item) for own, item in fitted_beside(step, seen, 0.0, None) if item.accepted]
    if not fitted:
        return 0.0
    own, best = max(fitted, key=lambda pair: pair[1].gain)
    if best.gain < EXPLAINED or noise_objection(own, best) is not None:
        return 0.0
    return _within(best.candidate.effect.band(best.candidate.member), found)


def _asked_band(found: Search) -> float:
    """Return the band that distinguishes the effects in the model from others, Hz; 0 if none requires one."""
    return _within(max((item.effect.band(item.member) for item in found.chosen), default=0.0), found)


def _within(band: float, found: Search) -> float:
    return min(band, HIGHEST_BAND * min(part.rate for part in found.data.stretches), _corrected_band(found))


def _corrected_band(found: Search) -> float:
    """Return the band, Hz, above which the rest of a correction hides effects of the arm; infinite without a correction.

    A rest that is tried as an effect counts only if it was found.
    """
    left = None if found.correction is None else found.correction.left(found.scene)
    if left is None or (left[0].effect.after_correction and left[0].label(found.scene) not in _labels(found)):
        return np.inf
    return left[1]


def _new(found: Search, before: Search) -> bool:
    """Whether new effects were found that need a wide band."""
    labels = _labels(before)
    return any(item.effect.band(item.member) > 0.0 and item.label(found.scene) not in labels for item in found.chosen)


def _labels(found: Search) -> set[str]:
    return {item.label(found.scene) for item in found.chosen}


def _widest(data: PreparedData) -> float:
    return max(band or np.inf for band in data.bands)


def _without_proxies(task: SearchTask, found: Outcome) -> Outcome:
    """Search again without effects that stand for another effect, or for none."""
    demoted: dict[str, Decision] = {}
    instead: dict[str, tuple[Candidate, Candidate]] = {}
    left = task.progress
    for _ in range(task.criteria.max_demotions):
        refused = [*proxies(found, task.criteria), *_unstable(found, _others(demoted, found))]
        if not refused:
            bettered = by_better_law(found.search, found.after.weights)
            if bettered is not None:
                found = outcome_of(task, bettered)
                continue
            found = with_parameters(found)
            refused = undetermined(found, task.criteria)
        if not refused:
            break
        demoted |= {item.label: item for item in reversed(refused)}
        scene = found.search.scene
        instead = {label: pair for label, pair in instead.items() if all(item.label != label for item in refused)}
        instead |= {pair[0].label(scene): pair for pair in in_place_of(task.catalogue, refused, scene)}
        without = [label for label in demoted if label not in instead]
        now, left = next_of(left)
        again = search_again(replace(task, progress=now), found.search, without, tuple(instead.values()))
        found = outcome_of(task, again)
    else:
        # No further search, but effects that fail are not believed.
        while refused := _failing(found, _others(demoted, found), task.criteria):
            demoted |= {item.label: item for item in refused}
            found = outcome_of(task, found.search.without([item.label for item in refused]))
    short = [item.refused(TOO_LITTLE.format(item)) for item in found.hinted]
    return replace(found, demoted=_others(demoted, found), suspected=tuple(short))


def _others(demoted: Mapping[str, Decision], found: Outcome) -> tuple[Decision, ...]:
    """Return those for which no effect of the same name was found instead."""
    chosen = _labels(found.search)
    return tuple(item for item in demoted.values() if item.label not in chosen)


def _failing(found: Outcome, demoted: Sequence[Decision], criteria: SelectionCriteria) -> list[Decision]:
    return _unstable(found, demoted) or undetermined(with_parameters(found), criteria)


def _unstable(found: Outcome, demoted: Sequence[Decision]) -> list[Decision]:
    search, weights = found.search, found.after.weights
    return [
        *unsettled(search, weights),
        *superfluous(search, weights, found.hinted),
        *beaten_by_impossible(search, weights),
        *beaten_by_its_like(search, weights),
        *outdone(search, weights, demoted),
    ]
