"""Whether a model's columns span those of an effect at all states, tested on random ones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.motion.motion import Motion
from scara_ident.robot.robot import Robot

# Share of an effect's square outside the model below which it is absorbed; above what a URDF loses by few digits.
ABSORBED_SHARE = 1e-6
# Parameters that carry less than this share of the effect are not named.
NAMED_SHARE = 1e-4


def random_motion(robot: Robot, rng: np.random.Generator, samples: int) -> Motion:
    """Return unrelated random states: positions within a turn or a metre, speeds to 2, accelerations to 8."""
    reach = np.where(robot.prismatic, 1.0, np.pi)[:, None]
    q, v, a = (scale * rng.uniform(-1.0, 1.0, (robot.n, samples)) for scale in (reach, 2.0, 8.0))
    return Motion("random", "random", np.arange(samples, dtype=float), q, v, a, None, 1.0)


def rows_by_sample(columns: Array) -> Array:
    """Return columns (n, k, N) as (n N, k)."""
    return np.ascontiguousarray(columns.transpose(0, 2, 1)).reshape(-1, columns.shape[1])


@dataclass(frozen=True, eq=False)
class Span:
    """What the columns of a model can carry.

    Attributes
    ----------
    entering : ndarray of int
        The columns that are not zero.
    unit : ndarray, shape (m, r)
        These, of unit length.
    inverse : ndarray, shape (r, m)
        Pseudo-inverse of ``unit``.
    """

    entering: NDArray[np.intp]
    unit: Array
    inverse: Array

    @classmethod
    def of(cls, rows: Array) -> Span:
        """Return the span of columns, shape (m, p)."""
        size = np.linalg.norm(rows, axis=0)
        entering = np.flatnonzero(size > 0.0)
        unit = rows[:, entering] / size[entering]
        return cls(entering, unit, np.linalg.pinv(unit, rcond=1e-12))

    def carriers(self, rows: Array) -> list[int] | None:
        """Return which of the model's columns carry an effect's, shape (m, k); None where they do not carry all of it."""
        total = np.sum(rows**2, axis=0)
        rows = rows[:, total > 0.0]
        if rows.shape[1] == 0:
            return []
        rows = rows / np.linalg.norm(rows, axis=0)
        sums = self.inverse @ rows
        if np.any(np.sum((rows - self.unit @ sums) ** 2, axis=0) >= ABSORBED_SHARE):
            return None
        return [int(self.entering[k]) for k in np.flatnonzero(np.any(np.abs(sums) > NAMED_SHARE, axis=1))]
