"""Small design problems for tests."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from scara_ident.arrays import Array
from scara_ident.excitation.criteria import Criterion, LogDet
from scara_ident.excitation.curves import make_basis
from scara_ident.excitation.limits import limits_of, nominal_parameters, resting_posture, without_coulomb
from scara_ident.excitation.problem import Problem, Task, row_names
from scara_ident.excitation.sensitivity import SmoothModel
from scara_ident.excitation.verification import grid
from scara_ident.model.model import TorqueModel
from scara_ident.model.terms import RigidBody
from scara_ident.model.terms.rigid_body import rigid_body
from scara_ident.robot.description import JointDescription, RobotDescription
from scara_ident.robot.robot import Robot, build_robot, embedded_urdf, load_robot
from tests.arms import Link, example_urdf, write_urdf

ENDS = np.full(3, -2.0), np.full(3, 2.0)
BALL = '<sphere radius="0.05"/>'


def panda() -> Robot:
    """Return the Panda with its fingers locked."""
    urdf = example_urdf("panda.urdf")
    joints = {f"panda_joint{k}": JointDescription() for k in range(1, 8)}
    return build_robot(RobotDescription(urdf=urdf, joints=joints), urdf)


def scara_with_quill(gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)) -> Robot:
    """Return the SCARA03 with its prismatic joint and a reversing gear."""
    joints = {
        "joint1": JointDescription(reduction=-100.0),
        "joint2": JointDescription(),
        "joint3": JointDescription(reduction=50.0),
    }
    description = RobotDescription(urdf=embedded_urdf(), effort_side="motor", joints=joints, gravity=gravity)
    return build_robot(description, embedded_urdf())


def rigid_model(robot: Robot) -> TorqueModel:
    """Return the model of the base parameters alone."""
    term: RigidBody = rigid_body(robot)
    return TorqueModel("rigid", robot, (term,))


def small_problem(
    model: TorqueModel,
    criterion: Criterion | None = None,
    *,
    lengths: Sequence[tuple[float, int]] = ((8.0, 6),),
    prior: float = 0.0,
    **limits: Any,
) -> Problem:
    """Return a problem of six harmonics over 8 s, or others, with a grid of 60 times, every second in the criterion."""
    robot = model.robot
    bounds = limits_of(robot, **{"share": 1.0, **limits})
    # What a search lets turn more and more sharply must not move the limits.
    nominal, bounds = without_coulomb(model, bounds, nominal_parameters(model))
    count = len(model.names)
    task = Task(
        smooth=SmoothModel(model, 0.2 * bounds.velocity),
        limits=bounds,
        nominal=nominal,
        criterion=LogDet() if criterion is None else criterion,
        bases=tuple(make_basis(duration, harmonics) for duration, harmonics in lengths),
        posture=resting_posture(model, bounds, nominal),
        samples=tuple(round(62.5 * duration) for duration, _ in lengths),
        weights=np.linspace(1.0, 2.0, robot.n),
        prior=prior * np.eye(count),
    )
    rows = len(row_names(bounds, robot.n))
    return Problem(task, grid(task.bases, 60), np.full(rows, 0.999))


def upright(folder: Path, *shapes: str) -> Robot:
    """Three links in a vertical plane, each 0.4 m long with its shape in the middle, lying along x at zero."""
    links = [
        Link(axis=(0.0, 1.0, 0.0), xyz=(0.4 * bool(k), 0.0, 0.0), com=(0.2, 0.0, 0.0), shape=shape)
        for k, shape in enumerate(shapes)
    ]
    return load_robot(write_urdf(folder / "arm.urdf", links))


def middle(q: Array, link: int) -> Array:
    """x and z of the middle of a link, (2, N)."""
    angle = np.cumsum(q, axis=0)
    lengths = [0.4] * link + [0.2]
    return sum(r * np.array([np.cos(angle[k]), -np.sin(angle[k])]) for k, r in enumerate(lengths))


def drawn(count: int = 40) -> Array:
    return np.random.default_rng(0).uniform(-2.0, 2.0, (3, count))
