"""Joints that move in proportion are named; what moves by itself, or not at all, is not."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.identification.in_step import groups, in_step
from scara_ident.identification.usable import usable_in_bands
from scara_ident.model.model import basic
from scara_ident.motion.prepared import prepare
from scara_ident.robot.robot import load_robot
from tests.arms import recording

ROBOT = load_robot()
RATE = 200.0


def run(name: str, first: float, second: float, phase: float = 0.0, own: float = 0.0):
    """12 s of sines of these amplitudes, with an encoder's noise; the second joint has a share of another frequency."""
    time = np.arange(2400) / RATE
    random = np.random.default_rng(len(name))
    moves = np.array([first * np.sin(2.0 * time), second * (np.sin(2.0 * time + phase) + own * np.sin(4.6 * time))])
    torque = 0.3 * moves + 0.01 * random.normal(size=moves.shape)
    return recording(ROBOT, name, time, moves + 1e-6 * random.normal(size=moves.shape), torque)


def told(*runs) -> list[str]:
    return in_step(ROBOT, prepare(runs, (5.0, 5.0)))


@pytest.mark.parametrize("second", [0.4, -0.9, 0.01])
def test_joints_in_proportion_are_named(second: float):
    """Five joints of seven moved as one: every parameter was called determined, and another motion had errors of 52 N m."""
    (said,) = told(run("a_1", 0.7, second), run("b_1", 0.35, 0.5 * second))
    assert said.startswith("joint1, joint2 move in proportion in all recordings: ")
    (note,) = (note for note in usable_in_bands(basic(ROBOT), [run("a_1", 0.7, second)])[2] if "proportion" in note)
    assert note == said


def test_one_recording_or_phase_or_frequency_that_differs_is_enough():
    assert told(run("a_1", 0.7, 0.4), run("b_1", 0.7, -0.4)) == []
    assert told(run("a_1", 0.7, 0.4, phase=0.1)) == []
    assert told(run("a_1", 0.7, 0.4, own=0.05)) == []
    assert len(told(run("a_1", 0.7, 0.4, own=1e-3))) == 1


def test_a_joint_at_rest_is_in_step_with_none():
    assert told(run("a_1", 0.7, 0.0)) == []


def test_groups_are_apart():
    velocity = np.array([[1.0, 0.0], [0.0, 2.0], [-3.0, 0.0], [1.0, 1.0], [0.0, 0.5], [0.0, 1e-5]])
    assert groups(velocity @ velocity.T) == [[0, 2], [1, 4]]
    assert groups(np.zeros((3, 3))) == []
