"""By how much a run that no parameter saw differs from a model, where runs were found to differ."""

from __future__ import annotations

import numpy as np

from scara_ident.arrays import Array
from scara_ident.estimation.observations import Observations
from scara_ident.estimation.run_variation import RunVariation, directions_of


def of_another_run(variation: RunVariation, observations: Observations, value: Array) -> Array:
    """Return the rms torque by which further runs are expected to lie off the mean of those that were seen.

    Each kind of difference is a draw of its standard deviation, see `scara_ident.estimation.run_variation`.

    Parameters
    ----------
    variation : RunVariation
        Of the runs that were seen.
    observations : Observations
        Of the same model, on the further ones.
    value : ndarray, shape (p,)

    Returns
    -------
    ndarray, shape (n,)
        N m (N); zero where runs do not differ, or no samples are kept.
    """
    found = np.zeros(len(variation.joints))
    if not observations.raw:
        return found
    for joint, (item, rows) in enumerate(zip(variation.joints, observations.joints, strict=True)):
        if item is not None and rows.table.shape[1] and rows.sizes is None:
            directions = directions_of(observations, joint, rows, value)
            found[joint] = np.sqrt(np.sum(item.std[:, None] ** 2 * directions**2) / rows.samples)
    return found
