"""Physical parameters and their standard deviations, those of nonlinear parameters included."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from scara_ident.diagnosis.candidates.candidates import Candidate, CandidateColumns
from scara_ident.diagnosis.criteria import CRITERIA
from scara_ident.diagnosis.fitting.effect_parameters import (
    Coefficients,
    _physical,
    parameters_beside,
    physical_parameters,
    size_in_stds,
    size_is_determined,
)
from scara_ident.diagnosis.fitting.nonlinear_fit import tune
from scara_ident.diagnosis.selection.search import scene_of as scene_at
from scara_ident.diagnosis.testing.selection_step import SelectionStep
from scara_ident.effects import CATALOGUE, Effect, Member, Parameter
from scara_ident.effects.coupling import DriveCoupling
from scara_ident.effects.elasticity import JointElasticity
from scara_ident.effects.friction import Stribeck
from scara_ident.effects.gear import TransmissionLoss
from scara_ident.effects.measurement import TimeDelay
from scara_ident.effects.position import Spring
from scara_ident.effects.tilt import BaseTilt
from scara_ident.estimation import wls
from scara_ident.estimation.observations import Observations, observe
from scara_ident.model.model import build_model
from scara_ident.motion.prepared import PreparedData, prepare
from scara_ident.recording.recording import Recording
from scara_ident.robot.robot import Robot, load_robot
from tests.arms import Link, noisy, recorded_torque, recording, sines, write_urdf
from tests.diagnosis.made import NOISE, complete, exact_runs, observed, step_beside, with_torque
from tests.effects.scenes import scene_of
from tests.effects.test_position import without_offset
from tests.effects.test_tilt import leaning
from tests.estimation.test_working_range import observations as hardly_moving

Array = NDArray[np.float64]

AMPLITUDE, VELOCITY, STIFFNESS, REST = 0.06, 0.5, 0.05, 0.4
WEIGHTS = 1.0 / np.array(NOISE)


class Leak(DriveCoupling):
    """A share of the other joint's torque as it was predicted once."""

    follows_estimate = False


def stribeck_runs():
    def added(motion):
        return AMPLITUDE * np.sign(motion.v[0]) * np.exp(-((motion.v[0] / VELOCITY) ** 2))

    return with_torque(exact_runs(), 0, added)


def test_what_changes_with_a_coefficient_that_is_left_open_is_not_determined():
    """The rest of a gas spring on a vertical axis was -0.21 m to half a millimetre, where 0 was true: weight is a preload too."""
    scene, candidate = without_offset(scene_of(load_robot())), Candidate(Spring(), Member(1))
    # What a generalized inverse leaves of a coefficient that is open.
    linear = Coefficients(np.array([0.19, 0.04]), np.diag([2.5e-7, 0.0]))
    told = _physical(scene, candidate, linear, np.array([], dtype=np.intp))
    assert told["rest_position"].std == pytest.approx(0.04 / 0.19**2 * 5e-4)
    told = _physical(scene, candidate, linear, np.array([1]))
    assert (told["stiffness"].std, told["rest_position"].std) == (pytest.approx(5e-4), np.inf)


