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
from itertools import pairwise

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from scara_ident.errors import RobotError
from scara_ident.tracing import Expr, Scalar, Trace, cos, sin

Vector = tuple[Scalar, Scalar, Scalar]
Matrix = tuple[Vector, Vector, Vector]

_ZERO: Vector = (0.0, 0.0, 0.0)
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
    prismatic : bool
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
    axis: NDArray[np.float64]
    rotation: NDArray[np.float64]
    offset: NDArray[np.float64]


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
    still = _Body(_ZERO, _negated(_floats(gravity.angular)), _negated(_floats(gravity.linear)), {})
    bodies = [still]
    entries: dict[tuple[int, int], Scalar] = {}
    for index, joint in enumerate(joints):
        state = tuple(trace.variable(joint.velocity_index + k * nv) for k in range(3))
        body, mass_terms = _moved(bodies[joint.parent], joint, *state)
        bodies.append(body)
        parameters = wanted.get(index, [])
        if not parameters:
            continue
        for row, (z, u) in body.jacobian.items():
            for parameter in parameters:
                entry = mass_terms[row] if parameter == 0 else _entry(parameter, body, z, u)
                if isinstance(entry, Expr) or entry != 0.0:
                    entries[row, 10 * index + parameter] = entry
    return trace, entries


class _Body:
    """Motion of one body in the frame of its joint."""

    def __init__(self, w: Vector, dw: Vector, a: Vector, jacobian: dict[int, tuple[Vector, Vector]]) -> None:
        self.w, self.dw, self.a, self.jacobian = w, dw, a, jacobian
        (wx, wy, wz), (ax, ay, az) = w, dw
        xx, yy, zz = wx * wx, wy * wy, wz * wz
        xy, xz, yz = wx * wy, wx * wz, wy * wz
        self.b: Matrix = (
            (-(yy + zz), xy - az, xz + ay),
            (xy + az, -(xx + zz), yz - ax),
            (xz - ay, yz + ax, -(xx + yy)),
        )
        # Moments per unit Ixx, Ixy, Iyy, Ixz, Iyz, Izz: what E_k dw + w x E_k w comes to.
        self.moments: tuple[Vector, ...] = (
            (ax, xz, -xy),
            (ay - xz, ax + yz, xx - yy),
            (-yz, ay, xy),
            (az + xy, zz - xx, ax - yz),
            (yy - zz, az - xy, ay + xz),
            (yz, -xz, az),
        )


def _moved(parent: _Body, joint: JointGeometry, q: Expr, v: Expr, a: Expr) -> tuple[_Body, dict[int, Scalar]]:
    """Return the body behind a joint, and its mass entries by row.

    The mass entry u . a is formed in the parent's orientation, where a revolute joint's angle does not enter.
    """
    axis, offset = _floats(joint.axis), _floats(joint.offset)
    rows = parent.jacobian
    origin = tuple(_sum(parent.a[k], _dot(parent.b[k], offset)) for k in range(3))
    shifted = {row: _plus(u, _cross(z, offset)) for row, (z, u) in rows.items()}
    masses: dict[int, Scalar]
    if not joint.prismatic:
        turn = _Turn(joint, q)
        w0, dw0 = turn.into(parent.w), turn.into(parent.dw)
        w = _plus(w0, _scaled(axis, v))
        dw = _plus(_plus(dw0, _scaled(axis, a)), _scaled(_cross(w0, axis), v))
        jacobian = {row: (turn.into(z), turn.into(shifted[row])) for row, (z, _) in rows.items()}
        jacobian[joint.velocity_index] = (axis, _ZERO)
        masses = {row: _dot(u, origin) for row, u in shifted.items()}
        masses[joint.velocity_index] = 0.0
        return _Body(w, dw, turn.into(origin), jacobian), masses
    turn = _Turn(joint, None)
    w, dw = turn.into(parent.w), turn.into(parent.dw)
    b = _Body(w, dw, _ZERO, {}).b
    travel = _scaled(axis, q)
    coriolis = _scaled(_cross(w, axis), 2.0 * v)
    acceleration = _plus(turn.into(origin), tuple(_dot(b[k], travel) for k in range(3)))
    acceleration = _plus(_plus(acceleration, _scaled(axis, a)), coriolis)
    jacobian = {}
    for row, (z, _) in rows.items():
        z_here = turn.into(z)
        jacobian[row] = (z_here, _plus(turn.into(shifted[row]), _cross(z_here, travel)))
    jacobian[joint.velocity_index] = (_ZERO, axis)
    masses = {row: _dot(u, acceleration) for row, (_, u) in jacobian.items()}
    return _Body(w, dw, acceleration, jacobian), masses


