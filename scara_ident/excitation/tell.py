"""The motion that best answers what recordings left open.

Effects remember, turn with the sign of a speed and pass the bands of the diagnosis, so that their columns have no useful
derivative by a motion's coefficients. The search draws motions, takes each as large as its limits allow or smaller, and
changes the best of them, beside motions at some speeds that tell most of the model's parameters, which a gradient finds. It
goes by glances, and judges in full what it ends with (`judge.py`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial

import numpy as np

from scara_ident.arrays import Array
from scara_ident.excitation.curves import Basis
from scara_ident.excitation.interior_point import Minimum
from scara_ident.excitation.judge import Judge, rows_over
from scara_ident.excitation.limits import InfeasibleLimits
from scara_ident.excitation.problem import Problem, Task, row_names
from scara_ident.excitation.search import (
    CLOSE,
    COARSE,
    FINE,
    SPARSE,
    Effort,
    Found,
    Progress,
    from_random,
    verified_inside,
    within_grid,
)
from scara_ident.inquiry.answerability import Inquiry
from scara_ident.processes import map_in_order
from scara_ident.threads import one_blas_thread

# Motions that a search draws first, and changes of the best of them in a round.
DRAWN, CHANGED = 48, 60
# Speeds of a drawn motion as shares of the limits, evenly in their logarithm; how often a joint stands still.
MIN_SPEED_SHARE, STANDSTILL_SHARE = 0.03, 0.15
# Shares of the speeds that joints can have at which motions that tell most of the parameters are searched.
PACES = (1.0, 0.3, 0.1)
# Size of the first change, of 1 for another motion; it grows by this where a change helps and else shrinks by its fourth
# root, so that one in five helps (Rechenberg 1973), and is at least so large.
FIRST_STEP, STEP_GROWTH, MIN_STEP = 0.3, 1.5, 0.01
# What a motion that breaks a limit shrinks by at first, twice as much each time up to the most, and how often.
SHRINKING, MAX_SHRINKING, TRIES = 0.01, 0.2, 40


def search_to_tell(
    task: Task, inquiry: Inquiry, effort: Effort, progress: Callable[[Progress], None] | None = None
) -> Found:
    """Search for the motion that answers questions best.

    Parameters
    ----------
    task : Task
        Of one trajectory; its criterion is that of the motions where the first search begins.
    inquiry : Inquiry
    effort : Effort
        Searches from ``starts`` sets of random motions, of which in each of ``rounds`` further rounds the better half goes on.
    progress : callable, optional
        Called after every round of every search.

    Raises
    ------
    InfeasibleLimits
        If no random motion is within the limits.
    """
    bounds = np.full(len(row_names(task.limits, len(task.posture))), CLOSE)
    # What is inside on the fine grid is so between its times, or all but; distances, which take longest, on a coarse one.
    fine = within_grid(task, FINE, bounds)
    problem = replace(fine, sparse=FINE // COARSE * SPARSE[COARSE])
    judge = Judge(inquiry, task.bases[0], task.posture)

    def paced(share: float) -> Minimum | None:
        return from_random(within_grid(slowed(task, share), COARSE, bounds), effort.seed, 0)

    beside = [item.x for item in map_in_order(paced, PACES, effort.processes) if item is not None]

    if beside:
        # What is known is made before the processes begin, each of which would make it.
        judge.glance(beside[0])
    rounds, going = _Rounds(problem, judge, effort.seed, tuple(beside)), list(range(effort.starts))
    total = sum(_left(effort.starts, number) for number in range(1 + effort.rounds))
    climbs: dict[int, _Climb] = {}
    done = 0
    for number in range(1 + effort.rounds):
        begun = [(index, climbs.get(index)) for index in going]
        for index, climb in zip(
            going, map_in_order(partial(rounds.climbed, number), begun, effort.processes), strict=True
        ):
            done += 1
            if climb is not None:
                climbs[index] = climb
            if progress is not None:
                progress(Progress(done, total, min((item.least for item in climbs.values()), default=np.inf)))
        going = sorted(climbs.keys() & set(going), key=lambda index: (climbs[index].least, index))
        going = sorted(going[: _left(effort.starts, number + 1)])
    if not climbs:
        raise InfeasibleLimits("no motion drawn is within the limits; widen the tightest of them")
    ends = [climbs.get(index) for index in range(effort.starts)]
    costs = tuple(map_in_order(lambda end: np.inf if end is None else judge.cost(end.x), ends, effort.processes))
    best = ends[int(np.argmin(costs))]
    assert best is not None
    with one_blas_thread():
        x, times = verified_inside(fine, best.x)
    return Found(x, costs, times)


def slowed(task: Task, share: float) -> Task:
    """Return the task with joints at most at a share of the speed that they can have."""
    return replace(task, limits=replace(task.limits, velocity=share * task.speed))


def _left(starts: int, number: int) -> int:
    """Return how many searches take part in a round: half of them each time, those that look best, and at least one."""
    return max(1, int(np.ceil(starts / 2**number)))


@dataclass(frozen=True, eq=False)
class _Climb:
    """How far a search is: the least at a glance, the motion that has it, and how large changes of it now are."""

    least: float
    x: Array
    size: float


@dataclass(frozen=True, eq=False)
class _Rounds:
    """What the rounds of all searches share; each round of each has random numbers of its own."""

    problem: Problem
    judge: Judge
    seed: int
    beside: tuple[Array, ...]

    def climbed(self, number: int, begun: tuple[int, _Climb | None]) -> _Climb | None:
        """Change the motion of a search as long as that helps; the first round begins at the best of some drawn."""
        (index, climb), task = begun, self.problem.task
        random = np.random.default_rng([self.seed, index, number])
        if climb is None:
            climb = self._drawn(self.beside if index == 0 else (), random)
        if climb is None:
            return None
        least, best, size = climb.least, climb.x, climb.size
        for _ in range(CHANGED):
            x = _inside(self.problem, _changed(task, best, size, self.beside, random))
            if x is not None and (now := self.judge.glance(x)) < least:
                least, best, size = now, x, min(1.0, STEP_GROWTH * size)
            else:
                size = max(MIN_STEP, STEP_GROWTH**-0.25 * size)
        return _Climb(least, best, size)

    def _drawn(self, first: Sequence[Array], random: np.random.Generator) -> _Climb | None:
        """Return the best of some motions and random ones; None where none is within the limits."""
        wanted = (*first, *(random_motion(self.problem.task, random) for _ in range(DRAWN)))
        inside = [x for x in (_inside(self.problem, x) for x in wanted) if x is not None]
        looks = [self.judge.glance(x) for x in inside]
        return _Climb(min(looks), inside[int(np.argmin(looks))], FIRST_STEP) if inside else None


def random_motion(task: Task, random: np.random.Generator) -> Array:
    """Draw a motion, shape (1, n, m): each joint with its own speed and pace, about its own place, or at rest."""
    _, n, m = task.shape
    (basis,), limits = task.bases, task.limits
    highest = basis.bandwidth * basis.duration
    time = basis.duration * np.arange(8 * m) / (8 * m)
    velocity = np.zeros((n, len(time)))
    shared = np.exp(random.uniform(np.log(2.0), np.log(max(3.0, highest))))
    for j in range(n):
        top = shared if random.uniform() < 0.5 else np.exp(random.uniform(np.log(2.0), np.log(max(3.0, highest))))
        orders = np.arange(1, int(np.ceil(top)) + 1)
        phases = 2.0 * np.pi / basis.duration * np.outer(orders, time)
        size = random.normal(size=(2, len(orders))) / np.sqrt(len(orders))
        if n < 2 or random.uniform() >= STANDSTILL_SHARE:
            share = np.exp(random.uniform(np.log(MIN_SPEED_SHARE), 0.0))
            velocity[j] = share * task.speed[j] * (size[0] @ np.cos(phases) + size[1] @ np.sin(phases))
    x = velocity @ _inverse(basis, 1).T
    place = random.uniform(limits.lower, limits.upper)
    return np.asarray(_placed(basis, x, place - task.posture)[None])


def _placed(basis: Basis, x: Array, mean: Array) -> Array:
    """Return coefficients with the mean of each joint's position moved to a place relative to the posture."""
    constant = _inverse(basis, 0) @ np.ones(8 * basis.size)
    return np.asarray(x + np.outer(mean - _mean(basis, x), constant))


