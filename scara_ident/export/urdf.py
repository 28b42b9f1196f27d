"""The identified arm as a URDF: the robot's own file with other inertials and joint dynamics."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np
import pinocchio as pin

from scara_ident.arrays import Array
from scara_ident.export.bodies import Body, body_about_com, body_parameters, check_standard, members_of, share
from scara_ident.export.friction import JointFriction, joint_side
from scara_ident.export.xml_text import (
    COMMENT,
    Edit,
    Element,
    append_child,
    apply,
    format_numbers,
    parse,
    prepend_child,
    read_xml,
    removal,
    same_numbers,
    set_numbers,
)
from scara_ident.robot.robot import Robot
from scara_ident.robot.urdf_validation import INERTIA

_ARMATURE_COMMENT = re.compile(rb"\s*armature [^ ]+ kg( m\^2)? at the joint\s*")


def urdf_text(
    robot: Robot, standard: Array, friction: JointFriction | None = None, *, rotors_reported: bool = False
) -> tuple[str, tuple[str, ...]]:
    """Write the identified arm as a URDF.

    The text is that of the robot's own file with other numbers in ``<inertial>``, ``<dynamics>`` and
    ``<rotorInertia>`` of the identified joints and their links; links that stand still keep theirs.

    Parameters
    ----------
    robot : Robot
        Its ``urdf`` is read again.
    standard : ndarray, shape (11 n,)
        Standard parameters, see `Robot.standard_parameters`.
    friction : JointFriction, optional
        Without it, and where it has NaN, ``<dynamics>`` stays as it is.
    rotors_reported : bool, optional
        Whether a file beside it tells the rotors' inertias, so that their want of a place needs no note.

    Returns
    -------
    text : str
        To be written as UTF-8 with its line ends as they are.
    notes : tuple of str
        What the reader of the file should know, one line each.

    Raises
    ------
    ScaraIdentError
        If a link cannot exist, or the robot's file cannot be read.
    """
    bodies, armature = check_standard(robot, standard)
    content, converted = read_xml(robot.urdf)
    root = parse(content, robot.urdf)
    notes = [f"{robot.urdf.name} was in another encoding; this is UTF-8"] if converted else []
    if _has_relative_meshes(root):
        notes.append(f"names of meshes are relative to the folder of the original {robot.urdf.name}")
    edits: list[Edit] = []
    links = {element.attributes.get("name", ""): element for element in root.find_all("link")}
    for part in (
        _inertials(robot, bodies, links, content),
        _dynamics(robot, friction, root, content),
        _rotors(robot, armature, root, content, rotors_reported),
    ):
        for item in part:
            if isinstance(item, Edit):
                edits.append(item)
            else:
                notes.append(item)
    return apply(content, edits).decode("utf-8"), tuple(notes)


def _has_relative_meshes(root: Element) -> bool:
    names = [mesh.attributes.get("filename", "") for mesh in root.descendants("mesh")]
    return any("://" not in name and not name.startswith("/") for name in names)


def _nominal(links: dict[str, Element]) -> dict[str, Array]:
    """Read the ten parameters, in the link's frame, of every link that has an inertial."""
    found: dict[str, Array] = {}
    for name, link in links.items():
        inertial = link.find("inertial")
        if inertial is None:
            continue
        parts = {child.tag: child.attributes for child in reversed(inertial.children)}
        origin, moments = parts.get("origin", {}), parts.get("inertia", {})
        ixx, ixy, ixz, iyy, iyz, izz = (float(moments.get(key, 0.0)) for key in INERTIA)
        turn = pin.rpy.rpyToMatrix(_vector(origin.get("rpy", "0 0 0")))
        about_com = turn @ np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]]) @ turn.T
        mass = float(parts.get("mass", {}).get("value", 0.0))
        found[name] = body_parameters(Body(mass, _vector(origin.get("xyz", "0 0 0")), about_com))
    return found


def _vector(text: str) -> Array:
    return np.array([float(part) for part in text.split()])


def _inertials(robot: Robot, bodies: Array, links: dict[str, Element], content: bytes) -> Iterator[Edit | str]:
    nominal = _nominal(links)
    unchanged = robot.standard_parameters()[: 10 * robot.n].reshape(robot.n, 10)
    for joint, body in enumerate(bodies):
        if np.array_equal(body, unchanged[joint]):
            continue
        members = members_of(robot, joint, nominal)
        parts, note = share(body, members)
        if note is not None:
            carrying = ", ".join(f"{name} at {value:g}" for name, value in robot.locked)
            yield f"{note} (with {carrying})" if carrying else note
        for member, part in zip(members, parts, strict=True):
            if not np.array_equal(part, member.parameters):
                yield from _set_inertial(content, links[member.link], part)


