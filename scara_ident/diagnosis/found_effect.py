"""An effect that the data show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from scara_ident.diagnosis.candidates.candidates import Candidate
from scara_ident.diagnosis.checks.setpoints import OR_ELSE, may_be_setpoints
from scara_ident.diagnosis.fitting.effect_parameters import Coefficients, PhysicalParameters, size_is_determined
from scara_ident.diagnosis.held_out.gain import HeldOutGain
from scara_ident.diagnosis.selection.confounding import Confounder
from scara_ident.diagnosis.selection.search import Search
from scara_ident.effects import Effect, Parameter, Scene
from scara_ident.estimation.run_offsets import rms_of


@dataclass(frozen=True, eq=False)
class FoundEffect:
    """One effect that the data show.

    Attributes
    ----------
    confounded_with : tuple of Confounder
        Effects that these recordings cannot tell from it.
    p_value : float
        Corrected for the candidates tried.
    gain : float
        What it removes on data that it was not fitted to, as a share of that and what it leaves on its joint.
    votes : tuple of (int, int)
        Trajectories in which it helps, of those that excite it.
    before, after : mapping of str to float or None
        Rms of each joint over the training recordings when it came in.
    candidate : Candidate or None
        As a term of the model; None where it was taken out of the recordings.
    direct : mapping of str to Parameter
        Those of its parameters that a channel of its own, as of a second encoder, tells without this fit.
    held_out : HeldOutGain or None
        What it changes on recordings that no choice has seen; None where there are none in which it acts.
    size_determined : bool
        Whether its size differs from none with all that is unsure about it, such as the law that it follows. That it is
        there is shown by what it removes, whatever that law.
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
    candidate: Candidate | None = None
    direct: Mapping[str, Parameter] = field(default_factory=dict)
    held_out: HeldOutGain | None = None
    size_determined: bool = True

    @property
    def label(self) -> str:
        """The effect and its joint."""
        return self.effect if self.joint is None else f"{self.effect} of {self.joint}"

    @property
    def title(self) -> str:
        """The effect and its joint, as a heading."""
        return self.effect if self.joint is None else f"{self.effect} on {self.joint}"

    def confounder_names(self, scene: Scene) -> tuple[str, ...]:
        """Return the labels of `confounded_with`, and beside its own, and that of a line that may have any period, what that member is."""
        return tuple(
            f"{item.label} ({item.candidate.effect.description(scene, item.candidate.member)})"
            if item.label == self.label or item.candidate.effect.seeded_by is not None
            else item.label
            for item in self.confounded_with
        )


Readings = Mapping[tuple[str, str | None], Mapping[str, Parameter]]


def direct_readings(found: Search, families: Sequence[Effect], rotor_std: float) -> Readings:
    """Return what channels tell of effects without a fit, by effect and joint, where they tell something."""
    found_parameters = {
        (family.name, joint): family.read_directly(found.scene, j, found.data.recordings, rotor_std)
        for family in families
        for j, joint in enumerate(found.scene.robot.joints)
    }
    return {key: values for key, values in found_parameters.items() if values}


def not_found(readings: Readings, effects: Sequence[FoundEffect]) -> list[str]:
    """Return in words what channels tell of effects that the fit did not find."""
    added = {(item.effect, item.joint) for item in effects}
    return [
        f"{effect} of {joint} was not added, but a separate channel gives {said(values)}"
        for (effect, joint), values in readings.items()
        if (effect, joint) not in added
    ]


def said(values: Mapping[str, Parameter]) -> str:
    """Return parameters in words."""
    return ", ".join(f"{name} {item.value:.4g} +- {item.std:.1g} {item.unit}" for name, item in values.items())


def found_effects(
    found: Search,
    groups: Sequence[tuple[Confounder, ...]],
    parameters: PhysicalParameters,
    readings: Readings,
    held_out: Mapping[str, HeldOutGain],
) -> list[FoundEffect]:
    """Return the effects that came in, in that order, with their parameters and what cannot be distinguished from them.

    What was taken out of the data in several steps is one effect, as it came in first.

    Parameters
    ----------
    groups : sequence of tuple of Confounder
        What cannot be distinguished from each effect in the model, see `confounders`.
    """
    scene = found.scene
    labels = [item.label(scene) for item in found.chosen]
    results: list[FoundEffect] = []
    before = rms_of(found.start.value, found.uncorrected)
    for item in found.steps:
        decision = item.decision
        candidate = decision.candidate
        now, otherwise = item.rms, ""
        if candidate.corrects_data and found.correction is not None:
            candidate = found.correction.candidate
            listed = any(result.candidate is None for result in results)
            if listed or uncounted_correction(found, parameters) is not None:
                before = now
                continue
            values: Mapping[str, Parameter] = candidate.effect.parameters(
                scene, candidate.member, found.correction.value, parameters.coefficients[-1].covariance
            )
            confounded: tuple[Confounder, ...] = ()
            otherwise = candidate.effect.or_else(scene, candidate.member, found.correction.value)
        else:
            place = labels.index(decision.label)
            candidate = found.chosen[place]
            values, confounded = parameters.effects[place], groups[place]
            # By the model that it is part of.
            beside = replace(scene, value=decision.examination.model_value[: len(scene.value)])
            coefficients = parameters.coefficients[place].value
            otherwise = candidate.effect.or_else(beside, candidate.member, coefficients)
            others = [
                (item.effect, item.member, parameters.coefficients[k].value)
                for k, item in enumerate(found.chosen)
                if k != place
            ]
            otherwise += candidate.effect.or_else_beside(candidate.member, coefficients, others)
            if may_be_setpoints(found.data, candidate.effect, candidate.member):
                otherwise += OR_ELSE
        results.append(
            FoundEffect(
                candidate.effect.name,
                candidate.joint(scene),
                candidate.effect.description(scene, candidate.member) + otherwise,
                candidate.effect.with_symmetric_powers(values),
                confounded,
                min(1.0, decision.examination.p_value * found.tried),
                decision.gain,
                decision.examination.votes,
                scene.robot.by_joint(before),
                scene.robot.by_joint(now),
                None if candidate.corrects_data else candidate,
                readings.get((candidate.effect.name, candidate.joint(scene)), {}),
                held_out.get(candidate.label(scene)),
                size_is_determined(candidate.effect, values, found.step.criteria.min_size),
            )
        )
        before = now
    return results


def uncounted_correction(found: Search, parameters: PhysicalParameters) -> str | None:
    """Say why what was corrected in the data is no effect to speak of.

    Parameters
    ----------
    parameters : PhysicalParameters
        Of `Search.whole`, the correction last.
    """
    if found.correction is None:
        return None
    candidate, value = found.correction.candidate, found.correction.value
    small = found.correction.negligible(found.scene)
    if small is not None:
        return small
    whole = parameters.coefficients[-1].covariance
    own = Coefficients(*candidate.effect.alike(value, whole))
    stds = found.step.criteria.min_final_size
    least = own.at_least(stds)
    small = candidate.effect.negligible(found.scene, candidate.member, least)
    if np.any(least) and small is None:
        return None
    found_parameters = said(candidate.effect.parameters(found.scene, candidate.member, value, whole))
    if found.correction.of_each:
        found_parameters = f"{candidate.effect.description(found.scene, candidate.member)}: {found_parameters}"
    if not np.any(least):
        return f"{found_parameters}; with the differences between runs counted, this is within {stds:g} standard deviations of zero"
    return (
        f"{found_parameters}; with the differences between runs counted, and less {stds:g} standard deviations, {small}"
    )
