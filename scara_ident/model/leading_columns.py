"""Which parameters lead the base parameters, where the first of a sum hardly enters the torque."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from scara_ident.arrays import Array

# A parameter leads where none of those regrouped with it weighs this many times as much in its sum; with masses and inertias of
# one size, the sums of an arm with axes at right angles and in parallel weigh them by 1 at most.
HEAVIER = 10.0
# Of those that weigh as much as the heaviest to this share, the first in the order leads.
SAME_WEIGHT_SHARE = 0.99


def sums_of(columns: Array, kept: Sequence[int], others: Sequence[int]) -> Array:
    """Write other columns, of shape (m, p), as sums of those kept, which are independent; shape (len(kept), len(others))."""
    size = np.linalg.norm(columns, axis=0)
    unit = np.linalg.lstsq(columns[:, kept] / size[kept], columns[:, others] / size[others], rcond=None)[0]
    return np.asarray(unit * size[others] / size[kept][:, None])


def with_heavier_leads(columns: Array, kept: Sequence[int], others: Sequence[int]) -> list[int]:
    """Return the columns kept, with those exchanged beside which one of the others weighs much more in their sum.

    Where an axis is off its frame's by a hundredth, as some URDFs of CAD programs have it, Ixx comes before Izz and enters
    the torque by a ten-thousandth of it: Ixx + 8182 Izz, and so are its value and its standard deviation. Each exchange makes the
    volume that the columns kept span larger by that weight (Gu and Eisenstat 1996, "Efficient algorithms for computing a strong
    rank-revealing QR factorization"), so that they come to an end.

    Parameters
    ----------
    columns : ndarray, shape (m, p)
        Of parameters of one size.
    kept : sequence of int
        Independent columns.
    others : sequence of int
        Columns that are sums of these, in the order in which they are to lead.
    """
    kept, others = list(kept), list(others)
    while others:
        weights = np.abs(sums_of(columns, kept, others))
        if not np.max(weights) > HEAVIER:
            break
        behind = int(np.argmax(np.max(weights, axis=0) > SAME_WEIGHT_SHARE * np.max(weights)))
        before = int(np.argmax(weights[:, behind]))
        kept[before], others[behind] = others[behind], kept[before]
    return kept
