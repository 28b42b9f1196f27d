"""The base parameters of a robot: what torque can determine, and what each of them is a sum of.

The standard parameters of an arm enter the torque only in certain sums (Gautier and Khalil 1990). The reduction
here is numerical: columns of the regressor of random states are taken in a fixed order and kept when they are
independent of those already kept. Which ones are kept is a property of the arm and of that order, not of the
random states, so the result does not depend on seed, sample order or rounding.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.errors import RobotError
from scara_ident.manners import Frozen
from scara_ident.model.leading_columns import sums_of, with_heavier_leads
from scara_ident.model.regressor.kernel import pinocchio_regressor
from scara_ident.robot.robot import Robot

# Pinocchio's order of the ten parameters of a body.
BODY_PARAMETERS = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")
BODY_UNITS = ("kg", "kg m", "kg m", "kg m", *("kg m^2",) * 6)
# Order in which columns are offered: proximal bodies first, first moments before inertia before mass, so that
# what a distal body shares with a proximal one is regrouped into the proximal one, as in Gautier's rules.
BODY_PREFERENCE = (1, 2, 3, 4, 5, 7, 6, 8, 9, 0)
# A column whose part outside the span of those kept is smaller than this share of it is regrouped. It sits
# above what a URDF loses by writing 1.5708 for pi/2 (4e-6) and far above rounding (1e-13).
RANK_TOLERANCE = 2e-5
# Below this share a regrouping is exact to rounding; between the two it is reported as approximate.
EXACT_TOLERANCE = 1e-9
# Random states: four for each standard parameter, within these. A state gives a row for every joint, and a joint adds
# eleven parameters, so that the largest number has tens of times the rows that a tree of any size needs.
FEWEST_STATES, MAX_STATES = 40, 400


@dataclass(frozen=True, eq=False, repr=False)
class BaseParameters(Frozen):
    """The reduction of standard parameters to base parameters.

    With ``p = 11 n`` standard parameters pi (see `Robot.standard_parameters`) and b base parameters beta,
    ``beta = grouping @ pi`` and ``W pi = W[:, kept] beta`` for every state.

    Attributes
    ----------
    standard_names : tuple of str
        Names of the p standard parameters; bodies are numbered like their joints in the robot description.
    standard_units : tuple of str
    kept : ndarray of int, shape (b,)
        The standard parameter that leads each base parameter.
    grouping : ndarray, shape (b, p)
        The sums, exact except for `approximate`; column ``kept[i]`` is the unit vector e_i.
    absent : tuple of int
        Standard parameters that never appear in the torque.
    approximate : tuple of (int, float)
        Standard parameters that are grouped with others or left out although a small share of their column, given here,
        is independent; the usual cause is an angle in the URDF with too few digits.
    reduction : ndarray, shape (n,)
        Reductions, to write armatures as rotor inertias.
    """

    standard_names: tuple[str, ...]
    standard_units: tuple[str, ...]
    kept: NDArray[np.intp]
    grouping: Array
    absent: tuple[int, ...]
    approximate: tuple[tuple[int, float], ...]
    reduction: Array

    @property
    def count(self) -> int:
        """Number of base parameters."""
        return len(self.kept)

    @property
    def names(self) -> tuple[str, ...]:
        """Name of each base parameter: that of the standard parameter that leads it."""
        return tuple(self.standard_names[k] for k in self.kept)

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of each base parameter."""
        return tuple(self.standard_units[k] for k in self.kept)

    def expression(self, index: int) -> str:
        """Write what base parameter ``index`` is made of, such as ``I1zz + 0.1089 m2 + 10000 Jm1``."""
        row = self.grouping[index]
        lead = int(self.kept[index])
        order = [lead, *(int(k) for k in np.flatnonzero(row) if k != lead)]
        text = ""
        for k in order:
            name, factor = self._physical(k)
            coefficient = row[k] * factor
            sign = "-" if coefficient < 0 else "+"
            # Twice, so that noise in the last digits does not decide how a five is rounded.
            size = f"{float(f'{abs(coefficient):.10g}'):.6g}"
            part = name if size == "1" else f"{size} {name}"
            text = (f"-{part}" if sign == "-" else part) if not text else f"{text} {sign} {part}"
        return text

    def _physical(self, k: int) -> tuple[str, float]:
        # An armature is the rotor inertia seen through the gear, N^2 Jm.
        first = 10 * len(self.reduction)
        if k < first:
            return self.standard_names[k], 1.0
        return f"Jm{k - first + 1}", float(self.reduction[k - first] ** 2)

    def only_in_sums(self) -> tuple[int, ...]:
        """Return the standard parameters that appear in the torque only together with others."""
        entering = np.flatnonzero(np.any(self.grouping != 0.0, axis=0))
        alone = {int(k) for i, k in enumerate(self.kept) if np.count_nonzero(self.grouping[i]) == 1}
        return tuple(int(k) for k in entering if int(k) not in alone)