@pytest.mark.slow
def test_the_deviation_of_a_nonlinear_parameter_is_its_scatter_over_noise():
    """Every repetition finds the parameter by search over a grid and a parabola, not by the derivative."""
    runs = stribeck_runs()
    chosen = Candidate(Stribeck(), Member(0, (VELOCITY,)))
    step = step_beside(runs, [chosen], WEIGHTS)
    (told,) = physical_parameters(step).effects

    def rows(observations: Observations, candidates: Sequence[Candidate] = ()) -> tuple[Array, Array]:
        """Weighted rows of both joints: the model's columns and the torque, and the candidates' columns."""
        own, added = [], []
        for j, joint in enumerate(observations.joints):
            wide = np.zeros((joint.table.shape[1], observations.parameters + 1))
            wide[:, joint.columns], wide[:, -1] = joint.table[:-1].T, joint.table[-1]
            own.append(WEIGHTS[j] * wide)
            none = np.zeros((1, len(wide)))
            added.append(
                WEIGHTS[j] * np.vstack([item.get(j, none) for item in step.columns.rows(step.scene, candidates)]).T
                if candidates
                else none.T
            )
        return np.vstack(own), np.vstack(added)

    grid = np.linspace(0.35, 0.65, 25)
    base, columns = rows(step.observations, [chosen.at([x]) for x in grid])
    q = np.linalg.qr(base[:, :-1])[0]
    columns -= q @ (q.T @ columns)
    size = np.sum(columns**2, axis=0)
    rng = np.random.default_rng(0)
    velocity, amplitude = [], []
    for _ in range(60):
        torque = rows(observed([noisy(run, rng, NOISE) for run in runs]))[0][:, -1]
        saved = (columns.T @ torque) ** 2 / size
        k = int(np.clip(np.argmax(saved), 1, len(grid) - 2))
        a, b, c = saved[k - 1 : k + 2]
        shift = 0.5 * (a - c) / (a - 2.0 * b + c)
        velocity.append(grid[k] + shift * (grid[1] - grid[0]))
        amplitude.append(float(np.interp(velocity[-1], grid, columns.T @ torque / size)))
    # What is added to the runs has the noise of the runs themselves, so its scatter is theirs.
    assert told["velocity"].std == pytest.approx(np.std(velocity), rel=0.4)
    assert told["amplitude"].std == pytest.approx(np.std(amplitude), rel=0.4)
    assert abs(told["amplitude"].value - AMPLITUDE) < 4.0 * told["amplitude"].std
    assert told["velocity"].unit == "rad/s"
    assert (told["velocity"].symmetric_power, told["amplitude"].symmetric_power) == (0.0, 1.0)


def test_several_effects_get_their_own_parameters():
    direction = complete().robot.drive_sign[1]
    runs = with_torque(stribeck_runs(), 1, lambda motion: direction * STIFFNESS * (motion.q[1] - REST))
    chosen = [Candidate(Spring(), Member(1)), Candidate(Stribeck(), Member(0, (VELOCITY,)))]
    spring, stribeck = physical_parameters(step_beside(runs, chosen, WEIGHTS)).effects
    assert set(spring) == {"stiffness", "rest_position"}
    assert abs(spring["stiffness"].value - STIFFNESS) < 4.0 * spring["stiffness"].std
    assert set(stribeck) == {"amplitude", "velocity"}
    assert abs(stribeck["amplitude"].value - AMPLITUDE) < 4.0 * stribeck["amplitude"].std
    assert 0.0 < spring["stiffness"].std < 0.1 * STIFFNESS
    # The model has an offset: nothing tells it from the spring's rest position.
    assert spring["rest_position"].std == np.inf


def test_a_parameter_that_only_serves_the_columns_is_not_reported():
    chosen = [Candidate(TransmissionLoss(), Member(1, (0.1,)))]
    (found,) = physical_parameters(step_beside(exact_runs(), chosen, WEIGHTS)).effects
    assert set(found) == {"loss_coefficient"}


def test_beside_a_model_the_parameters_are_those_of_the_model_that_has_the_effect():
    """Where they come from block scores of the effect alone, with what the model spans projected out."""
    runs = stribeck_runs()
    candidate = Candidate(Stribeck(), Member(0, (VELOCITY,)))
    beside = parameters_beside(step_beside(runs, (), WEIGHTS), candidate)
    (whole,) = physical_parameters(step_beside(runs, [candidate], WEIGHTS)).effects
    assert beside["amplitude"].value == pytest.approx(whole["amplitude"].value, rel=1e-9)
    assert beside["amplitude"].std == pytest.approx(whole["amplitude"].std, rel=0.15)
    spring = parameters_beside(step_beside(runs, (), WEIGHTS), Candidate(Spring(), Member(1)))
    assert abs(spring["stiffness"].value) < 4.0 * spring["stiffness"].std


