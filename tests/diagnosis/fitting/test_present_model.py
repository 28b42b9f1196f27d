"""How well a model fits at its present nonlinear parameters: against dense rows, and against the model that is linear about them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.arrays import Array
from scara_ident.diagnosis.candidates.candidates import Candidate
from scara_ident.diagnosis.fitting.linearised import linearise
from scara_ident.diagnosis.fitting.present_model import PresentModel, present_model
from scara_ident.effects import Member
from scara_ident.effects.elasticity import JointElasticity
from scara_ident.effects.friction import Stribeck
from scara_ident.effects.gear import TransmissionLoss
from scara_ident.effects.measurement import TimeDelay
from tests.diagnosis.fitting.test_linearised import dense
from tests.diagnosis.fitting.test_nonlinear_fit import WEIGHTS, loss_runs
from tests.diagnosis.made import exact_runs, step_beside


def weighted_rows(model: PresentModel) -> tuple[Array, Array]:
    size = np.repeat(WEIGHTS, [rows.table.shape[1] for rows in model.joints])
    torque = size * np.concatenate([rows.table[-1] for rows in model.joints])
    return size[:, None] * dense(model.joints, model.linear), torque


def left_by(rows: Array, torque: Array) -> float:
    scale = np.linalg.norm(rows, axis=0)
    scale[scale == 0.0] = 1.0
    best = np.linalg.lstsq(rows / scale, torque, rcond=1e-9)[0]
    return float(np.sum((torque - rows @ (best / scale)) ** 2))


def test_the_error_is_the_least_that_linear_parameters_leave() -> None:
    model = present_model(step_beside(exact_runs(1, 1), [Candidate(Stribeck(), Member(1, (0.2,)))], WEIGHTS))
    assert model.error == pytest.approx(left_by(*weighted_rows(model)), rel=1e-9)


def test_what_was_taken_out_of_the_data_is_not_fitted_again() -> None:
    model = present_model(step_beside(exact_runs(1, 1), [Candidate(TimeDelay(), Member(None))], WEIGHTS))
    rows, torque = weighted_rows(model)
    (place,) = model.places
    assert not np.any(model.fitted[place]) and np.any(rows[:, place])
    assert model.error == pytest.approx(left_by(np.delete(rows, place, axis=1), torque), rel=1e-9)


@pytest.mark.parametrize("effect", [Candidate(JointElasticity(), Member(1, (9.0, 0.1))), None], ids=["elastic", "loss"])
def test_where_effects_follow_from_the_bodies_these_stay_and_coefficients_are_what_they_say(
    effect: Candidate | None,
) -> None:
    chosen = effect or Candidate(TransmissionLoss(), Member(0, (0.3,)))
    model = present_model(step_beside(loss_runs(0.3, 1.0)[:1], [chosen], WEIGHTS))
    rows, torque = weighted_rows(model)
    (tie,), (place,) = model.ties, model.places
    assert tie is not None
    bodies = model.scene.model.place(model.scene.model.rigid_body)
    held = [*range(bodies.start, bodies.stop), place.start]
    given = np.append(model.scene.value[bodies], tie.value)
    expected = left_by(np.delete(rows, held, axis=1), torque - rows[:, held] @ given)
    # Rotors that are known to a share are as they were stated.
    assert model.error == pytest.approx(expected, rel=1e-9)
    # The bodies' derivatives say nothing of bodies that stay.
    state = linearise(model.step)
    value = np.zeros(state.information.parameters)
    free = np.delete(np.arange(model.linear), held)
    value[held] = given
    value[free] = state.information.moved(-value).select(free).solve().value
    assert state.information.residual_sum(value) == pytest.approx(model.error, rel=1e-9)


def test_priors_add_how_far_parameters_are_from_them() -> None:
    step = step_beside(loss_runs(0.3, 1.0)[:1], [Candidate(TransmissionLoss(), Member(0, (0.3,)))], WEIGHTS)
    known = [item for item in present_model(step).unknowns if np.isfinite(item.spread)]
    assert known
    model = present_model(step)
    moved = replace(model, unknowns=tuple(replace(item, nominal=item.value - 3.0 * item.spread) for item in known))
    rows = sum(own.table.shape[1] for own in model.joints)
    assert moved.error == pytest.approx(model.error * (1.0 + 9.0 * len(known) / rows), rel=1e-9)
