"""The state of an online identification: the triangular factor of all rows, with old rows forgotten."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from scara_ident.arrays import Array
from scara_ident.estimation.information import UNDETERMINED, triangular

Forgetting = Literal["none", "exponential", "directional"]


@dataclass(frozen=True, eq=False)
class Memory:
    """The triangular factor of ``[W | u]``, with every row divided by its joint's noise.

    Attributes
    ----------
    factor : ndarray, shape (p, p + 1)
        Upper triangular; rows of zeros where nothing is known.
    """

    factor: Array

    @staticmethod
    def empty(parameters: int) -> Memory:
        """Return the memory of nothing."""
        return Memory(np.zeros((parameters, parameters + 1)))

    @property
    def parameters(self) -> int:
        """Number of parameters p."""
        return len(self.factor)

    @cached_property
    def determined(self) -> bool:
        """Whether every parameter is known."""
        pivots, size = np.abs(np.diag(self.factor)), np.linalg.norm(self.factor[:, :-1], axis=0)
        return bool(np.all(size > 0.0) and np.all(pivots > UNDETERMINED * size))

    def value(self) -> Array:
        """Return the parameters, shape (p,); every one is known."""
        from scipy.linalg.lapack import dtrtrs

        return np.asarray(dtrtrs(self.factor[:, :-1], self.factor[:, -1])[0])

    def solved(self, rows: Array) -> Array:
        """Return ``A' x`` of rows x, shape (N, p), as columns (p, N), where ``A A'`` is the covariance; all is known."""
        from scipy.linalg.lapack import dtrtrs

        # LAPACK itself: on factors this small SciPy's checks of what it is given take ten times as long.
        return np.asarray(dtrtrs(self.factor[:, :-1], rows.T, trans=1)[0])

    def solved_back(self, column: Array) -> Array:
        """Return ``A y`` of a column y, shape (p,), so that a row times it is the row's `solved` times y."""
        from scipy.linalg.lapack import dtrtrs

        return np.asarray(dtrtrs(self.factor[:, :-1], column)[0])

    def absorbed(self, rows: Array) -> Memory:
        """Return the memory with rows ``[W | u]``, shape (N, p + 1), added."""
        found = triangular(np.concatenate([self.factor, rows]))[: self.parameters]
        if len(found) < self.parameters:
            found = np.concatenate([found, np.zeros((self.parameters - len(found), self.parameters + 1))])
        return Memory(found)

    def forgotten(self, share: float, rows: Array, kind: Forgetting) -> Memory:
        """Return the memory with what is old weighed less, before rows are added.

        Parameters
        ----------
        share : float
            Weight that information keeps, in (0, 1].
        rows : ndarray, shape (N, p + 1)
            What is to come.
        kind : {"none", "exponential", "directional"}
            Exponential: all that is known fades, whatever the motion tells. Directional: in each direction as much as
            new rows tell at the most, so that what is known never grows less. A motion that tells nothing then forgets
            nothing, and covariances do not wind up (directions as in Cao and Schwartz 2000, "A directional forgetting
            algorithm based on the decomposition of the information matrix").
        """
        if kind == "none" or share >= 1.0:
            return self
        if kind == "exponential":
            return Memory(np.sqrt(share) * self.factor)
        if not self.determined:
            return self
        # In directions in which old information is 1, new information is the square of these singular values.
        new = triangular(rows[:, :-1])
        solution = self.solved(new).T
        _, singular, right = np.linalg.svd(solution, full_matrices=False)
        kept = np.sqrt(np.maximum(share, 1.0 - np.minimum(singular**2, 1.0)))
        return Memory(triangular(self.factor - ((1.0 - kept)[:, None] * right).T @ (right @ self.factor)))
