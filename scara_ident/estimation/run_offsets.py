"""Rows in which offsets that differ from run to run are part of the noise (generalised least squares).

With one offset for all runs something else absorbs each run's own offset: gravity, if motions differ. Generalised
least squares (Aitken 1936) takes them for draws of a variance, so that a run says little of its mean torque and all it knows
of the rest. Offsets alone are weighted so: a model that lacks something seems to differ from motion to motion in friction
and torque scale, and to weigh those down would leave it to the motions that it fits best.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.estimation.observations import Observations
from scara_ident.estimation.run_variation import OFFSET, JointVariation, RunVariation, offset_direction


@dataclass(frozen=True, eq=False)
class OffsetRows:
    """Observations as a fit sees them.

    Attributes
    ----------
    fitted : Observations
        Their rows times V^-1/2, with V the covariance of a row's noise and of the offsets, in units of the noise: ordinary
        least squares on them is generalised least squares.
    """

    fitted: Observations
    offsets: RunVariation | None

    @cached_property
    def influence(self) -> Observations:
        """Their rows times V^-1: columns are by what a row moves that estimate, and the noise without the offsets is left."""
        if self.offsets is None:
            return self.fitted
        return replace(self.fitted, joints=self.offsets.whitened_rows(self.fitted.joints))

    def taken(self, inverse: Array, weights: Array) -> Array:
        """Return how many of the runs' offsets a fit takes up on each joint, shape (n,): the leverage of all of them.

        One where runs are alike, which is their mean; more where poses differ and gravity is determined by means of runs.

        Parameters
        ----------
        inverse : ndarray, shape (p, p)
            Inverse of ``W.T @ W`` of all weighted rows.
        weights : ndarray, shape (n,)
        """
        firsts, taken = _firsts(self.fitted), np.zeros(len(weights))
        for joint, (rows, weight) in enumerate(zip(self.fitted.joints, weights, strict=True)):
            constant, own = offset_direction(self.fitted.model, rows), inverse[np.ix_(rows.columns, rows.columns)]
            for start, stop in pairwise(rows.starts[firsts]):
                pull = weight * rows.table[:-1, start:stop] @ constant[start:stop]
                size = float(constant[start:stop] @ constant[start:stop])
                taken[joint] += float(pull @ own @ pull) / size if size > 0.0 else 0.0
        return taken


def _firsts(observations: Observations) -> NDArray[np.intp]:
    """Return the block with which each recording begins, and the number of blocks."""
    return np.searchsorted(observations.owner, np.arange(len(observations.data.recordings) + 1))


def beside_offsets(observations: Observations, offsets: RunVariation | None) -> OffsetRows:
    """Return rows with offsets of runs as noise.

    Parameters
    ----------
    offsets : RunVariation or None
        The scatter of the offsets, see `RunVariation.offsets`; None if they do not differ.
    """
    if offsets is None:
        return OffsetRows(observations, None)
    return OffsetRows(replace(observations, joints=offsets.whitened_rows(observations.joints)), offsets)


def larger_offsets(one: RunVariation | None, other: RunVariation | None) -> RunVariation | None:
    """Return for each joint the offsets with the larger scatter; None if there are none.

    Parameters
    ----------
    one, other : RunVariation or None
        Of the same rows.
    """
    if one is None or other is None:
        return one or other
    pairs = zip(one.joints, other.joints, strict=True)
    joints = [max((item for item in pair if item is not None), key=_apart, default=None) for pair in pairs]
    return RunVariation(tuple(joints))


def _apart(item: JointVariation) -> float:
    return float(item.std[OFFSET])


def offsets_on(observations: Observations, offsets: RunVariation | None) -> RunVariation | None:
    """Return the same offsets on other rows of the same runs, such as in another band, with the same white noise per row.

    Parameters
    ----------
    observations : Observations
        Of a model with the same offsets.
    """
    if offsets is None:
        return None
    joints = list(offsets.joints)
    firsts = _firsts(observations)
    for joint, (item, rows) in enumerate(zip(offsets.joints, observations.joints, strict=True)):
        if item is not None:
            directions = np.zeros((len(item.std), rows.table.shape[1]))
            directions[OFFSET] = offset_direction(observations.model, rows)
            joints[joint] = replace(item, directions=directions, bounds=rows.starts[firsts])
    return RunVariation(tuple(joints))


def rms_beside_own(value: Array, observations: Observations) -> Array:
    """Return the rms of each joint over recordings that have an offset of their own, within the band; NaN without rows.

    Parameters
    ----------
    value : ndarray, shape (p,)
    observations : Observations

    Returns
    -------
    ndarray, shape (n,)
    """
    firsts = _firsts(observations)
    found = np.full(len(observations.joints), np.nan)
    for joint, rows in enumerate(observations.joints):
        bounds = rows.starts[firsts]
        if rows.samples and bounds[-1] > bounds[0]:
            left, constant = rows.left(value), offset_direction(observations.model, rows)
            squares, along, size = (
                np.diff(np.append(0.0, np.cumsum(item))[bounds]) for item in (left**2, left * constant, constant**2)
            )
            left_of_each = squares - np.divide(along**2, size, out=np.zeros(len(size)), where=size > 0.0)
            found[joint] = np.sqrt(max(float(np.sum(left_of_each)), 0.0) / rows.samples)
    return found


def rms_of(value: Array, observations: Observations, offsets: RunVariation | None = None) -> tuple[float | None, ...]:
    """Return the rms of each joint over recordings, within the band; None without rows.

    Parameters
    ----------
    value : ndarray, shape (p,)
    offsets : RunVariation, optional
        Offsets of runs, which count as no more than the noise then, see `Estimate.offsets`.
    """
    joints = beside_offsets(observations, offsets).fitted.by_joint
    return tuple(item.rms(value) if item.rows else None for item in joints)
