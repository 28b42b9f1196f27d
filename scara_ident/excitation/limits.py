"""Limits of a motion, and a posture at rest within them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np

from scara_ident.arrays import Array
from scara_ident.calling import asked_for
from scara_ident.errors import RobotError, ScaraIdentError, UsageError
from scara_ident.excitation.clearance import Box, Clearance
from scara_ident.excitation.tool import Tool, tool_motion, tool_of
from scara_ident.excitation.watched_pairs import UNWATCHED, clearance_of
from scara_ident.model.model import TorqueModel
from scara_ident.model.terms import Friction
from scara_ident.motion.motion import Motion
from scara_ident.paper import PARAMETERS, table5_parameters
from scara_ident.robot.robot import Robot

Value = TypeVar("Value")

# Indri et al. 2002, section 2.1, horizontal acceleration of the gripper, m/s^2.
SCARA03_TOOL_ACCELERATION = 9.0
# Postures that are tried when the middle of the ranges is not within all limits.
POSTURES = 4000
# Share of the joints' limits that a motion uses, and distance that shapes keep, m.
SHARE, CLEARANCE = 0.8, 0.01
# A posture at rest must leave this share of every limit to move in.
ROOM_SHARE = 0.02
# A joint of a smaller range, which is that of a lock, shows nothing.
MIN_RANGE = {"rad": 1e-3, "m": 1e-5}


class InfeasibleLimits(ScaraIdentError):
    """Limits that no motion, or no posture at rest, can keep."""


@dataclass(frozen=True, eq=False)
class Limits:
    """Limits of a motion.

    Attributes
    ----------
    lower, upper : ndarray, shape (n,)
        Range of each joint, rad or m.
    velocity : ndarray, shape (n,)
        rad/s or m/s.
    acceleration, jerk : ndarray, shape (n,)
        rad/s^2 and rad/s^3, or m/s^2 and m/s^3; infinite where there is none.
    torque : ndarray, shape (n,)
        On the side where effort is recorded, N m or N; infinite where there is none.
    tool_acceleration, tool_speed : float
        m/s^2 (gravity not counted) and m/s; infinite where there is none.
    floor : float
        Height in the base frame that the tool stays above, m; -inf where there is none.
    tool : Tool or None
        The point that the last three are about.
    clearance : Clearance or None
        Shapes that are kept apart; None: not asked for.
    """

    lower: Array
    upper: Array
    velocity: Array
    acceleration: Array
    jerk: Array
    torque: Array
    tool_acceleration: float = np.inf
    tool_speed: float = np.inf
    floor: float = -np.inf
    tool: Tool | None = field(default=None, repr=False)
    clearance: Clearance | None = field(default=None, repr=False)

    def words(self) -> str:
        """Return what the limits are as text, equal for equal limits."""
        kept = self.clearance
        shapes = () if kept is None else (kept.margin, kept.floor, kept.boxes, kept.pairs)
        arrays = (self.lower, self.upper, self.velocity, self.acceleration, self.jerk, self.torque)
        tool = (self.tool_acceleration, self.tool_speed, self.floor, self.tool and self.tool.name)
        return repr(([each.tolist() for each in arrays], tool, shapes))

    @property
    def centre(self) -> Array:
        """Middle of each joint's range, shape (n,)."""
        return 0.5 * (self.lower + self.upper)

    @property
    def watches_tool(self) -> bool:
        """Whether any limit is about the tool."""
        return bool(np.isfinite([self.tool_acceleration, self.tool_speed, self.floor]).any())


