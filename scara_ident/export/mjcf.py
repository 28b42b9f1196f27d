"""The identified arm as a model of MuJoCo (MJCF)."""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np
import pinocchio as pin

from scara_ident.arrays import Array
from scara_ident.errors import ScaraIdentError
from scara_ident.export.bodies import Body, body_about_com, check_standard
from scara_ident.export.friction import JointFriction, JointSideFriction, joint_side
from scara_ident.export.xml_text import format_numbers
from scara_ident.robot.robot import Robot

# MuJoCo takes no body on the edge of the possible (a rod, a plate, a point): the covariance of mass gets at
# least this share of its trace in every direction, and at least this much in kg m^2 (MuJoCo's own is 1e-15).
SMALLEST_SPREAD = 1e-10
SMALLEST_INERTIA = 1e-14
# Thickness of the drawn arm as a share of its longest link.
DRAWN_RADIUS = 0.06


def mjcf_text(
    robot: Robot, standard: Array, friction: JointFriction | None = None, offset: Array | None = None
) -> tuple[str, tuple[str, ...]]:
    """Write the identified arm as MJCF.

    Bodies have the frames and names of the links, so generalised coordinates are those of the URDF; locked
    joints are welded where they were locked, and a link that is carried by another is a body without mass in
    it. Armature, frictionloss and damping are at the joint. An actuator per joint takes the recorded torque: its gear is
    the reduction where that is the motor's, and its bias takes off the offset.

    Parameters
    ----------
    robot : Robot
    standard : ndarray, shape (11 n,)
        Standard parameters, see `Robot.standard_parameters`.
    friction : JointFriction, optional
        Without it, and where it has NaN, joints are free of friction.
    offset : ndarray, shape (n,), optional
        Constant part of the recorded torque, which moves nothing, N m (N).

    Returns
    -------
    text : str
    notes : tuple of str
        What the reader of the file should know, one line each.

    Raises
    ------
    ScaraIdentError
        If a link cannot exist, or has no mass, which MuJoCo does not take.
    """
    parameters, armature = check_standard(robot, standard)
    known = joint_side(robot, friction)
    notes = [*known.notes]
    bodies: list[Body] = []
    for link, item in zip(robot.links, parameters, strict=True):
        body, note = _acceptable(link, body_about_com(item))
        bodies.append(body)
        notes += [] if note is None else [note]

    root = Element("mujoco", model=robot.name)
    root.append(
        Element(
            "compiler",
            angle="radian",
            autolimits="true",
            inertiafromgeom="false",
            balanceinertia="false",
            boundmass="0",
            boundinertia="0",
        )
    )
    gravity = format_numbers(robot.model.gravity.linear.tolist())
    root.append(Element("option", timestep="0.001", integrator="implicitfast", gravity=gravity))
    drawn = Element("default")
    # Drawn only: no mass and no contact.
    drawn.append(Element("geom", type="capsule", mass="0", contype="0", conaffinity="0", rgba="0.6 0.65 0.7 1"))
    root.append(drawn)
    world = ElementTree.SubElement(root, "worldbody")
    _grow(robot, world, 0, bodies, armature, known)
    root.append(_actuators(robot, np.zeros(robot.n) if offset is None else offset))
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode") + "\n", tuple(notes)


def _grow(
    robot: Robot,
    parent: Element,
    parent_id: int,
    bodies: Sequence[Body],
    armature: Array,
    friction: JointSideFriction,
) -> None:
    """Add the bodies that a joint of the Pinocchio model carries; joint 0 is the world."""
    model = robot.model
    joint_of = {int(k) + 1: j for j, k in enumerate(robot.order)}
    radius = DRAWN_RADIUS * max(
        (float(np.linalg.norm(model.jointPlacements[i].translation)) for i in range(1, model.njoints)), default=0.0
    )
    own = robot.links[joint_of[parent_id]] if parent_id else "world"
    for frame in model.frames:
        if frame.type != pin.FrameType.BODY or frame.parentJoint != parent_id or frame.name == own:
            continue
        parent.append(_placed("body", frame.name, frame.placement))
        _draw(parent, frame.placement.translation, radius)
    for child_id in range(1, model.njoints):
        if model.parents[child_id] != parent_id:
            continue
        j = joint_of[child_id]
        placement = model.jointPlacements[child_id]
        _draw(parent, placement.translation, radius)
        element = _placed("body", robot.links[j], placement)
        element.append(_joint(robot, j, float(armature[j]), float(friction.coulomb[j]), float(friction.viscous[j])))
        element.append(_inertial(bodies[j]))
        parent.append(element)
        _grow(robot, element, child_id, bodies, armature, friction)


