"""Whether an arm with the estimated parameters could exist, and if not, what contradicts it, in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scara_ident.errors import UsageError
from scara_ident.estimation.consistent.friction_certificate import FrictionFault, friction_faults
from scara_ident.estimation.consistent.matching import Match, fixed, match, sizes
from scara_ident.estimation.consistent.options import ConsistentOptions
from scara_ident.estimation.consistent.programme import Programme
from scara_ident.estimation.consistent.unknowns import Unknowns, build_unknowns
from scara_ident.estimation.information import Information
from scara_ident.model.model import TorqueModel
from scara_ident.model.terms.constraints import BrakingPolynomial
from scara_ident.model.terms.term import Column
from scara_ident.threads import one_blas_thread

Array = NDArray[np.float64]

# So many contradictions are told; more would not help anyone.
MOST_REASONS = 5
# A base parameter whose multiplier contributes less than this to the margin takes no part in a contradiction.
NO_PART = 1e-6


@dataclass(frozen=True)
class PhysicalConsistency:
    """Whether an arm with given parameters can exist.

    Attributes
    ----------
    possible : bool
    reasons : tuple of str
        What contradicts it; empty for a possible arm.
    margin : float
        How far inside what is possible the best arm with these base parameters is: the smallest eigenvalue of its
        bodies relative to the nominal ones, at most a half; negative for the share that they lack.
    distance_std : float or None
        Distance of the nearest possible arm, friction included, in standard deviations of the estimate; None where
        no information was given.
    """

    possible: bool
    reasons: tuple[str, ...]
    margin: float
    distance_std: float | None


@one_blas_thread()
def check_possible(
    model: TorqueModel,
    value: Array,
    *,
    information: Information | None = None,
    unknowns: Unknowns | None = None,
) -> PhysicalConsistency:
    """Check whether a physically consistent arm has these parameters.

    Bodies are possible when their pseudo-inertias can be positive semidefinite and the rotors' inertias
    nonnegative with these base parameters, to rounding. Friction is possible when it takes energy out and the motor
    can overcome it at every speed up to the velocity limit. What the data leave open counts as the estimate has it.

    Parameters
    ----------
    model : TorqueModel
    value : ndarray, shape (p,)
        Parameters, estimated by whatever method.
    information : Information, optional
        The rows that they came from, to tell the distance in standard deviations.
    unknowns : Unknowns, optional
        Of the same model, to spare building them again; limits on masses and centres of mass in them count too.

    Returns
    -------
    PhysicalConsistency

    Raises
    ------
    UsageError
        If the number of parameters is not the model's, or one is not finite.
    EstimationError
        If the solver fails.
    """
    value = np.asarray(value, dtype=float)
    if value.shape != (len(model.columns),) or not np.all(np.isfinite(value)):
        raise UsageError(
            f"expected {len(model.columns)} finite parameters of the model {model.name}, found shape {value.shape}"
        )
    u = unknowns or build_unknowns(model, ConsistentOptions(friction="free"))
    size = sizes(u, value)
    bodies = np.arange(u.place.start, u.place.stop)
    found = _matched(u, value, size, bodies)
    reasons: list[str] = []
    if not found.possible:
        reasons += _contradictions(u, value, size, bodies)
    reasons += [_column_reason(model.columns[k], value[k]) for k in u.nonnegative if value[k] < 0.0]
    for polynomial in u.polynomials:
        faults = friction_faults(polynomial, value[list(polynomial.columns)])
        reasons += [_friction_reason(model, fault, polynomial) for fault in faults]
    distance_std = None
    if information is not None:
        distance_std = 0.0 if not reasons else _distance_std(model, value, information)
    return PhysicalConsistency(not reasons, tuple(reasons), found.margin, distance_std)


def _matched(u: Unknowns, value: Array, size: Array, columns: Sequence[int] | NDArray[np.intp]) -> Match:
    rows = np.zeros((len(columns), len(size)))
    rows[np.arange(len(columns)), columns] = 1.0 / size[columns]
    return match(u, value, fixed(u, rows))


def _distance_std(model: TorqueModel, value: Array, information: Information) -> float:
    # The nearest arm in the data's own metric, friction and signs included.
    programme = Programme(model)
    noise = information.rms() or 1.0
    factor = information.regressor_factor / noise
    point = programme.solve(factor, factor @ value, 1e-2 * np.eye(programme.unknowns.size))
    return float(np.linalg.norm(factor @ (point.parameters - value)))


def _contradictions(u: Unknowns, value: Array, size: Array, bodies: NDArray[np.intp]) -> list[str]:
    """Find sets of base parameters that no arm has together, each as small as possible."""
    columns = u.model.columns
    negative = [int(k) for k in bodies if columns[k].nonnegative and value[k] < 0.0]
    reasons = [_column_reason(columns[k], value[k]) for k in negative]
    left = [int(k) for k in bodies if k not in negative]
    while len(reasons) < MOST_REASONS and left:
        found = _matched(u, value, size, left)
        if found.possible:
            break
        part = np.abs(found.multipliers * value[left] / size[left])
        together = _irreducible(u, value, size, [left[k] for k in np.argsort(part)], int(np.sum(part > NO_PART)))
        reasons.append(_together_reason([columns[k] for k in together], value[together]))
        left = [k for k in left if k not in together]
    return reasons


def _irreducible(u: Unknowns, value: Array, size: Array, columns: list[int], taking_part: int) -> list[int]:
    """Leave out every base parameter without which the others still contradict each other.

    ``columns`` come in the order of their part in the proof that there is no such arm; those with hardly a part are
    left out at once.
    """
    members = columns[-taking_part:] if taking_part else columns
    if _matched(u, value, size, members).possible:
        members = columns
    for k in list(members):
        rest = [m for m in members if m != k]
        if rest and not _matched(u, value, size, rest).possible:
            members = rest
    return sorted(members)


def _column_reason(column: Column, value: float) -> str:
    meaning = "" if column.meaning == column.name else f" = {column.meaning}"
    return f"{column.name}{meaning} = {value:.3g} {column.unit} cannot be negative"


def _together_reason(columns: Sequence[Column], values: Array) -> str:
    listed = ", ".join(f"{c.name} = {v:.3g} {c.unit}" for c, v in zip(columns, values, strict=True))
    if len(columns) == 1:
        return f"{listed} belongs to no bodies with mass"
    return f"{listed} cannot all be true: no bodies with mass have them together"


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
