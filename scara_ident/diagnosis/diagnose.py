"""The diagnosis as a whole: what the residual contains, which effect it is traced to, and the error before and after."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace

from numpy.typing import ArrayLike

from scara_ident.arrays import Array
from scara_ident.diagnosis.criteria import CRITERIA, SelectionCriteria
from scara_ident.diagnosis.evidence.evidence import Evidence
from scara_ident.diagnosis.evidence.outcome import Outcome, Unexplained, with_parameters
from scara_ident.diagnosis.evidence.standing_lines import standing_lines, tentative_lines
from scara_ident.diagnosis.fitting.effect_parameters import PhysicalParameters, RotorInertia, physical_parameters
from scara_ident.diagnosis.found_effect import (
    FoundEffect,
    direct_readings,
    found_effects,
    not_found,
    uncounted_correction,
)
from scara_ident.diagnosis.held_out.validation import Validation, validated
from scara_ident.diagnosis.model_selection import below_position_noise, select_model
from scara_ident.diagnosis.selection.confounding import confounders
from scara_ident.diagnosis.selection.interval_events import not_explained
from scara_ident.diagnosis.selection.search import Search, SearchTask
from scara_ident.diagnosis.selection.tentative import TentativeEffect, tentative_effects
from scara_ident.diagnosis.testing.lack_of_fit import LackOfFit
from scara_ident.diagnosis.testing.screening import Dependence
from scara_ident.diagnosis.verdict import Verdict, verdict_of, weighed_evidence
from scara_ident.diagnosis.whole_estimate import with_whole_estimate
from scara_ident.diagnosis.work import first, searching
from scara_ident.effects import Effect, EffectTerm
from scara_ident.effects.aliases import Alias, aliases
from scara_ident.effects.catalogue import CATALOGUE, available_effects
from scara_ident.errors import ArgumentError, RecordingError, UsageError
from scara_ident.estimation import Estimate
from scara_ident.estimation.observations import Observations, observe
from scara_ident.estimation.robust import robust_fit
from scara_ident.identification.arguments import Recordings, model_of, recordings_of
from scara_ident.identification.channel_check import channel_faults
from scara_ident.identification.clock_check import clock_drift
from scara_ident.identification.events import Event, find_events, same_events, without_events
from scara_ident.identification.gain_check import gain_said
from scara_ident.identification.identify import check_bands, check_held_out
from scara_ident.identification.usable import check_rows, usable_in_bands, with_rows
from scara_ident.manners import Saved
from scara_ident.model.model import TorqueModel
from scara_ident.motion.prepared import PreparedData
from scara_ident.progress import Tell, Work, log_notes, silent
from scara_ident.robot.robot import Robot
from scara_ident.threads import one_blas_thread

_LOG = logging.getLogger(__name__)
# Number of dependences in the result: further ones are pairs that only repeat the first.
NAMED_DEPENDENCES = 12
# Note if effects are estimated in a lower band than they were found in.
QUIETER = "all parameters are estimated below {:.2g} Hz: up to {:.2g} Hz, the band of the search, the noise of the positions biases them by more than chance"


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis(Saved, reported_by="diagnosis"):
    """What `diagnose` found.

    Attributes
    ----------
    verdict : {"complete", "explained", "unexplained", "undecided"}
        ``undecided``: the residual was neither shown to be noise on every joint nor shown to be something else.
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
        Per joint, whether the residual was shown to be noise.
    aliases : tuple of Alias
        Effects that the model absorbs on any data.
    unexplained : Unexplained or None
    dependences : tuple of Dependence
        What the remainder depends on, ranked.
    notes : tuple of str
    rotors : tuple of RotorInertia
        Rotors behind the gears that the effects found depend on.
    events : tuple of Event
        What happens in a part of the time: left out of every fit, or in held-out recordings.
    bands_given : bool
        Whether the user chose the bands; further recordings then do not widen them.
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
        """Effects found that `predict` leaves out: they need more than a state, or were corrected in the recordings."""
        within = {(term.name, term.joint) for term in self.after.model.terms if isinstance(term, EffectTerm)}
        corrected = [item for item in self.effects if (item.effect, item.joint) not in within]
        return (*self.after.prediction.left_out, *(item.label for item in corrected))

    def _in_short(self) -> str:
        return f"{self.robot.name}: {', '.join((self.verdict, *(item.label for item in self.effects)))}"


