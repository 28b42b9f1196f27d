"""What changed in an arm, since when, and how sure that is.

Parameters that all dates share are fitted to all of them together. Beside these each cause is tried with a step at each
date and a slope from each date on: its F statistic has the dates' noise with what differs from run to run, scaled by
how much more neighbouring dates differ along this cause in the whole fleet than they should. The probability is corrected
for all that was tried: of one arm by the number of independent tests that its causes, dates and shapes are worth, which
is simulated, and of all arms by their false discovery rate (Benjamini and Hochberg 1995). One in fifty of the arms named is
wrong on average, and one in fifty reports of a fleet in which nothing changed names any.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from scara_ident.arrays import Array
from scara_ident.fleet.causes import Cause
from scara_ident.fleet.history import (
    DateRows,
    History,
    common_removed,
    freedom_of,
    scatter,
)
from scara_ident.fleet.scatter import LEFT_SHARE, Scatter, inverses_by_size

# Chance that a report names any arm of a fleet in which nothing changed, and share of the arms named that are wrong on average.
FALSE_CHANGE_LEVEL = 0.02
# Causes named of one arm, and the probability up from which what one explains more than another is chance.
MAX_CAUSES = 3
AS_GOOD = 0.05
# The model leaves a share of a joint's torque unexplained, and so of what another change moves: what moves by no more than so many
# times that share may be this. Of a payload of 0.8 kg there was left what looked like a ripple of 11 standard deviations.
MIN_OVER_UNEXPLAINED = 2.0
# Draws of noise that say how many independent tests an arm's are worth, and the probability at which they do.
SIMULATED, SIMULATED_LEVEL = 2000, 0.1
# The median of fewer differences between dates does not withstand one that is a change: what differs by nature is then taken
# to be as large, and nothing is named.
FEWEST_STEPS = 3


@dataclass(frozen=True, eq=False)
class Change:
    """Something that changed in an arm.

    Attributes
    ----------
    cause : Cause or None
        None: what no cause explains, seen in a residual that grew.
    joint : str or None
    since : str
        Date at which it was seen first.
    gradual : bool
        Whether it grows from then on; else it came at once.
    size : ndarray, shape (s,)
        By how much it makes the last date differ, all that changed fitted together.
    covariance : ndarray, shape (s, s)
    p_value : float
        Corrected for all that was tried.
    or_else : tuple of Cause
        What the dates cannot tell from it.
    """

    cause: Cause | None
    joint: str | None
    since: str
    gradual: bool
    size: Array
    covariance: Array
    p_value: float
    or_else: tuple[Cause, ...] = ()

    @property
    def score(self) -> float:
        """Size in standard deviations, of several sizes together."""
        square = float(self.size @ np.linalg.pinv(self.covariance, hermitian=True) @ self.size)
        return float(np.sqrt(max(0.0, square)))


def find_changes(history: History, scatter: Scatter, tried: float) -> tuple[Change, ...]:
    """Return what changed in an arm, the surest first; nothing of fewer than two dates.

    A cause that changes on several dates is there for each; sizes are those of all changes together.

    Parameters
    ----------
    history : History
    scatter : Scatter
    tried : float
        How many independent tests the fleet's report makes: those of an arm, see `trials_of`, times `arms_counted`.
    """
    from scipy.special import fdtri

    if len(history.dates) < 2:
        return ()
    search = first = _search(history, scatter)
    found: list[_Named] = []
    for _ in range(MAX_CAUSES):
        unknown = _left_of_others(history, first, [item.beside for item in found])
        ordered = search.in_order(history.causes)
        trials = [trial for trial in ordered if np.any(_moved(history, first, trial) > unknown)]
        if not trials or trials[0].p_value * tried >= FALSE_CHANGE_LEVEL:
            break
        best = _best_of(trials, history.causes, scatter.freedom, tried)
        sizes, others = history.causes[best.cause].sizes, [item for item in trials if item is not best]
        enough = sizes * float(fdtri(sizes, scatter.freedom, 1.0 - AS_GOOD))
        alike = tuple(history.causes[item.cause] for item in others if best.explained - item.explained < enough)
        found = _needed([*found, _Named(best, best, alike)], first, history.causes, tried)
        search = first.beside(found)
    named = []
    for item in found:
        cause, (start, gradual, _), beside = (
            history.causes[item.trial.cause],
            first.shapes[item.trial.shape],
            item.beside,
        )
        chance, since = min(1.0, beside.p_value * tried), history.dates[start]
        named.append(Change(cause, cause.joint, since, gradual, beside.size, beside.covariance, chance, item.alike))
    return tuple(named)


def _best_of(trials: Sequence[_Trial], causes: Sequence[Cause], freedom: float, tried: float) -> _Trial:
    """Return the best explanation of trials in order: the first, or one of more sizes that explains surely more than it.

    With few degrees of freedom the probabilities of large changes are those of a scatter that would have to be far larger than
    it seems, and one size comes before many, however much it leaves. If the first were all that changed, one of d sizes more
    would explain d more than it, in units of the noise.
    """
    from scipy.special import fdtrc

    best = trials[0]
    for item in trials[1:]:
        sizes, more = causes[item.cause].sizes - causes[best.cause].sizes, item.explained - best.explained
        if sizes > 0 and float(fdtrc(sizes, freedom, more / sizes)) * tried < FALSE_CHANGE_LEVEL:
            best = item
    return best


def _needed(found: Sequence[_Named], first: _Search, causes: Sequence[Cause], tried: float) -> list[_Named]:
    """Return what is still sure beside all others, with its size beside them: what came later may be what came first, and more.

    Of friction that is named as a whole first, and then as its Coulomb part, nothing may be left of the whole.
    """
    left = list(found)
    while left:
        each = [
            replace(first.beside([other for other in left if other is not item]), shapes=[first.shapes[item.trial.shape]])
            .best(item.trial.cause, causes[item.trial.cause])
            for item in left
        ]  # fmt: skip
        chances = [np.inf if trial is None else trial.p_value for trial in each]
        worst = int(np.argmax(chances))
        if chances[worst] * tried < FALSE_CHANGE_LEVEL:
            return [replace(item, beside=trial) for item, trial in zip(left, each, strict=True) if trial is not None]
        del left[worst]
    return []


def _moved(history: History, first: _Search, trial: _Trial) -> Array:
    """Return the squared torque that a change makes on each joint over all dates, in units of the noise, shape (n,)."""
    share = first.shapes[trial.shape][2]
    each = (
        np.add.reduceat((x * (row.directions[trial.cause] @ trial.size)) ** 2, row.starts)
        for x, row in zip(share, history.rows, strict=True)
    )
    return np.asarray(sum(each))


def _left_of_others(history: History, first: _Search, found: Sequence[_Trial]) -> Array:
    """Return what changes that were found may leave over as the model is not exact, as `_moved`."""
    moved = sum((_moved(history, first, trial) for trial in found), np.zeros(history.model.robot.n))
    share = np.max([np.nan_to_num(visit.error) for visit in history.visits], axis=0)
    return np.asarray((MIN_OVER_UNEXPLAINED * share) ** 2 * moved)


def arms_counted(probabilities: Sequence[float]) -> float:
    """Return by what the smallest probability of each arm is to be multiplied, so that the false discovery rate is kept.

    Parameters
    ----------
    probabilities : sequence of float
        Of each arm, corrected for what was tried on it.
    """
    count = len(probabilities)
    ranks = np.arange(1, count + 1)
    named = np.flatnonzero(np.sort(probabilities) <= FALSE_CHANGE_LEVEL * ranks / count)
    return count / float(ranks[named[-1]] if len(named) else 1)


def min_probability(history: History, scatter: Scatter, tried: float) -> float:
    """Return the probability of the surest change of an arm, corrected for what was tried on it."""
    trials = _search(history, scatter).in_order(history.causes)
    return min(1.0, tried * trials[0].p_value) if trials else 1.0


def residual_scatter(histories: Sequence[History]) -> tuple[Array, float]:
    """Return by what share the residual of each joint differs from date to date, shape (n,), and its degrees of freedom.

    Parameters
    ----------
    histories : sequence of History
        The whole fleet; at least one has two dates.
    """
    steps = np.concatenate([np.diff(np.log([visit.error for visit in item.visits]), axis=0) for item in histories])
    return np.sqrt(scatter(steps, np.zeros_like(steps))), freedom_of(len(steps))


def grown_residuals(history: History, std: Array, freedom: float, tried: float) -> tuple[Change, ...]:
    """Return the joints whose residual grew by more than it differs from date to date.

    Parameters
    ----------
    history : History
    std : ndarray, shape (n,)
    freedom : float
        See `residual_scatter`.
    tried : float
        See `find_changes`.
    """
    from scipy.special import stdtr

    if len(history.dates) < 2:
        return ()
    own = np.log([visit.error for visit in history.visits])
    count, found = len(own), []
    for j, joint in enumerate(history.model.robot.joints):
        if not np.all(np.isfinite(own[:, j])) or std[j] == 0.0:
            continue
        ends = np.arange(1, count)
        growth = np.array([np.mean(own[k:, j]) - np.mean(own[:k, j]) for k in ends])
        spread = std[j] * np.sqrt(1.0 / ends + 1.0 / (count - ends))
        best = int(np.argmax(growth / spread))
        p_value = float(stdtr(freedom, -growth[best] / spread[best])) * tried
        if p_value < FALSE_CHANGE_LEVEL:
            size, variance = np.array([np.expm1(growth[best])]), np.array([[spread[best] ** 2]])
            found.append(Change(None, joint, history.dates[ends[best]], False, size, variance, p_value))
    return tuple(found)


def trials_of(history: History, scatter: Scatter) -> float:
    """Return how many independent tests all causes, dates and shapes of an arm are worth.

    That is what Sidak's correction would need to meet the simulated distribution of the smallest probability in noise at
    `SIMULATED_LEVEL`.

    Parameters
    ----------
    history : History
    scatter : Scatter
    """
    from scipy.special import chdtrc

    rows = history.whitened(scatter.runs)
    _, basis = common_removed(rows)
    ends = np.cumsum([len(part) for part in basis])
    known = np.concatenate(basis)
    noise = np.random.default_rng(0).standard_normal((len(known), SIMULATED))
    noise -= known @ (known.T @ noise)
    left = np.split(noise, ends[:-1])
    share = np.array([share for _, _, share in _shapes(history.days)])
    least = np.ones(SIMULATED)
    for k, cause in enumerate(history.causes):
        own = [row.directions[k] for row in rows]
        inverse, _, kept = _left_of(own, basis, share)
        aims = np.array([each.T @ part for each, part in zip(own, left, strict=True)])
        along = np.einsum("sd,din->sin", share, aims)
        explained = np.einsum("sin,sij,sjn->sn", along, inverse, along)[kept]
        if len(explained):
            least = np.minimum(least, chdtrc(cause.sizes, np.max(explained, axis=0)))
    level = float(np.quantile(least, SIMULATED_LEVEL))
    return max(1.0, float(np.log1p(-SIMULATED_LEVEL) / np.log1p(-level)))


@dataclass(frozen=True, eq=False)
class _Trial:
    cause: int
    shape: int
    explained: float
    order: float
    p_value: float
    size: Array
    covariance: Array


@dataclass(frozen=True, eq=False)
class _Named:
    """What was found at one step, what it is beside all that was found, and the causes that it was not distinguished from."""

    trial: _Trial
    beside: _Trial
    alike: tuple[Cause, ...]


def _shapes(days: Array) -> Iterator[tuple[int, bool, Array]]:
    """Give the first date that differs, whether it grows from then on, and the share of its last size on every date."""
    count = len(days)
    for start in range(1, count):
        yield start, False, (np.arange(count) >= start).astype(float)
    for start in range(1, count - 1):
        before = days[start - 1]
        yield start, True, np.clip((days - before) / (days[-1] - before), 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class _Search:
    """Rows of every date, what is left of them beside a basis of what is known, and the shapes that are tried."""

    rows: Sequence[DateRows]
    left: Sequence[Array]
    basis: Sequence[Array]
    shapes: Sequence[tuple[int, bool, Array]]
    scatter: Scatter

    def best(self, k: int, cause: Cause) -> _Trial | None:
        """Return the best shape of the k-th cause; None where the common parameters leave nothing of it."""
        from scipy.special import fdtrc

        own = [row.directions[k] for row in self.rows]
        aims = np.array([each.T @ rest for each, rest in zip(own, self.left, strict=True)])
        share = np.array([share for _, _, share in self.shapes])
        inverse, information, kept = _left_of(own, self.basis, share)
        if not np.any(kept):
            return None
        wider = np.sqrt(self.scatter.causes.get(cause.label, np.ones(cause.sizes)))
        value = np.einsum("sij,sj->si", inverse, share @ aims)
        explained = np.where(kept, np.einsum("si,sij,sj->s", value / wider, information, value / wider), -1.0)
        best = int(np.argmax(explained))
        # Causes are compared as if all were as sure: else the surest scatter, not the best explanation, would come first.
        freedom = self.scatter.freedom
        freedoms = np.array([freedom, self.scatter.freedoms.get(cause.label, freedom)])
        order, p_value = (float(p) for p in fdtrc(cause.sizes, freedoms, explained[best] / cause.sizes))
        covariance = np.outer(wider, wider) * inverse[best]
        return _Trial(k, best, float(explained[best]), order, p_value, value[best], covariance)

    def in_order(self, causes: Sequence[Cause]) -> list[_Trial]:
        """Return the best shape of each cause, the best explanation first."""
        each = (self.best(k, cause) for k, cause in enumerate(causes))
        return sorted((trial for trial in each if trial is not None), key=lambda item: item.order)

    def beside(self, found: Sequence[_Named]) -> _Search:
        """Return the search beside all that was found."""
        search = self
        for item in found:
            search = search.without(item.trial)
        return search

    def without(self, trial: _Trial) -> _Search:
        """Return the search beside a cause that was found."""
        share = self.shapes[trial.shape][2]
        added = np.concatenate([x * row.directions[trial.cause] for x, row in zip(share, self.rows, strict=True)])
        known, rest = np.concatenate(self.basis), np.concatenate(self.left)
        added = added - known @ (known.T @ added)
        turned, _ = np.linalg.qr(added)
        ends = np.cumsum([len(part) for part in self.left])[:-1]
        left, basis = np.split(rest - turned @ (turned.T @ rest), ends), np.split(np.hstack([known, turned]), ends)
        return replace(self, left=left, basis=basis)


def _search(history: History, scatter: Scatter) -> _Search:
    rows = history.whitened(scatter.runs)
    return _Search(rows, *common_removed(rows), list(_shapes(history.days)), scatter)


def _left_of(own: Sequence[Array], basis: Sequence[Array], share: Array) -> tuple[Array, Array, Array]:
    """Return for each shape the covariance of a cause's sizes, its inverse, (S, s, s), and whether anything of it is left."""
    squares = np.array([part.T @ part for part in own])
    shared = np.array([part.T @ each for part, each in zip(basis, own, strict=True)])
    taken = np.einsum("sd,drj->srj", share, shared)
    whole = np.einsum("sd,dij->sij", share**2, squares)
    matrix = whole - np.einsum("sri,srj->sij", taken, taken)
    kept = np.all(np.einsum("sii->si", matrix) > LEFT_SHARE * np.einsum("sii->si", whole), axis=1)
    return inverses_by_size(matrix), matrix, kept