def standard_regressor(robot: Robot, q: Array, v: Array, a: Array) -> Array:
    """Regressor of all standard parameters, armatures included, straight from Pinocchio.

    Parameters
    ----------
    q, v, a : ndarray, shape (n, N)
        Positions, velocities and accelerations in the order of ``robot.joints``.

    Returns
    -------
    ndarray, shape (n, 11 n, N)
        Torque at the joints per standard parameter.
    """
    n, samples = robot.n, q.shape[1]
    back = np.argsort(robot.order)
    bodies = pinocchio_regressor(robot.model, q[back], v[back], a[back])[robot.order]
    columns = (10 * robot.order[:, None] + np.arange(10)).ravel()
    armature = np.zeros((n, n, samples))
    armature[np.arange(n), np.arange(n)] = a
    return np.concatenate([bodies[:, columns], armature], axis=1)


def find_base_parameters(robot: Robot, *, rotor_inertia: bool = True, seed: int = 0) -> BaseParameters:
    """Find the base parameters of a robot.

    Parameters
    ----------
    robot : Robot
    rotor_inertia : bool, optional
        Whether the rotor inertias are parameters too.
    seed : int, optional
        Seed of the random states; it does not change the result, as the tests check.

    Returns
    -------
    BaseParameters

    Raises
    ------
    RobotError
        If no parameter appears in the torque.

    References
    ----------
    M. Gautier, W. Khalil, "Direct calculation of minimum set of inertial parameters of serial robots",
    IEEE Transactions on Robotics and Automation 6(3), 1990.

    Examples
    --------
    >>> from scara_ident import find_base_parameters, load_robot
    >>> find_base_parameters(load_robot()).names
    ('I1zz', 'mx2', 'my2', 'I2zz', 'Ia2')
    """
    n = robot.n
    p = 11 * n
    names = [_numbered(text, i + 1) for i in range(n) for text in BODY_PARAMETERS]
    names += [f"Ia{i + 1}" for i in range(n)]
    units = list(BODY_UNITS) * n + [robot.armature_unit(i) for i in range(n)]

    scale = parameter_scale(robot)
    # Lengths of columns and what they share are those of the triangular factor, which has p rows.
    columns = np.asarray(np.linalg.qr(_random_columns(robot, seed) * scale, mode="r"))
    size = np.linalg.norm(columns, axis=0)
    largest = size.max(initial=0.0)
    absent = [k for k in range(p) if size[k] <= RANK_TOLERANCE * largest]
    weak = [(k, float(size[k] / largest)) for k in absent if size[k] > EXACT_TOLERANCE * largest]
    # From the base outwards, in whatever order the description names the joints.
    outwards = [int(i) for i in np.argsort(robot.order)]
    order = [10 * i + k for i in outwards for k in BODY_PREFERENCE]
    if rotor_inertia:
        order += [10 * n + i for i in outwards]
    else:
        absent += list(range(10 * n, p))
    absent = sorted(set(absent))
    if not any(k not in absent for k in order):
        raise RobotError(f"{robot.urdf}: no inertial parameter appears in the torque of {', '.join(robot.joints)}")

    kept: list[int] = []
    basis = np.zeros((columns.shape[0], 0))
    dependent: list[int] = []
    outside: list[float] = []
    for k in order:
        if k in absent:
            continue
        direction = columns[:, k] / size[k]
        for _ in range(2):  # once more for orthogonality to rounding
            direction = direction - basis @ (basis.T @ direction)
        share = float(np.linalg.norm(direction))
        if share > RANK_TOLERANCE:
            kept.append(k)
            basis = np.column_stack([basis, direction / share])
        else:
            dependent.append(k)
            outside.append(share)
    leads = with_heavier_leads(columns, kept, dependent)
    if leads != kept:
        dependent = [k for k in order if k in {*kept, *dependent} - {*leads}]
        kept = [k for k in order if k in leads]
        outside = [
            float(np.linalg.norm(columns[:, k] - columns[:, kept] @ sum_of_k) / size[k])
            for k, sum_of_k in zip(dependent, sums_of(columns, kept, dependent).T, strict=True)
        ]
    weak += [(k, share) for k, share in zip(dependent, outside, strict=True) if share > EXACT_TOLERANCE]
    grouping = np.zeros((len(kept), p))
    grouping[np.arange(len(kept)), kept] = 1.0
    if dependent:
        in_units = sums_of(columns, kept, dependent)
        # Of a column that the sums miss by a share, what they have of it below that share is the same rounding: an xArm7's
        # right angles of few digits put a ten-millionth of a rotor into every sum. A column met exactly keeps all it has.
        shares = in_units * size[kept][:, None] / size[dependent]
        in_units[np.abs(shares) < np.maximum(EXACT_TOLERANCE, outside)] = 0.0
        grouping[:, dependent] = in_units * scale[kept][:, None] / scale[dependent]
    return BaseParameters(
        standard_names=tuple(names),
        standard_units=tuple(units),
        kept=np.array(kept, dtype=np.intp),
        grouping=grouping,
        absent=tuple(absent),
        approximate=tuple(weak),
        reduction=robot.reduction,
    )


