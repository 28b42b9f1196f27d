"""Random motions of any arm within its limits: Fourier series, point to point, and sweeps.

All start and end at rest. Ranges of the URDF are kept with a margin and cut to half a turn to either side, velocities
to a drawn share of their limits, accelerations to `ACCELERATION`, torques to `EFFORT_SHARE` of theirs. Contact of the arm
with itself is not looked for: the virtual arm has none.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from scara_ident.errors import RecordingError
from scara_ident.robot.robot import Robot
from scara_ident.simulation import ReferenceMotion, VirtualArm
from scara_ident.simulation.inverse_dynamics import inverse_dynamics

Array = NDArray[np.float64]
Signals = tuple[Array, Array, Array]
MotionKind = Literal["fourier", "points", "sweep"]
KINDS: tuple[MotionKind, ...] = ("fourier", "points", "sweep")
RATE = 500.0
# Half range of a joint that turns on without end, rad; slides keep their own.
REACH = 2.8
RANGE_SHARE = 0.9
# Largest velocity where the URDF has none, rad/s and m/s; largest acceleration, rad/s^2 and m/s^2.
SPEED, SLIDE_SPEED = 2.5, 0.4
ACCELERATION, SLIDE_ACCELERATION = 20.0, 3.0
EFFORT_SHARE = 0.7
# What an attempt that exceeds a torque is slowed down by; where none is left gravity alone exceeds it, and the drive's
# limit cuts in.
SLOWER, ATTEMPTS = 0.8, 10
# A controller that makes an arm accelerate by this many times what its motion asks drives it to and fro against its torque
# limits. With a coarse encoder arms tremble, by up to ten times.
SHAKING = 15.0
# A motion comes out of rest and back to it within this time, s.
RAMP = 1.0


def random_motion(
    name: str, arm: VirtualArm, kind: MotionKind, duration: float, rng: np.random.Generator
) -> ReferenceMotion:
    """Draw a motion and slow it down, or make it smaller, until it is within all limits."""
    robot = arm.robot
    lower, upper = ranges(robot)
    share = rng.uniform(0.35, 0.9)
    speed = share * np.minimum(robot.velocity_limit, np.where(robot.prismatic, SLIDE_SPEED, SPEED))
    acceleration = np.where(robot.prismatic, SLIDE_ACCELERATION, ACCELERATION)
    draw = {"fourier": fourier, "points": points, "sweep": sweep}[kind]
    seed = int(rng.integers(2**63))
    time = np.arange(round(duration * RATE) + 1) / RATE
    every = slice(None, None, 10)
    for slower in SLOWER ** np.arange(ATTEMPTS):
        # The same draw each time: only the limits that it is fitted into shrink.
        again = np.random.default_rng(seed)
        motion = draw(robot, (lower, upper), slower * speed, slower**2 * acceleration, duration, again)
        made = ReferenceMotion(name, robot.joints, time, *motion(time))
        torque = inverse_dynamics(
            arm, arm.bodies, made.position[:, every], made.velocity[:, every], made.acceleration[:, every]
        )
        if np.all(np.abs(torque) <= EFFORT_SHARE * robot.effort_limit[:, None]):
            break
    return made


def after_rest(motion: ReferenceMotion, lead: float) -> ReferenceMotion:
    """Return a motion from rest after a rest of any length, s."""
    if lead <= 0.0:
        return motion
    still = np.zeros((len(motion.joints), 1))
    return replace(
        motion,
        time=np.concatenate([[0.0], motion.time + lead]),
        position=np.concatenate([motion.position[:, :1], motion.position], axis=1),
        velocity=np.concatenate([still, motion.velocity], axis=1),
        acceleration=np.concatenate([still, motion.acceleration], axis=1),
    )


def refuse_shaking(motion: ReferenceMotion, acceleration: Array) -> None:
    """Refuse the acceleration of an arm, (n, N), that its controller drives to and fro instead: nobody records that."""
    asked, seen = (np.sqrt(np.mean(part**2, axis=1)) for part in (motion.acceleration, acceleration))
    if np.any(seen > SHAKING * np.max(asked)):
        raise RecordingError(f"{motion.name}: the controller shakes the arm; take a slower one")


def ranges(robot: Robot) -> tuple[Array, Array]:
    """Return the range of each joint that motions keep to, shape (n,) each."""
    lower = np.where(np.isfinite(robot.lower), robot.lower, -REACH)
    upper = np.where(np.isfinite(robot.upper), robot.upper, REACH)
    middle, half = 0.5 * (lower + upper), 0.5 * RANGE_SHARE * (upper - lower)
    half = np.where(robot.prismatic, half, np.minimum(half, REACH))
    return middle - half, middle + half


def fourier(robot: Robot, limits, speed: Array, acceleration: Array, duration: float, rng) -> Callable:
    """A periodic sum of harmonics about a random pose, faded in and out."""
    lower, upper = limits
    harmonics = int(rng.integers(3, 8))
    period = rng.uniform(4.0, max(5.0, duration))
    omega = 2.0 * np.pi * np.arange(1, harmonics + 1) / period
    a, b = rng.normal(size=(2, robot.n, harmonics)) / np.arange(1, harmonics + 1)
    place = rng.uniform(0.35, 0.65, robot.n)
    fill = rng.uniform(0.6, 1.0, robot.n)

    def wave(t: Array) -> Signals:
        c, s = np.cos(omega[:, None] * t), np.sin(omega[:, None] * t)
        w = omega
        return a @ s + b @ c, (a * w) @ c - (b * w) @ s, -(a * w * w) @ s - (b * w * w) @ c

    return _fitted(wave, lower, upper, place, fill, speed, acceleration, duration)


def sweep(robot: Robot, limits, speed: Array, acceleration: Array, duration: float, rng) -> Callable:
    """A sine of rising frequency on a slow swing, each joint with its own."""
    lower, upper = limits
    first = rng.uniform(0.05, 0.2, robot.n)[:, None]
    last = rng.uniform(0.5, 3.0, robot.n)[:, None]
    slow = rng.uniform(0.5, 1.5, robot.n)[:, None] * 2.0 * np.pi / duration
    phase, share = rng.uniform(0.0, 2.0 * np.pi, (robot.n, 1)), rng.uniform(0.2, 0.7, robot.n)[:, None]
    grow = np.log(last / first) / duration

    def wave(t: Array) -> Signals:
        # An exponential sweep; its amplitude falls as its frequency rises, so that its speed stays.
        w = 2.0 * np.pi * first * np.exp(grow * t)
        angle = w / grow + phase
        e = np.exp(-grow * t)
        s, c = np.sin(angle), np.cos(angle)
        u = e * s, e * (w * c - grow * s), e * ((grow**2 - w**2) * s - grow * w * c)
        k = slow
        v = np.cos(k * t + phase), -k * np.sin(k * t + phase), -(k**2) * np.cos(k * t + phase)
        x, y, z = (share * one + (1.0 - share) * other for one, other in zip(u, v, strict=True))
        return x, y, z

    place = rng.uniform(0.35, 0.65, robot.n)
    fill = rng.uniform(0.6, 1.0, robot.n)
    return _fitted(wave, lower, upper, place, fill, speed, acceleration, duration)


def points(robot: Robot, limits, speed: Array, acceleration: Array, duration: float, rng) -> Callable:
    """Quintic strokes between random poses, all joints at once, with a rest after each."""
    lower, upper = limits
    poses, begins, lasts = [rng.uniform(lower, upper)], [], []
    at = rng.uniform(0.0, 0.4)
    while True:
        goal = rng.uniform(lower, upper)
        way = np.abs(goal - poses[-1])
        # Largest speed and acceleration of the quintic stroke: 15/8 way/T and 10/sqrt(3) way/T^2.
        needed = max((1.875 * way / speed).max(), np.sqrt(5.7735 * way / acceleration).max(), 0.2)
        needed *= rng.uniform(1.0, 1.4)
        if at + needed > duration:
            break
        poses.append(goal)
        begins.append(at)
        lasts.append(needed)
        at += needed + rng.uniform(0.0, 0.5)

    # Slower by as much as the last stroke leaves of the time.
    slower = 1.0 if not begins else max(1.0, duration / (begins[-1] + lasts[-1]))

    def motion(t: Array) -> Signals:
        q, v, a = np.repeat(poses[0][:, None], len(t), axis=1), np.zeros((robot.n, len(t))), np.zeros((robot.n, len(t)))
        for k, (begin, last) in enumerate((slower * x, slower * y) for x, y in zip(begins, lasts, strict=True)):
            way = (poses[k + 1] - poses[k])[:, None]
            s, ds, dds = _rise((t - begin) / last)
            q, v, a = q + way * s, v + way * ds / last, a + way * dds / last**2
        return q, v, a

    if len(begins) < 2:
        # Too short for strokes from end to end: within a third of the range.
        middle, half = 0.5 * (lower + upper), (upper - lower) / 6.0
        if np.all(half < 1e-3):
            return motion
        return points(robot, (middle - half, middle + half), speed, acceleration, duration, rng)
    return motion


def _fitted(wave, lower, upper, place, fill, speed, acceleration, duration) -> Callable:
    """Return the wave faded in and out about a pose and scaled, joint by joint, into all limits."""

    def faded(t: Array) -> Signals:
        e = _envelope(t, duration)
        x = wave(t)
        return (
            e[0] * x[0],
            e[1] * x[0] + e[0] * x[1],
            e[2] * x[0] + 2.0 * e[1] * x[1] + e[0] * x[2],
        )

    t = np.linspace(0.0, duration, 4000)
    q, v, a = faded(t)
    centre = lower + place * (upper - lower)
    room = np.minimum(upper - centre, centre - lower)
    size = np.min(
        [fill * room / np.abs(q).max(axis=1), speed / np.abs(v).max(axis=1), acceleration / np.abs(a).max(axis=1)],
        axis=0,
    )[:, None]

    def motion(t: Array) -> Signals:
        q, v, a = faded(t)
        return centre[:, None] + size * q, size * v, size * a

    return motion


def _envelope(t: Array, duration: float) -> Signals:
    up, down = _rise(t / RAMP), _rise((duration - t) / RAMP)
    value = up[0] * down[0]
    slope = (up[1] * down[0] - up[0] * down[1]) / RAMP
    bend = (up[2] * down[0] - 2.0 * up[1] * down[1] + up[0] * down[2]) / RAMP**2
    return value, slope, bend


def _rise(s: Array) -> Signals:
    """The quintic from 0 to 1 with rest at both ends, and its derivatives by s."""
    s = np.clip(s, 0.0, 1.0)
    return s**3 * (10 - 15 * s + 6 * s**2), 30 * s**2 * (1 - s) ** 2, 60 * s * (1 - s) * (1 - 2 * s)
