"""A model that is linear about its nonlinear parameters: its derivatives, and its solutions against those of dense rows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from scara_ident.diagnosis.candidates.candidates import Candidate, CandidateColumns, with_columns
from scara_ident.diagnosis.fitting.linearised import with_estimate_slopes
from scara_ident.diagnosis.fitting.trust_region import RADIUS_TOLERANCE
from scara_ident.diagnosis.testing.selection_step import SelectionStep
from scara_ident.effects import Member
from scara_ident.effects.friction import Stribeck
from scara_ident.effects.gear import TransmissionLoss
from scara_ident.effects.measurement import TimeDelay, TorqueSensorNonlinearity
from scara_ident.estimation.information import merge
from scara_ident.estimation.joint_rows import JointRows
from tests.diagnosis.fitting.test_nonlinear_fit import WEIGHTS, linear, loss_runs
from tests.diagnosis.made import step_beside

pytestmark = pytest.mark.slow


def dense(joints: Sequence[JointRows], parameters: int) -> np.ndarray:
    """All columns on the rows of all joints."""
    tables = []
    for rows in joints:
        wide = np.zeros((rows.table.shape[1], parameters))
        wide[:, rows.columns] = rows.table[:-1].T
        tables.append(wide)
    return np.vstack(tables)


def predicted(step: SelectionStep, value: np.ndarray) -> np.ndarray:
    """Torque on the rows of all joints by the columns as they are."""
    joints = with_columns(step.observations, step.columns.rows(step.scene, step.chosen))
    return dense(joints, len(value)) @ value


def test_the_derivatives_are_those_of_the_predicted_torque() -> None:
    chosen = (Candidate(Stribeck(), Member(1, (0.2,))), Candidate(TransmissionLoss(), Member(0, (0.3,))))
    step = step_beside(loss_runs(0.3, 1.0)[:1], chosen, WEIGHTS)
    scene, state = step.scene, linear(step)

    def moved(velocity: float, share: float, armature: float) -> np.ndarray:
        other = (chosen[0].at([velocity]), chosen[1].at([share]))
        return predicted(replace(step, scene=replace(scene, armatures={0: armature}), chosen=other), state.value)

    derivatives = dense(state.joints, state.information.parameters)[:, state.linear :]
    at = [0.2, 0.3, scene.nominal_armature(0)]
    for k, value in enumerate(at):
        # The load's absolute value has kinks, which hardly any row has within so short a step.
        up, down = ([x * (1.0 + sign * 1e-5 * (i == k)) for i, x in enumerate(at)] for sign in (1.0, -1.0))
        # An armature's parameter is its logarithm.
        numeric = (moved(*up) - moved(*down)) / (2e-5 * (1.0 if k == 2 else value))
        # What passes on of a load that swings is held, beside the rotor that takes up the rest.
        bound = 1e-2 if k == 2 else 2e-3
        assert np.linalg.norm(derivatives[:, k] - numeric) < bound * np.linalg.norm(numeric)


def test_where_columns_follow_the_base_model_its_derivatives_are_those_of_the_predicted_torque() -> None:
    chosen = (
        Candidate(Stribeck(), Member(1, (0.2,))),
        Candidate(TransmissionLoss(), Member(0, (0.3,))),
        Candidate(TorqueSensorNonlinearity(), Member(1)),
    )
    step = step_beside(loss_runs(0.3, 1.0)[:1], chosen, WEIGHTS)
    scene, plain = step.scene, linear(step)
    state = with_estimate_slopes(step, plain)
    start = len(scene.value)
    at = np.append(scene.value, plain.value[start:])

    def moved(value: np.ndarray) -> np.ndarray:
        return predicted(replace(step, scene=replace(scene, value=value)), np.append(value, at[start:]))

    derivatives, without = (dense(each.joints, state.information.parameters) for each in (state, plain))
    for k in range(start):
        # Loads change their sign at other samples where a parameter moves: hardly, by so little.
        reach = 1e-5 * max(abs(scene.value[k]), 0.1)
        up, down = (scene.value + sign * reach * (np.arange(start) == k) for sign in (1.0, -1.0))
        numeric = (moved(up) - moved(down)) / (2.0 * reach)
        assert np.linalg.norm(derivatives[:, k] - numeric) < 2e-3 * np.linalg.norm(numeric)
    # What is tied had its own before; the other's are new, all else as it was, and what is left at the present estimate too.
    bodies = scene.model.place(scene.model.rigid_body)
    columns = dense(step.observations.joints, start)
    of_tied, of_other = (
        np.linalg.norm(each[:, bodies]) for each in (without[:, :start] - columns, derivatives - without)
    )
    assert 0.0 < of_other < of_tied
    assert np.array_equal(derivatives[:, start:], without[:, start:])
    for here, there in zip(state.joints, plain.joints, strict=True):
        before, after = (rows.left(np.append(at, np.zeros(len(state.unknowns)))) for rows in (there, here))
        assert after == pytest.approx(before, abs=1e-9 * np.max(np.abs(here.table[-1])))
    # Where nothing follows nothing is made.
    (friction, *_) = chosen
    alone = replace(step, chosen=(friction,))
    as_it_was = linear(alone)
    assert with_estimate_slopes(alone, as_it_was) is as_it_was


def test_what_was_taken_out_of_the_data_has_no_torque_that_the_base_model_could_change(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    step = step_beside(loss_runs(0.3, 1.0)[:1], (Candidate(TimeDelay(), Member(None)),), WEIGHTS)
    plain = linear(step)
    asked = list[Candidate]()
    monkeypatch.setattr(CandidateColumns, "estimate_slopes", lambda *given: asked.append(given[2]) or {})
    state = with_estimate_slopes(step, plain)
    assert not asked and not np.any(plain.value[plain.places[0]])
    assert np.array_equal(state.information.factor, plain.information.factor)


def test_a_parameter_that_is_the_coefficient_is_one_with_it() -> None:
    chosen = (Candidate(Stribeck(), Member(1, (0.2,))), Candidate(TransmissionLoss(), Member(0, (0.4,))))
    state = linear(step_beside(loss_runs(0.3, 1.0), chosen, WEIGHTS))
    column, share = state.places[1].start, state.linear + 1
    assert state.value[column] == pytest.approx(0.4, rel=1e-6)
    way, _ = state.solve()
    # It began far from where it leads the other: both go there together, near the truth.
    assert way[column] == pytest.approx(0.4 + way[share], rel=1e-6)
    assert abs(way[column] - 0.3) < 0.1 * abs(0.4 - 0.3)
    inverse = merge([state.information, state.prior]).inverse()
    variance, of_share = inverse[column, column], inverse[share, share]
    assert of_share == pytest.approx(variance, rel=1e-4)
    assert inverse[column, share] == pytest.approx(variance, rel=1e-4)


def test_the_solution_is_that_of_all_weighted_rows_with_those_of_the_priors() -> None:
    """From triangular factors, and once more from dense rows."""
    chosen = (Candidate(Stribeck(), Member(1, (0.2,))), Candidate(TransmissionLoss(), Member(0, (0.3,))))
    state = linear(step_beside(loss_runs(0.3, 1.0)[:1], chosen, WEIGHTS))
    size = np.repeat(WEIGHTS, [rows.table.shape[1] for rows in state.joints])
    torque = size * np.concatenate([rows.table[-1] for rows in state.joints])
    rows = size[:, None] * dense(state.joints, state.information.parameters)
    own, tied = rows[:, : state.linear], state.places[1].start
    # At the present parameters a tied coefficient is what they say.
    assert state.value[tied] == pytest.approx(0.3, rel=1e-6)
    free, given = np.delete(own, tied, axis=1), torque - 0.3 * own[:, tied]
    fitted = 0.3 * own[:, tied] + free @ np.linalg.lstsq(free, given)[0]
    assert own @ state.value == pytest.approx(fitted, abs=1e-6 * np.max(np.abs(torque)))
    left = torque - own @ state.value
    assert state.variance == pytest.approx(np.mean(left**2), rel=1e-9)
    prior = state.prior.factor
    columns = np.vstack([rows, prior[:, :-1]])
    scale = np.linalg.norm(columns, axis=0)
    scale[scale == 0.0] = 1.0
    best = np.linalg.lstsq(columns / scale, np.concatenate([torque, prior[:, -1]]), rcond=1e-9)[0] / scale
    change, std = state.solve()
    assert change == pytest.approx(best, rel=1e-6)
    inverse = np.linalg.pinv((columns / scale).T @ (columns / scale), rcond=1e-18, hermitian=True) / np.outer(
        scale, scale
    )
    assert std[state.linear :] == pytest.approx(np.sqrt(state.variance * np.diag(inverse))[state.linear :], rel=1e-5)


def test_beside_a_parameter_at_its_bound_all_others_are_the_best_without_it() -> None:
    chosen = (Candidate(Stribeck(), Member(1, (0.2,))), Candidate(TransmissionLoss(), Member(0, (0.3,))))
    free = linear(step_beside(loss_runs(0.3, 1.0)[:1], chosen, WEIGHTS))
    place, last = free.linear + 1, free.unknowns[1]
    away = np.sign(free.solve()[0][place])
    ends = {"upper": last.value} if away > 0.0 else {"lower": last.value}
    unknowns = (free.unknowns[0], replace(last, **ends), *free.unknowns[2:])
    stuck = replace(free, present=replace(free.present, unknowns=unknowns))
    change, _ = stuck.solve()
    rows = np.delete(np.vstack([free.information.factor, free.prior.factor]), place, axis=1)
    scale = np.linalg.norm(rows[:, :-1], axis=0)
    best = np.linalg.lstsq(rows[:, :-1] / scale, rows[:, -1], rcond=1e-9)[0] / scale
    assert change[place] == 0.0
    assert np.delete(change, place) == pytest.approx(best, rel=1e-6)


def test_a_step_within_a_radius_is_the_best_of_its_length_and_linear_parameters_are_free() -> None:
    chosen = (Candidate(Stribeck(), Member(1, (0.2,))), Candidate(TransmissionLoss(), Member(0, (0.3,))))
    state = linear(step_beside(loss_runs(0.3, 1.0)[:1], chosen, WEIGHTS))
    rows = np.vstack([state.information.factor, state.prior.factor])
    own, theirs = rows[:, : state.linear], rows[:, state.linear : -1]
    beside = theirs - own @ np.linalg.lstsq(own, theirs, rcond=1e-9)[0]
    left = rows[:, -1] - own @ np.linalg.lstsq(own, rows[:, -1], rcond=1e-9)[0]
    way = state.solve()[0]
    whole = way[state.linear :]
    size = np.linalg.norm(beside, axis=0)
    assert state.length(way) == pytest.approx(np.linalg.norm(size * whole), rel=1e-6)
    # No room ends so near.
    radius = 0.05 * state.length(way)
    found = state.step(radius)
    assert state.length(found) == pytest.approx(radius, rel=RADIUS_TOLERANCE)
    # With a multiplier it leaves least.
    change = found[state.linear :]
    slope = beside.T @ (left - beside @ change)
    multiplier = (slope / size) @ (size * change) / np.sum((size * change) ** 2)
    assert multiplier > 0.0
    best = np.linalg.solve(beside.T @ beside + multiplier * np.diag(size**2), beside.T @ left)
    assert size * change == pytest.approx(size * best, abs=1e-4 * radius)
    given = np.linalg.lstsq(own, rows[:, -1] - theirs @ change, rcond=1e-9)[0]
    assert own @ found[: state.linear] == pytest.approx(own @ given, abs=1e-7 * np.max(np.abs(rows[:, -1])))
    # By dense rows.
    weights = np.repeat(WEIGHTS, [rows.table.shape[1] for rows in state.joints])
    columns = dense(state.joints, len(way))
    after = weights * (np.concatenate([rows.table[-1] for rows in state.joints]) - columns @ way)
    (rotor,) = (item for item in state.unknowns if item.owner is None)
    far = ((rotor.value + way[-1] - rotor.nominal) / rotor.spread) ** 2
    assert state.gain(way) == pytest.approx(1.0 - (np.mean(after**2) / state.variance + far / len(after)), abs=1e-9)
    assert state.gain(way) > state.gain(found) > 0.0


def test_a_step_ends_where_its_room_does_and_the_others_make_the_best_of_that() -> None:
    """The whole way was cut in proportion: what one parameter could not go, none of the others went."""
    chosen = (Candidate(Stribeck(), Member(1, (0.05,))), Candidate(TransmissionLoss(), Member(0, (0.2,))))
    state = linear(step_beside(loss_runs(0.3, 1.0)[:1], chosen, WEIGHTS))
    free, _ = state.solve()
    place = state.linear
    low, high = state.unknowns[0].room
    narrow = replace(state.unknowns[0], lower=state.unknowns[0].value - 1e-4, upper=state.unknowns[0].value + 1e-4)
    assert max(low, -1e-4) > free[place] or free[place] > min(high, 1e-4)
    found = replace(state, present=replace(state.present, unknowns=(narrow, *state.unknowns[1:]))).step()
    assert abs(found[place]) == pytest.approx(1e-4)
    rows = np.vstack([state.information.factor, state.prior.factor])
    others = np.delete(rows, place, axis=1)
    scale = np.linalg.norm(others[:, :-1], axis=0)
    best = np.linalg.lstsq(others[:, :-1] / scale, rows[:, -1] - rows[:, place] * found[place], rcond=1e-9)[0] / scale
    assert np.delete(found, place) == pytest.approx(best, rel=1e-5)
