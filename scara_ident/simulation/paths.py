"""Lines and circles of the tool point for any arm, by inverse kinematics with Pinocchio."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from scara_ident.arrays import Array
from scara_ident.errors import ScaraIdentError, UsageError
from scara_ident.robot.kinematics import farthest_point
from scara_ident.robot.robot import Robot
from scara_ident.simulation.laws import MotionLaw
from scara_ident.simulation.reference import ReferenceMotion

# A pose whose smallest singular value is this share of the largest is taken for singular.
SINGULAR = 5e-3
# The tool point is found to this share of the arm's reach.
POINT_TOLERANCE = 1e-9
# Poses along the path that are solved for; between them joint positions are a spline of degree 7.
POSES = 401
NEWTON_STEPS = 60
# A Newton step turns no joint farther than this, rad or m.
LONGEST_STEP = 0.3
STARTS = 30
# A path that is singular and this share of the way on out of reach is said to leave the reach.
AHEAD = 0.03


class PathError(ScaraIdentError):
    """A path that the arm cannot follow.

    Attributes
    ----------
    share : float
        How far along the path, 0 to 1.
    point : ndarray, shape (3,)
        The point there, in the base's frame, m.
    """

    def __init__(self, message: str, share: float, point: Array) -> None:
        super().__init__(message)
        self.share = share
        self.point = point


@dataclass(frozen=True, eq=False)
class Tool:
    """The tool point of an arm and what of its pose the joints can choose.

    Attributes
    ----------
    point : ndarray, shape (3,)
        In the frame of the last joint, m.
    oriented : bool
        Whether the orientation is held along a path; with six joints or more.
    rank : int
        Directions in which the joints can move the tool at a general pose.
    reach : float
        Length by which angles are made comparable with ways, m.
    """

    robot: Robot
    point: Array
    oriented: bool
    rank: int
    reach: float

    def pose(self, q: Array) -> tuple[Array, Array, Array]:
        """Return tool point (3,), orientation (3, 3) and Jacobian (3 or 6, n) at positions in the robot's order."""
        robot = self.robot
        model, data = robot.model, robot.model.createData()
        inner = np.empty(robot.n)
        inner[robot.order] = q
        full = pin.integrate(model, pin.neutral(model), inner)
        last = model.njoints - 1
        pin.computeJointJacobians(model, data, full)
        whole = pin.getJointJacobian(model, data, last, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        # Of a single joint it comes as a vector.
        jacobian = whole.reshape(6, -1)[:, robot.order]
        placement = data.oMi[last]
        arm = placement.rotation @ self.point
        linear = jacobian[:3] - pin.skew(arm) @ jacobian[3:]
        rows = np.vstack([linear, self.reach * jacobian[3:]]) if self.oriented else linear
        return np.asarray(placement.translation + arm), np.asarray(placement.rotation), np.asarray(rows)


def tool_of(robot: Robot, point: Array | None = None) -> Tool:
    """Describe the tool of an arm; ``point`` defaults to the farthest frame that the last joint carries."""
    model = robot.model
    chosen = farthest_point(robot) if point is None else np.asarray(point, dtype=float)
    lengths = [float(np.linalg.norm(placement.translation)) for placement in model.jointPlacements]
    reach = max(sum(lengths) + float(np.linalg.norm(chosen)), 1e-3)
    tool = Tool(robot, chosen, robot.n >= 6, 0, reach)
    random = np.random.default_rng(0)
    rank = max(
        int(np.linalg.matrix_rank(tool.pose(random.uniform(-1.5, 1.5, robot.n))[2], tol=1e-6 * reach)) for _ in range(8)
    )
    return Tool(robot, chosen, tool.oriented, rank, reach)


def line(
    robot: Robot,
    start: Sequence[float] | Array,
    end: Sequence[float] | Array,
    duration: float,
    *,
    near: Sequence[float] | Array,
    law: MotionLaw | None = None,
    tool: Array | None = None,
    rate: float = 1000.0,
    name: str = "line",
) -> ReferenceMotion:
    """Move the tool point along a straight line.

    Parameters
    ----------
    start, end : sequence of float
        Points in the base's frame, m: x, y, z, or x, y at the height of the tool at ``near``.
    duration : float
        Of the whole motion, s.
    near : sequence of float
        Joint positions, in the robot's order, from which the first pose is sought; they choose among elbow up and
        down, and with six joints or more the orientation, which is then held.
    law : MotionLaw, optional
        Quintic by default.
    tool : ndarray, shape (3,), optional
        See `tool_of`.
    rate : float
        Samples per second.

    Raises
    ------
    PathError
        If a point is outside the reach, a pose is singular, or a joint leaves its range: one line with the point.
    """
    solver = tool_of(robot, tool)
    first, last = (_in_space(solver, point, near) for point in (start, end))
    return follow(solver, lambda s: first + s * (last - first), duration, near, law or MotionLaw(), rate, name)


def circle(
    robot: Robot,
    centre: Sequence[float] | Array,
    radius: float,
    duration: float,
    *,
    near: Sequence[float] | Array,
    start_angle: float = 0.0,
    turns: float = 1.0,
    normal: Sequence[float] | Array = (0.0, 0.0, 1.0),
    law: MotionLaw | None = None,
    tool: Array | None = None,
    rate: float = 1000.0,
    name: str = "circle",
) -> ReferenceMotion:
    """Move the tool point along a circle.

    Parameters
    ----------
    centre : sequence of float
        In the base's frame, m: x, y, z, or x, y at the height of the tool at ``near``.
    radius : float
        m.
    duration : float
        s.
    near : sequence of float
        See `line`.
    start_angle : float
        rad, from the direction in the circle's plane nearest to the base's x (y where the normal is along x).
    turns : float
        Negative against the sense of the normal.
    normal : sequence of float
        Of the circle's plane.
    law, tool, rate, name
        See `line`.

    Raises
    ------
    PathError
        See `line`.
    """
    if not radius > 0.0:
        raise UsageError(f"radius is {radius:g} m; expected a positive number")
    solver = tool_of(robot, tool)
    middle = _in_space(solver, centre, near)
    z = np.asarray(normal, dtype=float) / np.linalg.norm(normal)
    helper = np.array([1.0, 0.0, 0.0]) if abs(z[0]) < 0.99 else np.array([0.0, 1.0, 0.0])
    x = helper - (helper @ z) * z
    x /= np.linalg.norm(x)
    y = np.cross(z, x)

    def curve(s: float) -> Array:
        angle = start_angle + 2.0 * np.pi * turns * s
        return np.asarray(middle + radius * (np.cos(angle) * x + np.sin(angle) * y))

    return follow(solver, curve, duration, near, law or MotionLaw(), rate, name)


def follow(
    tool: Tool,
    curve: Callable[[float], Array],
    duration: float,
    near: Sequence[float] | Array,
    law: MotionLaw,
    rate: float = 1000.0,
    name: str = "path",
) -> ReferenceMotion:
    """Move the tool point along a smooth curve, given as a function of the share of the way.

    Joint positions are solved for at equal shares of the way and joined by a spline of degree 7 in that share, so
    that velocity and acceleration are exact derivatives of position whatever the redundancy.
    """
    from scipy.interpolate import make_interp_spline

    if not duration > 0.0:
        raise UsageError(f"{name}: duration is {duration:g} s; expected a positive number")
    robot = tool.robot
    shares = np.linspace(0.0, 1.0, POSES)
    poses = np.empty((POSES, robot.n))
    q = _first_pose(tool, curve(0.0), np.asarray(near, dtype=float), name)
    orientation = tool.pose(np.asarray(near, dtype=float))[1] if tool.oriented else None
    for k, share in enumerate(shares):
        point = curve(share)
        q, distance, quality = _solve(tool, point, orientation, q)
        if quality < SINGULAR and not _leads_out(tool, curve(min(share + AHEAD, 1.0)), orientation, q):
            raise PathError(f"{name}: singular at {_where(share, point)}; choose a path away from it", share, point)
        if quality < SINGULAR or distance > POINT_TOLERANCE * tool.reach:
            raise PathError(f"{name}: {_where(share, point)} is outside the reach; move the path closer", share, point)
        _check_range(robot, q, share, point, name)
        poses[k] = q
    spline = make_interp_spline(shares, poses, k=7)
    time = np.arange(round(duration * rate) + 1) / rate
    s, ds, dds = law(time, duration)
    slope, bend = spline(s, 1), spline(s, 2)
    velocity = slope * ds[:, None]
    acceleration = bend * (ds**2)[:, None] + slope * dds[:, None]
    return ReferenceMotion(name, robot.joints, time, spline(s).T, velocity.T, acceleration.T)


def _in_space(tool: Tool, point: Sequence[float] | Array, near: Sequence[float] | Array) -> Array:
    given = np.asarray(point, dtype=float)
    if np.shape(near) != (tool.robot.n,):
        raise UsageError(f"near has {np.size(near)} positions; {tool.robot.name} has {tool.robot.n} joints")
    if given.shape == (2,):
        return np.append(given, tool.pose(np.asarray(near, dtype=float))[0][2])
    if given.shape != (3,):
        raise UsageError(f"a point has {given.size} coordinates; expected x, y or x, y, z")
    return given


def _first_pose(tool: Tool, point: Array, near: Array, name: str) -> Array:
    """Find the first pose from ``near``, and where that fails from around it."""
    random = np.random.default_rng(0)
    orientation = tool.pose(near)[1] if tool.oriented else None
    best = np.inf
    for attempt in range(STARTS):
        guess = near if attempt == 0 else near + random.uniform(-1.0, 1.0, len(near)) * min(0.1 * attempt, 1.5)
        q, distance, quality = _solve(tool, point, orientation, guess)
        best = min(best, distance)
        if distance <= POINT_TOLERANCE * tool.reach and quality >= SINGULAR and _inside(tool.robot, q):
            return q
        if attempt == 0 and distance <= POINT_TOLERANCE * tool.reach and quality < SINGULAR:
            raise PathError(f"{name}: singular at {_where(0.0, point)}; choose a path away from it", 0.0, point)
    if best <= POINT_TOLERANCE * tool.reach:
        raise PathError(f"{name}: no pose within the joints' ranges at {_where(0.0, point)}; move it", 0.0, point)
    raise PathError(f"{name}: {_where(0.0, point)} is outside the reach; move the path closer", 0.0, point)


def _solve(tool: Tool, point: Array, orientation: Array | None, q: Array) -> tuple[Array, float, float]:
    """Newton's method with damping; returns the pose, the distance left and the ratio of singular values there."""
    q = q.copy()
    distance, quality = np.inf, 0.0
    for _ in range(NEWTON_STEPS):
        place, turned, jacobian = tool.pose(q)
        error = point - place
        if orientation is not None:
            error = np.append(error, tool.reach * pin.log3(orientation @ turned.T))
        u, sizes, vt = np.linalg.svd(jacobian, full_matrices=False)
        quality = float(sizes[tool.rank - 1] / sizes[0])
        distance = float(np.linalg.norm(error))
        if distance <= POINT_TOLERANCE * tool.reach:
            break
        used = sizes[: tool.rank]
        damping = (1e-2 * sizes[0]) ** 2 if quality < 2e-2 else 0.0
        step = vt[: tool.rank].T @ ((u[:, : tool.rank].T @ error) * used / (used**2 + damping))
        q += step * min(1.0, LONGEST_STEP / max(float(np.abs(step).max()), 1e-300))
    return q, distance, quality


def _leads_out(tool: Tool, point: Array, orientation: Array | None, q: Array) -> bool:
    """Whether a point ahead of a singular pose is out of reach: the pose is then on the border of the reach."""
    return _solve(tool, point, orientation, q)[1] > 1e-4 * tool.reach


def _inside(robot: Robot, q: Array) -> bool:
    return bool(np.all((q >= robot.lower - 1e-9) & (q <= robot.upper + 1e-9)))


def _check_range(robot: Robot, q: Array, share: float, point: Array, name: str) -> None:
    for j, joint in enumerate(robot.joints):
        if not robot.lower[j] - 1e-9 <= q[j] <= robot.upper[j] + 1e-9:
            raise PathError(
                f"{name}: {joint} would be at {q[j]:.3f}, outside its range {robot.lower[j]:.3f} to "
                f"{robot.upper[j]:.3f}, at {_where(share, point)}; move the path",
                share,
                point,
            )


def _where(share: float, point: Array) -> str:
    coordinates = ", ".join(f"{x:.3f}" for x in point)
    return f"({coordinates}) m, {100.0 * share:.0f} % of the way"
