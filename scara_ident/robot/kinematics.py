"""The kinematic structure of a robot: parents and axes of its joints, and the tool."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
import pinocchio as pin

from scara_ident.arrays import Array
from scara_ident.errors import RobotError
from scara_ident.robot.robot import Robot

# Directions of a force below this share of the best determined one are not felt, and an axis is determined with this share of it in others.
UNFELT_SHARE, DETERMINED_SHARE = 1e-3, 0.999


def place_of(robot: Robot, joint_id: int) -> int:
    """Return the place in ``robot.joints`` of a joint of the Pinocchio model; -1 for the base."""
    return int(np.flatnonzero(robot.order == joint_id - 1)[0]) if joint_id > 0 else -1


def parent(robot: Robot, joint: int) -> int:
    """Return the place of the joint that carries a joint; -1 for the base."""
    return place_of(robot, int(robot.model.parents[int(robot.order[joint]) + 1]))


def axis(robot: Robot, data: pin.Data, joint: int) -> Array:
    """Return the axis of a revolute joint in the base frame, at the configuration last computed."""
    joint_id = int(robot.order[joint]) + 1
    subspace = robot.model.joints[joint_id].createData().S
    direction = np.asarray(subspace).reshape(6, -1)[3:, 0]
    return np.asarray(data.oMi[joint_id].rotation @ direction)


def tool_frame(robot: Robot, link: str | None = None) -> pin.Frame:
    """Return the frame of the tool.

    Parameters
    ----------
    link : str, optional
        A link of the URDF; without it the one that is farthest out on the last joint.

    Raises
    ------
    RobotError
        If the URDF has no such link, or no identified joint moves it.
    """
    bodies = [frame for frame in robot.model.frames if frame.type == pin.FrameType.BODY]
    if link is None:
        last = [frame for frame in bodies if frame.parentJoint == robot.model.njoints - 1]
        return max(last, key=lambda frame: float(np.linalg.norm(frame.placement.translation)))
    found = next((frame for frame in bodies if frame.name == link), None)
    if found is None:
        names = ", ".join(frame.name for frame in bodies)
        raise RobotError(f"{robot.urdf}: no link {link!r}; it has {names}")
    if found.parentJoint == 0:
        raise RobotError(f"{robot.urdf}: no identified joint moves {link!r}; name a link that moves")
    return found


def force_torques(robot: Robot, configurations: Iterable[Array]) -> Iterator[Array]:
    """Give what a unit of each force on the tool, base frame, is at the joints, recorded side, shape (n, 3): ``J.T``."""
    return (jacobian[:3].T for jacobian, _ in _tool_jacobians(robot, configurations))


def leaning_torques(robot: Robot, configurations: Iterable[Array]) -> Iterator[Array]:
    """Give what a unit of each force on the last link, base frame, is at the joints, recorded side, shape (n, 3, 4).

    The last axis is for a force on the tool, and what a metre more along each axis of the tool's frame adds to that.
    """
    for jacobian, rotation in _tool_jacobians(robot, configurations):
        moved = np.cross(jacobian[3:].T[:, None, :], rotation.T)
        yield np.concatenate([jacobian[:3].T[..., None], moved.swapaxes(1, 2)], axis=2)


def _tool_jacobians(robot: Robot, configurations: Iterable[Array]) -> Iterator[tuple[Array, Array]]:
    """Give the Jacobian of the tool, base frame, recorded side, shape (6, n), and the rotation of its frame, (3, 3)."""
    frame = robot.model.getFrameId(tool_frame(robot).name, pin.FrameType.BODY)
    data = robot.model.createData()
    for q in configurations:
        jacobian = pin.computeFrameJacobian(robot.model, data, q, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        # Of a single joint it comes as a vector.
        yield jacobian.reshape(6, -1)[:, robot.order] * robot.row_scale, data.oMf[frame].rotation


def tool_placement(robot: Robot) -> tuple[Array, Array]:
    """Return how the tool's frame stands in that of the link that carries it: rotation (3, 3) and origin, m, (3,)."""
    placement = tool_frame(robot).placement
    return np.array(placement.rotation), np.array(placement.translation)


def constant_force(rows: Sequence[Array] | Array, torques: Sequence[Array] | Array) -> tuple[Array, float]:
    """Return the force, N, shape (3,), of which rows (n, 3) make torques (n,) best, and the share of their square that it explains."""
    matrix, right = np.concatenate(rows), np.concatenate(torques)
    force = np.asarray(np.linalg.lstsq(matrix, right, rcond=UNFELT_SHARE)[0])
    total = float(right @ right)
    return force, 1.0 - float(np.sum((right - matrix @ force) ** 2)) / total if total > 0.0 else 0.0


def force_covariance(rows: Sequence[Array] | Array, products: Array) -> Array:
    """Return the covariance of `constant_force`, shape (3, 3), N^2; NaN along axes that rows (n, 3) do not tell.

    Parameters
    ----------
    products : ndarray, shape (n, n)
        Mean products of errors of the torques, which are the same for all rows.
    """
    matrix = np.concatenate(rows)
    inverse = np.linalg.pinv(matrix, rcond=UNFELT_SHARE)
    slope = inverse @ np.tile(np.eye(len(products)), (len(rows), 1))
    undetermined = np.diag(inverse @ matrix) < DETERMINED_SHARE
    return np.asarray(np.where(undetermined[:, None] | undetermined, np.nan, slope @ products @ slope.T))


def felt_directions(robot: Robot, configurations: Iterable[Array]) -> int:
    """Return how many directions of a force on the tool the arm feels in one configuration or another."""
    singular = np.linalg.svd(np.concatenate(list(force_torques(robot, configurations))), compute_uv=False)
    return int(np.sum(singular > UNFELT_SHARE * singular[0]))


def weakest_direction(rows: Sequence[Array] | Array, directions: int) -> float:
    """Return how well single rows (n, 3) of `constant_force` tell the last of so many directions, over the first.

    It is small near a singular pose, where that direction is determined by how the arm turns meanwhile, and so by how constant the force
    is.
    """
    singular = [np.linalg.svd(row, compute_uv=False) for row in rows]
    # An arm whose tool is on its only axis feels none.
    felt = [0 < directions <= len(each) and each[0] > 0.0 for each in singular]
    shares = [each[directions - 1] / each[0] if some else 0.0 for each, some in zip(singular, felt, strict=True)]
    return float(np.median(shares))


def farthest_point(robot: Robot) -> Array:
    """Return the farthest frame that the last joint carries, in that joint's frame, m, shape (3,)."""
    model = robot.model
    points = [np.array(frame.placement.translation) for frame in model.frames if frame.parentJoint == model.njoints - 1]
    return max(points, key=lambda point: float(np.linalg.norm(point)), default=np.zeros(3))
