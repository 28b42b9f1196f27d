"""Whether an arm with given parameters can exist, and if not, what contradicts it, in words.

All bodies with the same base parameters differ by a few directions that torque does not see. Along these the
smallest eigenvalue of all bodies (relative to nominal) is made as large as it can be: a small semidefinite programme.
A positive result is an arm. A negative one proves that there is none, if the dual solution bounds it below zero too,
and its multipliers say which base parameters contradict each other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.errors import EstimationError, UsageError
from scara_ident.estimation.consistent.friction import FrictionFault, as_recorded, friction_faults
from scara_ident.estimation.consistent.options import ConsistentOptions
from scara_ident.estimation.consistent.problem import (
    DEPENDENT,
    Problem,
    Unknowns,
    build_unknowns,
    declared,
    unless_panic,
)
from scara_ident.estimation.information import Information
from scara_ident.model.model import TorqueModel
from scara_ident.model.terms.constraints import BrakingPolynomial
from scara_ident.model.terms.term import Column
from scara_ident.threads import one_blas_thread

# A body that lacks less than this share of the nominal one lacks nothing but the solver's digits.
ROUNDING = 1e-7
# Bodies further inside than this share of the nominal ones need no further search.
ENOUGH_MARGIN = 0.5
# Contradictions that are listed; more would not help anyone.
MAX_REASONS = 5
# A base parameter whose multiplier contributes less than this to the margin is not needed for a contradiction.
NO_PART = 1e-6
# Slack of the solver's constraints and gap, well below ROUNDING; and the residuals up to which its bounds are used
# where it does not reach that.
TOLERANCE = 1e-9
ACCEPTED_RESIDUAL = 1e-6
# The programme has no quadratic term that would bound its free directions, so that the solver's first step may fail
# by the way it scales or regularises; the answer does not depend on either.
_ATTEMPTS: tuple[dict[str, Any], ...] = (
    {"iterative_refinement_enable": False},
    {"static_regularization_constant": 1e-7},
    {"equilibrate_enable": False},
)


@dataclass(frozen=True)
class PhysicalConsistency:
    """Whether an arm with given parameters can exist.

    Attributes
    ----------
    possible : bool or None
        None where the solver could not decide it.
    reasons : tuple of str
        What contradicts it, or why it is undecided; empty for a possible arm.
    margin : float
        How far inside what is possible the best arm with these base parameters is: the smallest eigenvalue of its
        bodies relative to the nominal ones, at most a half; negative for the share that they lack.
    distance_std : float or None
        Distance of the nearest possible arm, friction included, in standard deviations of the estimate; None where
        no information was given or the solver did not find that arm.
    """

    possible: bool | None
    reasons: tuple[str, ...]
    margin: float
    distance_std: float | None


@dataclass(frozen=True, eq=False)
class Fixed:
    """Combinations of parameters that are given, and the directions that they leave free.

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

    def shortest(self, value: Array) -> Array:
        """Return the shortest x that has these combinations of parameters, shape (size,)."""
        return self.corrected(np.zeros(self.rows.shape[1]), value)

    def corrected(self, x: Array, value: Array) -> Array:
        """Return the x nearest to a given one that has these combinations of parameters, shape (size,)."""
        wanted = np.concatenate([self.combinations @ value, np.zeros(len(self.rows) - len(self.combinations))])
        # The second correction removes the rounding of the first.
        for _ in range(2):
            x = x + self.inverse @ (wanted - self.rows @ x)
        return x


def fixed(unknowns: Unknowns, combinations: Array) -> Fixed:
    """Prepare questions about arms with these combinations of parameters."""
    from scipy.linalg import null_space

    rows = np.vstack([combinations @ unknowns.to_parameters, unknowns.held])
    return Fixed(combinations, rows, np.linalg.pinv(rows, rcond=1e-12), null_space(rows, rcond=DEPENDENT))