def limits_of(
    robot: Robot,
    *,
    ranges: Mapping[str, tuple[float, float]] | None = None,
    velocities: Mapping[str, float] | None = None,
    accelerations: Mapping[str, float] | None = None,
    jerks: Mapping[str, float] | None = None,
    torques: Mapping[str, float] | None = None,
    tool_acceleration: float | None = None,
    tool_speed: float = np.inf,
    floor: float = -np.inf,
    boxes: Sequence[Box] = (),
    clearance: float | None = CLEARANCE,
    tool: str | None = None,
    share: float = SHARE,
) -> Limits:
    """Gather the limits of a robot.

    Parameters
    ----------
    robot : Robot
        Its URDF gives ranges, velocities, efforts and collision shapes, its ``robot.yaml`` accelerations and jerks.
    ranges, velocities, accelerations, jerks, torques : mapping from joint to limit, optional
        Instead of these: (lower, upper) in rad or m, rad/s or m/s, rad/s^2 or m/s^2, rad/s^3 or m/s^3, and N m or N on
        the recorded side.
    tool_acceleration : float, optional
        m/s^2; without it 9 for the SCARA03 and none for any other robot. Infinity lifts it.
    tool_speed, floor : float, optional
        m/s, and a height in the base frame in m: of a floor for the tool, and for all links that have shapes.
    boxes : sequence of Box, optional
        Obstacles: centre and edges along the axes of the base frame, m.
    clearance : float, optional
        Distance that links keep from one another, from the floor and from boxes, m; None: not looked for.
    tool : str, optional
        Link whose origin is the tool; see `tool_of`.
    share : float, optional
        Share of the limits of every joint to be used, of ranges about their middle; in (0, 1].

    Raises
    ------
    UsageError
        If a limit is given for a joint that the robot lacks, or makes no sense; if there are boxes without shapes, or
        without a clearance.
    RobotError
        If a joint has no range or no velocity limit.
    """
    if not 0.0 < share <= 1.0:
        raise UsageError(f"share of the limits {share:g}: expected more than 0 and at most 1")
    lower, upper = robot.lower.copy(), robot.upper.copy()
    velocity, torque = robot.velocity_limit.copy(), robot.torque_limit.copy()
    acceleration, jerk = robot.acceleration_limit.copy(), robot.jerk_limit.copy()
    for joint, (low, high) in _of_joints(robot, ranges, "range"):
        if not (np.isfinite(low) and np.isfinite(high) and low < high):
            raise UsageError(f"range of {robot.joints[joint]}: {low:g}..{high:g} is empty; give lower < upper")
        lower[joint], upper[joint] = low, high
    for given, wanted, kind in (
        (velocities, velocity, "velocity"), (accelerations, acceleration, "acceleration"), (jerks, jerk, "jerk"),
        (torques, torque, "torque"),
    ):  # fmt: skip
        for joint, limit in _of_joints(robot, given, kind):
            if not limit > 0.0:
                raise UsageError(f"{kind} limit of {robot.joints[joint]}: {limit:g} allows no motion; give more than 0")
            wanted[joint] = limit
    _check_stated(robot, lower, upper, velocity)
    for joint, name in enumerate(robot.joints):
        unit = robot.position_unit(joint)
        if not upper[joint] - lower[joint] > MIN_RANGE[unit]:
            raise RobotError(
                f"{robot.urdf}: joint {name!r} cannot move: its range is {lower[joint]:g}..{upper[joint]:g} {unit}; "
                "correct the URDF, give a wider range, or lock the joint"
            )
    if tool_acceleration is None:
        tool_acceleration = SCARA03_TOOL_ACCELERATION if robot.name == "scara03" else np.inf
    for value, kind in ((tool_acceleration, "tool acceleration"), (tool_speed, "tool speed")):
        if not value > 0.0:
            raise UsageError(f"{kind} {value:g}: allows no motion; give more than 0")
    if not floor < np.inf:
        raise UsageError(f"floor {floor:g}: expected a height in m")
    middle, half = 0.5 * (lower + upper), 0.5 * share * (upper - lower)
    lower, upper = middle - half, middle + half
    limits = Limits(
        lower, upper, share * velocity, share * acceleration, share * jerk, share * torque,
        tool_acceleration, tool_speed, floor,
    )  # fmt: skip
    if boxes and clearance is None:
        raise UsageError("boxes without a clearance have no effect; give a clearance of 0 m or more")
    if clearance is not None:
        kept = clearance_of(robot, lower, upper, margin=clearance, floor=floor, boxes=boxes)
        # A box that no link is ever clear of keeps nothing, as one whose numbers are in mm.
        if boxes and not any(group.startswith("box") for *_, group in kept.pairs):
            lacking = kept.notes[0].startswith(UNWATCHED)
            advice = "Give the URDF collision shapes, or no boxes" if lacking else "Give boxes that the arm can leave"
            raise UsageError(f"boxes: {' '.join(kept.notes)} {advice}")
        limits = replace(limits, clearance=kept)
    if limits.watches_tool or tool is not None:
        return replace(limits, tool=tool_of(robot, tool))
    return limits


