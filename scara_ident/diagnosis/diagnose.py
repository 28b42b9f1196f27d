"""The whole story: what the residual lacks, what it is traced to, and the error before and after."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from scara_ident.arrays import Array
from scara_ident.diagnosis.audit import left_open
from scara_ident.diagnosis.candidates import CandidateColumns, columns_at_hand
from scara_ident.diagnosis.correction import corrected
from scara_ident.diagnosis.criteria import CRITERIA, SelectionCriteria
from scara_ident.diagnosis.effect_parameters import PhysicalParameters, RotorInertia, physical_parameters
from scara_ident.diagnosis.even_evidence import even_evidence
from scara_ident.diagnosis.evidence import Evidence, evidence, held_out_evidence, unsure_of_others
from scara_ident.diagnosis.found_effect import (
    FoundEffect,
    direct_readings,
    found_effects,
    not_found,
    uncounted_correction,
)
from scara_ident.diagnosis.held_out_gain import held_out_gains, spoken_against
from scara_ident.diagnosis.held_out_states import HeldOut, held_out_states
from scara_ident.diagnosis.lack_of_fit import LackOfFit
from scara_ident.diagnosis.model_selection import Outcome, Unexplained, rms_of, select_model
from scara_ident.diagnosis.screening import Dependence
from scara_ident.diagnosis.search import Search, SearchTask
from scara_ident.diagnosis.selection_step import observed_at_every_sample
from scara_ident.diagnosis.tentative import TentativeEffect, tentative_effects
from scara_ident.diagnosis.work import first, searching
from scara_ident.effects import Effect, EffectTerm
from scara_ident.effects.aliases import Alias, aliases
from scara_ident.effects.catalogue import available_effects
from scara_ident.errors import RecordingError, UsageError
from scara_ident.estimation import Estimate
from scara_ident.estimation.another_run import of_another_run
from scara_ident.estimation.noise_bias import noise_signals
from scara_ident.estimation.observations import Observations, observe
from scara_ident.estimation.robust import robust_fit
from scara_ident.identification.arguments import Recordings, model_of, recordings_of
from scara_ident.identification.channel_check import channel_faults
from scara_ident.identification.clock_check import clock_drift
from scara_ident.identification.events import Event, find_events, same_events, without_events
from scara_ident.identification.identify import check_bands, check_held_out
from scara_ident.identification.recording_check import held_out_events, own_uncertainty, without_stretches
from scara_ident.identification.usable import check_rows, usable_in_bands, with_rows
from scara_ident.manners import Saved
from scara_ident.model.model import TorqueModel
from scara_ident.progress import Tell, Work, log_notes, silent
from scara_ident.robot.robot import Robot
from scara_ident.threads import one_blas_thread

Verdict = Literal["complete", "explained", "unexplained", "undecided"]
_LOG = logging.getLogger(__name__)
# Dependences that are handed on: further ones are pairs that only repeat the first.
NAMED_DEPENDENCES = 12


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis(Saved, told_by="diagnosis"):
    """What `diagnose` found.

    Attributes
    ----------
    verdict : {"complete", "explained", "unexplained", "undecided"}
        ``undecided``: what is left was not shown to be noise on every joint, nor to be anything else.
    search : Search
        Every candidate tried, with its statistics.
    before, after : Estimate
        The base model, and the model with the effects found.
    training_before, training_after, validation_before, validation_after : Observations
    fit_before, fit_after : tuple of LackOfFit
        Per joint; empty without repetitions.
    effects : tuple of FoundEffect
        Believed, and in the model.
    tentative : tuple of TentativeEffect
        Worth a look, and not in it.
    evidence : tuple of Evidence
        Per joint, whether what is left was shown to be noise.
    aliases : tuple of Alias
        Effects that the model absorbs on any data.
    unexplained : Unexplained or None
    dependences : tuple of Dependence
        What the remainder depends on, ranked.
    notes : tuple of str
    rotors : tuple of RotorInertia
        Behind the gears that found effects depend on.
    events : tuple of Event
        What is local in time: left out of every fit, or in recordings that were held out.
    bands_given : bool
        Whether somebody chose the bands, so that further recordings do not widen them.
    """

    verdict: Verdict
    search: Search
    before: Estimate
    after: Estimate
    training_before: Observations
    training_after: Observations
    validation_before: Observations
    validation_after: Observations
    fit_before: tuple[LackOfFit, ...]
    fit_after: tuple[LackOfFit, ...]
    effects: tuple[FoundEffect, ...]
    tentative: tuple[TentativeEffect, ...]
    evidence: tuple[Evidence, ...]
    aliases: tuple[Alias, ...]
    unexplained: Unexplained | None
    dependences: tuple[Dependence, ...]
    notes: tuple[str, ...]
    rotors: tuple[RotorInertia, ...] = ()
    events: tuple[Event, ...] = ()
    bands_given: bool = False

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self.before.model.robot

    def predict(self, q: ArrayLike, v: ArrayLike, a: ArrayLike) -> Array:
        """Predict the recorded torque with the effects found that follow from the state, see `not_predicted`.

        Parameters
        ----------
        q, v, a : array_like, shape (n,) or (N, n)
            Position, velocity and acceleration in rad or m, per s and s^2; joints in the robot's order.

        Returns
        -------
        ndarray, shape (n,) or (N, n)
            N m (N), on the side of the gear where effort is recorded.

        Raises
        ------
        UsageError
            If the shapes are not these.
        """
        return self.after.predict(q, v, a)

    @property
    def not_predicted(self) -> tuple[str, ...]:
        """Effects found that `predict` leaves out: they take more than a state, or were taken out of the recordings."""
        within = {(term.name, term.joint) for term in self.after.model.terms if isinstance(term, EffectTerm)}
        corrected = [item for item in self.effects if (item.effect, item.joint) not in within]
        return (*self.after.prediction.left_out, *(item.label for item in corrected))

    def _in_short(self) -> str:
        return f"{self.robot.name}: {', '.join((self.verdict, *(item.label for item in self.effects)))}"


# Matrices are small throughout: a second BLAS thread waits more than it works.
@one_blas_thread()
def diagnose(
    robot: Robot,
    recordings: Recordings,
    *,
    model: str | TorqueModel = "complete",
    validation: Recordings = (),
    unloaded: Sequence[str] = (),
    bands: Sequence[float | None] | None = None,
    catalogue: Sequence[Effect] | None = None,
    criteria: SelectionCriteria = CRITERIA,
    progress: Tell = silent,
) -> Diagnosis:
    """Find what a model lacks, trace it to a physical effect, add it, and report before and after.

    Parameters
    ----------
    robot : Robot
    recordings : sequence of Recording, or of path
        Every choice is made on these.
    model : str or TorqueModel, optional
        The base model, as in `identify`.
    validation : sequence of Recording, or of path, optional
        Recordings that no choice sees; they are only predicted, before and after. Where an effect was found that acts in
        some recordings only, the first third of each tells whether it acts there, and errors are of the rest.
    unloaded : sequence of str, optional
        Names of those of ``recordings`` that are known to be without payload.
    bands : sequence of float or None, one per joint, optional
        Low-pass on both sides; by default the widest band that any joint's data allow, for all joints.
    catalogue : sequence of Effect, optional
        Families to try, by default all that are built in or installed; a user's own can be among them.
    criteria : SelectionCriteria, optional
        When an effect is believed.
    progress : callable, optional
        Called with every step that begins and the share of the work done before it.

    Returns
    -------
    Diagnosis

    Raises
    ------
    UsageError
        If a recording is both fitted and held out, one named as unloaded is not among those to fit, or a band is no
        frequency that the slowest recording carries.
    RecordingError
        If none of the recordings can be used, or they have fewer rows than the model has parameters (one of several that
        cannot be used is left out with a note), or channels are not what the mapping says (see `channel_faults`).

    Examples
    --------
    >>> from scara_ident import diagnose, load_robot, named_motion, simulate, virtual_arm
    >>> robot = load_robot()
    >>> arm, motion = virtual_arm(robot), named_motion("OJD", robot)
    >>> runs = [simulate(arm, motion, rate=250.0, repetition=k).recording for k in (1, 2)]
    >>> found = diagnose(robot, runs, bands=[20.0, 20.0], catalogue=())
    >>> found.effects, found.not_predicted
    ((), ())
    """
    work = Work(progress)
    recordings, validation = recordings_of(recordings, robot), recordings_of(validation, robot, "validation")
    check_held_out(recordings, validation)
    strange = sorted({*unloaded} - {item.name for item in recordings})
    if strange:
        raise UsageError(
            f"{strange[0]}: named as unloaded, but not among the recordings to diagnose; give it there too"
        )
    if bands is not None:
        check_bands(robot, bands, (*recordings, *validation))
    base = model_of(model, robot)
    given = bands is not None
    if not given:
        work("choosing the band")
    data, held_out, notes = usable_in_bands(base, recordings, validation, bands, alike=True)
    observations = observe(base, data)
    check_rows(observations)
    faults = channel_faults(observations)
    if faults:
        raise RecordingError("; ".join(str(fault) for fault in faults))
    notes[:0] = robot.notes
    known = frozenset(unloaded)
    families = tuple(item.knowing(known) for item in (available_effects() if catalogue is None else catalogue))
    task = SearchTask(base, families, criteria, searching(work, band_given=given))
    outcome, events = _without_events(task, observations, free=not given)
    work("comparing what was found with what else it could be", task.progress.stop)
    found, after = outcome.search, outcome.after
    step = replace(found.step, weights=after.weights)
    held_out, useless = with_rows(held_out.at(found.bands), needed=False)
    notes += [note for note in useless if note not in notes]
    held = held_out_states(found, after.value, after.weights, held_out)
    notes += held.notes
    validation_before = observe(base, held.data)
    validation_after = _with_effects(found, held, validation_before)
    gains = held_out_gains(found, after, validation_after, validation_before)
    whole = found.whole(step)
    parameters = physical_parameters(whole) if whole.chosen else PhysicalParameters((), (), ())
    readings = direct_readings(found, families, criteria.rotor_inertia_std)
    effects = found_effects(found, step, parameters, readings, gains)
    notes += not_found(readings, effects)
    refused = (*outcome.demoted, *outcome.suspected)
    notes += [f"{item.label} is not counted: {item.why}" for item in refused]
    drift = clock_drift(after.value, outcome.training)
    notes += [] if drift is None else [drift]
    left = outcome.unexplained
    if left is not None and robot.reduction[robot.joints.index(left.joint)] == 1.0:
        notes.append(
            f"{left.joint}: no reduction is stated, and of a motor behind a gear or a screw no ripple is looked for; "
            "state it in robot.yaml"
        )
    if after.variation is not None:
        notes += after.variation.sentences(robot, None if left is None else left.joint)
    uncounted = uncounted_correction(found, parameters)
    if uncounted is not None:
        notes.append(f"{uncounted}; corrected in the data, not counted as an effect")
    in_held_out = held_out_events(after.value, outcome.training, validation_after)
    unsure = unsure_of_others(after, validation_after)
    apart = np.zeros(robot.n)
    if after.variation is not None:
        apart = of_another_run(after.variation, validation_after, after.value)
    in_held_out = tuple(own_uncertainty(event, dict(zip(robot.joints, unsure, strict=True))) for event in in_held_out)
    # Where something stays unexplained that is why a whole recording is, and no event.
    in_held_out = tuple(
        event
        for event in in_held_out
        if event.kind != "unknown" or np.isfinite(event.score) or outcome.unexplained is None
    )
    events += in_held_out
    notes += [event.sentence(robot) for event in events]
    log_notes(_LOG, notes)
    undisturbed = without_stretches(validation_after, in_held_out)
    doubtful = (*outcome.suspected, *left_open(found, after.weights, outcome.demoted))
    made = partial(noise_signals, outcome.training, after.value)
    shown = evidence(found, outcome.residuals, outcome.fit_after, outcome.small, doubtful, criteria, made)
    shown = held_out_evidence(
        even_evidence(shown, after, outcome.training, criteria),
        rms_of(after.value, outcome.training),
        rms_of(after.value, undisturbed),
        unsure,
        apart,
        criteria,
    )
    told = {item.label: item.held_out for item in effects if item.held_out is not None}
    shown = spoken_against(shown, told, criteria)
    verdict = _verdict(outcome.unexplained is not None, bool(effects), shown)
    return Diagnosis(
        verdict,
        found,
        found.start,
        after,
        found.uncorrected,
        outcome.training,
        validation_before,
        validation_after,
        outcome.fit_before,
        outcome.fit_after,
        tuple(effects),
        tentative_effects(found, refused, {(item.effect, item.joint) for item in effects}),
        shown,
        aliases(base),
        outcome.unexplained,
        outcome.dependences[:NAMED_DEPENDENCES],
        tuple(notes),
        parameters.rotors,
        events,
        given,
    )


def _without_events(task: SearchTask, observations: Observations, *, free: bool) -> tuple[Outcome, tuple[Event, ...]]:
    """Search without what is local in time, and again if with the effects found that is something else."""
    events = find_events(observations, robust_fit(observations).value)
    now, left = first(task.progress)
    outcome = select_model(replace(task, progress=now), without_events(observations, events), free=free)
    if outcome.training is observations:
        return outcome, events
    remaining = find_events(outcome.training, robust_fit(outcome.training).value)
    if same_events(events, remaining):
        return outcome, events
    left("searching again without what is local in time")
    return select_model(replace(task, progress=left), without_events(observations, remaining), free=free), remaining


def _verdict(unexplained: bool, found: bool, shown: Sequence[Evidence]) -> Verdict:
    if unexplained:
        return "unexplained"
    if not all(item.shown for item in shown):
        return "undecided"
    return "explained" if found else "complete"


def _with_effects(found: Search, held: HeldOut, before: Observations) -> Observations:
    """Return held-out observations, corrected as the training ones were, with the effects found."""
    if not before.data.recordings:
        return replace(before, model=found.model)
    if found.correction is not None:
        data = corrected(before.data, found.correction.candidate, found.correction.value)
        before = before.with_torque(data)
    scene = replace(held.scene, columns=columns_at_hand(before))
    step = replace(found.step, scene=scene, columns=CandidateColumns(before), chosen=held.chosen)
    return observed_at_every_sample(step)
