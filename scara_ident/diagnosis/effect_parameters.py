"""Physical parameters of the effects found, with standard deviations that include the nonlinear ones."""

from __future__ import annotations

import numpy as np

from scara_ident.arrays import Array
from scara_ident.diagnosis.candidate_tests import examine
from scara_ident.diagnosis.candidates import Candidate, Rows
from scara_ident.diagnosis.nonlinear_fit import DERIVATIVE_STEP, Linearised, linearise
from scara_ident.diagnosis.selection_step import SelectionStep
from scara_ident.effects import Parameter
from scara_ident.estimation.covariance import block_covariance
from scara_ident.estimation.information import merge
from scara_ident.estimation.run_variation import run_variation


def physical_parameters(step: SelectionStep) -> list[dict[str, Parameter]]:
    """Return the physical parameters of each chosen effect.

    Nonlinear parameters, armatures included, join the fit by the derivative of the effects' columns, so that the
    covariance is that of all parameters together.
    """
    state = linearise(step.scene, step.columns, step.weights, step.chosen, step.criteria.rotor_inertia_std)
    covariance = _covariance(step, state)
    found = []
    for owner, (candidate, own) in enumerate(zip(step.chosen, state.places, strict=True)):
        parameters = dict(
            candidate.effect.parameters(step.scene, candidate.member, state.value[own], covariance[own, own])
        )
        for position, unknown in enumerate(state.unknowns):
            if unknown.owner != owner:
                continue
            parameter = candidate.effect.nonlinear[unknown.place]
            # An underscore marks a parameter that only serves the shape of the columns.
            if not parameter.name.startswith("_"):
                variance = covariance[len(state.value) + position, len(state.value) + position]
                parameters[parameter.name] = Parameter(
                    unknown.value, float(np.sqrt(max(variance, 0.0))), parameter.unit
                )
        found.append(parameters)
    return found


def parameters_beside(step: SelectionStep, candidate: Candidate) -> dict[str, Parameter]:
    """Return the physical parameters of one effect beside a model, as `physical_parameters` at a fraction of the work.

    The model's columns are projected out, and the covariance is that of the effect's block scores. Armatures stay as
    they are.
    """
    (own,) = step.columns.rows(step.scene, [candidate])
    (alone,) = examine(step.model, [own], step.criteria)
    wide: Rows = {joint: rows for joint, rows in own.items()}
    size = len(alone.value)
    for place, parameter in enumerate(candidate.effect.nonlinear):
        value = candidate.member.nonlinear[place]
        reach = DERIVATIVE_STEP * (abs(value) if value else parameter.upper - parameter.lower)
        sides = []
        for sign in (1.0, -1.0):
            moved = list(candidate.member.nonlinear)
            moved[place] = value + sign * reach
            sides.append(candidate.at(moved))
        up, down = step.columns.rows(step.scene, sides)
        for joint in wide:
            change = alone.value @ (up[joint] - down[joint]) / (2.0 * reach)
            wide[joint] = np.concatenate([wide[joint], change[None]])
    (found,) = examine(step.model, [wide], step.criteria)
    covariance = found.covariance[:size, :size]
    return dict(candidate.effect.parameters(step.scene, candidate.member, alone.value, covariance))


def _covariance(step: SelectionStep, state: Linearised) -> Array:
    """Block covariance of all parameters, with what the priors leave open, which no residual shows."""
    inverse = merge([state.information, state.prior]).inverse()
    value = np.concatenate([state.value, np.zeros(len(state.unknowns))])
    spread = block_covariance(inverse, value, state.joints, step.observations.owner, step.weights).matrix
    spread = spread + run_variation(step.observations, state.joints, value).covariance(
        inverse, state.joints, step.weights
    )
    known = state.prior.factor[:, :-1]
    return np.asarray(spread + state.variance * inverse @ (known.T @ known) @ inverse)
