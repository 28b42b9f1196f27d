from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from scara_ident.export.friction import JointFriction
from scara_ident.export.urdf import urdf_text
from scara_ident.model.terms import Friction
from scara_ident.motion.motion import Motion
from scara_ident.robot.robot import load_robot
from tests.export.arms import branched, random_motion


def test_friction_that_the_data_leave_open_stays_the_file_s() -> None:
    robot = load_robot()
    friction = JointFriction(np.array([0.1, np.nan]), np.array([np.nan, 0.4]))
    text, notes = urdf_text(robot, robot.standard_parameters(), friction)
    assert re.findall(r"<dynamics.*/>", text) == ['<dynamics friction="10.0"/>', '<dynamics damping="40.0"/>']
    assert "joint1: viscous friction is not known and was not written" in notes


def test_friction_below_zero_is_not_written_and_reported() -> None:
    robot = load_robot()
    text, notes = urdf_text(
        robot, robot.standard_parameters(), JointFriction(np.array([0.1, 0.1]), np.array([0.01, -0.02]))
    )
    assert '<dynamics damping="0.0" friction="10.0"/>' in text
    assert notes == ("joint2: viscous friction is -0.02; below zero it would drive the joint, so 0 was written",)


def test_friction_brakes_at_a_gear_that_reverses_as_the_model_has_it(tmp_path: Path) -> None:
    """The torque of the model's own friction columns, carried to the joint, is that of the exported file."""
    robot = branched(tmp_path)
    assert robot.reduction[0] == -50.0
    term = Friction(robot, (0, 1))
    rng = np.random.default_rng(0)
    coulomb, viscous = rng.uniform(0.1, 1.0, (2, 3))
    text, _ = urdf_text(robot, robot.standard_parameters(), JointFriction(coulomb, viscous))
    root = ElementTree.fromstring(text)
    _, v, a = random_motion(robot, 0)
    motion = Motion("run_1", "run", 0.01 * np.arange(v.shape[1], dtype=np.float64), v, v, a, None, 100.0)
    recorded = np.einsum("jpn,p->jn", term.regressor(motion), np.column_stack([coulomb, viscous]).ravel())
    for j, name in enumerate(robot.joints):
        dynamics = root.find(f"joint[@name='{name}']/dynamics")
        assert dynamics is not None
        damping, friction = float(dynamics.attrib["damping"]), float(dynamics.attrib["friction"])
        at_joint = recorded[j] * robot.reduction[j]
        np.testing.assert_allclose(damping * v[j] + friction * np.sign(v[j]), at_joint, rtol=1e-13)
