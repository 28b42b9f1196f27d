"""What a search leaves: whether it is noise, and on which joint the model still lacks something."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from scara_ident.diagnosis.checks.other_laws import parameters_of_laws
from scara_ident.diagnosis.criteria import SelectionCriteria
from scara_ident.diagnosis.evidence.evidence import coloured_shares
from scara_ident.diagnosis.fitting.effect_parameters import PhysicalParameters, size_in_stds
from scara_ident.diagnosis.selection.audit import suspected
from scara_ident.diagnosis.selection.search import Search, SearchTask
from scara_ident.diagnosis.testing.acceptance import Decision
from scara_ident.diagnosis.testing.lack_of_fit import LackOfFit, lack_of_fit
from scara_ident.diagnosis.testing.screening import Dependence, screen
from scara_ident.diagnosis.testing.selection_step import SelectionStep, observed_at_every_sample
from scara_ident.estimation import Estimate, wls
from scara_ident.estimation.assumed_variation import assumed_variation
from scara_ident.estimation.least_squares import value_and_weights
from scara_ident.estimation.noise_bias import largest_noise_torque
from scara_ident.estimation.observations import Observations
from scara_ident.estimation.residuals import Residuals
from scara_ident.estimation.run_variation import MIN_RUNS, RunVariation


@dataclass(frozen=True)
class Unexplained:
    """A repeatable remainder that no effect explains.

    Attributes
    ----------
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
    small : tuple of float
        What is too small on each joint to be called a remainder, where one is significant; 0 elsewhere. N m or N.
    of_positions : tuple of float
        What of it the noise of the positions may make.
    repeating : frozenset of str
        Joints on which more repeats than noise, however small beside the torque, of however few moments or frequencies.
    demoted : tuple of Decision
        On effects that were found and are not believed, with why.
    suspected : tuple of Decision
        On what would be let in beside those that are, did the recordings hold enough of it, with why it is not.
    parameters : PhysicalParameters or None
        Of the effects found and what was taken out of the data, as unsure as other laws and fits leave them; see `with_parameters`.
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
    of_positions: tuple[float, ...]
    repeating: frozenset[str]
    demoted: tuple[Decision, ...] = ()
    suspected: tuple[Decision, ...] = ()
    parameters: PhysicalParameters | None = None

    @property
    def whole(self) -> SelectionStep:
        """The step by which all parameters are estimated: with what was taken out of the data, and the last weights and offsets of runs."""
        return replace(
            self.search.whole(replace(self.search.step, weights=self.after.weights)), variation=self.after.offsets
        )

    @cached_property
    def hinted(self) -> Sequence[Decision]:
        """What is suspected beside the effects that stayed, asked for more than once."""
        return suspected(self.search, self.after.weights)


def with_parameters(found: Outcome) -> Outcome:
    """Return an outcome with the physical parameters of what was found."""
    if found.parameters is not None:
        return found
    whole = found.whole
    return replace(found, parameters=parameters_of_laws(whole) if whole.chosen else PhysicalParameters())


def undetermined(found: Outcome, criteria: SelectionCriteria) -> list[Decision]:
    """Return the decision on the effect whose size is the least determined of those that act together, with the reason; none if all are.

    Other fits of such effects explain as much: one that has no size by them all may only correct what the others, or what a
    correction of the data leaves, are taken for.

    Parameters
    ----------
    found : Outcome
        With its parameters.
    """
    step, parameters = replace(found.search.step, weights=found.after.weights), found.parameters
    assert parameters is not None
    sizes = {
        place: size_in_stds(item.effect, parameters.effects[place])
        for place, item in enumerate(step.chosen)
        if item.effect.together
    }
    place = min(sizes, key=lambda place: sizes[place], default=-1)
    if place < 0 or sizes[place] > criteria.min_size:
        return []
    (decision,) = step.without(place).judge([step.chosen[place]])
    return [decision.refused("by other fits that explain as much, its size is within its uncertainty")]


def _min_offsets(found: Search, training: Observations) -> RunVariation | None:
    """Return the offsets that runs differ by at least: two do not say, and what one of them alone carries takes them up."""
    runs = len(training.data.recordings)
    if runs >= MIN_RUNS or not any(item.effect.by_recording for item in found.chosen):
        return None
    return assumed_variation(training, training.joints, value_and_weights(training)[0]).offsets


def outcome_of(task: SearchTask, found: Search) -> Outcome:
    """Say what a search leaves."""
    training = observed_at_every_sample(found.step)
    before = found.uncorrected.residuals(found.start.value)
    after, left = found.start, before
    if training is not found.uncorrected:
        after = wls(training, least=_min_offsets(found, training))
        if found.chosen and (after.offsets or found.step.offsets):
            # With the effects in the model offsets of runs are others, or none.
            found = found.beside(after.offsets)
            training = observed_at_every_sample(found.step)
            after = wls(training, least=_min_offsets(found, training))
        left = training.residuals(after.value)
    joints, criteria = task.model.robot.joints, task.criteria
    least = dict.fromkeys(joints, criteria.remainder)
    min_share = dict.fromkeys(joints, criteria.min_remainder)
    if after.variation:
        # What a run differs by from the others is no remainder of the model; of second order something of it is left.
        off = after.variation.deviations(training, after.value)
        pairs = zip(training.predicted(after.value), off, strict=True)
        left = Residuals(training.data, tuple(torque + more for torque, more in pairs))
        differing = after.variation.sizes(task.model.robot)
        least |= dict.fromkeys(differing, criteria.remainder_of_runs)
        min_share |= dict.fromkeys(differing, criteria.min_remainder_of_runs)
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
        made = largest_noise_torque(training, after.value, criteria.significant / len(joints))
        small = np.maximum(made, np.array(list(min_share.values())) * torque)
    min_rms, of_positions = (dict(zip(joints, each.tolist(), strict=True)) for each in (small, made))
    # A force that nearly all goes with the position is neither a filter's nor an encoder's, though no effect of an arm is so.
    along = {
        item.candidate.joint(found.scene)
        for item in found.decisions
        if item.candidate.effect.of_position and item.as_no_arm >= criteria.nearly_all
    }
    repeating = [
        fit
        for fit in repeating
        if (fit.missing > of_positions[fit.joint] and fit.joint in along)
        or (
            fit.missing > min_rms[fit.joint]
            and (
                coloured[fit.joint] > criteria.colour_of_remainder
                or fit.missing > criteria.far_above_noise * max(fit.noise, of_positions[fit.joint])
            )
        )
    ]
    depending = [item for item in depending if item.rms > min_rms[item.joint]]
    unexplained = _unexplained(repeating, depending, criteria)
    # An effect may stand for that all the same.
    names = frozenset(
        fit.joint for fit in above if coloured[fit.joint] > criteria.min_colour or fit.p_value < criteria.significant
    )
    fit_before = fit_after if left is before else lack_of_fit(before)
    return Outcome(
        *(found, after, training, left, fit_before, fit_after, dependences, unexplained),
        *(tuple(small.tolist()), tuple(made.tolist()), names),
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