# All matrices are small: a second BLAS thread would mostly wait.
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
        Training recordings; every choice is made on these.
    model : str or TorqueModel, optional
        The base model, as in `identify`.
    validation : sequence of Recording, or of path, optional
        Held-out recordings, which no choice uses; they are only predicted, without and with the effects. If an effect
        acts in some recordings only, the first third of each held-out recording shows whether it acts there, and errors
        are of the rest.
    unloaded : sequence of str, optional
        Names of those of ``recordings`` that are known to be without payload.
    bands : sequence of float or None, one per joint, optional
        Low-pass of both sides; default: the widest band that any joint's data allow, for all joints.
    catalogue : sequence of Effect, optional
        Families to try; default: all that are built in or installed. It may contain your own effects.
    criteria : SelectionCriteria, optional
        Criteria for believing an effect.
    progress : callable, optional
        Called at the begin of every step with its name and the share of the work done.

    Returns
    -------
    Diagnosis

    Raises
    ------
    UsageError
        If a recording is both fitted and held out, one named as unloaded is not among the training recordings, a band
        is not positive or above half of the slowest sample rate, or the catalogue contains something that is no effect.
    RecordingError
        If none of the recordings can be used, or they have fewer rows than the model has parameters (one of several that
        cannot be used is left out with a note), or channels are not what the mapping says (see `channel_faults`).
    ScaraIdentError
        If an effect of a given ``catalogue`` has no finite columns on a joint; an effect of the default catalogue is
        left out with a note.

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
    if isinstance(catalogue, str):
        raise ArgumentError(f"catalogue: expected effects; found a word: give effects_named({catalogue!r})")
    families = available_effects() if catalogue is None else tuple(catalogue)
    other = next((item for item in families if not isinstance(item, Effect)), None)
    if other is not None:
        raise ArgumentError(f"catalogue: expected effects, as effects_named gives; found {other!r}")
    given = bands is not None
    if not given:
        work("choosing the band")
    data, held_out, notes = usable_in_bands(base, recordings, validation, bands, alike=True, held=True)
    observations = observe(base, data)
    check_rows(observations)
    faults = channel_faults(observations)
    if faults:
        raise RecordingError("; ".join(str(fault) for fault in faults))
    gain = gain_said(observations)
    notes[:0] = (*robot.notes, *base.notes, *([] if gain is None else [gain]))
    known = frozenset(unloaded)
    families = tuple(item.knowing(known) for item in families)
    # A catalogue with everything that is built in is not a request for single effects.
    chosen = catalogue is not None and not set(CATALOGUE) <= set(catalogue)
    task = SearchTask(base, families, criteria, searching(work, band_given=given), chosen)
    outcome, events = _without_events(task, observations, free=not given)
    reported = outcome if given else below_position_noise(task, outcome)
    elsewhere = reported is not outcome
    work("comparing the effects found with their alternatives", task.progress.stop)
    reported = with_parameters(reported)
    found, parameters = reported.search, reported.parameters
    assert parameters is not None
    step = replace(found.step, weights=reported.after.weights)
    groups = confounders(step, found.decisions, found.first, found.doubtful) if found.chosen else []
    final = reported if parameters.linear is None else with_whole_estimate(reported, parameters.linear)
    rows, useless = with_rows(held_out.at(found.bands), found.scene.robot, needed=False)
    held = validated(final, rows)
    # Effects beyond the model keep their values and their bands.
    final = replace(final, search=found)
    searched, seen = _where_searched(outcome, held_out) if elsewhere else (final, held)
    readings = direct_readings(found, families, criteria.rotor_inertia_std)
    effects = found_effects(found, groups, parameters, readings, held.gains)
    refused = (*outcome.demoted, *outcome.suspected)
    events += held.events
    notes += [note for note in (*useless, *held.notes) if note not in notes]
    notes += not_found(readings, effects)
    notes += [f"{item.label} is not counted: {item.why}" for item in refused]
    if elsewhere:
        notes.append(QUIETER.format(found.scene.band, searched.search.scene.band))
    notes += _remarks(final, parameters)
    notes += [event.sentence(robot) for event in events]
    log_notes(_LOG, notes)
    # If an unexplained remainder is known, evidence adds nothing on it.
    lines = (None,) * robot.n if final.unexplained is not None else standing_lines(searched.residuals, criteria)
    shown = weighed_evidence(searched, seen, effects, lines, criteria)
    believed = {(item.effect, item.joint) for item in effects}
    tentative = tentative_effects(found, refused, believed)
    named = believed | {(item.effect, item.joint) for item in tentative}
    # A result is kept longer than caches.
    found.step.lean()
    return Diagnosis(
        verdict_of(final, effects, shown),
        found,
        found.start,
        final.after,
        found.uncorrected,
        final.training,
        held.before,
        held.after,
        final.fit_before,
        final.fit_after,
        tuple(effects),
        (*tentative, *tentative_lines(lines, searched.search, families, named)),
        shown,
        aliases(base),
        final.unexplained,
        final.dependences[:NAMED_DEPENDENCES],
        tuple(notes),
        parameters.rotors,
        events,
        given,
    )