def _entry(parameter: int, body: _Body, z: Vector, u: Vector) -> Scalar:
    """First moment (1 to 3) or inertia (4 to 9) entry of one joint's row."""
    if parameter >= 4:
        return _dot(z, body.moments[parameter - 4])
    k = parameter - 1
    column = (body.b[0][k], body.b[1][k], body.b[2][k])
    return _cross(body.a, z)[k] + _dot(column, u)


class _Turn:
    """Rotation of vectors from the parent's orientation into that of a joint.

    The turn about the joint's axis is done about a coordinate axis, between two constant rotations `before` and
    `after`; or, where it takes fewer operations a vector, as one matrix. The part of the placement that turns about
    the axis is an addition to the angle; this is exact, and keeps a placement written with a rounded pi/2 as sparse
    as one with the true value.
    """

    def __init__(self, joint: JointGeometry, q: Expr | None) -> None:
        if q is None:
            self.before, self.after, self.matrix, self.cosine = joint.rotation.T, np.eye(3), None, None
            return
        main = int(np.argmax(np.abs(joint.axis)))
        direction = 1.0 if joint.axis[main] > 0 else -1.0
        self.main = main
        align = _shortest_turn(main, direction * joint.axis)
        before = _snap(joint.rotation @ align)
        twist = _twist(before, main)
        if not _is_permutation(before) and twist != 0.0:
            untwisted = _snap(before @ _rotation(main, twist).T)
            if _cost(untwisted.T) < _cost(before.T):
                before = untwisted
            else:
                twist = 0.0
        else:
            twist = 0.0
        angle = direction * q + twist
        self.cosine, self.sine = cos(angle), sin(angle)
        self.before, self.after = before.T, align
        # Constant, cosine and sine parts of the whole matrix.
        middle = [np.zeros((3, 3)) for _ in range(3)]
        i, j = (main + 1) % 3, (main + 2) % 3
        middle[0][main, main] = 1.0
        middle[1][i, i] = middle[1][j, j] = 1.0
        middle[2][i, j], middle[2][j, i] = 1.0, -1.0
        parts = [_snap(self.after @ part @ self.before) for part in middle]
        dense = sum(np.abs(part) for part in parts)
        self.matrix: list[Vector] | None = None
        if _cost(np.where(dense != 0.0, 0.5, 0.0)) < _cost(self.before) + _cost(self.after) + 6:
            terms = [[p[0] + p[1] * self.cosine + p[2] * self.sine for p in zip(*rows, strict=True)]
                     for rows in zip(*(part.tolist() for part in parts), strict=True)]
            self.matrix = [(x, y, z) for x, y, z in terms]

    def into(self, vector: Vector) -> Vector:
        """Return `vector`, given in the parent's orientation, in the joint's."""
        if self.matrix is not None:
            x, y, z = self.matrix
            return _dot(x, vector), _dot(y, vector), _dot(z, vector)
        result = list(_apply(self.before, vector))
        if self.cosine is not None:
            i, j = (self.main + 1) % 3, (self.main + 2) % 3
            x, y = result[i], result[j]
            result[i] = self.cosine * x + self.sine * y
            result[j] = self.cosine * y - self.sine * x
        return _apply(self.after, (result[0], result[1], result[2]))
