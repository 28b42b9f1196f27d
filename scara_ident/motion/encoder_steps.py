"""The steps in which an encoder has positions."""

from __future__ import annotations

import numpy as np

from scara_ident.arrays import Array, median

# Positions have steps where their changes are whole multiples of the least one, but for this much of it in the mean:
# numbers of random size leave a quarter.
WHOLE = 0.1


def encoder_step(position: Array) -> float | None:
    """Return the step of an encoder; None where positions do not go in steps.

    Parameters
    ----------
    position : ndarray, shape (N,)
        rad or m.
    """
    change = np.abs(np.diff(position))
    largest = max(np.max(position, initial=0.0), -np.min(position, initial=0.0))
    # What rounding of a number in single precision leaves is no change.
    changed = change > 4.0 * np.finfo(np.float32).eps * largest
    # A joint that is never at rest is not copied.
    change = change if np.all(changed) else change[changed]
    if len(change) < 4:
        return None
    least = float(np.min(change))
    step = median(change[change < 1.5 * least])
    multiple = change / step
    # Beyond so many steps at once the error of the step itself adds up.
    near = multiple[multiple < 1.0 / WHOLE]
    if len(near) < 4 or float(np.mean(np.abs(near - np.round(near)))) > WHOLE:
        return None
    return step
