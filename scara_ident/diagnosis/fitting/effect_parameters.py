"""Physical parameters of the effects found, with standard deviations that include the nonlinear ones."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.diagnosis.candidates.candidates import Candidate, Rows
from scara_ident.diagnosis.candidates.finite_columns import torque_slope
from scara_ident.diagnosis.candidates.unknowns import sides
from scara_ident.diagnosis.fitting.linearised import Linearised, linearise, with_estimate_slopes
from scara_ident.diagnosis.fitting.nonlinear_fit import tune
from scara_ident.diagnosis.testing.candidate_tests import examine
from scara_ident.diagnosis.testing.selection_step import SelectionStep
from scara_ident.effects import Effect, Parameter, Scene
from scara_ident.estimation.covariance import Covariance, block_covariance
from scara_ident.estimation.information import merge
from scara_ident.estimation.noise_bias import OF_LAG, noisy
from scara_ident.estimation.run_offsets import beside_offsets
from scara_ident.estimation.run_variation import MIN_RUNS
from scara_ident.estimation.variation_between import run_variation
from scara_ident.estimation.working_range import DeterminedDirections, determined_directions

# A rotor is determined by the data where they leave less than this share of its prior's standard deviation.
DETERMINED_SHARE = 0.7
# Logarithm that no factor of an armature exceeds: more is nothing known.
LARGEST_LOG = 20.0


@dataclass(frozen=True)
class RotorInertia:
    """The rotor's inertia behind a gear that a found effect depends on.

    Attributes
    ----------
    armature : float
        N^2 Jm at the joint, kg m^2 or kg.
    factor : float or None
        The armature times and over this is one standard deviation; None where the base model tells it apart.
    stated : bool
        Whether the robot's description or its URDF states it.
    nominal : float
        As stated, or guessed (`scara_ident.robot.rotors`).
    determined : bool
        Whether these recordings make it surer than that.
    """

    joint: str
    armature: float
    factor: float | None
    stated: bool
    nominal: float
    determined: bool


@dataclass(frozen=True, eq=False)
class Coefficients:
    """Coefficients of an effect (k,) and their covariance (k, k)."""

    value: Array
    covariance: Array

    def at_least(self, stds: float) -> Array:
        """Return the coefficients so many standard deviations nearer to zero, and no further than that."""
        reach = stds * np.sqrt(np.maximum(np.diag(self.covariance), 0.0))
        return np.asarray(np.sign(self.value) * np.maximum(np.abs(self.value) - reach, 0.0))


@dataclass(frozen=True, eq=False)
class LinearParameters(Coefficients):
    """All linear parameters of a model with effects (k,), those of the base model first, and their covariance (k, k).

    Attributes
    ----------
    undetermined : ndarray of bool, shape (k,)
    std_kind : str
        How the covariance was found, see `scara_ident.estimation.covariance`.
    noise_bias : ndarray, shape (k,), or None
        By how much the noise of positions moves them, which is part of the covariance; None where negligible or not looked for.
    """

    undetermined: NDArray[np.bool_]
    std_kind: str
    noise_bias: Array | None


@dataclass(frozen=True)
class PhysicalParameters:
    """Of each chosen effect its parameters and its coefficients, the rotors that these depend on, and the model that all are of.

    Attributes
    ----------
    linear : LinearParameters or None
        Beside all that is nonlinear, of the estimate that coefficients are part of; None of a model without effects.
    """

    effects: tuple[dict[str, Parameter], ...] = ()
    coefficients: tuple[Coefficients, ...] = ()
    rotors: tuple[RotorInertia, ...] = ()
    linear: LinearParameters | None = None


def size_is_determined(effect: Effect, parameters: Mapping[str, Parameter], stds: float) -> bool:
    """Whether any of an effect's sizes, its nonlinear parameters left aside, is so many standard deviations from none."""
    return size_in_stds(effect, parameters) > stds


def size_in_stds(effect: Effect, parameters: Mapping[str, Parameter]) -> float:
    """Return how many standard deviations the best determined of an effect's sizes is from none."""
    others = {"phase", *(parameter.name for parameter in effect.nonlinear)}
    sizes = [item for name, item in parameters.items() if name not in others and item.value and np.isfinite(item.std)]
    return max((abs(size.value) / size.std if size.std else np.inf for size in sizes), default=0.0)