def _numbered(text: str, body: int) -> str:
    # m2, mx2, I2zz: the body's number follows the symbol of the quantity.
    return text.replace("I", f"I{body}") if "I" in text else f"{text}{body}"


def size_of(robot: Robot) -> float:
    """Size of the arm, so that thresholds do not depend on the unit of length."""
    offsets = [float(np.linalg.norm(robot.model.jointPlacements[int(k) + 1].translation)) for k in robot.order]
    strokes = robot.upper[robot.prismatic] - robot.lower[robot.prismatic]
    total = sum(offsets[1:]) + float(np.sum(strokes[np.isfinite(strokes)]))
    return total if total > 0.0 else 1.0


def parameter_scale(robot: Robot) -> Array:
    """Factors on the columns that go with one kilogram at the arm's length, shape (11 n,)."""
    length = size_of(robot)
    body = [1.0, *(length,) * 3, *(length**2,) * 6]
    return np.concatenate([np.tile(body, robot.n), np.where(robot.prismatic, 1.0, length**2)])


def _random_columns(robot: Robot, seed: int) -> Array:
    """Stack the standard regressor of random states that move gravity, speed and acceleration alike."""
    rng = np.random.default_rng(seed)
    n, length = robot.n, size_of(robot)
    samples = min(max(FEWEST_STATES, 44 * n), MAX_STATES)
    gravity = float(np.linalg.norm(robot.model.gravity.linear))
    rate = np.sqrt((gravity if gravity > 0.0 else 9.81) / length)
    stroke = np.where(robot.prismatic, length, np.pi)[:, None]
    unit = np.where(robot.prismatic, length, 1.0)[:, None]
    q = stroke * rng.uniform(-1.0, 1.0, (n, samples))
    v = unit * rate * rng.uniform(-1.0, 1.0, (n, samples))
    a = unit * rate**2 * rng.uniform(-1.0, 1.0, (n, samples))
    regressor = standard_regressor(robot, q, v, a) / np.where(robot.prismatic, 1.0, length)[:, None, None]
    return np.ascontiguousarray(regressor.transpose(2, 0, 1)).reshape(samples * n, -1)