def _where_searched(outcome: Outcome, held_out: PreparedData) -> tuple[Outcome, Validation]:
    """Return an outcome that was estimated in other bands, at the estimate in its own bands, and what held-out recordings show of it.

    Whether the residual is noise is tested in the band that shows most of it, with the estimate that leaves least
    there.
    """
    linear = physical_parameters(outcome.whole).linear
    assert linear is not None
    final = with_whole_estimate(outcome, linear)
    held = validated(final, with_rows(held_out.at(outcome.search.bands), outcome.search.scene.robot, needed=False)[0])
    return replace(final, search=outcome.search), held


def _without_events(task: SearchTask, observations: Observations, *, free: bool) -> tuple[Outcome, tuple[Event, ...]]:
    """Search without the events, and again if the events change with the effects found."""
    events = not_explained(task, observations, find_events(observations, robust_fit(observations).value))
    now, left = first(task.progress)
    outcome = select_model(replace(task, progress=now), without_events(observations, events), free=free)
    if outcome.training is observations:
        return outcome, events
    remaining = find_events(outcome.training, robust_fit(outcome.training).value)
    if same_events(events, remaining):
        return outcome, events
    left("searching again without the events")
    return select_model(replace(task, progress=left), without_events(observations, remaining), free=free), remaining


def _remarks(outcome: Outcome, parameters: PhysicalParameters) -> list[str]:
    """Return further notes on a search and on its residual."""
    found, after, left = outcome.search, outcome.after, outcome.unexplained
    robot, notes = found.scene.robot, [*found.notes]
    drift = clock_drift(after.value, outcome.training)
    if drift is not None:
        notes.append(drift)
    if left is not None and robot.reduction[place := robot.joints.index(left.joint)] == 1.0:
        of_slide = (
            ", in motor rad per metre (of a linear motor 2 pi over its pole pitch)" if robot.prismatic[place] else ""
        )
        notes.append(
            f"{left.joint}: no reduction is stated, so a ripple of a motor behind a gear or a screw cannot be looked "
            f"for; state the reduction in robot.yaml{of_slide}"
        )
    elif left is not None and f"position of {left.joint}" in left.signals:
        criteria = found.step.criteria
        notes.append(
            f"{left.joint}: what repeats with the motor's angle is looked for from {criteria.lowest_order:g} to "
            f"{criteria.highest_order:g} periods per motor turn; the rest may lie outside this range, such as once per tooth of the gear's last stage"
        )
    if after.variation is not None:
        notes += after.variation.sentences(robot, None if left is None else left.joint)
    uncounted = uncounted_correction(found, parameters)
    if uncounted is not None:
        notes.append(f"{uncounted}; corrected in the data, not counted as an effect")
    return notes
