"""Parameters where each run has an offset of its own, from triangular factors of runs alone.

Where no row is kept, as where a band is chosen, how far offsets lie apart is not estimated. Where they make most of what one
offset for all leaves, each run is given its own, which takes nothing from what its motion says (Frisch and Waugh 1933).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from scara_ident.arrays import Array
from scara_ident.estimation.information import Information, joint_noise, merge, triangular, weighted
from scara_ident.model.model import TorqueModel
from scara_ident.model.offsets import OWN_LEAVE, offset_columns


def value_beside_offsets(model: TorqueModel, each: Sequence[Sequence[Information]]) -> Array:
    """Return the parameters of `wls`, shape (p,), with an offset for every run where these make most of what one for all leaves.

    Parameters
    ----------
    each : sequence of sequence of Information
        Of every run the rows of every joint, in the columns that act on it.

    Returns
    -------
    ndarray, shape (p,)
        Offsets that are each run's own are zero.
    """
    joints = [merge(parts) for parts in zip(*each, strict=True)]
    value, noise = _fit(model, joints)
    if len(each) < 2:
        return value
    # Beside one offset for all, the rest of the model takes up what it can of the others: it is not seen in what is left.
    freed = []
    for joint, (item, active, column) in enumerate(zip(joints, model.active, offset_columns(model), strict=True)):
        place = None if column is None else int(np.flatnonzero(active == column)[0])
        freed.append(item if place is None else merge([without(run[joint], place) for run in each]))
    own, _ = _fit(model, freed)
    return own if _left(model, freed, own, noise) < OWN_LEAVE * _left(model, joints, value, noise) else value


def _fit(model: TorqueModel, joints: Sequence[Information]) -> tuple[Array, Array]:
    """Return the parameters and each joint's noise (n,) of `wls`."""
    whole = [item.embed(own, len(model.columns)) for item, own in zip(joints, model.active, strict=True)]
    noise = joint_noise(whole)
    return weighted(whole, 1.0 / noise).solve().value, noise


def _left(model: TorqueModel, joints: Sequence[Information], value: Array, noise: Array) -> float:
    """Return the squared residual of all joints in units of the noise."""
    triples = zip(joints, model.active, noise, strict=True)
    return float(sum(item.residual_sum(value[own]) / sigma**2 for item, own, sigma in triples))


def without(information: Information, column: int) -> Information:
    """Return what rows say of all else with a parameter of their own, which is zero then."""
    factor = information.factor
    size = np.linalg.norm(factor[:, column])
    if size == 0.0:
        return information
    # What is along its column says nothing but of it; nothing of the column itself is left.
    along = factor[:, column] / size
    rows = factor - np.outer(along, along @ factor)
    rows[:, column] = 0.0
    return Information(triangular(rows), information.rows)
