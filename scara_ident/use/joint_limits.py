"""Limits of the joints and their drives, and how near a motion comes to them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from scara_ident.arrays import Array, runs_of
from scara_ident.errors import UsageError
from scara_ident.robot.robot import Robot
from scara_ident.use.energy import Drive

# Less than this share beyond a limit is what files round and filters swing over.
TOLERANCE = 1e-3


@dataclass(frozen=True, eq=False)
class JointLimits:
    """What each joint may reach, shape (n,) each; infinite where there is no limit.

    Attributes
    ----------
    lower, upper : ndarray
        Position, rad or m.
    velocity, acceleration : ndarray
        rad/s and rad/s^2, or m/s and m/s^2.
    torque : ndarray
        On the side where effort is recorded, N m or N.
    power : ndarray
        Mechanical, of the drive, in either direction, W.
    """

    lower: Array
    upper: Array
    velocity: Array
    acceleration: Array
    torque: Array
    power: Array


def joint_limits(
    robot: Robot,
    *,
    ranges: Mapping[str, tuple[float, float]] | None = None,
    velocities: Mapping[str, float] | None = None,
    accelerations: Mapping[str, float] | None = None,
    torques: Mapping[str, float] | None = None,
    powers: Mapping[str, float] | None = None,
) -> JointLimits:
    """Gather limits: of the URDF and ``robot.yaml``, and what is given instead or beside them.

    Parameters
    ----------
    robot : Robot
    ranges, velocities, accelerations, torques, powers : mapping from joint to limit, optional
        Units as in `JointLimits`.

    Raises
    ------
    UsageError
        If a joint is unknown, a range is empty or a limit is not above 0.
    """
    endless = np.full(robot.n, np.inf)
    lower, upper = robot.lower.copy(), robot.upper.copy()
    for name, (low, high) in (ranges or {}).items():
        if not low < high:
            raise UsageError(f"range of {name}: {low:g}..{high:g} is empty; give lower < upper")
        lower[robot.joint_index(name)], upper[robot.joint_index(name)] = low, high
    found = []
    for kind, given, own in (
        ("velocity", velocities, robot.velocity_limit),
        ("acceleration", accelerations, robot.acceleration_limit),
        ("torque", torques, robot.torque_limit),
        ("power", powers, endless),
    ):
        bound = np.array(own, dtype=float)
        for name, value in (given or {}).items():
            if not value > 0.0:
                raise UsageError(f"{kind} limit of {name}: {value:g} allows no motion; give more than 0")
            bound[robot.joint_index(name)] = value
        found.append(bound)
    return JointLimits(lower, upper, *found)


@dataclass(frozen=True)
class Margin:
    """What a motion reaches of one limit.

    Attributes
    ----------
    joint : str
    kind : str
        ``position.lower``, ``position.upper``, ``velocity``, ``acceleration``, ``torque`` or ``power``.
    bound, reached : float
        The limit, and the value that is nearest to it or farthest beyond, with its sign.
    time : float
        When, s.
    margin : float
        What is left; negative beyond the limit, which holds up to a thousandth of it.
    share : float or None
        Reached over bound, of positions from the middle of the range and 0 before it; None where the range has one end only.
    unit : str
    beyond : tuple of (float, float)
        From when to when the limit is exceeded, s.
    """

    joint: str
    kind: str
    bound: float
    reached: float
    time: float
    margin: float
    share: float | None
    unit: str
    beyond: tuple[tuple[float, float], ...] = ()

    @property
    def name(self) -> str:
        """Joint and kind."""
        return f"{self.joint}.{self.kind}"

    @property
    def kept(self) -> bool:
        """Whether the limit holds."""
        return not self.beyond

    @property
    def excess(self) -> float:
        """By how much it counts among others: the share, or infinite where it is broken without one."""
        return self.share if self.share is not None else (0.0 if self.kept else np.inf)


def margins(robot: Robot, limits: JointLimits, drives: Sequence[Drive]) -> tuple[Margin, ...]:
    """Return what a motion reaches of every limit there is, joint by joint.

    Parameters
    ----------
    robot : Robot
    limits : JointLimits
    drives : sequence of Drive
        Stretches of the motion with the torque that it takes.
    """
    time = np.concatenate([each.motion.time for each in drives])
    q, v, a = (np.concatenate([getattr(each.motion, name) for each in drives], axis=1) for name in "qva")
    torque = np.concatenate([each.torque for each in drives], axis=1)
    power = np.concatenate([each.power for each in drives], axis=1)
    found = []
    for j, joint in enumerate(robot.joints):
        length = robot.position_unit(j)
        half = 0.5 * (limits.upper[j] - limits.lower[j])
        for kind, bound, signal, side, unit in (
            ("position.lower", limits.lower[j], q[j], -1.0, length),
            ("position.upper", limits.upper[j], q[j], 1.0, length),
            ("velocity", limits.velocity[j], v[j], 0.0, f"{length}/s"),
            ("acceleration", limits.acceleration[j], a[j], 0.0, f"{length}/s^2"),
            ("torque", limits.torque[j], torque[j], 0.0, robot.torque_unit(j)),
            ("power", limits.power[j], power[j], 0.0, "W"),
        ):
            if not np.isfinite(bound):
                continue
            left = bound - np.abs(signal) if side == 0.0 else side * (bound - signal)
            k = int(np.argmin(left))
            share: float | None = None
            if side == 0.0:
                share = float(abs(signal[k]) / bound)
            elif np.isfinite(half):
                share = float(max(0.0, 1.0 - left[k] / half))
            allowed = TOLERANCE * (abs(bound) if side == 0.0 else half if np.isfinite(half) else 0.0)
            beyond = tuple((float(time[i]), float(time[m - 1])) for i, m in runs_of(left < -allowed))
            found.append(
                Margin(joint, kind, float(bound), float(signal[k]), float(time[k]), float(left[k]), share, unit, beyond)
            )
    return tuple(found)
