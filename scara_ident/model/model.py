"""The torque model: a tuple of terms, and the rows of its regressor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from scara_ident.errors import UsageError
from scara_ident.model.terms import Column, Friction, Offset, RigidBody, Term
from scara_ident.model.terms.rigid_body import rigid_body
from scara_ident.motion.motion import Motion
from scara_ident.robot.robot import Robot

ModelName = Literal["complete", "reduced", "basic"]


@dataclass(frozen=True, eq=False)
class TorqueModel:
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

    @property
    def columns(self) -> tuple[Column, ...]:
        """The p columns of all terms."""
        return tuple(column for term in self.terms for column in term.columns)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the p parameters."""
        return tuple(column.name for column in self.columns)

    @property
    def pattern(self) -> NDArray[np.bool_]:
        """Which entries of the regressor can differ from zero, shape (n, p)."""
        return np.concatenate([term.pattern for term in self.terms], axis=1)

    @property
    def rigid_body(self) -> RigidBody:
        """The rigid-body term."""
        return next(term for term in self.terms if isinstance(term, RigidBody))

    def place(self, term: Term) -> slice:
        """Return where a term's columns stand among the p."""
        start = 0
        for other in self.terms:
            if other is term:
                return slice(start, start + len(other.columns))
            start += len(other.columns)
        raise ValueError(f"the model {self.name} has no such term: {term.name}")

    def regressor(self, motion: Motion) -> NDArray[np.float64]:
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


def build_model(robot: Robot, name: ModelName = "complete") -> TorqueModel:
    """Build one of the three models of the command line.

    Parameters
    ----------
    robot : Robot
    name : {"complete", "reduced", "basic"}
        ``complete``: rigid bodies, rotors, friction to the third power of speed and offset. ``reduced``: no
        cubic friction and no offset; on the SCARA03 no P_d3 either, which leaves the ten parameters of
        Indri et al. 2002. ``basic``: Coulomb and viscous friction and offset.

    Raises
    ------
    UsageError
        If the name is none of these.
    """
    if name == "complete":
        return TorqueModel(name, robot, (rigid_body(robot), Friction(robot), Offset(robot)))
    if name == "reduced":
        return TorqueModel(name, robot, (rigid_body(robot, without=("P_d3",)), Friction(robot, (0, 1, 2))))
    if name == "basic":
        return TorqueModel(name, robot, (rigid_body(robot), Friction(robot, (0, 1)), Offset(robot)))
    raise UsageError(f"model {name!r}: expected one of {', '.join(get_args(ModelName))}")
