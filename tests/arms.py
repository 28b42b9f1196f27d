"""Arms for tests: URDFs written on the spot, those of example-robot-data, and recordings simulated with Pinocchio."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from importlib.metadata import distribution
from pathlib import Path

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from scara_ident.motion.motion import Motion
from scara_ident.recording.recording import Recording, split_name
from scara_ident.robot.robot import Robot, load_robot

Array = NDArray[np.float64]


@cache
def ur5() -> Robot:
    """The UR5, loaded once: its base parameters and its regressor's arithmetic, which belong to a `Robot`, are found once too."""
    return load_robot("ur5")


@dataclass(frozen=True)
class Link:
    """A link of a test arm and the joint that moves it."""

    kind: str = "revolute"
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    xyz: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rpy: tuple[float, float, float] = (0.0, 0.0, 0.0)
    mass: float = 2.0
    com: tuple[float, float, float] = (0.1, 0.02, 0.03)
    inertia: tuple[float, float, float] = (0.03, 0.04, 0.05)
    parent: int = -1
    """Number of the link it hangs on; -1 is the one before it (the base for the first), -2 is the base."""
    shape: str = ""
    """Collision geometry about its centre of mass, such as '<sphere radius="0.1"/>'."""


def write_urdf(path: Path, links: Sequence[Link], reductions: Sequence[float] = ()) -> Path:
    """Write a URDF with joints j1, j2, ... and links l1, l2, ..."""
    text = ['<robot name="test_arm"><link name="base"/>']
    for i, link in enumerate(links):
        on = i - 1 if link.parent == -1 else link.parent
        parent = "base" if on < 0 else f"l{on + 1}"
        shape = f'<collision><origin xyz="{_words(link.com)}"/><geometry>{link.shape}</geometry></collision>'
        ixx, iyy, izz = (repr(float(x)) for x in link.inertia)
        text.append(
            f'<link name="l{i + 1}"><inertial><origin xyz="{_words(link.com)}"/><mass value="{link.mass!r}"/>'
            f'<inertia ixx="{ixx}" ixy="0" ixz="0" iyy="{iyy}" iyz="0" izz="{izz}"/></inertial>{shape if link.shape else ""}</link>'
            f'<joint name="j{i + 1}" type="{link.kind}"><parent link="{parent}"/><child link="l{i + 1}"/>'
            f'<origin xyz="{_words(link.xyz)}" rpy="{_words(link.rpy)}"/><axis xyz="{_words(link.axis)}"/>'
            '<limit lower="-3" upper="3" effort="50" velocity="4"/></joint>'
        )
    for i, value in enumerate(reductions):
        text.append(
            f'<transmission name="t{i}"><type>transmission_interface/SimpleTransmission</type><joint name="j{i + 1}"/>'
            f'<actuator name="m{i}"><mechanicalReduction>{value!r}</mechanicalReduction></actuator></transmission>'
        )
    path.write_text("\n".join([*text, "</robot>"]), encoding="utf-8")
    return path


def _words(numbers: Sequence[float]) -> str:
    return " ".join(repr(float(x)) for x in numbers)


PLANAR_2R = (
    Link(axis=(0.0, 1.0, 0.0), mass=3.0, com=(0.15, 0.0, 0.0), inertia=(0.01, 0.05, 0.05)),
    Link(axis=(0.0, 1.0, 0.0), xyz=(0.4, 0.0, 0.0), mass=1.5, com=(0.12, 0.0, 0.02), inertia=(0.005, 0.03, 0.03)),
)
"""Two links in a vertical plane."""

UP, ALONG = (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)
CYLINDRICAL = (
    Link(axis=UP, mass=40.0, com=(0.05, 0.0, 0.3), inertia=(4.0, 4.0, 0.6)),
    Link("prismatic", axis=UP, mass=22.0, com=(0.1, 0.02, 0.0), inertia=(0.3, 0.4, 0.5)),
    Link("prismatic", axis=ALONG, xyz=(0.2, 0.0, 0.0), mass=12.0, com=(-0.2, 0.0, 0.0), inertia=(0.02, 1.4, 1.4)),
)
"""A column that turns, a carriage that it lifts, and a ram that reaches out."""


def in_unit(links: tuple[Link, ...], unit: float, folder: Path) -> Robot:
    """Return an arm whose lengths are told in another unit, so many to the metre."""
    scaled = [
        replace(
            link, xyz=tuple(unit * x for x in link.xyz), com=tuple(unit * x for x in link.com),
            inertia=tuple(unit**2 * x for x in link.inertia),
        )
        for link in links
    ]  # fmt: skip
    path = write_urdf(folder / "arm.urdf", scaled)
    lines = path.read_text(encoding="utf-8").replace('lower="-3" upper="3"', 'lower="{0}" upper="{1}"').split("\n")
    ends = [3.0 * unit if 'type="prismatic"' in line else 3.0 for line in lines]
    path.write_text("\n".join(line.format(-end, end) for line, end in zip(lines, ends, strict=True)), encoding="utf-8")
    (folder / "robot.yaml").write_text(f"urdf: arm.urdf\ngravity: [0, 0, {-9.81 * unit}]\n", encoding="utf-8")
    return load_robot(folder / "robot.yaml")


