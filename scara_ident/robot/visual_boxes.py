"""Bounding boxes of the links' visual shapes."""

from __future__ import annotations

import os
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pinocchio as pin

from scara_ident.arrays import Array
from scara_ident.errors import RobotError
from scara_ident.robot.robot import Robot
from scara_ident.robot.urdf_file import read_urdf


def visual_boxes(robot: Robot) -> tuple[tuple[Array, Array], ...]:
    """Return the bounding box of each body's visual shapes, along the axes of its link.

    A body is the link that a joint moves with all that is fixed or locked to it.

    Returns
    -------
    tuple of (ndarray, ndarray)
        Lower and upper corner per body, each of shape (3,), m.

    Raises
    ------
    RobotError
        If a body has no visual shape, or a mesh cannot be read.
    """
    low = np.full((robot.n, 3), np.inf)
    high = np.full((robot.n, 3), -np.inf)
    body_of_joint = {int(k) + 1: i for i, k in enumerate(robot.order)}
    for link in read_urdf(robot.urdf, robot.urdf).findall("link"):
        name = link.get("name", "")
        if not robot.model.existFrame(name, pin.FrameType.BODY):
            continue
        frame = robot.model.frames[robot.model.getFrameId(name, pin.FrameType.BODY)]
        body = body_of_joint.get(int(frame.parentJoint))
        if body is None:
            continue
        for visual in link.findall("visual"):
            corners = _corners(visual, frame.placement, robot.urdf, name)
            low[body] = np.minimum(low[body], corners.min(axis=0))
            high[body] = np.maximum(high[body], corners.max(axis=0))
    for i, name in enumerate(robot.links):
        if not np.all(low[i] < high[i]):
            raise RobotError(
                f"{robot.urdf}: link {name} has no visual shape with a volume; bound its centre of mass by an ellipsoid"
            )
    return tuple(zip(low, high, strict=True))


def _corners(visual: ElementTree.Element, placement: pin.SE3, urdf: Path, link: str) -> Array:
    """Points whose bounding box is that of the shape, in the frame of the body's joint, shape (k, 3)."""
    origin = visual.find("origin")
    xyz = _numbers(origin, "xyz", (0.0, 0.0, 0.0))
    rpy = _numbers(origin, "rpy", (0.0, 0.0, 0.0))
    pose = placement * pin.SE3(pin.rpy.rpyToMatrix(*rpy), xyz)
    rotation, centre = np.asarray(pose.rotation), np.asarray(pose.translation)
    geometry = visual.find("geometry")
    if geometry is None or len(geometry) == 0:
        raise RobotError(f"{urdf}: link {link}: a visual without a geometry")
    shape = geometry[0]
    if shape.tag == "mesh":
        return np.asarray(_mesh_points(shape, urdf, link) @ rotation.T + centre)
    if shape.tag == "box":
        reach = np.abs(rotation) @ (0.5 * _numbers(shape, "size", (0.0, 0.0, 0.0)))
    elif shape.tag == "sphere":
        reach = np.full(3, float(shape.get("radius", "0")))
    elif shape.tag in ("cylinder", "capsule"):
        radius, half = float(shape.get("radius", "0")), 0.5 * float(shape.get("length", "0"))
        axis = np.abs(rotation[:, 2])
        round_ = radius if shape.tag == "capsule" else radius * np.sqrt(np.clip(1.0 - axis**2, 0.0, None))
        reach = axis * half + round_
    else:
        raise RobotError(f"{urdf}: link {link}: visual shape <{shape.tag}> is not known")
    return np.array([centre - reach, centre + reach])


def _numbers(element: ElementTree.Element | None, key: str, default: tuple[float, float, float]) -> Array:
    text = None if element is None else element.get(key)
    return np.array(default if text is None else [float(x) for x in text.split()])


def _mesh_points(shape: ElementTree.Element, urdf: Path, link: str) -> Array:
    import trimesh

    name = shape.get("filename", "")
    path = find_mesh(name, urdf)
    if path is None:
        raise RobotError(f"{urdf}: link {link}: mesh {name} is not found; bound its centre of mass by an ellipsoid")
    try:
        bounds = np.asarray(trimesh.load_scene(path).bounds)
    except Exception as error:  # trimesh's loaders raise whatever their parser raises
        raise RobotError(f"{path}: cannot be read as a mesh: {' '.join(str(error).split())}") from None
    if bounds.shape != (2, 3):
        raise RobotError(f"{path}: the mesh is empty")
    scaled = bounds * _numbers(shape, "scale", (1.0, 1.0, 1.0))
    return np.array([[scaled[i, 0], scaled[j, 1], scaled[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])


def find_mesh(name: str, urdf: Path) -> Path | None:
    """Find a mesh by its name in a URDF: beside it, or in a package above it or on ROS_PACKAGE_PATH."""
    for scheme in ("package://", "model://"):
        if name.startswith(scheme):
            relative = Path(name.removeprefix(scheme))
            places = [*urdf.resolve().parents, *map(Path, os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep))]
            return next((place / relative for place in places if (place / relative).is_file()), None)
    path = urdf.resolve().parent / name.removeprefix("file://")
    return path if path.is_file() else None