def _check_stated(robot: Robot, lower: Array, upper: Array, velocity: Array) -> None:
    """Refuse an arm that leaves limits open, with all that are to be given, so that no one runs into them one by one."""
    ranges, speeds = ~(np.isfinite(lower) & np.isfinite(upper)), ~np.isfinite(velocity)
    asked = [
        f"joint {name!r} has no {' nor '.join(kinds)}"
        for name, *open_ in zip(robot.joints, ranges, speeds, strict=True)
        if (kinds := [kind for kind, lacks in zip(("position limits", "velocity limit"), open_, strict=True) if lacks])
    ]
    if not asked:
        return
    words = [
        asked_for(f"--range {name}=LOWER..UPPER", f"ranges={{{name!r}: (LOWER, UPPER)}}")
        for name, lacks in zip(robot.joints, ranges, strict=True)
        if lacks
    ]
    words += [
        asked_for(f"--velocity {name}=V", f"velocities={{{name!r}: V}}")
        for name, lacks in zip(robot.joints, speeds, strict=True)
        if lacks
    ]
    raise RobotError(
        f"{robot.urdf}: {', '.join(asked)}; give <limit lower= upper= velocity=> in the URDF, which hold for a joint of type "
        f"revolute or prismatic and are more than 0, or {' '.join(words)}, in rad or m"
    )


def _of_joints(robot: Robot, given: Mapping[str, Value] | None, kind: str) -> list[tuple[int, Value]]:
    for name in given or {}:
        if name not in robot.joints:
            raise UsageError(f"{kind} for {name!r}: the robot has no such joint; its joints: {', '.join(robot.joints)}")
    return [(robot.joints.index(name), value) for name, value in (given or {}).items()]


def nominal_parameters(model: TorqueModel, known: Mapping[str, float] | None = None) -> Array:
    """Return parameters with which the torque of a motion is foreseen.

    Parameters
    ----------
    model : TorqueModel
    known : mapping from parameter to value, optional
        What is known better than the URDF says: an earlier identification, or friction alone.

    Returns
    -------
    ndarray, shape (p,)
        The URDF's bodies and rotors as base parameters, and zero for what it does not say (friction, offset). If
        nothing is known, the SCARA03 has the friction of the paper's Table 5, column OJD.

    Raises
    ------
    UsageError
        If a parameter is given that the model lacks.
    """
    value = np.zeros(len(model.names))
    body = model.rigid_body
    value[model.place(body)] = (body.base.grouping @ model.robot.standard_parameters())[body.kept]
    if known is None:
        known = {name: given for name, given in scara03_friction(model.robot).items() if name in model.names}
    for name, given in known.items():
        if name not in model.names:
            raise UsageError(f"parameter {name!r}: the model {model.name} has none of that name: {model.names}")
        value[model.names.index(name)] = given
    return value


def scara03_friction(robot: Robot) -> dict[str, float]:
    """Return the friction of the paper's Table 5 (OJD) by parameter, N m at the motor; none for any other robot."""
    if robot.name != "scara03" or robot.effort_side != "motor" or robot.n != 2:
        return {}
    values = zip(PARAMETERS, table5_parameters("OJD").tolist(), strict=True)
    return {parameter.name: value for parameter, value in values if parameter.name.startswith("a")}


def without_coulomb(model: TorqueModel, limits: Limits, nominal: Array) -> tuple[Array, Limits]:
    """Take Coulomb friction off the torque limits instead of adding it to the torque.

    It jumps where a joint turns back, which is where the torque of acceleration is largest: there both signs count,
    and so they are counted everywhere.

    Parameters
    ----------
    model : TorqueModel
    limits : Limits
    nominal : ndarray, shape (p,)

    Returns
    -------
    nominal : ndarray, shape (p,)
        Without Coulomb friction.
    limits : Limits
        With what it leaves of the torques.

    Raises
    ------
    InfeasibleLimits
        If it leaves nothing.
    """
    smooth, torque = nominal.copy(), limits.torque.copy()
    for term in model.terms:
        if isinstance(term, Friction) and 0 in term.powers:
            step, place = len(term.powers), model.place(term).start + term.powers.index(0)
            columns = place + step * np.arange(model.robot.n)
            torque -= np.abs(nominal[columns])
            smooth[columns] = 0.0
    for joint, name in enumerate(model.robot.joints):
        if not torque[joint] > 0.0:
            unit = model.robot.torque_unit(joint)
            raise InfeasibleLimits(
                f"{name}: a torque of {limits.torque[joint]:.4g} {unit} does not overcome its friction of "
                f"{limits.torque[joint] - torque[joint]:.4g} {unit}; allow more torque, or correct the friction"
            )
    return smooth, replace(limits, torque=torque)