def test_the_deviation_of_a_coefficient_holds_what_the_noise_of_positions_does():
    """A gear loss behind 17 bits was 2.3 of its deviations off, the parameters beside it none of theirs."""
    rng = np.random.default_rng(9)
    shared = [replace(run, effort=run.effort + np.outer([0.1, 0.0], run.effort[1])) for run in exact_runs()]
    runs = [replace(run, position=run.position + 3e-4 * rng.standard_normal(run.position.shape)) for run in shared]
    step = step_beside(runs, [Candidate(Leak(), Member(0, (), 1))], WEIGHTS)

    def share(at: SelectionStep) -> float:
        """Plain least squares of all rows at once."""
        (added,) = at.columns.rows(at.scene, at.chosen)
        wide = np.zeros((at.observations.parameters + 2, sum(rows.table.shape[1] for rows in at.observations.joints)))
        start = 0
        for j, rows in enumerate(at.observations.joints):
            own = slice(start, start := start + rows.table.shape[1])
            wide[np.append(rows.columns, len(wide) - 1), own] = WEIGHTS[j] * rows.table
            wide[-2, own] = WEIGHTS[j] * added[j][0] if j in added else 0.0
        return float(np.linalg.lstsq(wide[:-1].T, wide[-1], rcond=None)[0][-1])

    (whole,), (scatter,) = (physical_parameters(step, of_noise=counted).effects for counted in (True, False))
    bias = share(step.noisier) - share(step)
    assert abs(bias) > 0.5 * scatter["share"].std
    assert whole["share"].std == pytest.approx(np.hypot(scatter["share"].std, bias), rel=1e-3)


@pytest.mark.slow
def test_what_lags_has_noise_where_accelerations_have_next_to_none() -> None:
    """Steps of 20 bits bias no inertia, and a fit of an elastic gear was told as if there were none."""
    step = 2.0 * np.pi / 2**20
    fine = exact_runs()
    coarse = [replace(run, position=step * np.round(run.position / step)) for run in fine]
    told = []
    for runs, effect in ((coarse, JointElasticity()), (coarse, Spring()), (fine, JointElasticity())):
        begun = Member(0, (25.0, 0.1)) if effect.nonlinear else Member(0)
        linear = physical_parameters(step_beside(runs, [Candidate(effect, begun)], WEIGHTS)).linear
        assert linear is not None
        told.append(linear.noise_bias is not None)
    assert told == [True, False, False]


def test_coefficients_are_at_least_what_their_uncertainty_leaves():
    own = Coefficients(np.array([5.0, -5.0, 1.0]), np.diag([1.0, 4.0, 1.0]))
    np.testing.assert_allclose(own.at_least(2.0), [3.0, -1.0, 0.0])


@pytest.mark.parametrize(("std", "told"), [(0.01, True), (0.03, False)])
def test_a_size_is_determined_where_it_differs_from_none_whatever_the_other_parameters(std: float, told: bool):
    parameters = {"amplitude": Parameter(AMPLITUDE, std, "N m"), "velocity": Parameter(VELOCITY, 0.01, "rad/s")}
    assert size_is_determined(Stribeck(), parameters, 2.5) is told
    assert size_in_stds(Stribeck(), parameters) == pytest.approx(abs(AMPLITUDE) / std)


@pytest.mark.parametrize(("value", "std", "stds"), [(0.0, 0.0, 0.0), (1.0, 0.0, np.inf), (1.0, np.inf, 0.0)])
def test_a_size_of_nothing_and_one_that_may_be_anything_differ_from_none_by_no_standard_deviation(value, std, stds):
    assert size_in_stds(Stribeck(), {"amplitude": Parameter(value, std, "N m")}) == stds


def fits(robot: Robot, runs: Sequence[Recording], chosen: Candidate, noise: Array, draws: int) -> dict[str, Array]:
    """Each parameter with its standard deviation, (draws, 2), as it is fitted to the same motions with noise anew."""
    ready, model = prepare(runs, (10.0,) * robot.n), build_model(robot)
    found: dict[str, list[tuple[float, float]]] = {}
    for k in range(draws):
        rng = np.random.default_rng([3, k])
        parts = [own.with_effort_of(noisy(run, rng, noise)) for own, run in zip(ready.recordings, runs, strict=True)]
        seen = observe(model, PreparedData(tuple(parts), ready.bands))
        scene = scene_at(model, wls(seen).value, seen)
        step = SelectionStep(scene, CandidateColumns(seen), (chosen,), 1.0 / noise, 10, CRITERIA)
        (told,) = physical_parameters(tune(step)).effects
        for name, parameter in told.items():
            found.setdefault(name, []).append((parameter.value, parameter.std))
    return {name: np.array(each) for name, each in found.items()}