def _placed(tag: str, name: str, placement: pin.SE3) -> Element:
    element = Element(tag, name=name)
    if np.any(placement.translation):
        element.set("pos", format_numbers(placement.translation.tolist()))
    if not np.array_equal(placement.rotation, np.eye(3)):
        x, y, z, w = pin.Quaternion(placement.rotation).coeffs().tolist()
        element.set("quat", format_numbers([w, x, y, z]))
    return element


def _joint(robot: Robot, j: int, armature: float, coulomb: float, viscous: float) -> Element:
    element = Element("joint", name=robot.joints[j], type="slide" if robot.prismatic[j] else "hinge")
    element.set("axis", format_numbers(_axis(robot, j).tolist()))
    # MuJoCo takes no one-sided range and no empty one.
    if np.isfinite(robot.lower[j]) and np.isfinite(robot.upper[j]) and robot.lower[j] < robot.upper[j]:
        element.set("range", format_numbers([robot.lower[j], robot.upper[j]]))
    for key, value in (("armature", armature), ("damping", viscous), ("frictionloss", coulomb)):
        if value > 0.0:  # not NaN either
            element.set(key, format_numbers([value]))
    return element


def _actuators(robot: Robot, offset: Array) -> Element:
    result = Element("actuator")
    for j, name in enumerate(robot.joints):
        element = Element("general", name=name, joint=name, gear=format_numbers([1.0 / robot.row_scale[j]]))
        if offset[j] != 0.0:
            element.set("biastype", "affine")
            element.set("biasprm", format_numbers([-offset[j], 0.0, 0.0]))
        limit = float(robot.torque_limit[j])
        if np.isfinite(limit):
            element.set("ctrlrange", format_numbers([-limit, limit]))
        result.append(element)
    return result


def _axis(robot: Robot, j: int) -> Array:
    """Axis of a joint in its own frame: its column of the joint's Jacobian there."""
    model = robot.model
    joint_id = int(robot.order[j]) + 1
    jacobian = np.asarray(pin.computeJointJacobian(model, model.createData(), pin.neutral(model), joint_id))
    # Pinocchio gives the matrix of a single joint as a vector.
    column = jacobian.reshape(6, model.nv)[:, robot.order[j]]
    return np.asarray(column[:3] if robot.prismatic[j] else column[3:])


def _inertial(body: Body) -> Element:
    full = [body.inertia[k] for k in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
    return Element(
        "inertial",
        pos=format_numbers(body.com.tolist()),
        mass=format_numbers([body.mass]),
        fullinertia=format_numbers(full),
    )


def _acceptable(link: str, body: Body) -> tuple[Body, str | None]:
    """Move a body off the edge of the possible, where MuJoCo refuses it."""
    if body.mass <= 0.0:
        raise ScaraIdentError(
            f"{link}: MuJoCo takes no moving link without mass; give the link a mass, or lock its joint"
        )
    covariance = np.trace(body.inertia) / 2.0 * np.eye(3) - body.inertia
    values, vectors = np.linalg.eigh(covariance)
    smallest = max(SMALLEST_SPREAD * float(np.clip(values, 0.0, None).sum()), SMALLEST_INERTIA)
    if values[0] >= smallest:
        return body, None
    lifted = np.maximum(values, smallest)
    spread = (vectors * lifted) @ vectors.T
    change = float(np.max(lifted - values))
    note = f"{link}: a point, rod or plate was made thicker by {change:.3g} kg m^2, as MuJoCo refuses it"
    return Body(body.mass, body.com, float(lifted.sum()) * np.eye(3) - spread), note


def _draw(parent: Element, end: Array, radius: float) -> None:
    if float(np.linalg.norm(end)) > radius > 0.0:
        ends = format_numbers([0.0, 0.0, 0.0, *end.tolist()])
        parent.append(Element("geom", fromto=ends, size=format_numbers([radius])))