def _set_inertial(content: bytes, link: Element, parameters: Array) -> Iterator[Edit]:
    body = body_about_com(parameters)
    inertial = link.find("inertial")
    if inertial is not None and not np.any(parameters):
        yield removal(content, inertial)
        return
    pose = {"xyz": body.com.tolist(), "rpy": [0.0, 0.0, 0.0]}
    mass = {"value": [body.mass]}
    upper = body.inertia[np.triu_indices(3)].tolist()
    moments = {key: [value] for key, value in zip(INERTIA, upper, strict=True)}
    wanted = {"origin": pose, "mass": mass, "inertia": moments}
    if inertial is None:
        if np.any(parameters):
            inner = [f"\t{_element(tag, values)}" for tag, values in wanted.items()]
            yield prepend_child(content, link, ("<inertial>", *inner, "</inertial>"))
        return
    for tag, values in wanted.items():
        child = inertial.find(tag)
        if child is not None:
            # No angles are no rotation already.
            needed = {key: value for key, value in values.items() if key != "rpy" or key in child.attributes}
            yield from set_numbers(content, child, needed)
        elif tag != "origin" or any(pose["xyz"]):
            yield prepend_child(content, inertial, (_element(tag, values),))


def _element(tag: str, values: dict[str, list[float]]) -> str:
    attributes = [f'{key}="{format_numbers(numbers)}"' for key, numbers in values.items()]
    return f"<{tag} {' '.join(attributes)}/>"


def _dynamics(robot: Robot, friction: JointFriction | None, root: Element, content: bytes) -> Iterator[Edit | str]:
    known = joint_side(robot, friction)
    yield from known.notes
    for name, coulomb, viscous in zip(robot.joints, known.coulomb, known.viscous, strict=True):
        values = {"damping": [float(viscous)], "friction": [float(coulomb)]}
        values = {key: numbers for key, numbers in values.items() if not np.isnan(numbers[0])}
        joint = _joint(root, name)
        dynamics = joint.find("dynamics")
        if dynamics is not None:
            yield from set_numbers(content, dynamics, values)
        elif values:
            yield append_child(content, joint, _element("dynamics", values))


def _joint(root: Element, name: str) -> Element:
    return next(element for element in root.find_all("joint") if element.attributes.get("name") == name)


def _rotors(robot: Robot, armature: Array, root: Element, content: bytes, reported: bool) -> Iterator[Edit | str]:
    """Set the rotors' inertias where the file has them; say so in a comment where it has no place for them."""
    homeless: list[str] = []
    for j, name in enumerate(robot.joints):
        inertia = float(armature[j] / robot.reduction[j] ** 2)
        holders = [
            next(transmission.descendants("rotorInertia"))
            for transmission in root.descendants("transmission")
            if [joint.attributes.get("name") for joint in transmission.find_all("joint")] == [name]
            and any(transmission.descendants("rotorInertia"))
        ]
        for holder in holders:
            text = content[holder.opened : holder.closing].decode()
            if same_numbers(text, [inertia]):
                continue
            if same_numbers(text, [robot.rotor_inertia[j]]):
                if armature[j] == robot.reduction[j] ** 2 * robot.rotor_inertia[j]:
                    continue
            else:
                yield (
                    f"{name}: the robot description overrides <rotorInertia>; set its rotor_inertia to "
                    f"{format_numbers([inertia])} kg m^2"
                )
            yield Edit(holder.opened, holder.closing, format_numbers([inertia]).encode())
        if not holders:
            yield from _armature_comment(robot, j, float(armature[j]), _joint(root, name), content)
            if armature[j] > 0.0:
                # The comment has every digit.
                homeless.append(f"{name}: {inertia:.4g}")
    if homeless and not reported:
        yield (
            "a URDF has no place for rotor inertias, so a comment at the joint has the armature; to load them "
            f"again give rotor_inertia in robot.yaml ({', '.join(homeless)})"
        )


def _armature_comment(robot: Robot, joint: int, armature: float, element: Element, content: bytes) -> Iterator[Edit]:
    unit = robot.armature_unit(joint)
    text = f" armature {format_numbers([armature])} {unit} at the joint "
    for comment in element.find_all(COMMENT):
        if _ARMATURE_COMMENT.fullmatch(content, comment.opened, comment.closing):
            yield Edit(comment.opened, comment.closing, text.encode())
            return
    if armature > 0.0:
        yield append_child(content, element, f"<!--{text}-->")
