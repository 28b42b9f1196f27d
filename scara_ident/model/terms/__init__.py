"""Terms of the torque equation, one file per physical family."""

from scara_ident.model.terms.constraints import BrakingPolynomial, Constrained, Nonnegative, RealBodies, constraints_of
from scara_ident.model.terms.friction import Friction, Offset
from scara_ident.model.terms.rigid_body import RigidBody
from scara_ident.model.terms.term import Column, Term, joint_rows

__all__ = [
    "BrakingPolynomial",
    "Column",
    "Constrained",
    "Friction",
    "Nonnegative",
    "Offset",
    "RealBodies",
    "RigidBody",
    "Term",
    "constraints_of",
    "joint_rows",
]
