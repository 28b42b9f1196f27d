"""What is known of nonlinear parameters before the fit: bounds, steps, and priors of rotors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.diagnosis.candidates.candidates import Candidate
from scara_ident.diagnosis.candidates.unknowns import LONGEST_STEP, Unknown, unknowns_of
from scara_ident.diagnosis.criteria import CRITERIA
from scara_ident.effects import Member
from scara_ident.effects.gear import TransmissionLoss
from scara_ident.effects.links import largest_armature
from scara_ident.model.model import build_model
from scara_ident.robot.rotors import GUESS_FACTOR
from tests.diagnosis.made import NOISE, exact_runs, step_beside


def test_a_rotor_that_nobody_stated_has_a_wide_prior_within_what_the_estimate_leaves_room_for() -> None:
    step = step_beside(exact_runs(), [Candidate(TransmissionLoss(), Member(0, (0.05,)))], 1.0 / np.array(NOISE))
    (stated,) = [
        item for item in unknowns_of(step.scene, step.chosen, CRITERIA.rotor_inertia_std) if item.owner is None
    ]
    robot = replace(step.scene.robot, rotor_stated=np.zeros(2, dtype=bool))
    scene = replace(step.scene, model=build_model(robot, "complete"))
    (guessed,) = [item for item in unknowns_of(scene, step.chosen, CRITERIA.rotor_inertia_std) if item.owner is None]
    assert stated.spread == CRITERIA.rotor_inertia_std
    assert guessed.spread == np.log(GUESS_FACTOR)
    assert guessed.nominal == np.log(robot.rotor_guess.armature[0])
    assert guessed.upper <= np.log(largest_armature(scene, 0))
    assert guessed.room[0] == -LONGEST_STEP
    assert guessed.moved(100.0) == guessed.upper


def test_a_step_goes_no_further_than_a_bound_and_than_the_linear_model_holds() -> None:
    """A frequency of 24 Hz that wanted to fall by 42 went to its least, 2 Hz: only what it could fall was cut, and not its step."""
    assert Unknown(0, 0, 24.0, 2.0, 200.0).room == (-LONGEST_STEP * 24.0, LONGEST_STEP * 24.0)
    assert Unknown(0, 0, 0.006, 0.005, 0.9).room == pytest.approx((-0.001, LONGEST_STEP * 0.006))
    # What is zero has no size that a share could be of.
    assert Unknown(0, 0, 0.0, -0.1, 0.1).room == (-0.1, 0.1)
    # What may have either sign is no larger for being far from zero, and goes as far from beside it.
    assert Unknown(0, 0, 1e-3, -1.0, 1.0).room == pytest.approx((-1.0, 0.999), rel=1e-2)