def fixed_columns(unknowns: Unknowns, columns: Sequence[int] | NDArray[np.intp], size: Array) -> Fixed:
    """Prepare questions about arms with given parameters in these columns; ``size`` as of `Unknowns.sizes`."""
    return fixed(unknowns, np.eye(len(size))[columns] / size[columns, None])


@dataclass(frozen=True, eq=False)
class BestArm:
    """The arm with given parameters that is furthest inside what is possible.

    Attributes
    ----------
    x : ndarray, shape (size,)
        See `Unknowns`; it gives the parameters to rounding.
    margin : float
        Its smallest eigenvalue of bodies, rotors and limits relative to nominal; at most a half.
    bound : float
        No arm with these parameters has a larger margin.
    multipliers : ndarray, shape (k,)
        Of the combinations: where ``bound`` is negative, no possible arm has a negative sum of multiplier times
        combination, and this one has.
    """

    x: Array
    margin: float
    bound: float
    multipliers: Array

    @property
    def possible(self) -> bool | None:
        """Whether such an arm exists, to rounding; None where the solver could not decide it."""
        if self.margin >= -ROUNDING:
            return True
        return False if self.bound < -ROUNDING else None


def furthest_inside(unknowns: Unknowns, value: Array, given: Fixed) -> BestArm:
    """Find the arm with given parameters that is furthest inside what is possible.

    Parameters
    ----------
    value : ndarray, shape (p,)
        The model's parameters.
    given : Fixed
        The combinations that are given. What they leave free among friction and other columns keeps its own
        constraints; what they fix there is not judged.
    """
    u, start, free = unknowns, given.shortest(value), given.free
    total, count = u.size + u.auxiliary, free.shape[1]
    rigid = 11 * u.n
    cones = [(cone.at(np.arange(rigid), total), cone.identity) for cone in u.arm]
    extra = 0
    if np.any(np.abs(free[rigid:]) > 1e-12):
        cones += [(cone, np.zeros(len(cone.offset))) for cone in u.others]
        extra = u.auxiliary
    # The solver's unknowns: the move along free directions, auxiliary ones where friction takes part, the margin.
    along = np.zeros((total, count + extra))
    along[: u.size, :count], along[u.size :, count:] = free, np.eye(u.auxiliary, extra)
    matrix = np.vstack([np.column_stack([-cone.matrix @ along, down]) for cone, down in cones])
    whole = np.concatenate([start, np.zeros(u.auxiliary)])
    offset = np.concatenate([cone(whole) for cone, _ in cones])
    found = _largest_margin(matrix, offset, [(cone.kind, len(cone.offset)) for cone, _ in cones])
    if found is None:
        # Bodies could lack as much as it takes; friction and the like cannot.
        return BestArm(start, -np.inf, -np.inf, np.zeros(len(given.combinations)))
    move, dual, bound = found
    x = start + free @ move[:count]
    # At the best point the multipliers' force on x is a combination of the given rows.
    force = sum(
        z @ cone.matrix[:, : u.size]
        for z, (cone, _) in zip(np.split(dual, np.cumsum([len(c.offset) for c, _ in cones])[:-1]), cones, strict=True)
    )
    multipliers = (given.inverse.T @ force)[: len(given.combinations)]
    return BestArm(x, min(u.margin(x), ENOUGH_MARGIN), bound, multipliers)