@pytest.mark.slow
def test_a_tilt_is_as_unsure_as_the_masses_that_it_pulls_at(tmp_path: Path):
    """Of a slide that turns, gravity from the side tells mass times tilt: the tilt seemed known however little the mass was."""
    links = (
        Link(mass=12.0, inertia=(0.2, 0.2, 0.4)),
        Link("prismatic", (1.0, 0.0, 0.0), mass=5.0, com=(0.2, 0.0, 0.0), inertia=(0.02, 0.1, 0.1)),
    )
    robot = load_robot(write_urdf(tmp_path / "arm.urdf", links))
    tilts, time = (0.1, -0.08), np.arange(3000) / 125.0
    runs = []
    for k in range(3):
        q, v, a = sines(np.random.default_rng(k), time, 2, size=0.8, lowest=0.04)
        torque = recorded_torque(leaning(robot, tilts), q, v, a, [(0.2, 0.1, 0.0, 0.0, 0.0)] * 2)
        runs.append(recording(robot, f"t{k}_1", time, q, torque))
    found = fits(robot, runs, Candidate(BaseTilt(), Member(None)), np.array([0.2, 0.2]), 24)
    for axis, tilt in zip("xy", tilts, strict=True):
        value, std = found[f"tilt_{axis}"].T
        assert np.median(std) == pytest.approx(np.std(value), rel=0.4)
        assert np.mean(np.abs(value - tilt) < 2.0 * std) > 0.8


@pytest.mark.slow
def test_what_a_gear_loses_is_determined_where_one_parameter_is_its_load(tmp_path: Path):
    """Of a lift the gain that goes with the loss is one with its mass: free, it left open how large the loss is."""
    robot = load_robot(write_urdf(tmp_path / "lift.urdf", (Link("prismatic", mass=20.0),)))
    share, time = 0.15, np.arange(3000) / 250.0
    runs = []
    for k in range(3):
        q, v, a = sines(np.random.default_rng(k), time, 1, size=0.5)
        load = recorded_torque(robot, q, v, a, [(0.0,) * 5])
        lost = (np.sqrt(1.0 + share**2) - 1.0) * load + share * np.abs(load) * np.sign(v)
        runs.append(recording(robot, f"t{k}_1", time, q, load + lost + 2.0 * np.sign(v) + v))
    found = fits(robot, runs, Candidate(TransmissionLoss(), Member(0, (share,))), np.array([2.0]), 24)
    value, std = found["loss_coefficient"].T
    assert np.median(std) == pytest.approx(np.std(value), rel=0.4)


def test_what_rows_leave_open_is_no_less_known_beside_what_was_taken_out_of_the_data() -> None:
    """Of a joint that hardly moves directions are left at zero, and do not make all others unsure."""
    seen = hardly_moving(load_robot(), 2, (0.2, 2e-4))
    start = wls(seen)
    told = ~start.undetermined
    assert 0 < np.count_nonzero(told) < len(told)
    scene, delay = scene_at(seen.model, start.value, seen), Candidate(TimeDelay(), Member(None))
    step = SelectionStep(scene, CandidateColumns(seen), (delay,), start.weights, 10, CRITERIA, start.offsets)
    linear = physical_parameters(step).linear
    assert linear is not None
    # Nothing is left to find of what was taken out.
    assert linear.value[-1] == 0.0
    std = np.sqrt(np.diag(linear.covariance))[:-1]
    assert std[told] == pytest.approx(start.std[told], rel=0.2)


@pytest.mark.slow
@pytest.mark.parametrize("effect", CATALOGUE, ids=lambda effect: type(effect).__name__)
def test_a_coefficient_is_as_unsure_among_all_parameters_as_among_those_of_its_effect(effect: Effect):
    """The width of a clearance was known to 7e-06 rad in the list, and to 7e-05 as the effect's parameter."""
    step = step_beside(exact_runs())
    members = effect.members(step.scene)[:1]
    found = physical_parameters(replace(step, chosen=tuple(Candidate(effect, member) for member in members)))
    for member, told, own in zip(members, found.effects, found.coefficients, strict=True):
        std = np.sqrt(np.diag(found.linear.covariance))[-len(own.value) :]
        for column, x, spread in zip(effect.columns(step.scene, member), own.value, std, strict=True):
            if column.name in told and np.isfinite(told[column.name].std):
                assert (x, spread) == pytest.approx((told[column.name].value, told[column.name].std), rel=1e-9)