def resting_posture(
    model: TorqueModel, limits: Limits, nominal: Array, *, start: Array | None = None, seed: int = 0
) -> Array:
    """Find a posture in which the arm can rest with room to move.

    Parameters
    ----------
    model : TorqueModel
    limits : Limits
    nominal : ndarray, shape (p,)
        Parameters of which the torque of holding is foreseen.
    start : ndarray, shape (n,), optional
        A posture that must be the one, rad or m.
    seed : int, optional

    Returns
    -------
    ndarray, shape (n,)
        ``start``; else the middle of the ranges if it will do, else the roomiest of random postures.

    Raises
    ------
    InfeasibleLimits
        In one line: which limit is broken, where, by how much, and what to do.
    """
    robot = model.robot
    if start is not None:
        start = np.asarray(start, dtype=float)
        if start.shape != (robot.n,):
            raise UsageError(f"start: expected {robot.n} positions ({', '.join(robot.joints)}), given {start.size}")
        for joint, name in enumerate(robot.joints):
            if not limits.lower[joint] <= start[joint] <= limits.upper[joint]:
                raise InfeasibleLimits(
                    f"start: {name} = {start[joint]:g} lies outside its range "
                    f"{limits.lower[joint]:g}..{limits.upper[joint]:g}; start within it, or widen the range"
                )
        tried = start[:, None]
    else:
        random = np.random.default_rng(seed)
        drawn = random.uniform(limits.lower[:, None], limits.upper[:, None], (robot.n, POSTURES))
        tried = np.concatenate([limits.centre[:, None], drawn], axis=1)
    if _at_rest(model, limits, nominal, tried[:, :1])[0][0] <= -ROOM_SHARE:
        return np.asarray(tried[:, 0])
    excess, broken = _at_rest(model, limits, nominal, tried)
    best = int(np.argmin(excess))
    if excess[best] > -ROOM_SHARE:
        where = "at the start" if start is not None else "in every posture tried"
        raise InfeasibleLimits(f"limits cannot be kept {where}, even at rest: {broken(best)}")
    return np.asarray(tried[:, best])


def _at_rest(model: TorqueModel, limits: Limits, nominal: Array, q: Array) -> tuple[Array, Callable[[int], str]]:
    """Return how far postures are beyond the limits, as shares, and a function that says which."""
    robot, samples = model.robot, q.shape[1]
    still = np.zeros_like(q)
    motion = Motion("rest", "rest", np.arange(samples, dtype=float), q, still, still, None, 1.0)
    torque = np.einsum("jpN,p->jN", model.regressor(motion), nominal)
    shares = list(np.abs(torque) / limits.torque[:, None] - 1.0)
    half = 0.5 * (limits.upper - limits.lower)
    shares += list(np.abs(q - limits.centre[:, None]) / half[:, None] - 1.0)
    height: Array = np.full(samples, np.inf)
    if limits.tool is not None and np.isfinite(limits.floor):
        height = tool_motion(limits.tool, q).position[2]
        shares.append(limits.floor - height)
    if limits.clearance is not None and limits.clearance.pairs:
        near = limits.clearance.nearest(q, limits.clearance.reach)
        shares += list(limits.clearance.rows(near, samples) - 1.0)
    stacked = np.array(shares)

    def broken(index: int) -> str:
        row = int(np.argmax(stacked[:, index]))
        if row < robot.n:
            unit, name = robot.torque_unit(row), robot.joints[row]
            return (
                f"{name} needs {abs(torque[row, index]):.4g} of {limits.torque[row]:.4g} {unit} to hold the arm; "
                f"allow {name} more torque, or correct masses and gravity in the URDF"
            )
        if row < 2 * robot.n:
            name = robot.joints[row - robot.n]
            return f"{name} is at the end of its range; start away from it"
        if row >= 2 * robot.n + bool(np.isfinite(limits.floor)) and limits.clearance is not None:
            return f"{limits.clearance.nearest_of(q[:, index])}; ask for less clearance, or move what is in the way"
        return (
            f"the tool's height is {height[index]:.4g} m where the floor is at {limits.floor:.4g} m; "
            "lower the floor, or start higher"
        )

    return stacked.max(axis=0), broken