def constant_torques(robot: Robot) -> tuple[int, ...]:
    """Return the joints, by their places, on which bodies can make a constant torque and none elsewhere: that of a weight.

    Only an axis that moves along gravity wherever the arm is has one.
    """
    if not np.any(robot.prismatic) or not np.any(robot.model.gravity.linear):
        return ()
    columns = _random_columns(robot, 0)
    size = np.linalg.norm(columns, axis=0)
    left, singular, _ = np.linalg.svd(columns[:, size > 0.0] / size[size > 0.0], full_matrices=False)
    basis = left[:, singular > RANK_TOLERANCE * singular[0]]
    found = []
    for j in np.flatnonzero(robot.prismatic):
        constant = np.zeros(len(columns))
        constant[j :: robot.n] = 1.0
        outside = constant - basis @ (basis.T @ constant)
        if np.linalg.norm(outside) < RANK_TOLERANCE * np.linalg.norm(constant):
            found.append(int(j))
    return tuple(found)


def constant_as_bodies(robot: Robot, base: BaseParameters, joint: int) -> Array:
    """Return the base parameters, shape (b,), that make a constant torque of 1 on one of `constant_torques` and none elsewhere."""
    columns = _random_columns(robot, 0)[:, base.kept]
    size = np.linalg.norm(columns, axis=0)
    constant = np.zeros(len(columns))
    constant[joint :: robot.n] = 1.0
    shares = np.linalg.lstsq(columns / size, constant, rcond=RANK_TOLERANCE)[0]
    # Of the others there is rounding.
    shares[np.abs(shares) < RANK_TOLERANCE * np.max(np.abs(shares))] = 0.0
    return np.asarray(shares / size)


@dataclass(frozen=True)
class BaseCheck:
    """Outcome of `check_base_parameters`.

    Attributes
    ----------
    rank : int
        Numerical rank of a regressor of fresh random states.
    count : int
        Number of base parameters; right when it equals the rank.
    torque_error : float
        Largest difference between torques of random standard parameters and of their base parameters, as a
        share of the torque's rms.
    null_error : float
        The same for standard parameters changed along directions that must not change the torque.
    """

    rank: int
    count: int
    torque_error: float
    null_error: float

    @property
    def passed(self) -> bool:
        """Whether rank and count agree and the torque is invariant to rounding."""
        return self.rank == self.count and max(self.torque_error, self.null_error) < 1e-10


def check_base_parameters(robot: Robot, base: BaseParameters, *, seed: int = 1) -> BaseCheck:
    """Check a reduction on fresh random states and parameters.

    Parameters
    ----------
    robot : Robot
    base : BaseParameters
    seed : int, optional

    Returns
    -------
    BaseCheck
    """
    rng = np.random.default_rng(seed)
    columns = _random_columns(robot, seed + 1000)
    # Every column that moves the torque, not only those that the reduction knows of.
    size = np.linalg.norm(columns, axis=0)
    entering = size * parameter_scale(robot)
    used = entering > RANK_TOLERANCE * np.max(entering)
    if not np.any(base.grouping[:, 10 * robot.n :]):
        used[10 * robot.n :] = False
    size = np.where(used, size, 1.0)
    singular = np.linalg.svd(np.linalg.qr(columns[:, used] / size[used], mode="r"), compute_uv=False)
    pi = rng.standard_normal(columns.shape[1]) / size * used
    torque = columns @ pi
    error = torque - columns[:, base.kept] @ (base.grouping @ pi)
    # Any change of pi in the null space of the grouping leaves the torque alone.
    change = rng.standard_normal(columns.shape[1]) / size * used
    change[base.kept] -= base.grouping @ change
    moved = columns @ change
    rms = float(np.sqrt(np.mean(torque**2)))
    reference = float(np.sqrt(np.mean((np.abs(columns) @ np.abs(change)) ** 2)))
    return BaseCheck(
        rank=int(np.count_nonzero(singular > RANK_TOLERANCE * singular[0])),
        count=base.count,
        torque_error=float(np.max(np.abs(error))) / rms,
        null_error=float(np.max(np.abs(moved))) / reference if reference > 0.0 else 0.0,
    )


def pseudo_inertia(parameters: Array) -> Array:
    """Return the 4x4 pseudo-inertia of a body's ten parameters (Wensing, Kim, Slotine 2018)."""
    return np.asarray(pin.PseudoInertia.FromDynamicParameters(np.asarray(parameters, dtype=float)).toMatrix())
