"""Physical constraints on a term's parameters, declared by the term and collected by the estimators.

Only facts are declared here; how a solver writes them is the estimators' matter.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from scara_ident.model.terms.term import Term


@dataclass(frozen=True)
class RealBodies:
    """The columns are sums of the standard parameters of bodies with mass and of rotors (see `RigidBody`)."""


@dataclass(frozen=True)
class Nonnegative:
    """These columns' parameters cannot be negative.

    Attributes
    ----------
    columns : tuple of int
        Places among the term's columns.
    """

    columns: tuple[int, ...]


@dataclass(frozen=True)
class BrakingPolynomial:
    """A polynomial of a joint's speed that takes energy out and that the joint's motor can overcome.

    ``0 <= p(v) <= limit`` for every speed v in [0, speed], with ``p(v) = sum_k parameter_k v**power_k``.

    Attributes
    ----------
    columns : tuple of int
        Places among the term's columns.
    powers : tuple of int
        Power of speed of each column, 0 to 3.
    speed : float
        Velocity limit of the joint, rad/s or m/s; infinite where it has none.
    limit : float
        Torque limit of the motor on the recorded side, N m or N; infinite where it has none.
    usual_speed, usual_torque : float or None
        Of the recordings, where they are known.
    """

    joint: str
    columns: tuple[int, ...]
    powers: tuple[int, ...]
    speed: float
    limit: float
    usual_speed: float | None = None
    usual_torque: float | None = None


Constraint = RealBodies | Nonnegative | BrakingPolynomial


@runtime_checkable
class Constrained(Protocol):
    """A term that says more of its parameters than which of them cannot be negative."""

    def constraints(self) -> tuple[Constraint, ...]:
        """Return what a real arm allows of the term's parameters."""
        ...


def constraints_of(term: Term) -> tuple[Constraint, ...]:
    """Return a term's own constraints, or else that its columns marked so cannot be negative."""
    if isinstance(term, Constrained):
        return term.constraints()
    columns = tuple(k for k, column in enumerate(term.columns) if column.nonnegative)
    return (Nonnegative(columns),) if columns else ()
