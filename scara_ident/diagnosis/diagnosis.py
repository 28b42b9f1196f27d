"""The whole story: what the residual lacks, what it is traced to, and the error before and after."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from scara_ident.bands import choose_bands
from scara_ident.diagnosis.confounding import Rival, rivals
from scara_ident.diagnosis.finish import physical_parameters
from scara_ident.diagnosis.lack_of_fit import LackOfFit, lack_of_fit
from scara_ident.diagnosis.screening import Dependence, screen
from scara_ident.diagnosis.search import Search, is_delay, model_with, search
from scara_ident.effects import CATALOGUE, Effect, Parameter
from scara_ident.effects.aliases import Alias, aliases
from scara_ident.effects.measurement import shifted, within_sampling
from scara_ident.errors import RecordingError
from scara_ident.estimators import Estimate, JointError
from scara_ident.estimators.estimate import joint_error
from scara_ident.estimators.least_squares import weighted_fit
from scara_ident.evidence import Evidence, gather_all
from scara_ident.identification import check_held_out, data_notes
from scara_ident.information import merge
from scara_ident.mapping import mapping_faults
from scara_ident.model import ModelName, TorqueModel, build_model
from scara_ident.recording import Recording
from scara_ident.robot import Robot

Array = NDArray[np.float64]
Verdict = Literal["complete", "explained", "unexplained"]

# Share of the squared residual that signals must explain on held-out trajectories to be called a remainder.
REMAINDER = 0.08
# A repeatable remainder larger than the noise, within the band, is one whatever it depends on.
REMAINDER_TO_NOISE = 1.0
# With what was found the search is repeated where the band becomes this many times as wide, so often at the most.
WIDER = 1.3
MOST_WIDENINGS = 2


@dataclass(frozen=True, eq=False)
class FoundEffect:
    """One effect that the data show.

    Attributes
    ----------
    effect : str
    joint : str or None
    description : str
    parameters : mapping of str to Parameter
    confounded_with : tuple of Rival
        Effects that these recordings cannot tell from it.
    p_value : float
        Corrected for the candidates tried.
    gain : float
        Share of the squared residual of its joints removed on data that it was not fitted to.
    votes : tuple of (int, int)
        Trajectories in which it helps, of those that excite it.
    before, after : mapping of str to float or None
        Rms of each joint over the training recordings when it came in.
    """

    effect: str
    joint: str | None
    description: str
    parameters: Mapping[str, Parameter]
    confounded_with: tuple[Rival, ...]
    p_value: float
    gain: float
    votes: tuple[int, int]
    before: Mapping[str, float | None]
    after: Mapping[str, float | None]


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
class Diagnosis:
    """What `diagnose` found.

    Attributes
    ----------
    verdict : {"complete", "explained", "unexplained"}
    search : Search
        Every candidate tried, with its statistics.
    before, after : Estimate
        The base model, and the model with the effects found.
    training_before, training_after, validation_before, validation_after : tuple of Evidence
    fit_before, fit_after : tuple of LackOfFit
        Per joint; empty without repetitions.
    effects : tuple of FoundEffect
    aliases : tuple of Alias
        Effects that the model absorbs on any data.
    unexplained : Unexplained or None
    dependences : tuple of Dependence
        What the remainder depends on, ranked.
    notes : tuple of str
    """

    verdict: Verdict
    search: Search
    before: Estimate
    after: Estimate
    training_before: tuple[Evidence, ...]
    training_after: tuple[Evidence, ...]
    validation_before: tuple[Evidence, ...]
    validation_after: tuple[Evidence, ...]
    fit_before: tuple[LackOfFit, ...]
    fit_after: tuple[LackOfFit, ...]
    effects: tuple[FoundEffect, ...]
    aliases: tuple[Alias, ...]
    unexplained: Unexplained | None
    dependences: tuple[Dependence, ...]
    notes: tuple[str, ...]

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self.before.model.robot


def diagnose(
    robot: Robot,
    model: ModelName | TorqueModel,
    recordings: Sequence[Recording],
    validation: Sequence[Recording] = (),
    *,
    bands: Sequence[float | None] | None = None,
    catalogue: Sequence[Effect] = CATALOGUE,
    progress: Callable[[str], None] = lambda step: None,
) -> Diagnosis:
    """Find what a model lacks, trace it to a physical effect, add it, and report before and after.

    Parameters
    ----------
    robot : Robot
    model : {"complete", "reduced", "basic"} or TorqueModel
        The base model.
    recordings : sequence of Recording
        Every choice is made on these.
    validation : sequence of Recording, optional
        Recordings that no choice sees; they are only predicted, before and after.
    bands : sequence of float or None, one per joint, optional
        Low-pass on both sides; by default the widest band that any joint's data allow, for all joints.
    catalogue : sequence of Effect, optional
        Families to try; a user's own can be among them.
    progress : callable, optional

    Returns
    -------
    Diagnosis

    Raises
    ------
    UsageError
        If a recording is both fitted and held out.
    RecordingError
        If a recording cannot be used, or its channels are not what the mapping says (see `mapping_faults`).
    """
    check_held_out(recordings, validation)
    base = build_model(robot, model) if isinstance(model, str) else model
    notes = list(data_notes((*recordings, *validation)))
    given = bands is not None
    if bands is None:
        progress("choosing the band")
        choice = choose_bands(base, recordings)
        # A joint whose model lacks something seems to have less band than it has.
        bands = (max(choice.bands),) * robot.n
        notes += choice.notes
    faults = mapping_faults(base, recordings, bands)
    if faults:
        raise RecordingError("; ".join(str(fault) for fault in faults))
    found = search(base, recordings, bands, catalogue=catalogue, progress=progress)
    for _ in range(0 if given else MOST_WIDENINGS):
        wider = max(choose_bands(found.model, found.recordings).bands) if found.chosen else 0.0
        if wider < WIDER * max(band or np.inf for band in bands):
            break
        # What was missing had hidden how far up the motion explains the torque, and other effects with it.
        bands = (wider,) * robot.n
        found = search(base, recordings, bands, catalogue=catalogue, progress=progress)
    progress("testing what is left")
    delay = found.delay[0] if found.delay else 0.0
    held_out = tuple(shifted(recording, delay) for recording in validation) if delay else tuple(validation)
    final = found.model
    training_after = gather_all(final, found.recordings, bands)
    after = weighted_fit(final, training_after)
    fit_before = lack_of_fit(base, found.start.value, recordings, bands)
    fit_after = lack_of_fit(final, after.value, found.recordings, bands)
    dependences = screen(final, after.value, found.recordings, bands)
    unexplained = _unexplained(fit_after, dependences)
    effects = _effects(found, after)
    if found.delay is not None and not _is_effect(found):
        notes.append(
            f"effort and position are {found.delay[0] * 1e3:+.2g} ms apart, less than one sample, as when a sample is "
            "held to the next; corrected in the data, not counted as an effect"
        )
    verdict: Verdict = "unexplained" if unexplained else ("explained" if effects else "complete")
    return Diagnosis(
        verdict,
        found,
        found.start,
        after,
        found.start_evidence,
        training_after,
        gather_all(base, validation, bands),
        gather_all(final, held_out, bands),
        fit_before,
        fit_after,
        tuple(effects),
        aliases(base),
        unexplained,
        dependences[:12],
        tuple(notes),
    )


def _unexplained(fit: Sequence[LackOfFit], dependences: Sequence[Dependence]) -> Unexplained | None:
    if dependences and dependences[0].explained > REMAINDER:
        top = dependences[0]
        # A pair must say clearly more than its better half.
        for other in dependences[1:]:
            if other.joint == top.joint and len(other.signals) == 1 and other.explained > 0.8 * top.explained:
                top = other
                break
        return Unexplained(top.joint, top.signals, top.rms, top.explained)
    for joint in fit:
        if joint.missing > REMAINDER_TO_NOISE * joint.noise and joint.p_value < 0.01:
            return Unexplained(joint.joint, (), joint.missing, 0.0)
    return None


def _effects(found: Search, after: Estimate) -> list[FoundEffect]:
    scene = found.scene
    groups = rivals(found, after.weights) if found.chosen else []
    parameters = (
        physical_parameters(scene, found.recordings, found.bands, after.weights, found.chosen) if found.chosen else []
    )
    labels = [item.label(scene) for item in found.chosen]
    results = []
    before = joint_rms(found.start.value, found.start_evidence)
    for step in found.steps:
        decision = step.decision
        candidate = decision.candidate
        now = joint_rms(step.estimate.value, step.evidence)
        if is_delay(candidate) and found.delay is not None:
            if not _is_effect(found):
                before = now
                continue
            values: Mapping[str, Parameter] = {"delay": Parameter(found.delay[0], found.delay[1], "s")}
            confounded: tuple[Rival, ...] = ()
        else:
            place = labels.index(decision.label)
            candidate = found.chosen[place]
            values, confounded = parameters[place], groups[place]
        results.append(
            FoundEffect(
                candidate.effect.name,
                candidate.joint(scene),
                candidate.effect.description(scene, candidate.member),
                values,
                confounded,
                min(1.0, decision.examination.p_value * found.tried),
                decision.gain,
                decision.examination.votes,
                dict(zip(scene.robot.joints, before, strict=True)),
                dict(zip(scene.robot.joints, now, strict=True)),
            )
        )
        before = now
    return results


def _is_effect(found: Search) -> bool:
    """Whether a delay is more than the place of a sample within its period."""
    return found.delay is not None and not within_sampling(found.delay[0], found.scene.rate)


def joint_rms(value: Array, evidence: Sequence[Evidence]) -> list[float | None]:
    """Return the rms of each joint over recordings, within the band; None without rows."""
    return [error.rms if error else None for error in joint_errors(value, evidence)]


def joint_errors(value: Array, evidence: Sequence[Evidence]) -> list[JointError | None]:
    """Return the error of each joint over all recordings together."""
    if not evidence:
        return []
    joints = len(evidence[0].unfiltered)
    return [
        joint_error(merge(item.joint(j) for item in evidence), merge(item.unfiltered[j] for item in evidence), value)
        for j in range(joints)
    ]


__all__ = ["Diagnosis", "FoundEffect", "Unexplained", "diagnose", "joint_errors", "joint_rms", "model_with"]