def physical_parameters(step: SelectionStep, *, of_runs: bool = True, of_noise: bool = True) -> PhysicalParameters:
    """Return the physical parameters of each chosen effect, and the rotor inertias that they depend on.

    Parameters
    ----------
    of_runs, of_noise : bool, optional
        Whether standard deviations hold what runs differ by, and what the noise of the positions moves parameters by. With neither,
        what is unsure of the parameters that columns follow is left out too: an effect that is not there changes with none of it.

    Notes
    -----
    Nonlinear parameters, armatures included, join the fit by the derivative of the effects' columns, so that the
    covariance is that of all parameters together. Where columns follow the estimate, values are a step of Gauss and Newton
    from that which the fit settled at, to the least squares whose covariance it is.
    """
    state = linearise(step)
    if of_runs or of_noise:
        state = with_estimate_slopes(step, state)
    spread, bias = _covariance(step, state, of_runs=of_runs, of_noise=of_noise)
    covariance = spread.matrix
    undetermined = merge([state.information, state.prior]).solve().undetermined
    found: list[dict[str, Parameter]] = []
    coefficients = []
    further = np.zeros(state.linear)
    for owner, (candidate, own) in enumerate(zip(step.chosen, state.places, strict=True)):
        linear = Coefficients(state.value[own], covariance[own, own])
        coefficients.append(linear)
        wide = np.r_[own, _beside(step, candidate, state)]
        all_sizes = Coefficients(state.value[wide], covariance[np.ix_(wide, wide)])
        parameters = _physical(step.scene, candidate, all_sizes, np.flatnonzero(undetermined[wide]))
        for position, unknown in enumerate(state.unknowns):
            if unknown.owner != owner:
                continue
            parameter = candidate.effect.nonlinear[unknown.place]
            # An underscore marks a parameter that only serves the shape of the columns.
            if not parameter.name.startswith("_"):
                variance = covariance[len(state.value) + position, len(state.value) + position]
                # Any value of a range that no row tells apart is as likely.
                variance += candidate.effect.gap(step.scene, candidate.member)[unknown.place] ** 2 / 12.0
                unit = parameter.unit.format(**candidate.effect.words(step.scene, candidate.member))
                parameters[parameter.name] = parameter.parameter(
                    unknown.value, float(np.sqrt(max(variance, 0.0))), unit
                )
        further[own] = _further(step.scene, candidate, linear, parameters)
        found.append(parameters)
    own = slice(state.linear)
    whole = covariance[own, own] + np.diag(further)
    linear = LinearParameters(
        *(state.value, whole, undetermined[own], spread.kind), None if bias is None else bias[own]
    )
    return PhysicalParameters(tuple(found), tuple(coefficients), _rotors(step, state, covariance), linear)


def _beside(step: SelectionStep, candidate: Candidate, state: Linearised) -> NDArray[np.intp]:
    """Return the columns of the effect beside which a candidate's parameters are estimated; none where it did not come in."""
    member = candidate.effect.estimated_beside(step.scene, candidate.member)
    places = [
        np.r_[own]
        for item, own in zip(step.chosen, state.places, strict=True)
        if item.member == member and item.effect.name == candidate.effect.name
    ]
    return np.concatenate([np.array([], dtype=np.intp), *places])


def _physical(
    scene: Scene, candidate: Candidate, linear: Coefficients, left_open: NDArray[np.intp]
) -> dict[str, Parameter]:
    """Return physical parameters from coefficients; one that changes with a coefficient that is left open is undetermined."""
    effect, member = candidate.effect, candidate.member
    found = dict(effect.parameters(scene, member, linear.value, linear.covariance))
    for k in left_open:
        other = linear.value.copy()
        other[k] += 1.0 + abs(other[k])
        for name, item in effect.parameters(scene, member, other, linear.covariance).items():
            if item.value != found[name].value:
                found[name] = replace(found[name], std=np.inf)
    return found


def _further(scene: Scene, candidate: Candidate, linear: Coefficients, parameters: Mapping[str, Parameter]) -> Array:
    """Return by how much the variance of an effect's coefficients is more than that of the fit, shape (k,).

    A coefficient that has its name among the physical parameters is as unsure as it is there: a family may know of more.
    """
    names = [column.name for column in candidate.effect.columns(scene, candidate.member)]
    named = [parameters.get(name) for name in names]
    same = [
        item.std**2 if item is not None and item.value == x and np.isfinite(item.std) else 0.0
        for item, x in zip(named, linear.value, strict=True)
    ]
    return np.asarray(np.maximum(np.array(same) - np.diag(linear.covariance), 0.0))


