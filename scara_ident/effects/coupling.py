"""Joints whose drives are coupled mechanically, beyond friction."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from scara_ident.effects.effect import Member, NonlinearParameter, Parameter
from scara_ident.effects.signals import Scene, Signals
from scara_ident.model.terms import Column, RigidBody
from scara_ident.motion.motion import Motion

Array = NDArray[np.float64]

# On arms of more joints only neighbours and the joints after them are tried: drives run through them.
REACH = 2
# Share of a column's square outside the base model below which the model spans it.
SPANNED = 1e-6


@dataclass(frozen=True)
class InertiaCoupling:
    """Inertia that two joints turn together: torque of one proportional to the other's acceleration, both ways.

    A rotor or shaft that turns with the sum of two joints' motions, as where a wrist is driven through its neighbour,
    has it beside what adds to each joint's own inertia.
    """

    @property
    def name(self) -> str:
        """Name of the effect."""
        return "inertia_coupling"

    @property
    def nonlinear(self) -> tuple[NonlinearParameter, ...]:
        """It has no nonlinear parameter."""
        return ()

    def members(self, scene: Scene) -> tuple[Member, ...]:
        """One per pair of joints where the base model does not span it."""
        return tuple(Member(j, (), k) for j, k in _unspanned(scene.model.rigid_body))

    def rows(self, member: Member) -> list[int]:
        """Return the two joints."""
        return [member.joint or 0, member.partner or 0]

    def columns(self, scene: Scene, member: Member) -> tuple[Column, ...]:
        """One column: the shared inertia, at the joints."""
        joint, other = (scene.robot.joints[k] for k in self.rows(member))
        return (Column("inertia", joint, _inertia_unit(scene, member), f"inertia that {joint} shares with {other}"),)

    def regressor(self, signals: Signals, member: Member) -> Array:
        """Return each joint's acceleration on the other, shape (n, 1, N)."""
        return _exchanged(signals.scene.robot.row_scale, signals.motion.a, *self.rows(member))

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """It has either sign, as the shaft turns with the sum or the difference."""
        return None

    def parameters(self, scene: Scene, member: Member, value: Array, covariance: Array) -> Mapping[str, Parameter]:
        """Return the shared inertia."""
        return {"inertia": Parameter(float(value[0]), float(np.sqrt(covariance[0, 0])), _inertia_unit(scene, member))}

    def description(self, scene: Scene, member: Member) -> str:
        """Say what it is."""
        return f"inertia that the drive shares with {scene.robot.joints[member.partner or 0]}"


@dataclass(frozen=True)
class DriveCoupling:
    """A drive that also carries a share of another joint's torque.

    Where the drive of joint k runs through joint j, as in wrists, or reacts on it, as a belt from the base does, j's
    motor carries a share of k's joint torque. A leak between torque channels looks the same.
    """

    @property
    def name(self) -> str:
        """Name of the effect."""
        return "drive_coupling"

    @property
    def nonlinear(self) -> tuple[NonlinearParameter, ...]:
        """It has no nonlinear parameter."""
        return ()

    def members(self, scene: Scene) -> tuple[Member, ...]:
        """One per joint and neighbour."""
        n = scene.robot.n
        return tuple(Member(j, (), k) for j in range(n) for k in (j - 1, j + 1) if 0 <= k < n)

    def columns(self, scene: Scene, member: Member) -> tuple[Column, ...]:
        """One column: the share."""
        joint, other = scene.robot.joints[member.joint or 0], scene.robot.joints[member.partner or 0]
        return (Column("share", joint, "1", f"share of the torque of {other} on {joint}, both at the joint"),)

    def regressor(self, signals: Signals, member: Member) -> Array:
        """Return the other joint's predicted torque, brought to this joint's side of the gear, shape (n, 1, N)."""
        j, k = member.joint or 0, member.partner or 0
        scale = signals.scene.robot.row_scale
        return signals.row(j, [signals.predicted[k] * (scale[j] / scale[k])])

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """A share is at most the whole."""
        if abs(value[0]) > 1.0 + 2.0 * std[0]:
            return "more than all of the other joint's torque would be shared"
        return None

    def parameters(self, scene: Scene, member: Member, value: Array, covariance: Array) -> Mapping[str, Parameter]:
        """Return the share."""
        return {"share": Parameter(float(value[0]), float(np.sqrt(covariance[0, 0])), "1")}

    def description(self, scene: Scene, member: Member) -> str:
        """Say what it is."""
        return f"a drive that carries a share of the torque of {scene.robot.joints[member.partner or 0]}"


def _inertia_unit(scene: Scene, member: Member) -> str:
    slides = int(scene.robot.prismatic[member.joint or 0]) + int(scene.robot.prismatic[member.partner or 0])
    return ("kg m^2", "kg m", "kg")[slides]


def _exchanged(scale: Array, a: Array, j: int, k: int) -> Array:
    result = np.zeros((len(a), 1, a.shape[1]))
    result[j, 0] = scale[j] * a[k]
    result[k, 0] = scale[k] * a[j]
    return result


@lru_cache(maxsize=16)
def _unspanned(term: RigidBody) -> tuple[tuple[int, int], ...]:
    """Return the pairs of joints whose shared inertia the rigid bodies' columns do not span, from random states."""
    robot = term.robot
    rng = np.random.default_rng(0)
    samples = 20 + 2 * len(term.columns)
    reach = np.where(robot.prismatic, 1.0, np.pi)[:, None]
    q, v, a = (scale * rng.uniform(-1.0, 1.0, (robot.n, samples)) for scale in (reach, 2.0, 8.0))
    motion = Motion("random", "random", np.arange(float(samples)), q, v, a, None, 1.0)
    basis = term.regressor(motion).transpose(0, 2, 1).reshape(-1, len(term.columns))
    size = np.linalg.norm(basis, axis=0)
    unit = basis[:, size > 0.0] / size[size > 0.0]
    found = []
    for j in range(robot.n):
        for k in range(j + 1, min(robot.n, j + REACH + 1)):
            column = _exchanged(robot.row_scale, a, j, k).ravel()
            left = column - unit @ np.linalg.lstsq(unit, column, rcond=1e-12)[0]
            if left @ left > SPANNED * (column @ column):
                found.append((j, k))
    return tuple(found)