@cache
def example_urdf(name: str) -> Path:
    """Return a URDF of example-robot-data by the end of its path, without loading any mesh."""
    files = distribution("example-robot-data").files or []
    found = [file for file in files if str(file).endswith(f"/{name}") and "/robots/" in str(file)]
    assert len(found) == 1, f"{name}: {found}"
    return Path(str(found[0].locate()))


def sines(rng: np.random.Generator, time: Array, n: int, size: float = 0.6, lowest: float = 0.15) -> list[Array]:
    """Return positions, velocities and accelerations of sums of three sines, each of shape (n, N)."""
    result = [np.zeros((n, len(time))) for _ in range(3)]
    for j in range(n):
        for k in range(3):
            w = 2 * np.pi * lowest * (k + 1) * rng.uniform(0.85, 1.15)
            phase = w * time + rng.uniform(0, 2 * np.pi)
            amplitude = size / (k + 1)
            result[0][j] += amplitude * np.sin(phase)
            result[1][j] += amplitude * w * np.cos(phase)
            result[2][j] -= amplitude * w**2 * np.sin(phase)
    return result


def rnea(robot: Robot, q: Array, v: Array, a: Array) -> Array:
    """Inverse dynamics by Pinocchio in the order of the robot's joints, rotors not included, shape (n, N)."""
    model, data = robot.model, robot.model.createData()
    back = np.argsort(robot.order)
    angle, speed, acceleration = q[back], v[back], a[back]
    full = np.tile(pin.neutral(model)[:, None], q.shape[1])
    for joint in list(model.joints)[1:]:
        own = angle[joint.idx_v]
        full[joint.idx_q : joint.idx_q + joint.nq] = own if joint.nq == 1 else (np.cos(own), np.sin(own))
    states = zip(full.T, speed.T, acceleration.T, strict=True)
    return np.array([pin.rnea(model, data, *state) for state in states]).reshape(-1, len(back)).T[robot.order]


def recorded_torque(robot: Robot, q: Array, v: Array, a: Array, friction: Sequence[Sequence[float]]) -> Array:
    """Torque on the recorded side: bodies, rotors, friction a0..a3 at the motor's sign, and an offset per joint."""
    torque = rnea(robot, q, v, a) + (robot.reduction**2 * robot.rotor_inertia)[:, None] * a
    torque *= robot.row_scale[:, None]
    for j, (a0, a1, a2, a3, offset) in enumerate(friction):
        speed = robot.drive_sign[j] * v[j]
        torque[j] += a0 * np.sign(speed) + a1 * speed + a2 * np.abs(speed) * speed + a3 * speed**3 + offset
    return torque


def recording(robot: Robot, name: str, time: Array, q: Array, torque: Array | None, **more: Array) -> Recording:
    """Make a recording as if read from a file."""
    trajectory, repetition = split_name(name)
    return Recording(name, trajectory, repetition, robot.joints, time, q, torque, **more)


def noisy(item: Recording, rng: np.random.Generator, sigma: float | Sequence[float]) -> Recording:
    """Return the recording with white noise on its torque."""
    assert item.effort is not None
    scale = np.broadcast_to(np.asarray(sigma, dtype=float), item.effort.shape[:1])[:, None]
    return replace(item, effort=item.effort + scale * rng.standard_normal(item.effort.shape))


def motion(q: Array, v: Array, a: Array, rate: float = 1000.0, torque: Array | None = None) -> Motion:
    """Make a motion from exact signals."""
    return Motion("m", "m", np.arange(q.shape[1]) / rate, q, v, a, torque, rate)


SWING_FRICTION = ((0.4, 0.3, 0.0, 0.0, 0.1), (0.2, 0.1, 0.0, 0.0, -0.05))


@lru_cache(maxsize=16)
def swing(robot: Robot, name: str = "swing_1", seed: int = 0, seconds: float = 12.0, rate: float = 500.0) -> Recording:
    """Sums of sines of an arm of one or two joints, with Coulomb and viscous friction and an offset, without noise."""
    time = np.arange(round(seconds * rate)) / rate
    q, v, a = sines(np.random.default_rng(seed), time, robot.n)
    return recording(robot, name, time, q, recorded_torque(robot, q, v, a, SWING_FRICTION[: robot.n]))
