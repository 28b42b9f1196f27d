"""Guesses of rotors: against what makers say of drives, and what tells them where no limit does."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scara_ident.robot.robot import load_robot
from scara_ident.robot.rotors import GUESS_FACTOR
from tests.arms import PLANAR_2R, write_urdf

# Harmonic Drive, FHA-C series, with absolute encoder: ratio, maximum torque N m, inertia of the actuator at its output kg m^2.
FHA = (
    (50, 39, 0.2), (100, 57, 0.7), (160, 64, 1.9), (50, 150, 0.8), (100, 230, 3.4), (160, 260, 8.6),
    (50, 281, 1.8), (100, 398, 7.3), (160, 453, 18.1), (50, 500, 5.0), (100, 690, 19.8), (160, 820, 50.7),
)  # fmt: skip
# Franka FR3, joints 1, 3 and 7: torque limit N m, reflected inertia kg m^2 as its makers give it.
FR3 = ((87, 0.606), (87, 0.462), (12, 0.206))


def guess(reduction: float, torque: float) -> float:
    robot = load_robot()
    robot = replace(robot, reduction=np.full(2, reduction), effort_limit=np.full(2, torque))
    assert np.all(robot.rotor_guess.by_limit)
    return float(robot.rotor_guess.armature[0])


def test_it_meets_the_data_sheets_it_was_fitted_to_within_a_factor_of_two():
    factors = np.array([guess(ratio, torque) / inertia for ratio, torque, inertia in FHA])
    assert np.max(np.abs(np.log(factors))) < np.log(2.0)
    assert np.mean(np.log(factors)) == pytest.approx(0.0, abs=0.1)


@pytest.mark.parametrize("reduction", [1.0, -1.0, 100.0, -100.0])
def test_other_arms_lie_within_two_standard_deviations_of_it_and_a_gear_not_stated_counts_as_100(reduction: float):
    scara = load_robot()
    known = [*FR3, *zip(scara.effort_limit, scara.reduction**2 * scara.rotor_inertia, strict=True)]
    factors = np.array([guess(reduction, torque) / inertia for torque, inertia in known])
    assert np.max(np.abs(np.log(factors))) < 2.0 * np.log(GUESS_FACTOR)
    assert np.sqrt(np.mean(np.log(factors) ** 2)) < np.log(GUESS_FACTOR)


def test_where_no_limit_tells_a_motor_the_links_do(tmp_path: Path):
    robot = replace(load_robot(write_urdf(tmp_path / "arm.urdf", PLANAR_2R)), effort_limit=np.array([np.inf, 20.0]))
    found = robot.rotor_guess
    assert found.by_limit.tolist() == [False, True]
    # A tenth of the inertia about the first joint, which poses change: body 1 has 0.05 + 3 x 0.15^2 = 0.118 alone.
    first, second = 0.05 + 3.0 * 0.15**2, 0.03 + 1.5 * (0.12**2 + 0.02**2)
    assert 0.1 * (first + 0.03 + 1.5 * 0.28**2) < found.armature[0] < 0.1 * (first + second + 1.5 * 0.52**2)
    assert found.armature[1] == pytest.approx(1e4 * 1.5e-4 * 0.2**1.2)


def test_what_is_stated_is_distinguished_from_what_is_not():
    assert load_robot().rotor_stated.tolist() == [True, True]
    assert not np.any(load_robot("ur5").rotor_stated)
