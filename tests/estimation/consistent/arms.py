"""Arms and bodies for the tests of consistency."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scara_ident.model.model import TorqueModel, build_model
from scara_ident.robot.robot import Robot, load_robot
from tests.arms import Link, example_urdf, write_urdf

Array = NDArray[np.float64]

WRIST = (
    Link(axis=(0.0, 0.0, 1.0), mass=4.0, com=(0.05, 0.02, 0.1), inertia=(0.05, 0.06, 0.04)),
    Link(axis=(0.0, 1.0, 0.0), xyz=(0.0, 0.0, 0.4), mass=2.0, com=(0.1, 0.01, 0.02), inertia=(0.01, 0.02, 0.02)),
    Link(axis=(1.0, 0.0, 0.0), xyz=(0.3, 0.0, 0.0), mass=1.0, com=(0.05, 0.01, 0.02), inertia=(0.004, 0.005, 0.006)),
)
"""Three joints about different axes: most of the last body shows in the torque."""


def wrist_model(folder: Path) -> TorqueModel:
    return build_model(load_robot(write_urdf(folder / "wrist.urdf", WRIST)), "basic")


def parameters(model: TorqueModel, standard: Array, friction: tuple[float, float] = (0.5, 0.3)) -> Array:
    """Parameters of the model for standard parameters, with Coulomb and viscous friction on every joint."""
    value = np.zeros(len(model.columns))
    term = model.rigid_body
    value[model.place(term)] = (term.base.grouping @ standard)[term.kept]
    for k, column in enumerate(model.columns):
        if column.name.startswith("a0"):
            value[k] = friction[0]
        elif column.name.startswith("a1"):
            value[k] = friction[1]
    return value


def with_last_body(robot: Robot, body: Array) -> Array:
    """Nominal standard parameters with another last body, and rotors of 0.01."""
    standard = robot.standard_parameters()
    standard[10 * (robot.n - 1) : 10 * robot.n] = body
    standard[10 * robot.n :] = 0.01
    return standard


def ur5() -> Robot:
    return load_robot(example_urdf("ur5_robot.urdf"))


def panda() -> Robot:
    from scara_ident.robot.description import JointDescription, RobotDescription
    from scara_ident.robot.robot import build_robot

    urdf = example_urdf("panda.urdf")
    joints = {f"panda_joint{i}": JointDescription() for i in range(1, 8)}
    return build_robot(RobotDescription(urdf=urdf, joints=joints), urdf)


def heavier(robot: Robot, factor: float) -> Robot:
    """The same robot with a URDF that is wrong by a factor in every inertia."""
    model = robot.model.copy()
    for k in range(1, model.njoints):
        body = model.inertias[k]
        model.inertias[k] = type(body)(factor * body.mass, body.lever, factor * np.asarray(body.inertia))
    return replace(robot, model=model, rotor_inertia=factor * robot.rotor_inertia)
