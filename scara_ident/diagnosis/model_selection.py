"""Which of several searches is believed: in which band, whether what is left is noise, which effects stand for others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from scara_ident.arrays import Array
from scara_ident.diagnosis.acceptance import Decision, hopeless
from scara_ident.diagnosis.audit import outdone, superfluous, suspected, unsettled
from scara_ident.diagnosis.candidates import Candidate, CandidateColumns
from scara_ident.diagnosis.choice import fitted_beside, more_than_chance
from scara_ident.diagnosis.criteria import SelectionCriteria
from scara_ident.diagnosis.evidence import coloured_shares
from scara_ident.diagnosis.lack_of_fit import LackOfFit, lack_of_fit
from scara_ident.diagnosis.moments import examine_moments
from scara_ident.diagnosis.noise_check import noise_objection
from scara_ident.diagnosis.screening import Dependence, screen
from scara_ident.diagnosis.search import Search, SearchTask, scene_of, search
from scara_ident.diagnosis.selection_step import SelectionStep, observed, observed_at_every_sample
from scara_ident.diagnosis.work import first, next_of
from scara_ident.estimation import Estimate, wls
from scara_ident.estimation.bands import HIGHEST_BAND, choose_bands
from scara_ident.estimation.explained_power import EXPLAINED, sample
from scara_ident.estimation.least_squares import told_value_and_weights, value_and_weights
from scara_ident.estimation.noise_bias import noise_torque
from scara_ident.estimation.observations import Observations, observe
from scara_ident.estimation.residuals import Residuals
from scara_ident.motion.prepared import PreparedData

# Of what is suspected, and others may stand for.
TOO_LITTLE = "{0.label} would remove {0.gain:.0%} of what is left, but the recordings hold too little of it to tell it from others"


@dataclass(frozen=True)
class Unexplained:
    """A repeatable remainder that no effect explains.

    Attributes
    ----------
    joint : str
    signals : tuple of str
        What it depends on; empty where no signal or pair of signals shows it.
    rms : float
        Its size within the band, N m or N.
    explained : float
        Share of the squared residual that the signals explain on held-out trajectories.
    """

    joint: str
    signals: tuple[str, ...]
    rms: float
    explained: float


@dataclass(frozen=True, eq=False)
class Outcome:
    """A search and what is left after it.

    Attributes
    ----------
    search : Search
    after : Estimate
        With the effects found.
    training : Observations
        Of the training recordings, as corrected, with the effects found.
    residuals : Residuals
        What is left of them, without what runs differ by.
    fit_before, fit_after : tuple of LackOfFit
        Per joint; empty without repetitions.
    dependences : tuple of Dependence
        What the remainder depends on, ranked.
    unexplained : Unexplained or None
    small : tuple of float
        What is too small on each joint to be called a remainder, where one is significant; 0 elsewhere. N m or N.
    repeating : frozenset of str
        Joints on which more repeats than noise, however small beside the torque, of however few moments or frequencies.
    demoted : tuple of Decision
        On effects that were found and are not believed, with why.
    suspected : tuple of Decision
        On what would be let in beside those that are, did the recordings hold enough of it, with why it is not.
    """

    search: Search
    after: Estimate
    training: Observations
    residuals: Residuals
    fit_before: tuple[LackOfFit, ...]
    fit_after: tuple[LackOfFit, ...]
    dependences: tuple[Dependence, ...]
    unexplained: Unexplained | None
    small: tuple[float, ...]
    repeating: frozenset[str]
    demoted: tuple[Decision, ...] = ()
    suspected: tuple[Decision, ...] = ()

    @cached_property
    def hinted(self) -> Sequence[Decision]:
        """What is suspected beside the effects that stayed, asked for more than once."""
        return suspected(self.search, self.after.weights)


def select_model(task: SearchTask, observations: Observations, *, free: bool) -> Outcome:
    """Search for what a model lacks in the band where that can be told.

    Parameters
    ----------
    task : SearchTask
    observations : Observations
        Of the base model, in the bands to begin with.
    free : bool
        Whether another band may be chosen.
    """
    criteria = task.criteria
    data = observations.data
    columns = CandidateColumns(observations)
    now, left = first(task.progress)
    found, looked = search(replace(task, progress=now), columns), False
    for _ in range(criteria.most_widenings if free else 0):
        left("choosing the band again")
        # What was missing had hidden how far up the motion explains the torque, and other effects with it.
        explains = max(choose_bands(found.model, found.data).bands) if found.chosen else 0.0
        asked = _asked_band(found)
        promised = max(asked, _promised_band(found, criteria))
        if not looked and max(explains, promised) < criteria.wider * _widest(found.data):
            looked, promised = True, _band_beyond(task, found)
        wider = max(explains, promised)
        if wider < criteria.wider * _widest(found.data):
            break
        more = CandidateColumns(observe(task.model, data.at((wider,) * len(data.bands))))
        now, left = next_of(left)
        again = search(replace(task, progress=now), more, known=found)
        told = asked >= criteria.wider * _widest(found.data) and _asked_band(again) > 0.0
        if promised > explains and not told and not _new(again, found):
            # The motion says less of what is so far up, and there is nothing.
            break
        columns, found = more, again
    left("testing what is left")
    return _without_proxies(replace(task, progress=left), columns, _outcome(task, found))


def _promised_band(found: Search, criteria: SelectionCriteria) -> float:
    """Return the band that would tell effects that are not in the model and may be there, Hz; 0 where there are none."""
    chosen = {item.label(found.scene) for item in found.chosen}
    promising = [
        item
        for item in found.decisions
        if item.label not in chosen
        and item.candidate.effect.band(item.candidate.member) > 0.0
        and more_than_chance(item, found.tried, criteria)
        # A grid point loses the rest.
        and item.gain >= criteria.near_best * criteria.least_gain
        and hopeless(item.candidate, item.examination, found.scene, criteria) is None
    ]
    if not promising:
        return 0.0
    # What chance would not do says better where the band has to reach.
    best = max(promising, key=lambda item: (item.examination.p_value * found.tried <= 1.0, item.gain)).candidate
    return _within(best.effect.band(best.member), found)


def _band_beyond(task: SearchTask, found: Search) -> float:
    """Return a band beyond that tells effects that this one does not, Hz; 0 where nothing is seen of them there.

    Below a resonance little tells of it, and where it begins the model without it explains no torque: the band ends.
    """
    band = _within(task.criteria.beyond * _widest(found.data), found)
    if band < task.criteria.wider * _widest(found.data):
        return 0.0
    # One repetition of each motion shows what is large enough.
    columns = CandidateColumns(observe(task.model, sample(found.data.at((band,) * len(found.bands)))))
    value, weights = told_value_and_weights(columns.observations)
    scene = replace(scene_of(task.model, value, columns.observations), armatures=found.scene.armatures)
    members = [Candidate(effect, item) for effect in task.catalogue for item in effect.members(scene)]
    # What the band at hand holds was tried there.
    needing = [item for item in members if item.effect.band(item.member) > _widest(found.data)]
    step = SelectionStep(scene, columns, found.chosen, weights, found.tried + len(needing), task.criteria)
    # The band was left where the motion explains less than half: so much of what is seen further up must be this effect.
    seen = [item for item in step.judge(needing) if item.accepted and item.gain >= task.criteria.near_best * EXPLAINED]
    fitted = [(own, item) for own, item in fitted_beside(step, seen, 0.0, None) if item.accepted]
    if not fitted:
        return 0.0
    own, best = max(fitted, key=lambda pair: pair[1].gain)
    if best.gain < EXPLAINED or noise_objection(own, best) is not None:
        return 0.0
    return _within(best.candidate.effect.band(best.candidate.member), found)


def _asked_band(found: Search) -> float:
    """Return the band that tells the effects in the model from others, Hz; 0 where none asks for one."""
    return _within(max((item.effect.band(item.member) for item in found.chosen), default=0.0), found)


def _within(band: float, found: Search) -> float:
    return min(band, HIGHEST_BAND * min(part.rate for part in found.data.stretches))


def _new(found: Search, before: Search) -> bool:
    """Whether effects that need a wide band were found that were not before."""
    labels = {item.label(before.scene) for item in before.chosen}
    return any(item.effect.band(item.member) > 0.0 and item.label(found.scene) not in labels for item in found.chosen)


def _outcome(task: SearchTask, found: Search) -> Outcome:
    """Say what a search leaves."""
    training = observed_at_every_sample(found.step)
    before = found.uncorrected.residuals(found.start.value)
    after, left = found.start, before
    if training is not found.uncorrected:
        after = wls(training)
        left = training.residuals(after.value)
    joints, criteria = task.model.robot.joints, task.criteria
    least = dict.fromkeys(joints, criteria.remainder)
    least_share = dict.fromkeys(joints, criteria.least_remainder)
    if after.variation:
        # What a run differs by from the others is no remainder of the model; of second order something of it is left.
        deviations = after.variation.deviations(training, after.value)
        left = Residuals(left.data, tuple(a + b for a, b in zip(left.predicted, deviations, strict=True)))
        differing = after.variation.sizes(task.model.robot)
        least |= dict.fromkeys(differing, criteria.remainder_of_runs)
        least_share |= dict.fromkeys(differing, criteria.least_remainder_of_runs)
    fit_after, dependences = lack_of_fit(left), screen(task.model, left, criteria)
    # What is spread evenly over frequency is no motion's doing even where it repeats: an encoder's steps do, and what a
    # controller makes of them.
    coloured = dict(zip(joints, coloured_shares(left).tolist(), strict=True))
    above = [fit for fit in fit_after if _above_noise(fit, criteria)]
    repeating = [fit for fit in above if fit.p_value < criteria.significant]
    depending = [
        item for item in dependences if item.p_value < criteria.significant and item.explained > least[item.joint]
    ]
    made, small = np.zeros(len(joints)), np.zeros(len(joints))
    if depending or any(fit.p_value < criteria.significant for fit in fit_after):
        # What the positions' noise does to the columns may repeat too; and what is small beside the torque is not called one.
        torque = [item.torque_rms if item.rows else 0.0 for item in training.by_joint]
        made = noise_torque(training, after.value)
        small = np.maximum(made, np.array(list(least_share.values())) * torque)
    least_rms, of_positions = (dict(zip(joints, each.tolist(), strict=True)) for each in (small, made))
    repeating = [
        fit
        for fit in repeating
        if fit.missing > least_rms[fit.joint]
        and (
            coloured[fit.joint] > criteria.colour_of_remainder
            or fit.missing > criteria.far_above_noise * max(fit.noise, of_positions[fit.joint])
        )
    ]
    depending = [item for item in depending if item.rms > least_rms[item.joint]]
    unexplained = _unexplained(repeating, depending, criteria)
    # An effect may stand for that all the same.
    names = frozenset(
        fit.joint for fit in above if coloured[fit.joint] > criteria.least_colour or fit.p_value < criteria.significant
    )
    fit_before = fit_after if left is before else lack_of_fit(before)
    return Outcome(
        found, after, training, left, fit_before, fit_after, dependences, unexplained, tuple(small.tolist()), names
    )


def _unexplained(
    repeating: Sequence[LackOfFit], depending: Sequence[Dependence], criteria: SelectionCriteria
) -> Unexplained | None:
    """Return the remainder on the joint that shows it most."""
    if depending:
        top = depending[0]
        # A pair must say clearly more than its better half.
        for other in depending[1:]:
            if (
                other.joint == top.joint
                and len(other.signals) == 1
                and other.explained > criteria.alone * top.explained
            ):
                top = other
                break
        return Unexplained(top.joint, top.signals, top.rms, top.explained)
    if repeating:
        return Unexplained(repeating[0].joint, (), repeating[0].missing, 0.0)
    return None


def _above_noise(fit: LackOfFit, criteria: SelectionCriteria) -> bool:
    return fit.missing > criteria.remainder_to_noise * fit.noise


def _widest(data: PreparedData) -> float:
    return max(band or np.inf for band in data.bands)


def _without_proxies(task: SearchTask, columns: CandidateColumns, found: Outcome) -> Outcome:
    """Search again without effects that stand for another, or for none."""
    demoted: dict[str, Decision] = {}
    left = task.progress
    for _ in range(task.criteria.most_demotions):
        proxies = [*_proxies(found, task.criteria), *_unstable(found, tuple(demoted.values()))]
        if not proxies:
            break
        demoted |= {item.label: item for item in reversed(proxies)}
        now, left = next_of(left)
        again = search(replace(task, progress=now), columns, without=tuple(demoted), known=found.search)
        found = _outcome(task, again)
    else:
        # No further search, but nothing is believed that does not stand.
        while unstable := _unstable(found, tuple(demoted.values())):
            demoted |= {item.label: item for item in unstable}
            found = _outcome(task, found.search.without([item.label for item in unstable]))
    short = [item.refused(TOO_LITTLE.format(item)) for item in found.hinted]
    return replace(found, demoted=tuple(demoted.values()), suspected=tuple(short))


def _unstable(found: Outcome, demoted: Sequence[Decision]) -> list[Decision]:
    search, weights = found.search, found.after.weights
    return [
        *unsettled(search, weights),
        *superfluous(search, weights, found.hinted),
        *outdone(search, weights, demoted),
    ]


def _proxies(found: Outcome, criteria: SelectionCriteria) -> list[Decision]:
    """Return the decisions on effects that remove little of a remainder most of which stays, with why."""
    # Not to believe an effect less is asked than to say that something is left: it may stand for what is too small, too.
    left = found.repeating | ({found.unexplained.joint} if found.unexplained else set())
    if not left or not found.fit_after:
        return []
    search = found.search
    joints = search.base.robot.joints
    noise = {fit.joint: fit.noise for fit in found.fit_after}
    # What runs differ by does not repeat, however much of the residual it is.
    variation = found.after.variation
    varied = np.zeros(len(joints)) if variation is None else variation.mean_squares(found.training.joints)
    own = dict(zip(joints, varied.tolist(), strict=True))
    # What the noise of the positions makes does repeat; on joints where nothing else does, no effect need remove it.
    made = dict(zip(joints, noise_torque(found.training, found.after.value).tolist(), strict=True))
    of_positions = {
        fit.joint: made[fit.joint]
        for fit in found.fit_after
        if fit.joint in left and 0.0 < fit.missing <= made[fit.joint]
    }
    proxies = []
    before, whole = rms_of(search.start.value, search.uncorrected), rms_of(found.after.value, found.training)
    labels = [item.label(search.scene) for item in search.chosen]
    for step in search.steps:
        after, decision = step.rms, step.decision
        old_rms, new_rms = before, after
        if decision.label in labels:
            # Beside all others, of which those that came later may have removed what was left when it came in.
            fitted = observed(search.step.without(labels.index(decision.label)))
            old_rms, new_rms = rms_of(value_and_weights(fitted)[0], fitted), whole
        elif decision.candidate.corrects_data:
            fitted = observed(replace(search.step, columns=search.step.columns.beside(search.uncorrected)))
            old_rms, new_rms = rms_of(value_and_weights(fitted)[0], fitted), whole
        owner = decision.candidate.joint(search.scene)
        repeats = beyond = removed = 0.0
        for joint, old, new in zip(joints, old_rms, new_rms, strict=True):
            if joint in noise and owner in (joint, None) and old is not None and new is not None:
                most = (old**2 - own[joint]) / noise[joint] ** 2 - 1.0
                repeats += max(0.0, most)
                beyond += max(0.0, most - (of_positions.get(joint, 0.0) / noise[joint]) ** 2)
                removed += (old**2 - new**2) / noise[joint] ** 2
        before = after
        short = removed < criteria.least_of_repeatable * repeats
        excused = short and owner in of_positions and removed >= criteria.least_of_repeatable * beyond
        if (owner is None or owner in left) and short and not (excused and decision.label in labels):
            share = max(0.0, removed / repeats)
            why = f"it would remove {share:.0%} of what repeats, and most of the rest stays unexplained"
            proxies.append(decision.refused(why))
        elif decision.label in labels and (excused or (found.unexplained and owner in (None, found.unexplained.joint))):
            # Repetitions of a motion prove no more than one run of it.
            place = labels.index(decision.label)
            p_value = examine_moments(search.step.without(place), search.chosen[place]).p_value
            if p_value * search.tried > criteria.family_error:
                why = f"what is left repeats: with repetitions of a motion counted once p = {p_value:.1e}"
                proxies.append(decision.refused(why))
    return proxies


def rms_of(value: Array, observations: Observations) -> tuple[float | None, ...]:
    """Return the rms of each joint over recordings, within the band; None without rows."""
    return tuple(item.rms(value) if item.rows else None for item in observations.by_joint)
