"""Arms that have given parameters exactly: how far inside what is possible the best of them is.

All bodies with the same base parameters differ by a few directions that torque does not see. Along these the
smallest eigenvalue of all bodies (relative to nominal) is made as large as it can be: a small semidefinite programme.
A positive result is an arm; a negative one proves that there is none, and its multipliers say which base parameters
contradict each other.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scara_ident.errors import EstimationError
from scara_ident.estimation.consistent.bodies import PACKED_IDENTITY, smallest_share
from scara_ident.estimation.consistent.cones import Affine
from scara_ident.estimation.consistent.friction_certificate import friction_faults, shape_faults
from scara_ident.estimation.consistent.options import FrictionShape
from scara_ident.estimation.consistent.prior import null_space
from scara_ident.estimation.consistent.unknowns import Unknowns

Array = NDArray[np.float64]

# A body that lacks less than this share of the nominal one lacks nothing but the solver's digits.
ROUNDING = 1e-7
# Bodies further inside than this need no further search.
ENOUGH = 0.5
# So many proofs are kept, and one counts where it is this clear.
PROOFS = 32
PROVEN = 1e-5
# The solver's slack, well below ROUNDING.
TOLERANCE = 1e-9
# The programme has no quadratic term that would bound its free directions, so that the solver's first step may fail
# by the way it scales or regularises; the answer does not depend on either.
_ATTEMPTS: tuple[dict[str, Any], ...] = (
    {"iterative_refinement_enable": False},
    {"static_regularization_constant": 1e-7},
    {"equilibrate_enable": False},
)
# Where it cannot keep that, it is believed to this.
CLOSE = 1e-6


@dataclass(frozen=True, eq=False)
class Match:
    """The arm with given parameters that is furthest inside what is possible.

    Attributes
    ----------
    x : ndarray, shape (size,)
        See `Unknowns`; it gives the parameters to rounding.
    margin : float
        Smallest eigenvalue of bodies, rotors and limits relative to nominal; at most a half.
    multipliers : ndarray, shape (k,)
        Of the matched combinations: where the margin is negative, no possible arm has a negative sum of
        multiplier times combination, and this one has.
    """

    x: Array
    margin: float
    multipliers: Array

    @property
    def possible(self) -> bool:
        """Whether such an arm exists, to rounding."""
        return self.margin >= -ROUNDING

    @property
    def inside(self) -> bool:
        """Whether x itself is possible without any tolerance."""
        return self.margin > 0.0


def sizes(unknowns: Unknowns, value: Array) -> Array:
    """Return the size of each parameter, shape (p,): what a change of the nominal arm by itself does, or the value."""
    return np.asarray(np.maximum(np.linalg.norm(unknowns.to_parameters, axis=1), np.abs(value)))


@dataclass(frozen=True, eq=False)
class Fixed:
    """What is matched, and what it leaves free.

    Attributes
    ----------
    combinations : ndarray, shape (k, p)
        Rows on the model's parameters, each scaled to its size.
    rows : ndarray, shape (k + h, size)
        The same on x, and below them the rows that the model holds at zero.
    inverse : ndarray, shape (size, k + h)
        Their pseudo-inverse.
    free : ndarray, shape (size, f)
        Orthonormal directions of x that they do not see.
    """

    combinations: Array
    rows: Array
    inverse: Array
    free: Array


def fixed(unknowns: Unknowns, combinations: Array) -> Fixed:
    """Prepare matching these combinations of parameters."""
    rows = np.vstack([combinations @ unknowns.to_parameters, unknowns.held])
    return Fixed(combinations, rows, np.linalg.pinv(rows, rcond=1e-12), null_space(rows))


def match(unknowns: Unknowns, value: Array, what: Fixed) -> Match:
    """Find the arm that has given parameters and is furthest inside what is possible.

    Parameters
    ----------
    unknowns : Unknowns
    value : ndarray, shape (p,)
        The model's parameters.
    what : Fixed
        What is to be matched. What it leaves free among friction and other columns keeps its own constraints; what
        it fixes there is not judged.

    Returns
    -------
    Match

    Raises
    ------
    EstimationError
        If the solver fails.
    """
    wanted = np.concatenate([what.combinations @ value, np.zeros(len(unknowns.held))])
    # Without its part in the free directions the shortest solution is as good as any other.
    start = what.inverse @ wanted
    start += what.inverse @ (wanted - what.rows @ start)
    x, margin, forces = _furthest_inside(unknowns, start, what.free)
    # At the best point the multipliers' force on x is a combination of the matched rows.
    return Match(x, margin, (what.inverse.T @ forces)[: len(what.combinations)])


class Matcher:
    """Finds arms with given base parameters; remembers proofs that there are none.

    Parameters
    ----------
    unknowns : Unknowns

    Attributes
    ----------
    unknowns : Unknowns
    """

    def __init__(self, unknowns: Unknowns) -> None:
        self.unknowns = unknowns
        place = unknowns.place
        rows = np.eye(unknowns.to_parameters.shape[0])[place]
        self._size = np.linalg.norm(unknowns.to_parameters[place], axis=1)
        self._place = place
        self._all = fixed(unknowns, rows / self._size[:, None])
        self._proofs: deque[Array] = deque(maxlen=PROOFS)

    def find(self, value: Array) -> Match | None:
        """Find an arm with these parameters, None if there is none.

        Parameters
        ----------
        value : ndarray, shape (p,)
            The model's parameters; those of bodies and rotors are matched, the others are taken as they are.
        """
        u = self.unknowns
        scaled = value[self._place] / self._size
        for proof in self._proofs:
            if proof @ scaled < -PROVEN * float(np.abs(proof) @ np.abs(scaled)):
                return None
        # The arm nearest to the nominal one may do already.
        x = u.reference.copy()
        x[11 * u.n :] = 0.0
        wanted = np.concatenate([scaled, np.zeros(len(u.held))])
        for _ in range(2):
            x += self._all.inverse @ (wanted - self._all.rows @ x)
        margin = min(margin_of(u, x), ENOUGH)
        if margin > ROUNDING:
            return Match(self._completed(x, value), margin, np.zeros(len(scaled)))
        found = match(u, value, self._all)
        if not found.possible:
            self._proofs.appendleft(found.multipliers)
            return None
        return Match(self._completed(found.x, value), found.margin, found.multipliers)

    def _completed(self, x: Array, value: Array) -> Array:
        """Put the parameters of the other columns into x."""
        u = self.unknowns
        result = x.copy()
        part = u.to_parameters[:, 11 * u.n :]
        column = np.argmax(part != 0.0, axis=0)
        result[11 * u.n :] = value[column] / part[column, np.arange(part.shape[1])]
        return result


def _furthest_inside(u: Unknowns, start: Array, free: Array) -> tuple[Array, float, Array]:
    n, count = u.n, free.shape[1]
    others = bool(np.any(np.abs(free[11 * n :]) > 1e-12))
    linear = u.limits.nonnegative.at(np.arange(11 * n), u.size)
    linear = Affine.stacked([Affine(np.eye(u.size)[10 * n : 11 * n], np.zeros(n)), linear], u.size)
    ball = u.limits.ball.at(np.arange(11 * n), u.size)
    bodies = Affine(np.eye(u.size)[: 10 * n], np.zeros(10 * n))

    # Unknowns of the solver: the move along free directions, auxiliary ones where friction takes part, the margin.
    extra = u.auxiliary if others else 0
    whole = np.concatenate([start, np.zeros(extra)])
    along = np.zeros((u.size + extra, count + extra))
    along[: u.size, :count], along[u.size :, count:] = free, np.eye(extra)
    blocks: list[tuple[Affine, Array, str]] = [
        (linear.widened(len(whole)), np.ones(len(linear)), "nonnegative"),
        (Affine(np.zeros((1, len(whole))), np.array([ENOUGH])), np.ones(1), "nonnegative"),
    ]
    if others:
        friction = u.cones.nonnegative
        mine = np.any(friction.matrix[:, 11 * n :] != 0.0, axis=1)
        blocks.append((Affine(friction.matrix[mine], friction.offset[mine]), np.zeros(int(mine.sum())), "nonnegative"))
        blocks += [(_as_ball(u.cones.small, k), np.zeros(3), "ball") for k in range(len(u.cones.small) // 3)]
    for k in range(len(ball) // 4):
        four = Affine(ball.matrix[4 * k : 4 * k + 4], ball.offset[4 * k : 4 * k + 4])
        blocks.append((four.widened(len(whole)), np.array([1.0, 0.0, 0.0, 0.0]), "ball"))
    for i in range(n):
        ten = Affine(bodies.matrix[10 * i : 10 * i + 10], bodies.offset[10 * i : 10 * i + 10])
        blocks.append((ten.widened(len(whole)), PACKED_IDENTITY, "body"))
    solved = _solve(blocks, whole, along)
    if solved is None:
        # Bodies could lack as much as it takes; friction and the like cannot.
        return start, -np.inf, np.zeros(u.size)
    found, duals = solved
    # Force of the multipliers on x: rotors and limits, then bodies.
    forces = np.zeros(u.size)
    for (block, _, _), dual in zip(blocks, duals, strict=True):
        forces += dual @ block.matrix[:, : u.size]
    x = start + free @ found[:count]
    return x, min(margin_of(u, x), ENOUGH), forces


def _as_ball(small: Affine, k: int) -> Affine:
    d, e, f = range(3 * k, 3 * k + 3)
    mix = np.zeros((3, len(small)))
    mix[0, [d, f]], mix[1, d], mix[1, f], mix[2, e] = 1.0, 1.0, -1.0, 2.0
    return Affine(mix @ small.matrix, mix @ small.offset)


def margin_of(u: Unknowns, x: Array) -> float:
    """Return the smallest eigenvalue of bodies and the smallest of rotors and limits at x."""
    arm = x[u.rigid]
    cones = u.limits.ball(arm).reshape(-1, 4)
    room = cones[:, 0] - np.linalg.norm(cones[:, 1:], axis=1)
    slack = np.concatenate([arm[10 * u.n :], u.limits.nonnegative(arm), room])
    return float(min(smallest_share(arm[: 10 * u.n]), np.min(slack)))


def _solve(blocks: list[tuple[Affine, Array, str]], whole: Array, along: Array) -> tuple[Array, list[Array]] | None:
    """Maximise t so that every block's functions less t times its direction lie in the block's cone, if any t does."""
    import clarabel
    import scipy.sparse as sp

    kinds: dict[str, Any] = {
        "nonnegative": clarabel.NonnegativeConeT,
        "ball": clarabel.SecondOrderConeT,
        "body": lambda _: clarabel.PSDTriangleConeT(4),
    }
    matrix = np.vstack([np.column_stack([-block.matrix @ along, down]) for block, down, _ in blocks])
    offset = np.concatenate([block(whole) for block, _, _ in blocks])
    # Everything is proportional to the offsets; far from nominal they are brought to a size of 1.
    scale = max(1.0, float(np.max(np.abs(offset))))
    size = along.shape[1] + 1
    goal = np.zeros(size)
    goal[-1] = -1.0
    cones = [kinds[kind](len(block)) for block, _, kind in blocks]
    result: Any = None
    for attempt in _ATTEMPTS:
        settings = clarabel.DefaultSettings()
        settings.verbose, settings.max_threads = False, 1
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = TOLERANCE
        for name, setting in attempt.items():
            setattr(settings, name, setting)
        nothing = sp.csc_matrix((size, size))
        solver = clarabel.DefaultSolver(nothing, goal, sp.csc_matrix(matrix), offset / scale, cones, settings)
        result = solver.solve()
        if str(result.status) == "Solved":
            break
    status = str(result.status)
    if "PrimalInfeasible" in status:
        return None
    close = abs(result.obj_val - result.obj_val_dual) <= CLOSE * max(1.0, abs(result.obj_val))
    if status != "Solved" and not (close and result.r_prim <= CLOSE):
        raise EstimationError(
            f"whether an arm with these parameters exists was not decided (CLARABEL: {status}); "
            "check the inertias in the URDF"
        )
    duals = np.split(np.array(result.z), np.cumsum([len(block) for block, _, _ in blocks])[:-1])
    return scale * np.array(result.x), duals


def is_allowed(unknowns: Unknowns, value: Array, friction: FrictionShape) -> bool:
    """Whether friction and the signs of parameters are possible; says nothing of bodies."""
    if np.any(value[unknowns.nonnegative] < 0.0):
        return False
    if friction == "free":
        return True
    parts = [(p, value[list(p.columns)]) for p in unknowns.polynomials]
    if any(friction_faults(p, part) for p, part in parts):
        return False
    return friction != "lubricated" or not any(shape_faults(p, part) for p, part in parts)
