"""Standard deviations from few draws: Student's t."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from scara_ident.arrays import Array


def widening(freedom: ArrayLike) -> Array:
    """Return by how much standard deviations of so few degrees of freedom are widened, so that two of them cover 95 %."""
    from scipy.special import stdtrit

    return np.asarray(0.5 * stdtrit(freedom, 0.975))
