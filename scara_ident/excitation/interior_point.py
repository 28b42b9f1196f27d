"""An interior-point method for a smooth cost under limits at many times.

The limits at the times of a grid are many, and at an optimum about as many are met exactly as there are coefficients,
so their barrier carries nearly all the curvature of the problem. The Newton matrix is therefore made of the barrier
alone, in its primal-dual form (Nocedal and Wright 2006, chapter 19), with a damping that grows where a step fails.
Every iterate is within all limits.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, cho_factor, cho_solve

from scara_ident.arrays import Array
from scara_ident.excitation.problem import Point, Problem
from scara_ident.excitation.slopes import Slopes

# Share of the way to the nearest limit that a step may go.
NEARLY = 0.95
# Least share of the foreseen decrease that a step must give (Armijo).
SUFFICIENT = 1e-4
HALVINGS = 8
MIN_DAMPING, MAX_DAMPING = 1e-6, 1e12
# Steps by which a motion is moved inside its limits, how far inside each aims, in the room asked for, and the first damping.
MOVES, AIM, FIRST_DAMPING = 40, 2.0, 1e-2
# How far multipliers may be from what the barrier alone says.
MULTIPLIER_RANGE = 1e3


@dataclass(frozen=True)
class Schedule:
    """How closely the limits are approached.

    Attributes
    ----------
    first, last : float
        What the barrier costs at the start and at the end, in units of the cost.
    factor : float
        By which it shrinks from one stage to the next.
    tolerance : float
        Foreseen decrease below which a stage is done.
    steps : int
        Most Newton steps.
    sharpness : float
        Sharpness of the cost at the start; it is 1 at the end. See `Problem.sharpened`.
    """

    first: float = 6.0
    last: float = 6e-3
    factor: float = 0.4
    tolerance: float = 0.02
    steps: int = 300
    sharpness: float = 0.0


@dataclass(frozen=True, eq=False)
class Minimum:
    """Where a search ended.

    Attributes
    ----------
    x : ndarray, shape (k, n, m)
    cost : float
        Of the sharpest criterion.
    """

    x: Array
    cost: float
    steps: int


def shrunk_inside(problem: Problem, x: Array, room: float = 0.03, factor: float = 0.95) -> Array | None:
    """Shrink a motion towards its posture at rest until it is inside all limits; None where it never is.

    Parameters
    ----------
    x : ndarray, shape (k, n, m)
    room : float
        Least distance from each limit, as a share of it.
    factor : float
        Of each try.
    """
    for _ in range(400):
        point = problem.at(x)
        if np.isfinite(point.cost) and np.min(_slack(problem, point.values)) > room:
            return x
        x = factor * x
    return None


def moved_inside(problem: Problem, x: Array, room: float) -> Array | None:
    """Change a motion that breaks limits by as little as brings it inside; None where it stays outside.

    Shrinking leads nowhere where a link comes nearer to another on the way. The steps are those of Levenberg and
    Marquardt towards what is broken alone, damped by what they change of all limited signals.

    Parameters
    ----------
    x : ndarray, shape (k, n, m)
    room : float
        Least distance from each limit, as a share of it.
    """
    two, damping, tried = problem.two_sided, FIRST_DAMPING, x
    best, least, slopes = problem.whole(x), np.inf, None
    for _ in range(MOVES):
        point = best if tried is x else problem.whole(tried)
        beyond = np.maximum(AIM * room - _slack(problem, point.values), 0.0)
        if np.max(beyond) < (AIM - 1.0) * room and np.isfinite(point.cost):
            return tried
        if np.sum(beyond**2) < least:
            best, least, slopes = point, float(np.sum(beyond**2)), problem.slopes(point)
            force = -slopes.pull(_fold(beyond, two, -1.0))
            matrix = slopes.curvature(_fold((beyond > 0.0).astype(float), two, 1.0))
            whole = slopes.curvature(np.ones_like(point.values))
            # Of all trajectories together: one that breaks nothing stays as it is.
            whole *= np.einsum("kii->", matrix) / np.einsum("kii->", whole)
            damping *= 0.3
        else:
            damping *= 10.0
        # A trajectory with fewer harmonics than another leaves the last coefficients unused.
        change = np.linalg.pinv(matrix + damping * whole, hermitian=True) @ force[..., None]
        tried = best.x + change.reshape(x.shape)
    return None


def minimise(problem: Problem, x: Array, schedule: Schedule | None = None) -> Minimum:
    """Lower the cost within the limits.

    Parameters
    ----------
    x : ndarray, shape (k, n, m)
        Strictly inside the limits.
    """
    plan = Schedule() if schedule is None else schedule
    span = np.log(plan.first / plan.last)
    damping = 1e-3
    gap, steps = plan.first, 0
    multipliers: Array | None = None
    while True:
        share = float(np.clip(np.log(plan.first / gap) / span, 0.0, 1.0)) if span > 0.0 else 1.0
        stage = problem.sharpened(plan.sharpness + (1.0 - plan.sharpness) * share)
        point = stage.at(x)
        slack = _slack(stage, point.values)
        mu = gap / slack.size
        if multipliers is None:
            multipliers = mu / slack
        stage_steps = 0
        while steps < plan.steps:
            found = _Direction(stage, stage.slopes(point), point, slack, multipliers, mu).search(damping)
            steps, stage_steps = steps + 1, stage_steps + 1
            if found is None:
                break
            point, slack, multipliers, damping = found.point, found.slack, found.multipliers, found.damping
            if found.decrease < plan.tolerance:
                break
        x = point.x
        if gap <= plan.last or steps >= plan.steps:
            return Minimum(x, problem.sharpened(1.0).at(x).cost, steps)
        gap = max(plan.last, plan.factor * gap)


@dataclass(frozen=True, eq=False)
class _Step:
    point: Point
    slack: Array
    multipliers: Array
    damping: float
    decrease: float


@dataclass(frozen=True, eq=False)
class _Direction:
    problem: Problem
    slopes: Slopes
    point: Point
    slack: Array
    multipliers: Array
    mu: float

    def search(self, damping: float) -> _Step | None:
        """Take a Newton step that lowers the barrier function; None where none does."""
        x, slack, mu = self.point.x, self.slack, self.mu
        two = self.problem.two_sided
        stiffness = self.multipliers / slack
        force = -(self.slopes.gradient + self.slopes.pull(_fold(mu / slack, two, -1.0)))
        matrix = self.slopes.curvature(_fold(stiffness, two, 1.0))
        merit = self.point.cost - mu * np.sum(np.log(slack))
        diagonal = np.arange(matrix.shape[1])
        scale = np.mean(matrix[:, diagonal, diagonal])
        while damping <= MAX_DAMPING:
            damped = matrix.copy()
            damped[:, diagonal, diagonal] += damping
            try:
                dx = np.array([cho_solve(cho_factor(a), b) for a, b in zip(damped, force, strict=True)])
            except LinAlgError:
                damping = 10.0 * damping + 1e-12 * float(scale)
                continue
            closing = _unfold(self.slopes.push(dx), two)
            near = closing > 0.0
            length = min(1.0, NEARLY * float(np.min(slack[near] / closing[near]))) if near.any() else 1.0
            slope = float(np.sum(force * dx))
            for halving in range(HALVINGS):
                there = self.problem.at(x + length * dx.reshape(x.shape))
                room = _slack(self.problem, there.values) if np.isfinite(there.cost) else np.zeros(1)
                if np.min(room) > 0.0 and there.cost - mu * np.sum(np.log(room)) <= merit - SUFFICIENT * length * slope:
                    wanted = self.multipliers + length * (mu / slack - self.multipliers + stiffness * closing)
                    usual = mu / room
                    wanted = np.where(wanted > 0.0, wanted, usual)
                    held = np.clip(wanted, usual / MULTIPLIER_RANGE, usual * MULTIPLIER_RANGE)
                    # A step that had to be halved was so many times too long.
                    eased: float = damping * (0.3 if halving == 0 else 2.0**halving)
                    return _Step(there, room, held, max(eased, MIN_DAMPING), slope)
                length *= 0.5
            damping *= 10.0
        return None


def _slack(problem: Problem, values: Array) -> Array:
    """Distance of rows (R, N) from their bounds: from the upper ones, then from the lower ones that exist."""
    bounds = problem.bounds[: len(values), None]
    two = problem.two_sided[: len(values)]
    return np.concatenate([bounds - values, (bounds + values)[two]])


def _fold(u: Array, two: NDArray[np.bool_], sign: float) -> Array:
    """Bring what belongs to upper and lower bounds back to rows; the upper ones push down."""
    count = len(two)
    rows = u[:count].copy()
    rows[two] += sign * u[count:]
    return rows


def _unfold(rows: Array, two: NDArray[np.bool_]) -> Array:
    return np.concatenate([rows, -rows[two]])
