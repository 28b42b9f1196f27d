"""Physical parameters and their standard deviations, those of nonlinear parameters included."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.diagnosis.candidates import Candidate
from scara_ident.diagnosis.effect_parameters import physical_parameters
from scara_ident.diagnosis.table import tabulate, tabulate_candidates
from scara_ident.effects import Member
from scara_ident.effects.friction import Stribeck
from scara_ident.effects.gear import TransmissionLoss
from scara_ident.effects.position import Spring
from tests.arms import noisy
from tests.diagnosis.made import BANDS, NOISE, complete, exact_runs, scene_of, with_torque

MODEL = complete()
AMPLITUDE, VELOCITY, STIFFNESS, REST = 0.06, 0.5, 0.05, 0.4
WEIGHTS = 1.0 / np.array(NOISE)


def stribeck_runs():
    def added(motion):
        return AMPLITUDE * np.sign(motion.v[0]) * np.exp(-((motion.v[0] / VELOCITY) ** 2))

    return with_torque(exact_runs(), 0, added)


def test_the_deviation_of_a_nonlinear_parameter_is_its_scatter_over_noise():
    """Every repetition finds the parameter by search over a grid and a parabola, not by the derivative."""
    runs = stribeck_runs()
    scene = scene_of(MODEL, runs)
    chosen = [Candidate(Stribeck(), Member(0, (VELOCITY,)))]
    told = physical_parameters(scene, runs, BANDS, WEIGHTS, chosen)[0]

    base = tabulate(MODEL, runs, BANDS).weighted(WEIGHTS)
    grid = np.linspace(0.35, 0.65, 25)
    columns, _ = tabulate_candidates(scene, [chosen[0].at([x]) for x in grid], runs, BANDS)
    q = np.linalg.qr(base.columns)[0]
    columns = columns * WEIGHTS[base.joint][:, None]
    columns -= q @ (q.T @ columns)
    size = np.sum(columns**2, axis=0)
    rng = np.random.default_rng(0)
    velocity, amplitude = [], []
    for _ in range(60):
        rows = tabulate(MODEL, [noisy(run, rng, NOISE) for run in runs], BANDS).weighted(WEIGHTS)
        saved = (columns.T @ rows.torque) ** 2 / size
        k = int(np.clip(np.argmax(saved), 1, len(grid) - 2))
        a, b, c = saved[k - 1 : k + 2]
        shift = 0.5 * (a - c) / (a - 2.0 * b + c)
        velocity.append(grid[k] + shift * (grid[1] - grid[0]))
        amplitude.append(float(np.interp(velocity[-1], grid, columns.T @ rows.torque / size)))
    # What is added to the runs has the noise of the runs themselves, so its scatter is theirs.
    assert told["velocity"].std == pytest.approx(np.std(velocity), rel=0.4)
    assert told["amplitude"].std == pytest.approx(np.std(amplitude), rel=0.4)
    assert abs(told["amplitude"].value - AMPLITUDE) < 4.0 * told["amplitude"].std
    assert told["velocity"].unit == "rad/s"


def test_several_effects_get_their_own_parameters():
    direction = MODEL.robot.drive_sign[1]
    runs = with_torque(stribeck_runs(), 1, lambda motion: direction * STIFFNESS * (motion.q[1] - REST))
    scene = scene_of(MODEL, runs)
    chosen = [Candidate(Spring(), Member(1)), Candidate(Stribeck(), Member(0, (VELOCITY,)))]
    spring, stribeck = physical_parameters(scene, runs, BANDS, WEIGHTS, chosen)
    assert set(spring) == {"stiffness", "rest_position"}
    assert abs(spring["stiffness"].value - STIFFNESS) < 4.0 * spring["stiffness"].std
    assert set(stribeck) == {"amplitude", "velocity"}
    assert abs(stribeck["amplitude"].value - AMPLITUDE) < 4.0 * stribeck["amplitude"].std
    assert 0.0 < spring["stiffness"].std < 0.1 * STIFFNESS
    # The model has an offset: nothing tells it from the spring's rest position.
    assert spring["rest_position"].std == np.inf


def test_a_parameter_that_only_serves_the_columns_is_not_reported():
    runs = exact_runs()
    found = physical_parameters(
        scene_of(MODEL, runs), runs, BANDS, WEIGHTS, [Candidate(TransmissionLoss(), Member(1, (0.1,)))]
    )
    assert set(found[0]) == {"loss_coefficient"}
