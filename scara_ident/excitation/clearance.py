"""Distances that a motion keeps: between the links of the arm, to a floor and to boxes.

Shapes are those of the URDF. Bounding spheres tell which pairs may be near at all; of these Coal finds the distance, and
the nearest points with the direction between them give its derivative by the joints.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from pinocchio import coal

from scara_ident.arrays import Array
from scara_ident.excitation.joint_frames import JointFrames, joint_frames, joints_of
from scara_ident.manners import Frozen
from scara_ident.robot.collision_shapes import collision_shapes
from scara_ident.robot.kinematics import place_of
from scara_ident.robot.robot import Robot

# Centre and edges of a box along the axes of the base, m.
Box = tuple[tuple[float, float, float], tuple[float, float, float]]

# Distances are told apart up to so much more than the margin, m.
WATCHED_DISTANCE = 0.05
# Pairs count by this power of their room: the larger, the more the nearest alone.
POWER = 2.0
# Of Coal's search for nearest points, m.
TOLERANCE = 1e-8


@dataclass(frozen=True, eq=False, repr=False)
class Clearance(Frozen):
    """Pairs of shapes that are kept apart.

    Attributes
    ----------
    robot : Robot
    margin : float
        Least distance asked for, m.
    floor : float
        Height of the floor, m; -inf where there is none.
    boxes : tuple of Box
    pairs : tuple of (int, int, str)
        Two shapes and the group they count in: ``self``, ``floor``, ``box1``, ``box2``, ....
    notes : tuple of str
        What is not watched, and why.
    likely : tuple of bool
        Which pairs may come near the margin at all, as random postures say; a search looks at no others.
    """

    robot: Robot
    margin: float
    floor: float
    boxes: tuple[Box, ...]
    pairs: tuple[tuple[int, int, str], ...]
    notes: tuple[str, ...]
    likely: tuple[bool, ...] = ()

    @cached_property
    def groups(self) -> tuple[str, ...]:
        """Groups with a pair, in order."""
        return tuple(dict.fromkeys(group for *_, group in self.pairs))

    @cached_property
    def _group(self) -> NDArray[np.intp]:
        """Which group each pair counts in, shape (P,)."""
        return np.array([self.groups.index(group) for *_, group in self.pairs], dtype=np.intp)

    @cached_property
    def shapes(self) -> pin.GeometryModel:
        """Shapes of the robot, then the floor and the boxes, with the pairs."""
        shapes = pin.GeometryModel(shapes_about(self.robot, self.floor, self.boxes))
        for first, second, _ in self.pairs:
            shapes.addCollisionPair(pin.CollisionPair(first, second))
        return shapes

    @cached_property
    def _data(self) -> tuple[pin.Data, pin.GeometryData, list[coal.DistanceResult]]:
        measured = self.shapes.createData()
        # Pinocchio's own let Coal begin where it last ended: digits would depend on what was measured before.
        for pair in range(len(self.pairs)):
            measured.distanceRequests[pair] = coal.DistanceRequest()
            measured.distanceRequests[pair].gjk_tolerance = TOLERANCE
        return self.robot.model.createData(), measured, list(measured.distanceResults)

    @cached_property
    def _spheres(self) -> tuple[Array, Array]:
        """Centres in the frames of the joints, (S, 3), and radii of bounding spheres."""
        shapes = self.shapes.geometryObjects
        centres = np.array([shape.placement.act(shape.geometry.aabb_center) for shape in shapes])
        return centres, np.array([shape.geometry.aabb_radius for shape in shapes])

    @cached_property
    def _sides(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """First and second shape of every pair, each of shape (P,)."""
        first, second = np.array([pair[:2] for pair in self.pairs], dtype=np.intp).reshape(-1, 2).T
        return first, second

    @cached_property
    def _moved_by(self) -> NDArray[np.bool_]:
        """Which joints, in the robot's order, move each shape, shape (S, n)."""
        model, joints = self.robot.model, [shape.parentJoint for shape in self.shapes.geometryObjects]
        moved = np.zeros((len(joints), self.robot.n), dtype=bool)
        for shape, joint in enumerate(joints):
            while joint > 0:
                moved[shape, place_of(self.robot, joint)] = True
                joint = model.parents[joint]
        return moved

    @cached_property
    def _levers(self) -> tuple[Array, Array]:
        """How far at most a shape moves per rad or m of each joint, (S, n), and more per m that others slide, (S, n, n)."""
        joints, robot = joints_of(self.robot), self.robot
        centres, radii = self._spheres
        fixed, slid = np.zeros(self._moved_by.shape), np.zeros((*self._moved_by.shape, robot.n))
        for shape, found in enumerate(self.shapes.geometryObjects):
            joint, beyond = found.parentJoint, np.zeros(robot.n)
            # Obstacles do not move; a floor has no size.
            extent = float(np.linalg.norm(centres[shape]) + radii[shape]) if joint > 0 else 0.0
            while joint > 0:
                own, each = place_of(robot, joint), joints[joint - 1]
                fixed[shape, own] = 1.0 if each.prismatic else extent
                slid[shape, own] = 0.0 if each.prismatic else beyond
                extent += float(np.linalg.norm(each.offset))
                beyond[own] = float(each.prismatic)
                joint = each.parent
        return fixed, slid

    def _rates(self, q: Array) -> Array:
        """Return how much the distance of each pair changes at most per rad or m of each joint, shape (P, n)."""
        fixed, slid = self._levers
        rates = fixed + slid @ np.abs(q).max(axis=1, initial=0.0)
        first, second = self._sides
        # What moves both alike changes nothing.
        return np.where(self._moved_by[first] != self._moved_by[second], rates[first] + rates[second], 0.0)

    def nearest(self, q: Array, reach: float, *, likely: bool = False) -> Nearest:
        """Measure the pairs that are nearer than a reach.

        Parameters
        ----------
        q : ndarray, shape (n, N)
            rad or m.
        reach : float
            m.
        likely : bool
            Whether to look at likely pairs alone.
        """
        near = self._bounds(joint_frames(self.robot, q)) < reach
        if likely:
            near &= np.array(self.likely)[:, None]
        # How much the distance of each pair may have changed on the way to every posture.
        way = np.cumsum(self._rates(q) @ np.abs(np.diff(q, axis=1, prepend=q[:, :1])), axis=1)
        place, pair = np.nonzero(near.T)
        postures, last, placed = self._configurations(q), [-np.inf] * len(near), -1
        found = []
        for k, one, gone in zip(place.tolist(), pair.tolist(), way[pair, place].tolist(), strict=True):
            if last[one] - gone < reach:
                if k != placed:
                    self._place(postures[k])
                    placed = k
                value = self._measure(one).min_distance
                last[one] = value + gone
                if value < reach:
                    found.append((k, one, value))
        places, pairs, distances = zip(*found, strict=True) if found else ((), (), ())
        return Nearest(np.array(places, dtype=np.intp), np.array(pairs, dtype=np.intp), np.array(distances))

    def _place(self, posture: Array) -> None:
        """Bring the shapes to a posture as Pinocchio has it."""
        data, measured, _ = self._data
        pin.updateGeometryPlacements(self.robot.model, data, self.shapes, measured, posture)

    def _measure(self, pair: int) -> coal.DistanceResult:
        """Measure a pair where its shapes are; what is returned holds until it is measured again."""
        _, measured, results = self._data
        pin.computeDistance(self.shapes, measured, pair)
        return results[pair]

    def _configurations(self, q: Array) -> list[Array]:
        """Return Pinocchio's configuration of every posture (n, N)."""
        model, back = self.robot.model, np.argsort(self.robot.order)
        plain = model.nq == model.nv
        neutral = pin.neutral(model)
        return [each if plain else pin.integrate(model, neutral, each) for each in np.ascontiguousarray(q[back].T)]

    @property
    def reach(self) -> float:
        """Distance from which on there is room enough, m."""
        return self.margin + WATCHED_DISTANCE

    def rows(self, found: Nearest, samples: int) -> Array:
        """Return what is within reach as rows of limits, 1 at the margin and 0 where there is room, shape (G, N).

        The rooms of all pairs of a group make up one that is a little less than the least of them, and none where that is
        none, and that changes smoothly when another pair becomes the nearest. Where a pair is too near the worst counts alone.
        """
        _, least, parallel = self._rooms(found, samples)
        return 1.0 - np.where(least > 0.0, parallel ** (-1.0 / POWER), least)

    def _rooms(self, found: Nearest, samples: int) -> tuple[Array, Array, Array]:
        """Return the room of every pair, in watched distances, shape (K,), and of each group the least and the sum of powers, (G, N)."""
        room = (found.distance - self.margin) / WATCHED_DISTANCE
        place = self._group[found.pair], found.place
        least, parallel = np.ones((2, len(self.groups), samples))
        np.minimum.at(least, place, room)
        np.add.at(parallel, place, np.where(room > 0.0, room, 1.0) ** -POWER - 1.0)
        return room, least, parallel

    def slopes(self, q: Array, found: Nearest) -> Array:
        """Return the derivative of the rows by the joints, shape (G, n, N)."""
        slope = np.zeros((len(self.groups), q.shape[1], len(q)))
        place = self._group[found.pair], found.place
        room, least, parallel = self._rooms(found, q.shape[1])
        free = least[place] > 0.0
        together = (parallel[place] ** (-1.0 / POWER) / np.where(free, room, 1.0)) ** (POWER + 1.0)
        share = np.where(free, together, room == least[place])
        np.add.at(slope, place, -self.gradients(q, found) * (share / WATCHED_DISTANCE)[:, None])
        return slope.transpose(0, 2, 1)

    def gradients(self, q: Array, found: Nearest) -> Array:
        """Return the derivative of the distances by the joints, shape (K, n)."""
        frames, postures = joint_frames(self.robot, q), self._configurations(q)
        # Nearest points on the first and on the second shape, and the direction from one to the other.
        where = np.empty((len(found.pair), 3, 3))
        placed = -1
        for k, pair, place in zip(where, found.pair.tolist(), found.place.tolist(), strict=True):
            if place != placed:
                self._place(postures[place])
                placed = place
            result = self._measure(pair)
            k[0], k[1], k[2] = result.getNearestPoint1(), result.getNearestPoint2(), result.normal
        axes, origins = (each[:, :, found.place].transpose(2, 0, 1) for each in (frames.axis, frames.origin))
        slope = np.zeros((len(found.pair), len(q)))
        for side, sign, point in zip(self._sides, (-1.0, 1.0), (where[:, 0], where[:, 1]), strict=True):
            way = np.where(frames.prismatic[:, None], axes, np.cross(axes, point[:, None] - origins))
            slope += sign * self._moved_by[side[found.pair]] * np.einsum("kjc,kc->kj", way, where[:, 2])
        return slope

    def _bounds(self, frames: JointFrames) -> Array:
        """Return a lower bound of the distance of every pair, shape (P, N)."""
        centres, radii = self._spheres
        joints = np.array([shape.parentJoint for shape in self.shapes.geometryObjects])
        places = frames.centres(joints, centres)
        first, second = self._sides
        groups = np.array([group for *_, group in self.pairs])
        own = groups == "self"
        found = np.empty((len(groups), places.shape[2]))
        found[own] = np.linalg.norm(places[first[own]] - places[second[own]], axis=1) - radii[second[own], None]
        found[groups == "floor"] = places[first[groups == "floor"], 2] - self.floor
        for number, box in enumerate(self.boxes, 1):
            centre, edges = (np.array(part)[:, None] for part in box)
            beside = groups == f"box{number}"
            out = np.maximum(np.abs(places[first[beside]] - centre) - 0.5 * edges, 0.0)
            found[beside] = np.linalg.norm(out, axis=1)
        return found - radii[first, None]

    def all_distances(self, q: Array) -> Array:
        """Return the distance of every pair at postures (n, N), shape (P, N), m."""
        found = np.empty((len(self.pairs), q.shape[1]))
        for k, posture in enumerate(self._configurations(q)):
            self._place(posture)
            found[:, k] = [self._measure(pair).min_distance for pair in range(len(self.pairs))]
        return found

    def nearest_of(self, posture: Array) -> str:
        """Say which pair is nearest at a posture (n,)."""
        distance = self.all_distances(posture[:, None])[:, 0]
        first, second, _ = self.pairs[int(np.argmin(distance))]
        return (
            f"{link_of(self, first)} comes within {distance.min():.4g} m of {link_of(self, second)}, where {self.margin:g} m "
            "are to be kept"
        )

    def smallest(self, q: Array, group: str) -> float:
        """Return the smallest distance of a group over postures (n, N), m."""
        kept = tuple(pair for pair in self.pairs if pair[2] == group)
        alone = replace(self, pairs=kept, likely=())
        bounds = alone._bounds(joint_frames(self.robot, q))
        least = np.inf
        # Where spheres are nearest first, so that most postures need not be measured.
        for part in np.array_split(np.argsort(bounds.min(axis=0)), max(1, q.shape[1] // 50)):
            if bounds[:, part].min() < least:
                least = float(alone.nearest(q[:, part], least).distance.min(initial=least))
        return least


@dataclass(frozen=True, eq=False)
class Nearest:
    """Pairs that are near at some of N postures.

    Attributes
    ----------
    place, pair : ndarray of int, shape (K,)
        Which posture, and which of all pairs.
    distance : ndarray, shape (K,)
        m; negative where shapes overlap.
    """

    place: NDArray[np.intp]
    pair: NDArray[np.intp]
    distance: Array


def link_of(watched: Clearance, shape: int) -> str:
    """Return the link of a shape, or the name of an obstacle."""
    found = watched.shapes.geometryObjects[shape]
    frame = found.parentFrame
    return str(watched.robot.model.frames[frame].name) if 0 < frame < watched.robot.model.nframes else str(found.name)


@lru_cache(maxsize=4)
def shapes_about(robot: Robot, floor: float, boxes: tuple[Box, ...]) -> pin.GeometryModel:
    """Return shapes of the robot, then the floor and the boxes, without pairs."""
    shapes = collision_shapes(robot)
    found = []
    if np.isfinite(floor):
        found.append(("floor", pin.SE3.Identity(), coal.Halfspace(np.array([0.0, 0.0, 1.0]), floor)))
    for k, (centre, edges) in enumerate(boxes, 1):
        found.append((f"box{k}", pin.SE3(np.eye(3), np.array(centre)), coal.Box(*edges)))
    for name, placement, geometry in found:
        geometry.computeLocalAABB()
        shapes.addGeometryObject(pin.GeometryObject(name, 0, placement, geometry))
    return shapes
