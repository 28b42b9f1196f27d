"""Arms that are unlike all others of their fleet from their first date on, which no comparison of dates shows.

Each parameter of an arm's first date is compared with the median of all arms, in units of the spread between arms. This is the
distance within which three quarters of them lie: it is known better than the median distance where arms are few, and a quarter
of them may be odd. How far the farthest of so many normal arms lies is simulated, and corrected for all parameters by
Bonferroni's inequality.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from scara_ident.arrays import Array, medians
from scara_ident.fleet.table import Quantity
from scara_ident.model.model import TorqueModel

# Chance that a report names any arm of a fleet in which none is odd.
FALSE_ODD_LEVEL = 0.02
# Of fewer arms three quarters are too few to tell a spread from one that is odd.
FEWEST_ARMS = 5
# The share of arms whose distance is the spread, and what a normal variable's size is below with this probability.
NEAREST, NORMAL_NEAREST = 0.75, 1.1503
# Draws that tell how far the farthest arm lies, at the most and at least: of many arms fewer do, whose spread differs little.
DRAWS, FEWEST_DRAWS = 200_000, 10_000
# Numbers that are drawn, where that leaves draws enough.
NUMBERS = 4_000_000


@dataclass(frozen=True)
class Oddity:
    """A parameter of an arm that is far from those of the others.

    Attributes
    ----------
    name, meaning, unit : str
    value : float
        On the arm's first date.
    middle : float
        Median of all arms.
    stds : float
        How far it is from there, signed, in standard deviations of the spread between arms and of its own uncertainty.
    arms : int
        How many were compared.
    """

    name: str
    meaning: str
    unit: str
    value: float
    middle: float
    stds: float
    arms: int

    @property
    def words(self) -> str:
        """In words, such as ``a01 (Coulomb friction of joint1) is 1.9 N m, 12 standard deviations above ...``."""
        side = "above" if self.stds > 0.0 else "below"
        return (
            f"{self.name} ({self.meaning}) is {self.value:.3g} {self.unit}, {abs(self.stds):.0f} standard deviations {side} "
            f"the median of {self.arms} arms, {self.middle:.3g}"
        )


def odd_arms(
    model: TorqueModel, first: Mapping[str, Sequence[Quantity]]
) -> dict[str, tuple[Oddity, ...]]:  # fmt: skip
    """Return by arm the parameters that are far from those of the others, the farthest first; nothing of few arms.

    Parameters
    ----------
    model : TorqueModel
    first : mapping of str to sequence of Quantity
        By arm those of its first date.
    """
    arms, columns = list(first), {column.name: column for column in model.columns}
    known = [{item.name: item for item in each if item.name in columns} for each in first.values()]
    names = [name for name in columns if sum(np.isfinite(_std(own, name)) for own in known) >= FEWEST_ARMS]
    found: dict[str, list[Oddity]] = {}
    for name in names:
        kept = [(arm, own[name]) for arm, own in zip(arms, known, strict=True) if np.isfinite(_std(own, name))]
        value, std = (np.array([getattr(item, kind) for _, item in kept]) for kind in ("value", "std"))
        middle, stds = _stds(value, std)
        farthest = _farthest(len(kept), FALSE_ODD_LEVEL / len(names))
        for (arm, item), own in zip(kept, stds.tolist(), strict=True):
            if abs(own) > farthest:
                words = columns[name].meaning, item.unit, item.value, middle, own, len(kept)
                found.setdefault(arm, []).append(Oddity(name, *words))
    return {arm: tuple(sorted(own, key=lambda item: -abs(item.stds))) for arm, own in found.items()}


def _std(quantities: Mapping[str, Quantity], name: str) -> float:
    """Return the standard deviation of a quantity, infinite where it is not determined."""
    item = quantities.get(name)
    return np.inf if item is None or not np.isfinite(item.value) else item.std


def _stds(value: Array, std: Array) -> tuple[float, Array]:
    """Return the median of values and how far each is from there, in standard deviations of arms and of its own.

    The spread of values has their usual uncertainty in it, and is never less; what is more uncertain than usual is so by itself.
    """
    middle = float(np.median(value))
    usual = float(np.median(std**2))
    spread = max(float(_spreads(np.abs(value - middle)[None])[0]) ** 2, usual)
    own = np.sqrt(spread + np.maximum(0.0, std**2 - usual))
    return middle, np.divide(value - middle, own, out=np.zeros(len(value)), where=own > 0.0)


def _spreads(distances: Array) -> Array:
    """Return the standard deviation of normal variables from their distances to their median, shape (N, arms)."""
    place = int(np.ceil(NEAREST * distances.shape[1])) - 1
    return np.asarray(np.partition(distances, place, axis=1)[:, place] / NORMAL_NEAREST)


@lru_cache(maxsize=64)
def _farthest(arms: int, chance: float) -> float:
    """Return how many standard deviations the farthest of normal arms lies off with some probability only."""
    count = min(DRAWS, max(FEWEST_DRAWS, NUMBERS // arms))
    draws = np.random.default_rng(arms).standard_normal((count, arms))
    distances = np.abs(draws - medians(draws)[:, None])
    return float(np.quantile(distances.max(axis=1) / _spreads(distances), 1.0 - chance))
