"""The collision shapes of a URDF, as convex bodies that Coal measures distances between."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
from pinocchio import coal
from scipy.spatial import ConvexHull, QhullError

from scara_ident.arrays import Array
from scara_ident.errors import RobotError
from scara_ident.quiet import quiet_stderr
from scara_ident.robot.robot import Robot
from scara_ident.robot.urdf_file import read_urdf
from scara_ident.robot.visual_boxes import find_mesh


def collision_shapes(robot: Robot) -> pin.GeometryModel:
    """Return the collision shapes of a robot, each on the joint of ``robot.model`` that carries it.

    A mesh is replaced by its convex hull, which holds all of it: distances are rather too small than too large.

    Returns
    -------
    pinocchio.GeometryModel
        Without pairs; empty where the URDF has no collision shape.

    Raises
    ------
    RobotError
        If a mesh is not found or cannot be read, or a shape has a negative size.
    """
    tree = read_urdf(robot.urdf, robot.urdf)
    for link in tree.findall("link"):
        for mesh in link.iterfind("collision/geometry/mesh"):
            name = mesh.get("filename", "")
            path = find_mesh(name, robot.urdf)
            if path is None:
                raise RobotError(f"{robot.urdf}: link {link.get('name')}: mesh {name} is not found")
            mesh.set("filename", str(path))
    text = ElementTree.tostring(tree, encoding="unicode")
    try:
        with quiet_stderr():
            shapes = pin.buildGeomFromUrdfString(robot.model, text, pin.GeometryType.COLLISION)
    except (ValueError, RuntimeError) as error:
        # Coal says first where in its own source.
        said = " ".join(str(error).rpartition("message:")[2].split()).rstrip(".")
        raise RobotError(f"{robot.urdf}: collision shapes cannot be read: {said}") from None
    for shape in shapes.geometryObjects:
        if isinstance(shape.geometry, coal.BVHModelBase):
            shape.geometry = _hull(np.asarray(shape.geometry.vertices()), shape.meshPath)
        shape.geometry.computeLocalAABB()
        if not shape.geometry.aabb_radius >= 0.0:
            raise RobotError(f"{robot.urdf}: collision shape {shape.name} has a negative size; correct it")
    return shapes


def bare_links(robot: Robot) -> tuple[str, ...]:
    """Return the links that move and have a mass or a picture, but no collision shape, in the URDF's order."""
    model, found = robot.model, []
    for link in read_urdf(robot.urdf, robot.urdf).findall("link"):
        mass, name = link.find("inertial/mass"), str(link.get("name"))
        heavy = mass is not None and float(mass.get("value", "0")) > 0.0
        if link.find("collision") is None and (heavy or link.find("visual") is not None):
            frame = model.getFrameId(name, pin.FrameType.BODY)
            if frame < model.nframes and model.frames[frame].parentJoint > 0:
                found.append(name)
    return tuple(found)


def _hull(points: Array, mesh: str) -> coal.Convex:
    # Coal's own buildConvexRepresentation takes a mesh to be convex as it is, and then measures wrong distances.
    try:
        hull = ConvexHull(points)
    except (QhullError, ValueError):
        raise RobotError(f"{mesh}: the mesh has no volume; correct it") from None
    place = np.full(len(points), -1)
    place[hull.vertices] = np.arange(len(hull.vertices))
    vertices, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    for point in points[hull.vertices]:
        vertices.append(point)
    for corners, outwards in zip(hull.simplices, hull.equations[:, :3], strict=True):
        a, b, c = points[corners]
        order = corners if np.cross(b - a, c - a) @ outwards > 0.0 else corners[::-1]
        triangles.append(coal.Triangle(*(int(place[k]) for k in order)))
    return coal.Convex(vertices, triangles)
