"""The torque of a model with known parameters: of one state as fast as a controller asks, or of many."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from scara_ident.arrays import Array
from scara_ident.errors import UsageError
from scara_ident.manners import Frozen
from scara_ident.model.model import TorqueModel
from scara_ident.model.terms.rigid_body import CHUNK
from scara_ident.model.terms.term import InState, OfState, StateTorque, Term
from scara_ident.motion.motion import Motion


@dataclass(frozen=True, eq=False, repr=False)
class Prediction(Frozen):
    """The torque of a model with its parameters, as a function of position, velocity and acceleration.

    Attributes
    ----------
    model : TorqueModel
    value : ndarray, shape (p,)
    """

    model: TorqueModel
    value: Array

    def __call__(self, q: ArrayLike, v: ArrayLike, a: ArrayLike) -> Array:
        """Predict the recorded torque.

        Parameters
        ----------
        q, v, a : array_like, shape (n,) or (N, n)
            Position, velocity and acceleration of one state, or of N states, in rad or m, per s and s^2; joints in the
            robot's order.

        Returns
        -------
        ndarray, shape (n,) or (N, n)
            N m (N), on the side of the gear where effort is recorded.

        Raises
        ------
        UsageError
            If the shapes are not these.
        """
        q, v, a = np.asarray(q, dtype=float), np.asarray(v, dtype=float), np.asarray(a, dtype=float)
        if not q.shape == v.shape == a.shape or q.ndim not in (1, 2) or q.shape[-1] != self.model.robot.n:
            n = self.model.robot.n
            raise UsageError(
                f"predict: q, v and a have shapes {q.shape}, {v.shape} and {a.shape}; expected ({n},) or (N, {n}) for "
                f"the joints {', '.join(self.model.robot.joints)}"
            )
        return self._one(q, v, a) if q.ndim == 1 else self._many(q.T, v.T, a.T).T

    @property
    def left_out(self) -> tuple[str, ...]:
        """Terms of the model whose torque takes more than a state, such as time or what came before."""
        return tuple(_label(term) for term in self.model.terms if not self._of_state(term))

    @cached_property
    def _kept(self) -> Array:
        """The parameters of `_in_state`."""
        own = [self.value[self.model.place(term)] for term in self.model.terms if self._of_state(term)]
        return np.concatenate([np.empty(0), *own])

    def _of_state(self, term: Term) -> bool:
        return self._functions[self.model.terms.index(term)] is not None

    @cached_property
    def _in_state(self) -> TorqueModel:
        """The model without the terms that are left out."""
        terms = [term for term in self.model.terms if self._of_state(term)]
        return replace(self.model, terms=tuple(term.in_state if isinstance(term, InState) else term for term in terms))

    @cached_property
    def _functions(self) -> tuple[StateTorque | None, ...]:
        return tuple(_function(term, self.value[self.model.place(term)]) for term in self.model.terms)

    @cached_property
    def _present(self) -> tuple[StateTorque, ...]:
        return tuple(function for function in self._functions if function is not None)

    def _one(self, q: Array, v: Array, a: Array) -> Array:
        first, *others = self._present
        torque = first(q, v, a)
        for function in others:
            torque = torque + function(q, v, a)
        return torque

    def _many(self, q: Array, v: Array, a: Array) -> Array:
        torque = np.empty(q.shape)
        for start in range(0, q.shape[1], CHUNK):
            own = slice(start, start + CHUNK)
            rows = self._in_state.joint_columns(states(q[:, own], v[:, own], a[:, own]))
            torque[:, own] = [
                self._kept[columns] @ row for columns, row in zip(self._in_state.active, rows, strict=True)
            ]
        return torque


def states(q: Array, v: Array, a: Array) -> Motion:
    """Return states (n, N) that follow no time as a motion of no recording: nothing is too fast for its rate."""
    return Motion("", "", np.arange(float(q.shape[1])), q, v, a, None, np.inf)


def _function(term: Term, value: Array) -> StateTorque | None:
    """Return a term's torque in one state: its own function, or else what it fills in for one sample."""
    if isinstance(term, OfState):
        return term.state_torque(value)
    return lambda q, v, a: np.asarray(
        np.einsum("jk,k->j", term.regressor(states(q[:, None], v[:, None], a[:, None]))[:, :, 0], value)
    )


def _label(term: Term) -> str:
    joint = getattr(term, "joint", None)
    return term.name if joint is None else f"{term.name} of {joint}"
