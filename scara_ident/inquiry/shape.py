"""The shape of an unexplained residual: a free curve over the signals that it depends on."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from scara_ident.arrays import Array
from scara_ident.effects import Effect, Member, Scene, Signals
from scara_ident.model.terms import Column
from scara_ident.robot.robot import Robot

# Knots over one signal, and over each of two.
KNOTS, PAIR_KNOTS = 12, 6
# Half of the range of a joint that turns on without end, rad.
ENDLESS = np.pi


@dataclass(frozen=True)
class Shape(Effect):
    """Hat functions on equal intervals over the range of one or two signals: their sum is any broken line or surface.

    Attributes
    ----------
    signals : tuple of (str, int)
        What each is, ``position``, ``velocity`` or ``motor angle``, and of which joint.
    ranges : tuple of (float, float)
        From the first knot to the last of each.
    """

    name = "shape"
    summary = "a curve over signals"
    signals: tuple[tuple[str, int], ...] = ()
    ranges: tuple[tuple[float, float], ...] = ()

    def columns(self, scene: Scene, member: Member) -> tuple[Column, ...]:
        """Name the heights of all hats."""
        count = KNOTS if len(self.signals) == 1 else PAIR_KNOTS ** len(self.signals)
        joint, unit = scene.robot.joints[member.place], scene.robot.torque_unit(member.place)
        return tuple(Column(f"height{k}", joint, unit, f"height of hat {k}") for k in range(count))

    def signal_columns(self, signals: Signals, member: Member) -> Iterable[Array]:
        """Return every hat, or every product of two."""
        each = []
        knots = KNOTS if len(self.signals) == 1 else PAIR_KNOTS
        for (kind, joint), (low, high) in zip(self.signals, self.ranges, strict=True):
            x = _signal(signals, kind, joint)
            place = np.clip((x - low) / (high - low) * (knots - 1), 0.0, knots - 1)
            each.append(np.maximum(0.0, 1.0 - np.abs(place - np.arange(knots)[:, None])))
        if len(each) == 1:
            return list(each[0])
        return list(np.einsum("an,bn->abn", *each).reshape(-1, each[0].shape[1]))


def shape_over(robot: Robot, names: Sequence[str], joint: int) -> Shape | None:
    """Return the free curve over signals as `screen` names them; None where a motion cannot be spread over any.

    Parameters
    ----------
    joint : int
        Whose remainder it is.
    """
    signals, ranges = [], []
    for name in names:
        kind, _, of = name.partition(" of ")
        if name == "motor angle":
            kind, place, span = name, joint, (0.0, 2.0 * np.pi)
        elif kind == "position":
            place = robot.joints.index(of)
            low, high = float(robot.lower[place]), float(robot.upper[place])
            span = (low if np.isfinite(low) else -ENDLESS, high if np.isfinite(high) else ENDLESS)
        elif kind == "velocity" and np.isfinite(robot.velocity_limit[robot.joints.index(of)]):
            place = robot.joints.index(of)
            span = (-float(robot.velocity_limit[place]), float(robot.velocity_limit[place]))
        else:
            continue
        signals.append((kind, place))
        ranges.append(span)
    return Shape(tuple(signals), tuple(ranges)) if signals else None


def _signal(signals: Signals, kind: str, joint: int) -> Array:
    if kind == "position":
        return np.asarray(signals.motion.q[joint])
    if kind == "velocity":
        return np.asarray(signals.motion.v[joint])
    return np.asarray(np.mod(signals.motor_turns[joint], 2.0 * np.pi))
