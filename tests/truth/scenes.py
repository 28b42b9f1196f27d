"""Arms in space by formula: motion, inverse dynamics by Pinocchio, friction, encoder steps and noise, and nothing else."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from scara_ident.recording.recording import Recording
from scara_ident.robot.robot import Robot
from tests.arms import noisy, recording, rnea

Array = NDArray[np.float64]
Added = Callable[[Array, Array, Array, Array, Array], Array]
# Coulomb friction of a UR5's joints, N m; viscous friction is as much at 1 rad/s.
UR5_FRICTION = np.array([8.0, 8.0, 6.0, 1.2, 1.2, 1.2])[:, None]
ROTORS = np.array([1.2, 1.2, 0.8, 0.1, 0.1, 0.1])[:, None]


def harmonics(rng: np.random.Generator, time: Array, n: int, highest: int = 6, size: float = 0.8, speed: float = 1.5):
    """Positions, velocities and accelerations (n, N): random sums of sines within a range and a speed."""
    omega = 2.0 * np.pi * np.arange(1, highest + 1)[:, None] * rng.uniform(0.12, 0.2)
    a = rng.normal(size=(n, highest)) / np.arange(1, highest + 1)
    phase = omega * time + rng.uniform(0.0, 2.0 * np.pi, (n, highest, 1))
    q, v, acc = (
        np.einsum("jk,jkt->jt", a, x) for x in (np.sin(phase), omega * np.cos(phase), -(omega**2) * np.sin(phase))
    )
    share = np.minimum(size / np.abs(q).max(axis=1), speed / np.abs(v).max(axis=1))[:, None]
    return share * q, share * v, share * acc


def formula_run(
    robot: Robot,
    name: str,
    seed: int | Sequence[int],
    *,
    seconds: float = 16.0,
    rate: float = 500.0,
    bits: int = 0,
    noise: float = 0.012,
    friction: Array = UR5_FRICTION,
    rotors: Array = ROTORS,
    added: Added | None = None,
    highest: int = 6,
) -> Recording:
    """A run whose torque is that of the rigid arm with Coulomb and viscous friction; ``added(t, q, v, a, load)`` to it.

    Noise is a share of each joint's rms torque, and ``bits`` the encoder's steps per joint turn as a power of 2.
    """
    rng = np.random.default_rng(seed)
    time = np.arange(round(seconds * rate)) / rate
    q, v, a = harmonics(rng, time, robot.n, highest)
    load = rnea(robot, q, v, a)
    torque = load + rotors * a + friction * (np.sign(v) + v)
    if added is not None:
        torque = torque + added(time, q, v, a, load)
    step = 2.0 * np.pi / 2**bits
    seen = np.round(q / step) * step if bits else q
    return noisy(recording(robot, name, time, seen, torque), rng, noise * np.sqrt(np.mean(torque**2, axis=1)))


def payload_torque(robot: Robot, payload: pin.Inertia) -> Added:
    """Torque, at the joints, of a body fixed to the last joint of a robot: Pinocchio's with it less that without it."""
    model = robot.model.copy()
    model.appendBodyToJoint(model.njoints - 1, payload, pin.SE3.Identity())
    laden = replace(robot, model=model)
    return lambda t, q, v, a, load: rnea(laden, q, v, a) - rnea(robot, q, v, a)
