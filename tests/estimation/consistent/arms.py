"""Arms and bodies for the tests of consistency."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from scara_ident.estimation import ConsistentEstimate
from scara_ident.estimation.joint_rows import JointRows
from scara_ident.estimation.observations import Observations
from scara_ident.model.base_parameters import pseudo_inertia
from scara_ident.model.model import TorqueModel, build_model
from scara_ident.motion.motion import Motion
from scara_ident.motion.prepared import PreparedData
from scara_ident.robot.robot import Robot, load_robot
from scara_ident.threads import one_blas_thread
from tests.arms import Link, example_urdf, motion, sines, write_urdf

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


@cache
def scara(name: str = "complete") -> TorqueModel:
    return build_model(load_robot(), name)


def moving(robot: Robot, seed: int = 1, count: int = 2000, size: float = 0.6) -> Motion:
    rng = np.random.default_rng(seed)
    return motion(*sines(rng, np.arange(count) / 200.0, robot.n, size=size, lowest=0.3), rate=200.0)


def stroke(robot: Robot, speed: float = 0.65) -> Motion:
    """One slow stroke of every joint below a speed; each takes a little longer than the one before, up to 2.5 s."""
    time = np.linspace(0.0, 2.5, 1000)
    q, v, a = (np.zeros((robot.n, 1000)) for _ in range(3))
    for j in range(robot.n):
        duration = 2.5 * (1.0 - 0.3 * (robot.n - 1 - j) / robot.n)
        s, length = np.minimum(time / duration, 1.0), speed * duration / 1.875
        q[j] = length * (10 * s**3 - 15 * s**4 + 6 * s**5)
        v[j] = length * (30 * s**2 - 60 * s**3 + 30 * s**4) / duration
        a[j] = length * (60 * s - 180 * s**2 + 120 * s**3) / duration**2
    return motion(q, v, a, rate=400.0)


@one_blas_thread()
def observed(
    model: TorqueModel, item: Motion, value: Array, noise: float, seed: int = 0, memory: float = 0.0
) -> Observations:
    """Rows of a motion, unfiltered, with noise of which a sample keeps a share, in blocks of 200 samples; without prepared data."""
    w = model.regressor(item)
    u = np.einsum("jpn,p->jn", w, value)
    sigma = noise * np.sqrt(np.mean(u**2, axis=1, keepdims=True))
    white = np.random.default_rng(seed).standard_normal(u.shape)
    u = u + sigma * lfilter([np.sqrt(1.0 - memory**2)], [1.0, -memory], white, axis=1)
    columns, starts = np.arange(len(value)), np.array([*range(0, u.shape[1], 200), u.shape[1]])
    joints = tuple(
        JointRows(columns, np.vstack([rows, torque]), starts, np.diff(starts).astype(float))
        for rows, torque in zip(w, u, strict=True)
    )
    return Observations(model, PreparedData((), ()), joints, np.zeros(len(starts) - 1, dtype=np.intp), ())


def truth(model: TorqueModel) -> Array:
    return parameters(model, model.robot.standard_parameters(), (0.08, 0.05))


def smallest_eigenvalue_share(parameters: Array) -> float:
    """Return the smallest eigenvalue of a body's pseudo-inertia as a share of its trace; below 0 it cannot exist."""
    matrix = pseudo_inertia(parameters)
    trace = float(np.trace(matrix))
    smallest = float(np.linalg.eigvalsh(matrix)[0])
    return smallest / trace if trace > 0.0 else (0.0 if not np.any(matrix) else -np.inf)


def smallest(estimate: ConsistentEstimate) -> float:
    bodies = estimate.standard[: 10 * estimate.model.robot.n].reshape(-1, 10)
    return min(smallest_eigenvalue_share(body) for body in bodies)


def base_of(estimate: ConsistentEstimate) -> Array:
    term = estimate.model.rigid_body
    return (term.base.grouping @ estimate.standard)[term.kept]
