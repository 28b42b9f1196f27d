"""What a term of the torque equation is."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.motion.motion import Motion
from scara_ident.robot.robot import Robot


@dataclass(frozen=True)
class Column:
    """One column of the regressor: one parameter of the model.

    Attributes
    ----------
    name : str
        Name of the parameter.
    joint : str or None
        The joint it belongs to; None where it belongs to no one joint.
    unit : str
    meaning : str
        What the parameter is made of, in words or standard parameters.
    nonnegative : bool
        Whether no real arm can have a negative value.
    """

    name: str
    joint: str | None
    unit: str
    meaning: str
    nonnegative: bool = False

    def entry(self, **numbers: float) -> dict[str, Any]:
        """Return what result files say of the parameter, with its numbers."""
        return {"name": self.name, "joint": self.joint, **numbers, "unit": self.unit, "meaning": self.meaning}


class Term(Protocol):
    """A named block of columns of the torque equation."""

    @property
    def name(self) -> str:
        """Name of the term."""
        ...

    @property
    def columns(self) -> tuple[Column, ...]:
        """The term's p columns."""
        ...

    @property
    def pattern(self) -> NDArray[np.bool_]:
        """Which entries can differ from zero, shape (n, p)."""
        ...

    def fill(self, motion: Motion, rows: Sequence[Array]) -> None:
        """Write the columns on a stretch of motion, on the side of the recorded torque.

        Parameters
        ----------
        motion : Motion
            N samples.
        rows : sequence of ndarray, shape (k, N)
            For each joint, where to write the columns that `pattern` has on it, in their order.
        """
        ...

    def regressor(self, motion: Motion) -> Array:
        """Return the columns on a stretch of motion, shape (n, p, N), on the side of the recorded torque."""
        ...


StateTorque = Callable[[Array, Array, Array], Array]
"""Torque (n,) on the recorded side of one position, velocity and acceleration, (n,) each."""


@runtime_checkable
class OfState(Protocol):
    """A term that says what it is in one state, or that it is no function of it."""

    def state_torque(self, value: Array) -> StateTorque | None:
        """Return the torque of the term's parameters (k,) in one state; None where it takes more than the state."""
        ...


@runtime_checkable
class InState(Protocol):
    """A term that depends on more than a state, and says what it is without that."""

    @property
    def in_state(self) -> Term:
        """The term, with the same columns, as one state tells it."""
        ...


def joint_rows(term: Term, motion: Motion) -> list[Array]:
    """Return of each joint the columns of a term that act on it, shape (k, N) each, in the order of its `pattern`."""
    rows = [np.empty((np.count_nonzero(row), motion.samples)) for row in term.pattern]
    term.fill(motion, rows)
    return rows


class Filled:
    """A term whose dense regressor is made of what it fills in."""

    def regressor(self: Term, motion: Motion) -> Array:
        """Return the columns on a stretch of motion, shape (n, p, N), zero where the pattern says so."""
        pattern, rows = self.pattern, joint_rows(self, motion)
        result = np.zeros((*pattern.shape, motion.samples))
        for joint, row in enumerate(pattern):
            result[joint, row] = rows[joint]
        return result


def per_speed(robot: Robot, joint: int, power: int) -> str:
    """Return the unit of torque divided by speed to a power, such as ``N m s^2/rad^2``."""
    torque = robot.torque_unit(joint)
    length = robot.position_unit(joint)
    if power == 0:
        return torque
    exponent = "" if power == 1 else f"^{power}"
    return f"{torque} s{exponent}/{length}{exponent}"