def _mean(basis: Basis, x: Array) -> Array:
    return np.asarray(x @ np.mean(rows_over(basis, 8 * basis.size)[0], axis=0))


@lru_cache(maxsize=8)
def _inverse(basis: Basis, derivative: int) -> Array:
    """From values at equal steps to the coefficients of the nearest motion, shape (m, 8 m)."""
    return np.linalg.pinv(rows_over(basis, 8 * basis.size)[derivative], rcond=1e-9)


def _changed(task: Task, x: Array, size: float, beside: Sequence[Array], random: np.random.Generator) -> Array:
    """Return a motion with some joints' changed, enlarged or moved, or with another in a half of its time."""
    n = x.shape[1]
    chosen = random.uniform(size=n) < max(0.4, 1.0 / n)
    chosen[random.integers(n)] = True
    kind = random.integers(4 if beside else 3)
    (basis,), y = task.bases, x.copy()
    if kind == 0:
        y[0, chosen] = (1.0 - 0.5 * size) * x[0, chosen] + size * random_motion(task, random)[0, chosen]
    elif kind == 1:
        y[0, chosen] *= np.exp(size * random.normal(size=(int(np.sum(chosen)), 1)))
    elif kind == 3:
        y[0] = _spliced(basis, x[0], beside[int(random.integers(len(beside)))][0], random.uniform(0.0, 2.0 * np.pi))
    else:
        reach = size * (task.limits.upper - task.limits.lower) * random.normal(size=n)
        y[0] = np.where(chosen[:, None], _placed(basis, x[0], _mean(basis, x[0]) + reach), x[0])
    return y


