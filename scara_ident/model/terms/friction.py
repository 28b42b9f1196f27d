"""Friction as a polynomial of speed, and the torque offset."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.model.base_parameters import constant_torques
from scara_ident.model.terms.constraints import BrakingPolynomial, Constraint
from scara_ident.model.terms.term import Column, Filled, StateTorque, per_speed
from scara_ident.motion.motion import Motion
from scara_ident.robot.robot import Robot

_WORDS = ("Coulomb", "viscous", "quadratic", "cubic")


@dataclass(frozen=True, eq=False)
class Friction(Filled):
    """Friction of every joint as a polynomial of its own speed (equation 3 of Indri et al. 2002).

    ``u_f = a0 sign(v) + a1 v + a2 sign(v) v^2 + a3 v^3`` with the joint's speed v, on the side of the recorded
    torque; where the gear reverses, in the motor's direction, so that a friction that brakes is positive.

    Attributes
    ----------
    robot : Robot
    powers : tuple of int
        Which powers of speed there are; 0 is Coulomb friction.
    """

    robot: Robot
    powers: tuple[int, ...] = (0, 1, 2, 3)

    @property
    def name(self) -> str:
        """Name of the term."""
        return "friction"

    @cached_property
    def columns(self) -> tuple[Column, ...]:
        """Columns joint by joint: ``a01 a11 .. a02 ..`` where the last digits are the joint's number."""
        return tuple(
            Column(
                name=f"a{power}{i + 1}",
                joint=joint,
                unit=per_speed(self.robot, i, power),
                meaning=f"{_WORDS[power]} friction of {joint}",
                # A speed without friction may not push, so the Coulomb part cannot be negative; the others may.
                nonnegative=power == 0 or self.powers == (0, 1),
            )
            for i, joint in enumerate(self.robot.joints)
            for power in self.powers
        )

    @property
    def pattern(self) -> NDArray[np.bool_]:
        """Each joint's friction acts on that joint only."""
        return np.repeat(np.eye(self.robot.n, dtype=bool), len(self.powers), axis=1)

    def of_power(self, power: int) -> NDArray[np.bool_]:
        """Return which columns are of a power of speed, shape (k,)."""
        return np.tile(np.array(self.powers) == power, self.robot.n)

    def constraints(self) -> tuple[Constraint, ...]:
        """Return that every joint's friction brakes and leaves the motor able to reach the velocity limit."""
        k = len(self.powers)
        return tuple(
            BrakingPolynomial(
                joint=joint,
                columns=tuple(range(i * k, (i + 1) * k)),
                powers=self.powers,
                speed=float(self.robot.velocity_limit[i]),
                limit=float(self.robot.torque_limit[i]),
            )
            for i, joint in enumerate(self.robot.joints)
        )

    def fill(self, motion: Motion, rows: Sequence[Array]) -> None:
        """Write the powers of each joint's speed."""
        for i, columns in enumerate(rows):
            v = self.robot.drive_sign[i] * motion.v[i]
            square = v * v
            for power, column in zip(self.powers, columns, strict=True):
                # Products, for a power of doubles costs ten of them.
                np.copyto(column, v) if power % 2 else np.sign(v, out=column)
                for _ in range(power // 2):
                    column *= square

    def state_torque(self, value: Array) -> StateTorque:
        """Return the torque in one state, summed in Python: arrays of a few joints cost more than their numbers."""
        laws = np.zeros((self.robot.n, len(_WORDS)))
        laws[:, list(self.powers)] = value.reshape(self.robot.n, -1)
        # Columns are powers of the drive's speed, which is the joint's but for its direction.
        joints = [(*law, sign) for law, sign in zip(laws.tolist(), self.robot.drive_sign.tolist(), strict=True)]

        def torque(q: Array, v: Array, a: Array) -> Array:
            found = []
            for (a0, a1, a2, a3, sign), speed in zip(joints, v.tolist(), strict=True):
                w = sign * speed
                square = w * w
                dry = a0 + a2 * square
                found.append((dry if w > 0.0 else -dry if w < 0.0 else 0.0) + w * (a1 + a3 * square))
            return np.array(found)

        return torque


@dataclass(frozen=True, eq=False)
class Offset(Filled):
    """A constant torque on joints: offset of the measurement or friction that differs by direction.

    Attributes
    ----------
    robot : Robot
    left_out : tuple of int
        Joints without one, by their places; see `offset`.
    """

    robot: Robot
    left_out: tuple[int, ...] = ()

    @property
    def name(self) -> str:
        """Name of the term."""
        return "offset"

    @property
    def places(self) -> tuple[int, ...]:
        """The joints that have one."""
        return tuple(j for j in range(self.robot.n) if j not in self.left_out)

    @cached_property
    def columns(self) -> tuple[Column, ...]:
        """One column per joint that has one, ``p_o1 ..``."""
        joints = self.robot.joints
        return tuple(
            Column(f"p_o{j + 1}", joints[j], self.robot.torque_unit(j), f"torque offset of {joints[j]}")
            for j in self.places
        )

    @property
    def pattern(self) -> NDArray[np.bool_]:
        """Each joint's offset acts on that joint only."""
        return np.eye(self.robot.n, dtype=bool)[:, list(self.places)]

    def fill(self, motion: Motion, rows: Sequence[Array]) -> None:
        """Write ones."""
        for row in rows:
            row.fill(1.0)

    def of_joints(self, value: Array) -> Array:
        """Return the constant torque of every joint, shape (n,), of the term's parameters; zero where there is none."""
        torque = np.zeros(self.robot.n)
        torque[list(self.places)] = value
        return torque

    def state_torque(self, value: Array) -> StateTorque:
        """Return the constant."""
        constant = self.of_joints(value)
        return lambda q, v, a: constant

    def notes(self) -> tuple[str, ...]:
        """Say of which joints no offset can be determined, and why."""
        return tuple(
            f"{self.robot.joints[j]}: it always carries the same weight, so no recording distinguishes an offset of "
            f"its torque from that weight; the whole constant torque counts as weight, and if there is an offset, "
            f"masses are wrong by the offset divided by gravity"
            for j in self.left_out
        )


def offset(robot: Robot) -> Offset:
    """Return the offsets that torque can tell from the bodies' weight: those of axes that go up and down are not among them."""
    return Offset(robot, constant_torques(robot))