def _largest_margin(matrix: Array, offset: Array, kinds: list[tuple[str, int]]) -> tuple[Array, Array, float] | None:
    """Maximise t <= ENOUGH_MARGIN such that ``offset - matrix @ (move, t)`` lies in the cones; None if no t does.

    Returns the move, the multipliers and an upper bound of t. Clarabel is called without cvxpy here: to name what
    contradicts what, up to 50 of these are solved with other rows each, and on the arm of UR5 one takes 5 ms instead of
    29, 0.3 s in all instead of 1.7.
    """
    import clarabel
    import scipy.sparse as sp

    cone = {
        "nonnegative": clarabel.NonnegativeConeT,
        "ball": clarabel.SecondOrderConeT,
        "semidefinite": lambda length: clarabel.PSDTriangleConeT(int(np.sqrt(2 * length))),
    }
    size = matrix.shape[1]
    last = -np.eye(size)[-1]
    # Everything is proportional to the offsets; far from nominal they are brought to a size of 1.
    scale = max(1.0, float(np.max(np.abs(offset))))
    best: Any = None
    for attempt in _ATTEMPTS:
        settings = clarabel.DefaultSettings()
        settings.verbose, settings.max_threads = False, 1
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = TOLERANCE
        for name, setting in attempt.items():
            setattr(settings, name, setting)
        solver = clarabel.DefaultSolver(
            sp.csc_matrix((size, size)),
            last,
            sp.csc_matrix(np.vstack([matrix, -last])),
            np.append(offset / scale, ENOUGH_MARGIN / scale),
            [*(cone[kind](length) for kind, length in kinds), cone["nonnegative"](1)],
            settings,
        )
        result = unless_panic(solver.solve)
        if result is None:
            continue
        if "PrimalInfeasible" in str(result.status):
            return None
        if best is None or _gap(result) < _gap(best):
            best = result
        if str(result.status) == "Solved":
            break
    if best is None:
        return np.zeros(size), np.zeros(len(offset)), np.inf
    return scale * np.array(best.x), np.array(best.z)[:-1], scale * (_gap(best) - best.obj_val)


def _gap(result: Any) -> float:
    """Distance between a solution and the bound that its multipliers prove, infinite where they prove nothing.

    What the multipliers leave of the equations counts along arms as large as the one found.
    """
    if result.r_prim > ACCEPTED_RESIDUAL or result.r_dual > ACCEPTED_RESIDUAL:
        return np.inf
    left_over = result.r_dual * max(1.0, float(np.max(np.abs(result.x))))
    return float(abs(result.obj_val - result.obj_val_dual) + left_over)


@one_blas_thread()
def check_consistency(
    model: TorqueModel, value: Array, *, information: Information | None = None, unknowns: Unknowns | None = None
) -> PhysicalConsistency:
    """Check whether a physically consistent arm has these parameters.

    Bodies are possible when their pseudo-inertias can be positive semidefinite and the rotors' inertias
    nonnegative with these base parameters, to rounding. Friction is possible when it takes energy out and the motor
    can overcome it at every speed up to the velocity limit. What the data leave open counts as the estimate has it.

    Parameters
    ----------
    value : ndarray, shape (p,)
        Parameters, estimated by whatever method.
    information : Information, optional
        The rows that they came from, to give the distance in standard deviations.
    unknowns : Unknowns, optional
        Of the same model, to spare building them again; limits on masses and centres of mass in them count too.

    Raises
    ------
    UsageError
        If the number of parameters is not the model's, or one is not finite.
    """
    value = np.asarray(value, dtype=float)
    if value.shape != (len(model.columns),) or not np.all(np.isfinite(value)):
        raise UsageError(
            f"expected {len(model.columns)} finite parameters of the model {model.name}, found shape {value.shape}"
        )
    u = unknowns or build_unknowns(model, ConsistentOptions(friction="free"))
    size = u.sizes(value)
    bodies = list(range(u.place.start, u.place.stop))
    found = furthest_inside(u, value, fixed_columns(u, bodies, size))
    reasons = _contradictions(u, value, size, bodies) if found.possible is False else []
    reasons += [_column_reason(model.columns[k], value[k]) for k in u.nonnegative if value[k] < 0.0]
    for polynomial in u.polynomials:
        faults = friction_faults(polynomial, value[list(polynomial.columns)])
        reasons += [_friction_reason(model, fault, polynomial) for fault in faults]
    possible = False if reasons else found.possible
    distance_std = None
    if information is not None:
        distance_std = 0.0 if possible else _distance_std(model, value, information)
    if possible is None:
        reasons.append(
            f"whether bodies with these base parameters exist is undecided: the best ones found miss "
            f"{-found.margin:.1g} of the nominal ones, and the solver does not prove that there are no better ones; "
            f"check the inertias in the URDF"
        )
    return PhysicalConsistency(possible, tuple(reasons), found.margin, distance_std)


