"""The joint-torque regressor as a traced recursion over the bodies of a model.

For every body the recursion carries, in the frame of its joint, the angular velocity w, the angular acceleration dw
and the acceleration a of the origin (gravity taken off), and for every joint that moves the body the axis z and the
velocity u that a unit rate of the joint gives to the origin (u alone for a prismatic joint). With
B = S(dw) + S(w) S(w), by the principle of virtual power the torque of that joint per unit of the body's parameters is

* mass: ``u . a``
* first moments: ``B^T u + a x z``
* inertia about the origin: ``z . (E_k dw + w x E_k w)``, E_k the symmetric unit matrices of Ixx .. Izz

(Newton and Euler about the origin of the frame; e.g. Featherstone, "Rigid Body Dynamics Algorithms", 2008, chapter 2.)
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from scara_ident.arrays import Array
from scara_ident.errors import RobotError
from scara_ident.model.regressor.tracing import Expr, Scalar, Trace, cos, sin, vanishing
from scara_ident.model.regressor.vectors import ZERO, Vector, cross, dot, floats, plus, scaled, vector

Jacobian = dict[int, tuple[Vector, Vector]]

_ROUNDING = 4 * np.finfo(np.float64).eps
"""Constants this close to 0 or 1 (lengths: relative to the arm's longest offset) are those numbers, rounded."""
_REVOLUTE = ("JointModelRX", "JointModelRY", "JointModelRZ", "JointModelRevoluteUnaligned")
_UNBOUNDED = ("JointModelRUBX", "JointModelRUBY", "JointModelRUBZ", "JointModelRevoluteUnboundedUnaligned")
_PRISMATIC = ("JointModelPX", "JointModelPY", "JointModelPZ", "JointModelPrismaticUnaligned")
_SUPPORTED = _REVOLUTE + _UNBOUNDED + _PRISMATIC


@dataclass(frozen=True, eq=False)
class JointGeometry:
    """What the recursion needs of one joint.

    Attributes
    ----------
    parent : int
        Index of the parent joint, 0 for the base.
    velocity_index : int
        Row of the joint in q, v and a.
    axis : ndarray (3,)
        Unit axis in the joint's frame.
    rotation : ndarray (3, 3)
        From the joint's frame at position 0 to the parent's.
    offset : ndarray (3,)
        Origin at position 0 in the parent's frame, m.
    """

    parent: int
    velocity_index: int
    prismatic: bool
    axis: Array
    rotation: Array
    offset: Array


def joint_geometry(model: pin.Model) -> list[JointGeometry]:
    """Read joints 1.. of `model`.

    Raises
    ------
    RobotError
        The model has no joint, or one that is neither revolute nor prismatic.
    """
    if model.njoints < 2:
        raise RobotError(f"{model.name}: no joint to move; a robot of revolute or prismatic joints is needed")
    data = model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    reach = max(float(np.abs(placement.translation).max()) for placement in model.jointPlacements)
    joints = []
    for index in range(1, model.njoints):
        joint = model.joints[index]
        kind = joint.shortname()
        if kind not in _SUPPORTED:
            raise RobotError(
                f"{model.name}: joint '{model.names[index]}' is a {kind}; supported are revolute (also continuous) "
                "and prismatic joints"
            )
        prismatic = kind in _PRISMATIC
        subspace = np.asarray(data.joints[index].S, dtype=np.float64).reshape(6)
        placement = model.jointPlacements[index]
        joints.append(
            JointGeometry(
                parent=int(model.parents[index]),
                velocity_index=joint.idx_v,
                prismatic=prismatic,
                axis=_snap(subspace[:3] if prismatic else subspace[3:]),
                rotation=_snap(placement.rotation),
                offset=np.where(np.abs(placement.translation) > _ROUNDING * reach, placement.translation, 0.0),
            )
        )
    return joints


def trace_regressor(
    joints: Sequence[JointGeometry], gravity: pin.Motion, columns: Iterable[int]
) -> tuple[Trace, dict[tuple[int, int], Scalar]]:
    """Trace the requested columns of the joint-torque regressor.

    Parameters
    ----------
    joints : sequence of JointGeometry
        Joints 1.. in Pinocchio's order (a parent before its children).
    gravity : pin.Motion
        Spatial acceleration of gravity in the base frame.
    columns : iterable of int
        Standard parameters, 10 per body.

    Returns
    -------
    Trace
        Inputs are q (0 .. nv-1), v (nv .. 2 nv-1) and a (2 nv .. 3 nv-1).
    dict
        Entries ``(row, column) -> expression``, without those that are zero for every state.
    """
    trace = Trace()
    nv = len(joints)
    wanted: dict[int, list[int]] = {}
    for column in columns:
        wanted.setdefault(column // 10, []).append(column % 10)
    at_rest = Body(ZERO, floats(-gravity.angular), floats(-gravity.linear), {})
    bodies = [at_rest]
    entries: dict[tuple[int, int], Scalar] = {}
    for index, joint in enumerate(joints):
        q, v, a = (trace.variable(joint.velocity_index + k * nv) for k in range(3))
        body, masses = moved(bodies[joint.parent], joint, q, v, a)
        bodies.append(body)
        parameters = wanted.get(index, [])
        if not parameters:
            continue
        for row, (z, u) in body.jacobian.items():
            for parameter in parameters:
                entry = masses[row] if parameter == 0 else _entry(parameter, body, z, u)
                if isinstance(entry, Expr) or entry != 0.0:
                    entries[row, 10 * index + parameter] = entry
    states = np.random.default_rng(1).uniform(-2.0, 2.0, (3 * nv, 12))
    zero = vanishing(trace, list(entries.values()), states)
    return trace, {place: entry for (place, entry), none in zip(entries.items(), zero, strict=True) if not none}


class Body:
    """Motion of one body in the frame of its joint, and by row the axis z and the origin's velocity u."""

    def __init__(self, w: Vector, dw: Vector, a: Vector, jacobian: Jacobian) -> None:
        self.w, self.dw, self.a, self.jacobian = w, dw, a, jacobian
        (wx, wy, wz), (ax, ay, az) = w, dw
        xx, yy, zz = wx * wx, wy * wy, wz * wz
        xy, xz, yz = wx * wy, wx * wz, wy * wz
        self.b: tuple[Vector, Vector, Vector] = (
            (-(yy + zz), xy - az, xz + ay),
            (xy + az, -(xx + zz), yz - ax),
            (xz - ay, yz + ax, -(xx + yy)),
        )
        # E_k dw + w x E_k w for Ixx, Ixy, Iyy, Ixz, Iyz, Izz.
        self.moments: tuple[Vector, ...] = (
            (ax, xz, -xy),
            (ay - xz, ax + yz, xx - yy),
            (-yz, ay, xy),
            (az + xy, zz - xx, ax - yz),
            (yy - zz, az - xy, ay + xz),
            (yz, -xz, az),
        )


def moved(parent: Body, joint: JointGeometry, q: Scalar, v: Scalar, a: Scalar) -> tuple[Body, dict[int, Scalar]]:
    """Return the body behind a joint, and its mass entries by row."""
    axis, offset = floats(joint.axis), floats(joint.offset)
    row = joint.velocity_index
    matrix = turn_matrix(joint, q)

    def turn(x: Vector) -> Vector:
        return vector(dot(row, x) for row in matrix)

    origin = plus(parent.a, vector(dot(b, offset) for b in parent.b))
    moving = {j: (z, plus(u, cross(z, offset))) for j, (z, u) in parent.jacobian.items()}
    jacobian = {j: (turn(z), turn(u)) for j, (z, u) in moving.items()}
    w, dw = turn(parent.w), turn(parent.dw)
    masses: dict[int, Scalar]
    if joint.prismatic:
        along = scaled(axis, q)
        centripetal = (dot(b, along) for b in Body(w, dw, ZERO, {}).b)
        coriolis = scaled(cross(w, axis), v * 2.0)
        origin = plus(plus(plus(turn(origin), vector(centripetal)), coriolis), scaled(axis, a))
        jacobian = {j: (z, plus(u, cross(z, along))) for j, (z, u) in jacobian.items()}
        jacobian[row] = (ZERO, axis)
        masses = {j: dot(u, origin) for j, (_, u) in jacobian.items()}
        return Body(w, dw, origin, jacobian), masses
    # In the parent's orientation, where the joint's angle does not enter.
    masses = {j: dot(u, origin) for j, (_, u) in moving.items()}
    masses[row] = 0.0
    dw = plus(plus(dw, scaled(axis, a)), scaled(cross(w, axis), v))
    jacobian[row] = (axis, ZERO)
    return Body(plus(w, scaled(axis, v)), dw, turn(origin), jacobian), masses


def _entry(parameter: int, body: Body, z: Vector, u: Vector) -> Scalar:
    """First moment (1 to 3) or inertia (4 to 9) entry of one joint's row."""
    if parameter >= 4:
        return dot(z, body.moments[parameter - 4])
    k = parameter - 1
    column = (body.b[0][k], body.b[1][k], body.b[2][k])
    return cross(body.a, z)[k] + dot(column, u)


def turn_matrix(joint: JointGeometry, q: Scalar) -> tuple[Vector, Vector, Vector]:
    """Return the rows of the matrix that brings vectors from the parent's orientation into that of a joint.

    Rodrigues' formula with the placement multiplied in, so that an entry is a constant and multiples of cosine and
    sine of the angle q, which does not turn a prismatic joint. That costs next to nothing over turns about coordinate
    axes with constant rotations between them, and a placement written with a rounded pi/2 loses no zero by it.
    """
    placement = joint.rotation.T
    if joint.prismatic:
        return floats(placement[0]), floats(placement[1]), floats(placement[2])
    x, y, z = joint.axis
    along = np.outer(joint.axis, joint.axis)
    across = np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])
    fixed, even, odd = (_snap(part @ placement).tolist() for part in (along, np.eye(3) - along, across))
    c, s = cos(q), sin(q)
    first, second, third = (
        vector(fixed[k][m] + even[k][m] * c + odd[k][m] * s for m in range(3)) for k in range(3)
    )  # fmt: skip
    return first, second, third


def _snap(values: Array) -> Array:
    """Return numbers within rounding of 0, 1 and -1 as those, so that the tracer folds them."""
    result = np.array(values, dtype=np.float64)
    for number in (0.0, 1.0, -1.0):
        result[np.abs(result - number) <= _ROUNDING] = number
    return result