def _spliced(basis: Basis, x: Array, other: Array, phase: float) -> Array:
    """Return coefficients of a motion that goes as one does for half of the time, and as another for the other half."""
    angle = 2.0 * np.pi * np.arange(8 * basis.size) / (8 * basis.size)
    share = 0.5 + 0.5 * np.clip(2.0 * np.cos(angle - phase), -1.0, 1.0)
    one, two = (each @ rows_over(basis, 8 * basis.size)[1].T for each in (x, other))
    return _placed(basis, (share * one + (1.0 - share) * two) @ _inverse(basis, 1).T, _mean(basis, x))


def _inside(problem: Problem, x: Array) -> Array | None:
    """Bring a motion within its limits: first each joint's position and speed, then all of it; None where it never is."""
    limits, (basis,), posture = problem.task.limits, problem.task.bases, problem.task.posture
    bound = float(np.min(problem.bounds))
    speed = np.max(np.abs(x[0] @ problem.rows[1, 0].T), axis=1)
    x = x * np.minimum(1.0, bound * limits.velocity / np.maximum(speed, 1e-12))[None, :, None]
    q = x[0] @ problem.rows[0, 0].T + posture[:, None]
    low, high = q.min(axis=1), q.max(axis=1)
    half = 0.5 * bound * (limits.upper - limits.lower)
    size = np.minimum(1.0, 2.0 * half / np.maximum(high - low, 1e-12))
    middle = np.clip(0.5 * (low + high), limits.centre - half + 0.5 * size * (high - low),
                     limits.centre + half - 0.5 * size * (high - low))  # fmt: skip
    mean = np.mean(q, axis=1)
    moved = middle + size * (mean - 0.5 * (low + high)) - posture
    x = _placed(basis, size[:, None] * x[0], moved)[None]
    for k in range(TRIES):
        if problem.inside(x):
            return x
        x = (1.0 - min(MAX_SHRINKING, SHRINKING * 2.0**k)) * x
    return None
