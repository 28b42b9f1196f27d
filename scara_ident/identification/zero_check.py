"""Do positions count from elsewhere by quarter turns, as by another maker's convention? It imitates signs and every effect."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.estimation.least_squares import weighted_value
from scara_ident.estimation.observations import Observations
from scara_ident.estimation.urdf_gravity import near_axis, urdf_gravity
from scara_ident.identification.channel_comparison import SIMPLER_SHARE, far_less, friction_pushes, held_out, mean
from scara_ident.identification.channel_fault import ChannelFault, faults_of, in_words
from scara_ident.identification.channel_reading import JointReading, Reading, has_zeros, observed_as
from scara_ident.identification.few_rows import FewRows
from scara_ident.identification.gravity_check import SAME_GRAVITY, left_under, other_gravities
from scara_ident.identification.reading_search import SAME_ERROR_SHARE, ZERO_COST, cost, searched

# Readings that leave as much and are named; of more nothing is said.
MAX_READINGS = 2


@dataclass(frozen=True, eq=False)
class WrongZeros:
    """A reading with other zeros, and signs where these are wrong too, that leaves far less.

    Attributes
    ----------
    reading : tuple of JointReading
    alternatives : tuple of str
        In words, what leaves as much and is as simple.
    error, mended : float
        See `ChannelFault`.
    left, few_left : float
        What it leaves of the torque of all joints, geometric mean, on blocks that it was not fitted to, and of few rows.
    observations : Observations
    """

    reading: Reading
    alternatives: tuple[str, ...]
    error: float
    mended: float
    left: float
    few_left: float
    observations: Observations

    def faults(self, joints: Sequence[str]) -> list[ChannelFault]:
        """Return what is wrong with the mapping."""
        return faults_of(self.reading, joints, self.error, self.mended, self.alternatives)


def wrong_zeros(
    held: Observations, rows: FewRows, before: tuple[Array, Array], pushing: NDArray[np.bool_], most: float
) -> WrongZeros | None:
    """Return the reading with other zeros that explains recordings, if one does and neither signs nor gravity do as simply.

    Where several do, what they have in common is reported, and the next round looks at the rest.

    Parameters
    ----------
    held : Observations
    rows : FewRows
        Of them.
    before : tuple of ndarray
        What `held_out` says of them.
    pushing : ndarray of bool, shape (n,)
        Joints whose friction would feed energy in.
    most : float
        Share of the torque that a reading may leave at most.
    """
    tried = searched(rows)
    chosen, others = _simplest(tried)
    if not has_zeros(chosen):
        return None
    # An arm that is mounted otherwise is as simple as one zero; to tell of that is not for the channels.
    if _other_gravity(held, rows) * SIMPLER_SHARE <= tried[chosen]:
        return None
    found = _counted(held, before, pushing, most, rows, _common([chosen, *others])) if others else None
    if found is not None or len(others) > MAX_READINGS:
        return found
    alternatives = tuple(in_words(other, held.model.robot.joints) for other in others)
    return _counted(held, before, pushing, most, rows, chosen, alternatives)


def _counted(
    held: Observations,
    before: tuple[Array, Array],
    pushing: NDArray[np.bool_],
    most: float,
    rows: FewRows,
    reading: Reading,
    alternatives: tuple[str, ...] = (),
) -> WrongZeros | None:
    """Return a reading with other zeros if it counts on all rows, and friction pushes on no more joints."""
    if not has_zeros(reading):
        return None
    other = observed_as(held, reading)
    then = held_out(other)
    said = far_less(before, then, most, poor=True)
    pushed = np.count_nonzero(friction_pushes(weighted_value(other.by_joint), other))
    if said is None or pushed > np.count_nonzero(pushing):
        return None
    return WrongZeros(reading, alternatives, *said, mean(then[1]), mean(rows.left(reading)), other)


def _simplest(tried: dict[Reading, float]) -> tuple[Reading, list[Reading]]:
    """Return the simplest of the readings that leave about the least, and others about as simple, the best first.

    So is the one that leaves least, but where it has all of the simplest.
    """
    order = sorted(tried, key=tried.__getitem__)

    def within(share: float, of: Reading) -> list[Reading]:
        return [reading for reading in order if tried[reading] * share <= tried[of]]

    chosen = min(within(SIMPLER_SHARE, order[0]), key=cost)
    others = [one for one in within(SIMPLER_SHARE, chosen) if one != chosen and cost(one) <= cost(chosen) + 1]
    best = min(within(1.0 - SAME_ERROR_SHARE, order[0]), key=cost)
    if _common([best, chosen]) != chosen and cost(best) <= cost(chosen) + ZERO_COST:
        others.insert(0, best)
    return chosen, list(dict.fromkeys(others))


def _common(readings: Sequence[Reading]) -> Reading:
    """Return what readings have in common, joint by joint; as mapped elsewhere."""
    return tuple(each[0] if len(set(each)) == 1 else JointReading() for each in zip(*readings, strict=True))


def _other_gravity(held: Observations, rows: FewRows) -> float:
    """Return what is left at least where the arm stands otherwise: gravity along an axis of the base, or as the URDF's bodies show it."""
    stated = np.asarray(held.model.robot.model.gravity.linear, dtype=float)
    size = float(np.linalg.norm(stated))
    directions = list(other_gravities(stated))
    shown = urdf_gravity(held)
    if shown is not None and np.linalg.norm(shown.found) > 0.0:
        found = size * near_axis(shown.found / np.linalg.norm(shown.found))
        directions += [found] if np.linalg.norm(found - stated) > SAME_GRAVITY * size else []
    return min((left_under(rows, gravity) for gravity in directions), default=np.inf)
