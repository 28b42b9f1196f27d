"""Validation: the model on recordings that no choice has seen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from scara_ident.arrays import Array
from scara_ident.diagnosis.candidates.candidates import CandidateColumns, columns_at_hand
from scara_ident.diagnosis.evidence.evidence import unsure_of_others
from scara_ident.diagnosis.evidence.outcome import Outcome
from scara_ident.diagnosis.fitting.correction import corrected
from scara_ident.diagnosis.held_out.gain import HeldOutGain, held_out_gains
from scara_ident.diagnosis.held_out.states import HeldOut, held_out_states
from scara_ident.diagnosis.selection.search import Search
from scara_ident.diagnosis.testing.selection_step import observed_at_every_sample
from scara_ident.estimation.another_run import left_beside_own, of_another_run
from scara_ident.estimation.observations import Observations, observe
from scara_ident.estimation.student_t import widening
from scara_ident.identification.events import Event
from scara_ident.identification.recording_check import held_out_events, own_uncertainty, quiet_blocks
from scara_ident.motion.prepared import PreparedData


@dataclass(frozen=True, eq=False)
class Validation:
    """What recordings held out say; without any it is empty.

    Attributes
    ----------
    before, after : Observations
        Of the base model, and of the model with the effects found, corrected as the training recordings were.
    events : tuple of Event
        What stands out in them.
    undisturbed : Observations
        ``after`` without the stretches of events.
    gains : mapping of str to HeldOutGain
        By the label of each effect found.
    unsure : ndarray, shape (n,)
        Rms error that a right model has there, N m (N), see `unsure_of_others`.
    apart : ndarray, shape (n,)
        Rms torque by which runs were found to differ, N m (N); zero where these leave too much beside any such difference.
    """

    before: Observations
    after: Observations
    events: tuple[Event, ...]
    undisturbed: Observations
    gains: Mapping[str, HeldOutGain]
    unsure: Array
    apart: Array
    notes: tuple[str, ...]


def validated(outcome: Outcome, data: PreparedData) -> Validation:
    """Predict recordings held out.

    Parameters
    ----------
    data : PreparedData
        The recordings held out, in the bands of the search.
    """
    found, model = outcome.search, outcome.after
    robot, value = found.scene.robot, model.value
    held = held_out_states(found, model, data)
    before = observe(found.base, held.data)
    after = _with_effects(found, held, before)
    unsure = unsure_of_others(model, after)
    differ = _Differences(outcome, after, unsure)
    events = [
        own_uncertainty(event, robot.by_joint(unsure), robot.by_joint(differ.of(event.recording)))
        for event in held_out_events(value, outcome.training, after)
    ]
    if outcome.unexplained is not None:
        events = [event for event in events if says_more(event)]
    quiet = quiet_blocks(held.data, events)
    undisturbed = after if np.all(quiet) else after.faded(quiet)
    gains = held_out_gains(found, model, undisturbed, before, quiet, held.correction)
    return Validation(before, after, tuple(events), undisturbed, gains, unsure, differ.of(shares=quiet), held.notes)


def says_more(event: Event) -> bool:
    """Whether an event says more than that something stays unexplained, which is why a whole recording is.

    It is no reason for errors larger than the torque itself.
    """
    return event.kind != "unknown" or bool(np.isfinite(event.score)) or bool(event.beyond)


@dataclass(frozen=True, eq=False)
class _Differences:
    """By how much runs were found to differ, where that is what recordings held out differ by.

    Of runs that are all of different motions nobody can tell whether they differ, or the model lacks something that differs from
    motion to motion: a further run then leaves much in other directions too.
    """

    outcome: Outcome
    after: Observations
    unsure: Array

    def of(self, recording: str | None = None, shares: Array | None = None) -> Array:
        """Return the rms torque by which one of the recordings, or all, may differ for that, N m (N), shape (n,)."""
        variation, value = self.outcome.after.variation, self.outcome.after.value
        if not variation or not self.after.data.recordings:
            return np.zeros(len(self.unsure))
        # Of few runs how far they lie apart is known badly.
        wide = widening(len(self.outcome.training.each) - 1)
        apart = wide * of_another_run(variation, self.after, value)
        names = [item.name for item in self.after.data.recordings]
        own = np.array([recording in (None, name) for name in names])[self.after.owner]
        counted = own * (1.0 if shares is None else shares)
        usual = self.outcome.search.step.criteria.worse_held_out
        for joint, (left, rows) in enumerate(
            zip(left_beside_own(variation, self.after, value, counted), self.after.joints, strict=True)
        ):
            samples = float(rows.counts @ counted)
            most = np.hypot(usual * self.outcome.training.joints[joint].rms(value), self.unsure[joint])
            if left @ left > samples * most**2:
                apart[joint] = 0.0
        return apart


def _with_effects(found: Search, held: HeldOut, before: Observations) -> Observations:
    """Return held-out observations, corrected as the training ones were, with the effects found."""
    if not before.data.recordings:
        return replace(before, model=found.model)
    if held.correction is not None:
        before = before.with_torque(corrected(before.data, held.correction))
    scene = replace(held.scene, columns=columns_at_hand(before))
    step = replace(found.step, scene=scene, columns=CandidateColumns(before), chosen=held.chosen)
    return observed_at_every_sample(step)
