"""Lines of the residual's spectra as candidates."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.diagnosis.candidates.lines import line_candidates
from scara_ident.effects.periodic import TorqueRipple, Vibration
from scara_ident.effects.position import Spring
from tests.diagnosis.made import BANDS, exact_runs, residuals_of, step_beside, with_torque

WIDE = (40.0, 40.0)
PERIODIC = (TorqueRipple(), Vibration(), Spring())


def candidates(runs, catalogue=PERIODIC):
    scene = step_beside(exact_runs(), bands=WIDE).scene
    return line_candidates(scene, residuals_of(scene.value, runs, WIDE), catalogue)


def test_noise_has_no_line():
    assert candidates(exact_runs()) == []


def test_a_line_in_motor_angle_becomes_a_ripple_of_its_order():
    runs = with_torque(exact_runs(), 1, lambda motion: 0.01 * np.sin(1.37 * 100.0 * motion.q[1] + 0.5))
    ripples = [item for item in candidates(runs) if isinstance(item.effect, TorqueRipple)]
    assert [item.member.joint for item in ripples] == [1]
    assert ripples[0].member.nonlinear[0] == pytest.approx(1.37, abs=0.01)


def test_a_line_in_time_becomes_a_vibration_of_its_frequency():
    runs = with_torque(exact_runs(), 0, lambda motion: 0.02 * np.sin(2.0 * np.pi * 17.3 * motion.time))
    found = [item for item in candidates(runs) if isinstance(item.effect, Vibration)]
    assert found
    assert all(item.member.joint == 0 for item in found)
    assert all(item.member.nonlinear[0] == pytest.approx(17.3, abs=0.05) for item in found)


def test_a_line_just_above_the_band_is_tried_beside_the_strongest_within():
    def torque(motion):
        return 0.01 * np.sin(2.0 * np.pi * 7.1 * motion.time) + 0.3 * np.sin(2.0 * np.pi * 15.2 * motion.time)

    scene = step_beside(exact_runs()).scene
    found = line_candidates(
        scene, residuals_of(scene.value, with_torque(exact_runs(), 0, torque), BANDS), (Vibration(),)
    )
    assert [item.member.nonlinear[0] for item in found] == pytest.approx([7.1, 15.2], abs=0.05)


def test_only_families_of_the_catalogue_are_offered():
    runs = with_torque(exact_runs(), 1, lambda motion: 0.01 * np.sin(137.0 * motion.q[1]))
    assert candidates(runs, (Spring(),)) == []
    assert not [item for item in candidates(runs, (Vibration(),)) if isinstance(item.effect, TorqueRipple)]
