"""The search: many starts, the best of them changed and searched again, and the winner brought within its limits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from numbers import Integral

import numpy as np

from scara_ident.arrays import Array
from scara_ident.errors import ArgumentError, UsageError
from scara_ident.excitation.criteria import Condition
from scara_ident.excitation.interior_point import Minimum, Schedule, minimise, moved_inside, shrunk_inside
from scara_ident.excitation.limits import InfeasibleLimits
from scara_ident.excitation.problem import Problem, Task, row_names
from scara_ident.excitation.verification import extremes, grid
from scara_ident.motion.motion import Motion
from scara_ident.processes import map_in_order
from scara_ident.threads import one_blas_thread

# Times of limits and criterion per period of the highest frequency, in the search and for the winner. Of few in the criterion
# a search finds those between which friction turns, which is less in truth.
COARSE, FINE = 12, 48
# Distances are measured at every so many-th of them.
SPARSE = {COARSE: 2, FINE: 1}
# At least, in the search; the winner has as many more as above.
MIN_TIMES = 60
# Times of the verification per time of the winner's limits, and at least per second.
FINER, MIN_RATE = 10, 1000.0
# Bounds of the search, and of the winner for what happens between its times, as shares; and what a bound is tightened by
# besides its excess.
BOUND, CLOSE, MARGIN = 0.999, 0.998, 5e-4
# How the winner, searched anew on the finer grid, goes on where it broke a limit between the times.
CORRECTION = Schedule(first=0.05, last=1e-2, tolerance=1e-2, steps=50, sharpness=1.0)
# Room that it has to its limits to begin with, as a share of them.
ROOM = 1e-3
# Size of changes of a good motion, as shares of it.
CHANGES = (0.03, 0.1, 0.2)
ELITE = 3
# Random starts have this share of the highest frequency as their bandwidth, and this share of the speed that a joint can have.
START_BANDWIDTH_SHARE, START_SPEED_SHARE = 0.25, 0.5
CORRECTIONS = 5
# How much a motion shrinks that is beyond a limit, of the share beyond it; and at least and at most.
SHRUNK, SHRINKING = 0.5, (0.95, 0.999)
# Combinations of parameters whose columns, of unit length, sum up to less than this share are not seen.
UNSEEN = 1e-9


@dataclass(frozen=True)
class Effort:
    """The amount of search. The result depends on this alone, not on the number of processes or on time.

    Attributes
    ----------
    starts : int
        Number of searches from random motions, and of searches per round.
    rounds : int
        Number of rounds of searches from variations of the best motions so far.
    seed : int
    processes : int or None
        None: as many as there are cores.

    Raises
    ------
    UsageError
        If there is no search at all.
    """

    starts: int = 8
    rounds: int = 2
    seed: int = 0
    processes: int | None = None

    def __post_init__(self) -> None:
        if not (isinstance(self.starts, Integral) and isinstance(self.rounds, Integral)):
            raise ArgumentError(f"starts {self.starts!r}, rounds {self.rounds!r}: expected whole numbers")
        if self.starts < 1 or self.rounds < 0:
            raise UsageError(f"starts {self.starts}, rounds {self.rounds}: expected at least 1 and 0")


@dataclass(frozen=True)
class Progress:
    """How far a search is: searches done and in all, and the least cost so far."""

    done: int
    total: int
    cost: float


@dataclass(frozen=True, eq=False)
class Found:
    """What a search found.

    Attributes
    ----------
    x : ndarray, shape (k, n, m)
        Within all limits.
    costs : tuple of float
        Of every local search, as they were started.
    times : int
        Samples per trajectory at which the limits were verified.
    """

    x: Array
    costs: tuple[float, ...]
    times: int


def search(task: Task, effort: Effort, progress: Callable[[Progress], None] | None = None) -> Found:
    """Search for the best motion.

    Parameters
    ----------
    progress : callable, optional
        Called after every local search.

    Raises
    ------
    InfeasibleLimits
        If no motion, or none within the limits, shows all parameters.
    """
    alike = _never_distinguished(task)
    if alike:
        raise InfeasibleLimits(
            f"no motion can distinguish {', '.join(alike)} in the model {task.smooth.model.name}; use a model without "
            f"one of them, or give information about them"
        )
    problem = within_grid(task, COARSE, np.full(_rows(task), BOUND))
    total = effort.starts * (1 + effort.rounds)
    costs: list[float] = []
    elite: list[Minimum] = []

    def work(item: tuple[int, Array | None]) -> Minimum | None:
        return from_random(problem, effort.seed, *item)

    for generation in range(1 + effort.rounds):
        first = generation * effort.starts
        parents = [elite[k % len(elite)].x if elite else None for k in range(effort.starts)]
        for result in map_in_order(work, enumerate(parents, first), effort.processes):
            if result is not None:
                elite.append(result)
            costs.append(np.inf if result is None else result.cost)
            if progress is not None:
                progress(Progress(len(costs), total, min(costs)))
        if not elite:
            raise InfeasibleLimits(_tightest(problem, effort.seed))
        elite = sorted(elite, key=lambda found: found.cost)[:ELITE]
    with one_blas_thread():
        x, times = _finish(task, elite[0].x)
    return Found(x, tuple(costs), times)


def _rows(task: Task) -> int:
    return len(row_names(task.limits, len(task.posture)))


def within_grid(task: Task, density: int, bounds: Array) -> Problem:
    """Return a task on so many times per period of its highest frequency."""
    periods = max(basis.bandwidth * basis.duration for basis in task.bases)
    times = max(MIN_TIMES * density // COARSE, int(np.ceil(density * periods)))
    return Problem(task, grid(task.bases, times), bounds, SPARSE[density])


def from_random(problem: Problem, seed: int, index: int, parent: Array | None = None) -> Minimum | None:
    """Search from a random motion, or from a change of a parent; None where that cannot be brought within the limits."""
    random = np.random.default_rng([seed, index])
    drawn = _random_motion(problem.task, random)
    if parent is not None:
        size = CHANGES[index % len(CHANGES)] * np.linalg.norm(parent) / np.linalg.norm(drawn)
        drawn = parent + size * drawn
    start = shrunk_inside(problem.sharpened(0.0), drawn)
    return None if start is None else minimise(problem, start)


def _random_motion(task: Task, random: np.random.Generator) -> Array:
    """Draw a slow motion of about half the speed that each joint can have."""
    x = np.zeros(task.shape)
    for own, basis in zip(x, task.bases, strict=True):
        time = basis.duration * (np.arange(8 * basis.size) + 0.5) / (8 * basis.size)
        top = max(3.0, START_BANDWIDTH_SHARE * basis.bandwidth * basis.duration)
        orders = np.arange(1, int(np.ceil(top)) + 1)
        phases = 2.0 * np.pi / basis.duration * np.outer(orders, time)
        sizes = random.normal(size=(2, len(own), len(orders))) / np.sqrt(len(orders))
        velocity = sizes[0] @ np.cos(phases) + sizes[1] @ np.sin(phases)
        velocity *= START_SPEED_SHARE * task.speed[:, None]
        # The motion of the basis whose velocity is nearest to that.
        fit, *_ = np.linalg.lstsq(basis.rows(time, 1), velocity.T, rcond=1e-9)
        own[:, : basis.size] = fit.T
    return x


def _finish(task: Task, x: Array) -> tuple[Array, int]:
    """Take a motion to a fine grid, and tighten bounds until it keeps its limits between the samples as well."""
    bounds, plan = np.full(_rows(task), CLOSE), Schedule()
    problem = within_grid(task, FINE, bounds)
    times = _verified_times(problem)
    for _ in range(CORRECTIONS):
        start = moved_inside(problem.sharpened(plan.sharpness), x, room=ROOM)
        if start is None:
            # It is far outside where the coarse grid did not look, and is searched again from where it is inside.
            start, plan = shrunk_inside(problem.sharpened(0.0), x), Schedule()
        if start is None:
            break
        x = minimise(problem, start, plan).x
        excess = _excess(task, x, times)
        if np.all(excess <= 1.0):
            return x, times
        bounds = bounds * np.where(excess > 1.0, (1.0 - MARGIN) / np.maximum(excess, 1.0), 1.0)
        problem = within_grid(task, FINE, bounds)
        plan = CORRECTION
    # What was corrected last is moved alone: searched again, it would end at the limits once more.
    moved = moved_inside(problem.sharpened(plan.sharpness), x, room=ROOM)
    return verified_inside(problem, x if moved is None else moved)


def verified_inside(problem: Problem, x: Array) -> tuple[Array, int]:
    """Shrink a motion until it keeps all limits between samples ten times finer too; return it, and their number."""
    times = _verified_times(problem)
    while (most := float(np.max(_excess(problem.task, x, times)))) > 1.0:
        x = float(np.clip(1.0 - SHRUNK * (most - 1.0), *SHRINKING)) * x
    return x, times


def _verified_times(problem: Problem) -> int:
    longest = max(basis.duration for basis in problem.task.bases)
    return max(FINER * int(problem.rows.shape[2]), int(np.ceil(MIN_RATE * longest))) + 1


def _excess(task: Task, x: Array, times: int) -> Array:
    """Largest value of every row, as a share of its bound."""
    largest, smallest = extremes(task, x, times)
    one_sided = np.array([joint is None for _, joint in row_names(task.limits, len(task.posture))])
    return np.where(one_sided, largest, np.maximum(largest, -smallest))


def _tightest(problem: Problem, seed: int) -> str:
    """Say which limit a random motion breaks most."""
    task = problem.task
    limits, robot = task.limits, task.smooth.model.robot
    values = np.abs(problem.limited(_random_motion(task, np.random.default_rng([seed, 0])))).max(axis=1)
    names = row_names(limits, robot.n)
    # Rows of the tool's acceleration and speed are squares.
    squared = np.array([kind in ("tool_acceleration", "tool_speed") for kind, _ in names])
    kind, joint = names[int(np.argmax(np.where(squared, np.sqrt(values), values)))]
    if kind.startswith("distance"):
        clearance = limits.clearance
        assert clearance is not None
        other = kind.removeprefix("distance_")
        where = f"clearance of {clearance.margin:g} m {'of the links' if other == 'self' else f'to {other}'}"
    elif joint is None:
        bound = {"tool_acceleration": limits.tool_acceleration, "tool_speed": limits.tool_speed}.get(kind, limits.floor)
        unit = {"tool_acceleration": "m/s^2", "tool_speed": "m/s"}.get(kind, "m")
        where = f"{kind.replace('_', ' ')} limit of {bound:.4g} {unit}"
    else:
        length = robot.position_unit(joint)
        bound, unit = {
            "position": (limits.upper[joint] - limits.lower[joint], length),
            "velocity": (limits.velocity[joint], f"{length}/s"),
            "acceleration": (limits.acceleration[joint], f"{length}/s^2"),
            "jerk": (limits.jerk[joint], f"{length}/s^3"),
            "torque": (limits.torque[joint], robot.torque_unit(joint)),
        }[kind]
        what = "range" if kind == "position" else f"{kind} limit"
        where = f"{what} of {robot.joints[joint]}, {bound:.4g} {unit}"
    return (
        f"no motion within the limits determines all parameters; the tightest limit is the {where}; widen it, use more "
        f"harmonics, or a model with fewer parameters"
    )


def _never_distinguished(task: Task) -> list[str]:
    """Return the parameters of combinations that the regressor of no state shows, and that nobody gave."""
    model, limits = task.smooth.model, task.limits
    random = np.random.default_rng(0)
    count = max(60, 4 * len(model.names))
    q = random.uniform(limits.lower[:, None], limits.upper[:, None], (len(task.posture), count))
    v = limits.velocity[:, None] * random.uniform(-1.0, 1.0, q.shape)
    a = limits.velocity[:, None] * random.uniform(-10.0, 10.0, q.shape)
    regressor = model.regressor(Motion("states", "states", np.arange(count, dtype=float), q, v, a, None, 1.0))
    rows = np.vstack([regressor.transpose(2, 0, 1).reshape(-1, len(model.names)), task.prior])
    wanted = task.criterion.columns if isinstance(task.criterion, Condition) else None
    kept = np.arange(len(model.names)) if wanted is None else np.array(wanted)
    rows = rows[:, kept]
    size = np.linalg.norm(rows, axis=0)
    unseen = size == 0.0
    rows = rows / np.where(unseen, 1.0, size)
    _, singular, right = np.linalg.svd(rows, full_matrices=False)
    blind = right[singular < UNSEEN * singular[0]]
    alike = np.max(np.abs(blind), axis=0, initial=0.0) > np.sqrt(UNSEEN)
    return [name for name, of in zip([model.names[k] for k in kept], alike | unseen, strict=True) if of]
