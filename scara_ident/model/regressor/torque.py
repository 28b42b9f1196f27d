"""The joint torques of bodies of known parameters as a traced recursion.

Newton and Euler, outwards for the motion and inwards for force and moment (Luh, Walker, Paul 1980, "On-line
computational scheme for mechanical manipulators"). Where parameters are numbers, what is multiplied by a zero among
them is never traced: with base parameters, each in the place of the standard parameter that leads it, most of it.
"""

from __future__ import annotations

from collections.abc import Sequence

from scara_ident.arrays import Array
from scara_ident.model.regressor.recursion import Body, JointGeometry, moved, turn_matrix
from scara_ident.model.regressor.tracing import Expr, Scalar
from scara_ident.model.regressor.vectors import ZERO, Vector, cross, dot, floats, plus, scaled, vector


def trace_torque(
    joints: Sequence[JointGeometry],
    gravity: Vector,
    parameters: Sequence[Sequence[Scalar]] | Array,
    q: Sequence[Scalar],
    v: Sequence[Scalar],
    a: Sequence[Scalar],
) -> list[Scalar]:
    """Trace the torque at the joints.

    Parameters
    ----------
    joints : sequence of JointGeometry
        Joints 1.. in Pinocchio's order (a parent before its children).
    gravity : tuple of Expr or float
        Acceleration of gravity in the base frame, m/s^2.
    parameters : sequence of (bodies, 10) numbers or Expr
        Standard parameters, inertias about the origin of the joint's frame; they need not be those of a possible body.
    q, v, a : sequence of Expr or float, one per joint
        By velocity index; numbers fold.

    Returns
    -------
    list of Expr or float
        N m or N, by velocity index.
    """
    bodies = [Body(ZERO, ZERO, scaled(gravity, -1.0), {})]
    for joint in joints:
        k = joint.velocity_index
        parent = bodies[joint.parent]
        body, _ = moved(Body(parent.w, parent.dw, parent.a, {}), joint, q[k], v[k], a[k])
        bodies.append(body)
    forces: list[Vector] = [ZERO] * len(bodies)
    moments: list[Vector] = [ZERO] * len(bodies)
    torque: list[Scalar] = [0.0] * len(joints)
    for index in range(len(joints), 0, -1):
        joint, body = joints[index - 1], bodies[index]
        own = [value if isinstance(value, Expr) else float(value) for value in parameters[index - 1]]
        own_force, own_moment = _load(body, vector(own[1:4]), own)
        force, moment = plus(forces[index], own_force), plus(moments[index], own_moment)
        axis, position = floats(joint.axis), q[joint.velocity_index]
        torque[joint.velocity_index] = dot(axis, force if joint.prismatic else moment)
        columns = list(zip(*turn_matrix(joint, position), strict=True))
        back_force, back_moment = (vector(dot(column, x) for column in columns) for x in (force, moment))
        arm = floats(joint.offset)
        if joint.prismatic:
            slid = scaled(axis, position)
            arm = plus(arm, vector(dot(column, slid) for column in columns))
        forces[joint.parent] = plus(forces[joint.parent], back_force)
        moments[joint.parent] = plus(moments[joint.parent], plus(back_moment, cross(arm, back_force)))
    return torque


def _load(body: Body, first: Vector, parameters: Sequence[Scalar]) -> tuple[Vector, Vector]:
    """Return the force and the moment about the frame's origin that a body's own motion takes."""
    force = plus(scaled(body.a, parameters[0]), vector(dot(row, first) for row in body.b))
    moment = cross(first, body.a)
    for value, part in zip(parameters[4:], body.moments, strict=True):
        moment = plus(moment, scaled(part, value))
    return force, moment