def _distance_std(model: TorqueModel, value: Array, information: Information) -> float | None:
    """Distance of the nearest possible arm in the data's own metric, None where the solver does not find it."""
    options = ConsistentOptions(friction="dissipative")
    factor = information.regressor_factor / (information.rms() or 1.0)
    polynomials = [as_recorded(each, factor, value) for each in declared(model, options)[1]]
    problem = Problem(model, options, polynomials)
    u = problem.unknowns
    try:
        point = problem.solve(factor @ u.to_parameters, factor @ value, 1e-2 * np.eye(u.size))
    except EstimationError:
        return None
    return float(np.linalg.norm(factor @ (u.parameters(point.x) - value)))


def _contradictions(u: Unknowns, value: Array, size: Array, bodies: list[int]) -> list[str]:
    """Find sets of base parameters that no arm has together, each as small as possible."""
    columns = u.model.columns
    negative = [k for k in bodies if columns[k].nonnegative and value[k] < 0.0]
    reasons = [_column_reason(columns[k], value[k]) for k in negative]
    left = [k for k in bodies if k not in negative]
    while len(reasons) < MAX_REASONS and left:
        found = furthest_inside(u, value, fixed_columns(u, left, size))
        if found.possible is not False:
            break
        part = np.abs(found.multipliers * value[left] / size[left])
        together = _irreducible(u, value, size, [left[k] for k in np.argsort(part)], int(np.sum(part > NO_PART)))
        reasons.append(_together_reason([columns[k] for k in together], value[together]))
        left = [k for k in left if k not in together]
    return reasons


def _irreducible(u: Unknowns, value: Array, size: Array, columns: list[int], needed: int) -> list[int]:
    """Leave out every base parameter without which the others are still proven to contradict each other.

    ``columns`` come in the order of their part in the proof that there is no such arm; those with hardly a part are
    left out at once.
    """

    def contradict(some: list[int]) -> bool:
        return bool(some) and furthest_inside(u, value, fixed_columns(u, some, size)).possible is False

    members = columns[-needed:] if needed and contradict(columns[-needed:]) else columns
    for k in list(members):
        rest = [m for m in members if m != k]
        if contradict(rest):
            members = rest
    return sorted(members)


def _column_reason(column: Column, value: float) -> str:
    meaning = "" if column.meaning == column.name else f" = {column.meaning}"
    return f"{column.name}{meaning} = {value:.3g} {column.unit} cannot be negative"


def _together_reason(columns: Sequence[Column], values: Array) -> str:
    listed = ", ".join(f"{c.name} = {v:.3g} {c.unit}" for c, v in zip(columns, values, strict=True))
    if len(columns) == 1:
        return f"{listed} belongs to no bodies with mass"
    return f"{listed} contradict each other: no bodies with mass have all of them"


def _friction_reason(model: TorqueModel, fault: FrictionFault, polynomial: BrakingPolynomial) -> str:
    joint = model.robot.joints.index(fault.joint)
    unit = "m/s" if model.robot.prismatic[joint] else "rad/s"
    to_the_end = fault.stop >= polynomial.speed * (1.0 - 1e-9)
    if fault.start == 0.0 and to_the_end:
        where = "at every speed"
    elif to_the_end:
        where = f"above {fault.start:.3g} {unit}"
    else:
        where = f"between {fault.start:.3g} and {fault.stop:.3g} {unit}"
    if fault.kind == "pushes":
        return f"friction of {fault.joint} pushes {where}"
    limit = f"{polynomial.limit:.3g} {model.robot.torque_unit(joint)}"
    return f"friction of {fault.joint} exceeds the motor's limit of {limit} {where}"
