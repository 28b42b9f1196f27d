"""The torque model: a tuple of terms, and the rows of its regressor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.manners import Frozen
from scara_ident.model import MODELS
from scara_ident.model.base_parameters import constant_as_bodies
from scara_ident.model.terms import Column, Friction, Offset, RigidBody, Term
from scara_ident.model.terms.friction import offset
from scara_ident.model.terms.rigid_body import rigid_body
from scara_ident.motion.motion import Motion
from scara_ident.robot.robot import Robot


@dataclass(frozen=True, eq=False, repr=False)
class TorqueModel(Frozen):
    """A torque equation linear in its p parameters: ``u = regressor @ parameters``.

    Attributes
    ----------
    name : str
    robot : Robot
    terms : tuple of Term
    """

    name: str
    robot: Robot
    terms: tuple[Term, ...]

    @cached_property
    def columns(self) -> tuple[Column, ...]:
        """The p columns of all terms."""
        return tuple(column for term in self.terms for column in term.columns)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the p parameters."""
        return tuple(column.name for column in self.columns)

    def _in_short(self) -> str:
        terms = ", ".join(term.name for term in self.terms)
        return f"{self.robot.name}, {self.name}: {len(self.columns)} parameters of {terms}"

    @cached_property
    def pattern(self) -> NDArray[np.bool_]:
        """Which entries of the regressor can differ from zero, shape (n, p)."""
        return np.concatenate([term.pattern for term in self.terms], axis=1)

    @property
    def rigid_body(self) -> RigidBody:
        """The rigid-body term."""
        return next(term for term in self.terms if isinstance(term, RigidBody))

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on what the model leaves out because no recording determines it."""
        return tuple(note for term in self.terms if isinstance(term, Offset) for note in term.notes())

    def place(self, term: Term) -> slice:
        """Return the places of a term's columns among the p."""
        start = 0
        for other in self.terms:
            if other is term:
                return slice(start, start + len(other.columns))
            start += len(other.columns)
        raise ValueError(f"the model {self.name} has no such term: {term.name}")

    @cached_property
    def constants(self) -> Array:
        """One unit of offset of each joint as a combination of the columns on its rows, shape (n, p).

        If weight replaces it (`Offset.left_out`) this is a combination of bodies; zero for a model without offsets.
        """
        weights = np.zeros((self.robot.n, len(self.columns)))
        for term in (term for term in self.terms if isinstance(term, Offset)):
            weights[list(term.places), self.place(term)] = np.eye(len(term.places))
            for joint in term.left_out:
                body = self.rigid_body
                made = constant_as_bodies(self.robot, body.base, joint) / self.robot.row_scale[joint]
                weights[joint, self.place(body)] = made[body.kept]
        return weights

    def regressor(self, motion: Motion) -> Array:
        """Return the regressor of a stretch of motion.

        Parameters
        ----------
        motion : Motion
            N samples.

        Returns
        -------
        ndarray, shape (n, p, N)
            Torque of each joint per parameter, on the side where the torque is recorded.
        """
        return np.concatenate([term.regressor(motion) for term in self.terms], axis=1)

    @cached_property
    def active(self) -> tuple[NDArray[np.intp], ...]:
        """Columns that can differ from zero on each joint."""
        return tuple(np.flatnonzero(row) for row in self.pattern)

    def joint_columns(self, motion: Motion, into: Sequence[Array] | None = None) -> tuple[Array, ...]:
        """Return for each joint the columns that act on it, each of shape (k, N), see `active`; in arrays that are given."""
        found = tuple(np.empty((len(own), motion.samples)) for own in self.active) if into is None else tuple(into)
        start = np.zeros(self.robot.n, dtype=np.intp)
        for term in self.terms:
            stop = start + np.count_nonzero(term.pattern, axis=1)
            term.fill(motion, [rows[a:b] for rows, a, b in zip(found, start, stop, strict=True)])
            start = stop
        return found

    def torque(self, motion: Motion, value: Array) -> Array:
        """Return the torque of parameters ``value`` (p,) on a motion, recorded side, shape (n, N)."""
        columns = self.joint_columns(motion)
        return np.array([value[own] @ rows for own, rows in zip(self.active, columns, strict=True)])


def build_model(robot: Robot, name: str = "complete") -> TorqueModel:
    """Build a model by its name.

    Parameters
    ----------
    robot : Robot
    name : str
        ``complete``, ``reduced``, ``basic``, or one that an installed package adds to `scara_ident.model.MODELS`.

    Raises
    ------
    UsageError
        If there is no model of this name; the message lists the names.

    Examples
    --------
    >>> from scara_ident import build_model, load_robot
    >>> build_model(load_robot(), "basic")
    TorqueModel(scara03, basic: 11 parameters of rigid_body, friction, offset)
    """
    return MODELS.get(name)(robot)


def complete(robot: Robot) -> TorqueModel:
    """Return rigid bodies, rotors, friction to the third power of speed and offset."""
    return TorqueModel("complete", robot, (rigid_body(robot), Friction(robot), offset(robot)))


def reduced(robot: Robot) -> TorqueModel:
    """Return the model without cubic friction and offset.

    On the SCARA03 without P_d3 either, which leaves the ten parameters of Indri et al. 2002.
    """
    return TorqueModel("reduced", robot, (rigid_body(robot, without=("P_d3",)), Friction(robot, (0, 1, 2))))


def basic(robot: Robot) -> TorqueModel:
    """Return rigid bodies, rotors, Coulomb and viscous friction and offset."""
    return TorqueModel("basic", robot, (rigid_body(robot), Friction(robot, (0, 1)), offset(robot)))