def _rotors(step: SelectionStep, state: Linearised, covariance: Array) -> tuple[RotorInertia, ...]:
    scene = step.scene
    spread, prior = {}, {}
    for k, item in enumerate(state.unknowns, len(state.value)):
        if item.owner is None:
            spread[item.place], prior[item.place] = float(np.sqrt(max(covariance[k, k], 0.0))), item.spread
    behind = (candidate.effect.geared_joint(candidate.member) for candidate in step.chosen)
    return tuple(
        RotorInertia(
            scene.robot.joints[joint],
            scene.armature(joint),
            float(np.exp(min(spread[joint], LARGEST_LOG))) if joint in spread else None,
            bool(scene.robot.rotor_stated[joint]),
            scene.nominal_armature(joint),
            joint not in spread or spread[joint] < DETERMINED_SHARE * prior[joint],
        )
        for joint in dict.fromkeys(joint for joint in behind if joint is not None)
    )


def parameters_beside(step: SelectionStep, candidate: Candidate) -> dict[str, Parameter]:
    """Return the physical parameters of one effect beside a model, as `physical_parameters` at a fraction of the work.

    The model's columns are projected out, and the covariance is that of the effect's block scores. Armatures stay as
    they are.
    """
    (own,) = step.rows(step.scene, [candidate])
    (alone,) = examine(step.model, [own], step.criteria)
    wide: Rows = {joint: rows for joint, rows in own.items()}
    size = len(alone.value)
    for one, other, reach in sides(candidate):
        pair = step.rows(step.scene, [one, other])
        for joint, change in torque_slope(alone.value, own, pair, reach).items():
            wide[joint] = np.concatenate([wide[joint], change[None]])
    (found,) = examine(step.model, [wide], step.criteria)
    covariance = found.covariance[:size, :size]
    return dict(candidate.effect.parameters(step.scene, candidate.member, alone.value, covariance))


def _covariance(
    step: SelectionStep, state: Linearised, *, of_runs: bool, of_noise: bool
) -> tuple[Covariance, Array | None]:
    """Block covariance of all parameters, with what the priors leave open, which no residual shows, and the bias that is in it."""
    whole, directions = merge([state.information, state.prior]), _determined_directions(step, state)
    inverse = (
        whole.inverse()
        if directions is None
        else directions.kept @ directions.within(whole).inverse() @ directions.kept.T
    )
    # By what a row moves the fit; see `scara_ident.estimation.run_offsets`.
    rows = beside_offsets(replace(step.observations, joints=tuple(state.joints)), step.offsets)
    influence = rows.influence.joints
    spread = block_covariance(inverse, state.least, influence, step.observations.owner, step.weights)
    matrix = spread.matrix
    if of_runs:
        variation = run_variation(step.observations, state.joints, state.least, taken=rows.taken(inverse, step.weights))
        if step.offsets is not None and len(step.observations.data.recordings) < MIN_RUNS:
            variation = step.offsets
        matrix = matrix + variation.covariance(inverse, influence, step.weights)
    if directions is not None:
        matrix = matrix + directions.prior
    bias = _noise_bias(step, state) if of_noise and directions is None else None
    if bias is not None:
        matrix = matrix + np.outer(bias, bias)
    known = state.prior.factor[:, :-1]
    matrix = matrix + state.variance * inverse @ (known.T @ known) @ inverse
    return replace(spread, matrix=matrix), bias


def _determined_directions(step: SelectionStep, state: Linearised) -> DeterminedDirections | None:
    """Return what is determined and what is left open where data were corrected alone, see `determined_directions`; None where all of it is determined."""
    if any(not item.corrects_data for item in state.chosen):
        return None
    directions = determined_directions(beside_offsets(step.observations, step.offsets).fitted, 1.0 / step.weights)
    if directions is None:
        return None
    # Imported where it is needed, as it takes as long as all else here.
    from scipy.linalg import block_diag

    more = state.information.parameters - len(directions.kept)
    left_open = np.vstack([directions.left_open, np.zeros((more, directions.left_open.shape[1]))])
    return DeterminedDirections(block_diag(directions.kept, np.eye(more)), left_open)


def _noise_bias(step: SelectionStep, state: Linearised) -> Array | None:
    """Return by how much the noise of positions moves all parameters of a fit, see `scara_ident.estimation.noise_bias`."""
    tied = any(item.effect.tie(step.scene, item.member) is not None for item in step.chosen)
    if not noisy(step.observations.data, OF_LAG if tied else 0):
        return None
    # A resonance with little damping bends too much for one step.
    noisier = tune(step.noisier) if tied else step.noisier
    again = with_estimate_slopes(noisier, linearise(noisier))
    bias = again.solve()[0] - state.solve()[0]
    bias[state.linear :] += [
        there.value - here.value for there, here in zip(again.unknowns, state.unknowns, strict=True)
    ]
    return np.asarray(bias)
