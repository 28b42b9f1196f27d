"""Residuals at every sample, within the bands that the estimate used."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from scara_ident.arrays import Array
from scara_ident.manners import Frozen
from scara_ident.motion.prepared import PreparedData


@dataclass(frozen=True, eq=False, repr=False)
class Residuals(Frozen):
    """The residual of a model on prepared data.

    Attributes
    ----------
    data : PreparedData
    predicted : tuple of ndarray, shape (n, N)
        Torque that the model predicts on every stretch, not filtered.
    """

    data: PreparedData
    predicted: tuple[Array, ...]

    @cached_property
    def banded(self) -> tuple[Array, ...]:
        """Residual on every stretch, shape (n, N), within the bands and faded out towards rest."""
        return tuple(
            np.array([part.smooth(j, row) for j, row in enumerate(part.torque - predicted)])
            for part, predicted in zip(self.data.stretches, self.predicted, strict=True)
        )
