"""What makes one motion better than another: functions of the information matrix, with their gradients.

All are functions of ``P = H^T H`` for the stacked regressor H, plus what was known before. They are written as costs,
to be minimised. Nothing here knows of motions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Protocol, Self

import numpy as np

from scara_ident.arrays import Array
from scara_ident.errors import UsageError
from scara_ident.model.model import TorqueModel

# Sharpness with which the mean of eigenvalues' powers stands for the largest or smallest of them at the end.
SHARPEST = 24.0
# P with columns scaled to one has lost its rank below this eigenvalue.
SINGULAR = 1e-15


class Criterion(Protocol):
    """A cost of an information matrix."""

    @property
    def name(self) -> str:
        """Name for results."""
        ...

    def cost(self, information: Array) -> tuple[float, Array]:
        """Return the cost of P, shape (p, p), and its gradient; infinite cost where P is singular."""
        ...

    def sharpened(self, share: float) -> Criterion:
        """Return the criterion as an optimiser may use it, smooth at share 0 and sharp at share 1."""
        ...


class _Smooth:
    def sharpened(self, share: float) -> Self:
        """Return the criterion itself: it is smooth."""
        return self


@dataclass(frozen=True)
class LogDet(_Smooth):
    """D-optimality: ``-ln det P``, that is -J_d of Indri et al. 2002."""

    name: ClassVar[str] = "logdet"

    def cost(self, information: Array) -> tuple[float, Array]:
        """Return -ln det P and its gradient."""
        return _log_det(information)


@dataclass(frozen=True)
class BlockLogDet(_Smooth):
    """D_s-optimality: ``-ln det`` of the information about some parameters while the others are estimated too.

    That information is the Schur complement of the others in P (Atkinson, Donev and Tobias 2007, section 10.3).

    Attributes
    ----------
    columns : tuple of int
        Places of these parameters.
    """

    name: ClassVar[str] = "block_logdet"
    columns: tuple[int, ...]

    def cost(self, information: Array) -> tuple[float, Array]:
        """Return -ln det P + ln det of the part of the others, and its gradient."""
        others = np.setdiff1d(np.arange(len(information)), self.columns)
        cost, gradient = _log_det(information)
        if len(others) and np.isfinite(cost):
            inner = np.ix_(others, others)
            rest, slope = _log_det(information[inner])
            cost -= rest
            gradient[inner] -= slope
        return cost, gradient


@dataclass(frozen=True)
class Condition:
    """The condition of the regressor: ``ln cond(H^T H)``, that is ln J_k of Indri et al. 2002.

    The largest and smallest eigenvalue are replaced by means of the eigenvalues' powers s and -s, which bound them
    from outside and are smooth.

    Attributes
    ----------
    columns : tuple of int, optional
        Parameters whose columns count; all by default.
    scaled : bool
        Whether columns are scaled to unit length first.
    power : float
        s.
    """

    columns: tuple[int, ...] | None = None
    scaled: bool = False
    power: float = SHARPEST

    @property
    def name(self) -> str:
        """Name for results."""
        return "scaled_cond" if self.scaled else "cond"

    def cost(self, information: Array) -> tuple[float, Array]:
        """Return the smoothed logarithm of the condition and its gradient."""
        gradient = np.zeros_like(information)
        inner = np.ix_(*(2 * (self.columns,))) if self.columns is not None else np.ix_(*(2 * (range(len(gradient)),)))
        part = information[inner]
        diagonal = np.diag(part)
        if not np.all(np.isfinite(part)) or np.any(diagonal <= 0.0):
            return np.inf, gradient
        size = np.sqrt(diagonal) if self.scaled else np.ones(len(part))
        matrix = part / np.outer(size, size)
        value, vectors = np.linalg.eigh(matrix)
        if value[0] <= SINGULAR * value[-1]:
            return np.inf, gradient
        s = self.power
        logs = np.log(value)
        top, bottom = s * (logs - logs[-1]), -s * (logs - logs[0])
        cost = logs[-1] + np.log(np.sum(np.exp(top))) / s - logs[0] + np.log(np.sum(np.exp(bottom))) / s
        shares = np.exp(top) / np.sum(np.exp(top)) - np.exp(bottom) / np.sum(np.exp(bottom))
        slope = (vectors * (shares / value)) @ vectors.T
        if self.scaled:
            # Every column's length changes with its diagonal entry.
            slope = slope - np.diag(np.sum(vectors**2 * shares, axis=1))
        gradient[inner] = slope / np.outer(size, size)
        return float(cost), gradient

    def sharpened(self, share: float) -> Criterion:
        """Use gentler powers first, which move more than one eigenvalue at a time."""
        return replace(self, power=2.0 * (self.power / 2.0) ** share)


def criterion_of(name: str, model: TorqueModel, wanted: Sequence[str] = ()) -> Criterion:
    """Return ``logdet`` or ``cond`` over all parameters, or over some parameters or terms.

    Raises
    ------
    UsageError
        If the name or what is wanted is not known.
    """
    if name not in ("logdet", "cond"):
        raise UsageError(f"criterion {name!r}: expected logdet or cond")
    block = block_of(model, wanted) if wanted else None
    if name == "cond":
        return Condition(None if block is None else block.columns)
    return LogDet() if block is None else block


def block_of(model: TorqueModel, names: Sequence[str]) -> BlockLogDet:
    """Return the criterion that asks for some parameters of a model.

    Parameters
    ----------
    names : sequence of str
        Parameters, or whole terms such as ``friction``.

    Raises
    ------
    UsageError
        If the model has no such parameter or term, or none is given.
    """
    chosen: list[int] = []
    terms = {term.name: model.place(term) for term in model.terms}
    for name in names:
        if name in terms:
            chosen += range(terms[name].start, terms[name].stop)
        elif name in model.names:
            chosen.append(model.names.index(name))
        else:
            raise UsageError(
                f"parameter {name!r}: the model {model.name} has {', '.join(model.names)} "
                f"and the terms {', '.join(terms)}"
            )
    if not chosen:
        raise UsageError("no parameter chosen; name those that the design is for")
    return BlockLogDet(tuple(sorted(set(chosen))))


def _log_det(matrix: Array) -> tuple[float, Array]:
    diagonal = np.diag(matrix)
    if not np.all(np.isfinite(matrix)) or np.any(diagonal <= 0.0):
        return np.inf, np.zeros_like(matrix)
    size = np.sqrt(diagonal)
    value, vectors = np.linalg.eigh(matrix / np.outer(size, size))
    if value[0] <= SINGULAR * value[-1]:
        return np.inf, np.zeros_like(matrix)
    cost = -float(np.sum(np.log(value)) + np.sum(np.log(diagonal)))
    return cost, -((vectors / value) @ vectors.T) / np.outer(size, size)
