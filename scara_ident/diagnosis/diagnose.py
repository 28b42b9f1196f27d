"""The whole story: what the residual lacks, what it is traced to, and the error before and after."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from scara_ident.diagnosis.candidates import Candidate
from scara_ident.diagnosis.confounding import Confounder, confounders
from scara_ident.diagnosis.effect_parameters import physical_parameters
from scara_ident.diagnosis.lack_of_fit import LackOfFit
from scara_ident.diagnosis.model_selection import Task, Unexplained, joint_rms, outcome_of
from scara_ident.diagnosis.screening import Dependence
from scara_ident.diagnosis.search import Search, is_delay
from scara_ident.effects import Effect, Parameter, available_effects
from scara_ident.effects.aliases import Alias, aliases
from scara_ident.errors import RecordingError
from scara_ident.estimation import Estimate
from scara_ident.estimation.bands import choose_bands
from scara_ident.estimation.observations import Evidence, gather_all
from scara_ident.identification.channel_check import mapping_faults
from scara_ident.identification.identify import check_bands, check_held_out, data_notes
from scara_ident.model.model import TorqueModel, build_model
from scara_ident.recording.recording import Recording
from scara_ident.robot.robot import Robot

Array = NDArray[np.float64]
Verdict = Literal["complete", "explained", "unexplained"]


@dataclass(frozen=True, eq=False)
class FoundEffect:
    """One effect that the data show.

    Attributes
    ----------
    effect : str
    joint : str or None
    description : str
    parameters : mapping of str to Parameter
    confounded_with : tuple of Confounder
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
    confounded_with: tuple[Confounder, ...]
    p_value: float
    gain: float
    votes: tuple[int, int]
    before: Mapping[str, float | None]
    after: Mapping[str, float | None]


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
    model: str | TorqueModel,
    recordings: Sequence[Recording],
    validation: Sequence[Recording] = (),
    *,
    bands: Sequence[float | None] | None = None,
    catalogue: Sequence[Effect] | None = None,
    progress: Callable[[str], None] = lambda step: None,
) -> Diagnosis:
    """Find what a model lacks, trace it to a physical effect, add it, and report before and after.

    Parameters
    ----------
    robot : Robot
    model : str or TorqueModel
        The base model.
    recordings : sequence of Recording
        Every choice is made on these.
    validation : sequence of Recording, optional
        Recordings that no choice sees; they are only predicted, before and after.
    bands : sequence of float or None, one per joint, optional
        Low-pass on both sides; by default the widest band that any joint's data allow, for all joints.
    catalogue : sequence of Effect, optional
        Families to try; a user's own can be among them. By default all, those of installed packages included.
    progress : callable, optional

    Returns
    -------
    Diagnosis

    Raises
    ------
    UsageError
        If a recording is both fitted and held out, or a band is no frequency that the slowest recording carries.
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
    else:
        check_bands(robot, bands, (*recordings, *validation))
    faults = mapping_faults(base, recordings, bands)
    if faults:
        raise RecordingError("; ".join(str(fault) for fault in faults))
    task = Task(base, tuple(recordings), available_effects() if catalogue is None else tuple(catalogue), progress)
    outcome = outcome_of(task, bands, free=not given)
    found, after = outcome.search, outcome.after
    held_out = corrected(found, validation)
    effects = _effects(found, after)
    notes += outcome.demoted
    negligible = _negligible(found)
    if negligible is not None:
        notes.append(f"{negligible}; corrected in the data, not counted as an effect")
    verdict: Verdict = "unexplained" if outcome.unexplained else ("explained" if effects else "complete")
    return Diagnosis(
        verdict,
        found,
        found.start,
        after,
        found.start_evidence,
        outcome.training,
        gather_all(base, validation, found.bands),
        gather_all(found.model, held_out, found.bands),
        outcome.fit_before,
        outcome.fit_after,
        tuple(effects),
        aliases(base),
        outcome.unexplained,
        outcome.dependences[:12],
        tuple(notes),
    )


def _effects(found: Search, after: Estimate) -> list[FoundEffect]:
    scene = found.scene
    groups = confounders(found, after.weights) if found.chosen else []
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
            if _negligible(found) is not None:
                before = now
                continue
            value, std = found.delay
            values: Mapping[str, Parameter] = candidate.effect.parameters(
                scene, candidate.member, np.array([value]), np.array([[std**2]])
            )
            confounded: tuple[Confounder, ...] = ()
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


def corrected(found: Search, recordings: Sequence[Recording]) -> tuple[Recording, ...]:
    """Return recordings with what the search corrected in the data taken out of them."""
    candidate = _correction(found)
    if candidate is None or found.delay is None:
        return tuple(recordings)
    value = np.array([found.delay[0]])
    return tuple(candidate.effect.corrected(recording, candidate.member, value) for recording in recordings)


def _correction(found: Search) -> Candidate | None:
    candidates = (step.decision.candidate for step in found.steps)
    return next((candidate for candidate in candidates if is_delay(candidate)), None)


def _negligible(found: Search) -> str | None:
    """Say why what was corrected in the data is no effect to speak of."""
    candidate = _correction(found)
    if candidate is None or found.delay is None:
        return None
    return candidate.effect.negligible(found.scene, candidate.member, np.array([found.delay[0]]))
