"""Distances that a motion keeps: between the links of the arm, to a floor and to boxes.

Shapes are those of the URDF. Bounding spheres tell which pairs may be near at all; of these Coal finds the distance, and
the nearest points with the direction between them give its derivative by the joints.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from pinocchio import coal

from scara_ident.arrays import Array
from scara_ident.errors import RobotError, UsageError
from scara_ident.excitation.joint_frames import JointFrames, joint_frames, joints_of
from scara_ident.manners import Frozen
from scara_ident.robot.collision_shapes import bare_links, collision_shapes
from scara_ident.robot.kinematics import place_of
from scara_ident.robot.robot import Robot

# Centre and edges of a box along the axes of the base, m.
Box = tuple[tuple[float, float, float], tuple[float, float, float]]

# Distances are told apart up to so much more than the margin, m.
REACH = 0.05
# Of Coal's search for nearest points, m; and where it begins.
TOLERANCE = 1e-8
GUESS, HINT = np.array([1.0, 0.0, 0.0]), np.zeros(2, dtype=np.int32)
# Random postures at which pairs are looked at.
POSTURES = 100
# A pair is likely to come near if its least distance there is so much of the range of its distances, or less.
SPREAD = 0.5
# Links of the arm that are never further apart than this touch by design, m.
TOUCHING = 0.02


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

    @property
    def groups(self) -> tuple[str, ...]:
        """Groups with a pair, in order."""
        return tuple(dict.fromkeys(group for *_, group in self.pairs))

    @cached_property
    def shapes(self) -> pin.GeometryModel:
        """Shapes of the robot, then the floor and the boxes, with the pairs."""
        shapes = pin.GeometryModel(_shapes_about(self.robot, self.floor, self.boxes))
        for first, second, _ in self.pairs:
            shapes.addCollisionPair(pin.CollisionPair(first, second))
        return shapes

    @cached_property
    def _data(self) -> tuple[pin.Data, pin.GeometryData, list[coal.DistanceRequest], list[coal.DistanceResult]]:
        measured = self.shapes.createData()
        requests = list(measured.distanceRequests)
        for request in requests:
            request.gjk_tolerance = TOLERANCE
        return self.robot.model.createData(), measured, requests, list(measured.distanceResults)

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

    def nearest(self, q: Array, reach: float = np.inf, *, likely: bool = False) -> Nearest:
        """Measure the smallest distance of each group.

        Parameters
        ----------
        q : ndarray, shape (n, N)
            rad or m.
        reach : float
            Distances from this on need not be told apart, m.
        likely : bool
            Whether to look at likely pairs alone.
        """
        groups = self.groups
        distance = np.full((len(groups), q.shape[1]), reach)
        nearest = np.full(distance.shape, -1, dtype=np.intp)
        bounds = self._bounds(joint_frames(self.robot, q))
        # How much the distance of each pair may have changed on the way to every posture.
        way = np.cumsum(self._rates(q) @ np.abs(np.diff(q, axis=1, prepend=q[:, :1])), axis=1)
        near = np.flatnonzero(np.any(bounds < reach, axis=1) & (self.likely if likely else True))
        postures, measure = self._configurations(q), self._measure
        # Pairs that are near on the whole come first: beside them most others need not be measured.
        for pair in near[np.argsort(bounds[near].mean(axis=1), kind="stable")].tolist():
            group = groups.index(self.pairs[pair][2])
            least, found = distance[group], nearest[group]
            places = np.flatnonzero(bounds[pair] < least)
            last = -np.inf
            for k, gone, most in zip(places.tolist(), way[pair, places].tolist(), least[places].tolist(), strict=True):
                if last - gone < most:
                    value = measure(pair, postures[k]).min_distance
                    last = value + gone
                    if value < most:
                        least[k], found[k] = value, pair
        return Nearest(distance, nearest)

    def _measure(self, pair: int, posture: Array) -> coal.DistanceResult:
        """Measure a pair at a posture as Pinocchio has it; what is returned holds until the next measurement."""
        data, measured, requests, results = self._data
        # Coal begins where it last ended, so that digits would depend on what was measured before.
        requests[pair].cached_gjk_guess, requests[pair].cached_support_func_guess = GUESS, HINT
        pin.updateGeometryPlacements(self.robot.model, data, self.shapes, measured, posture)
        pin.computeDistance(self.shapes, measured, pair)
        return results[pair]

    def _configurations(self, q: Array) -> list[Array]:
        """Return Pinocchio's configuration of every posture (n, N)."""
        model, back = self.robot.model, np.argsort(self.robot.order)
        plain = model.nq == model.nv
        neutral = pin.neutral(model)
        return [each if plain else pin.integrate(model, neutral, each) for each in np.ascontiguousarray(q[back].T)]

    def slopes(self, q: Array, found: Nearest) -> Array:
        """Return the derivative of the distances by the joints, shape (G, n, N); 0 where they were not measured."""
        frames = joint_frames(self.robot, q)
        slope = np.zeros((len(found.distance), *q.shape))
        group, place = np.nonzero(found.pair >= 0)
        chosen, postures = found.pair[group, place], self._configurations(q[:, place])
        # Nearest points on the first and on the second shape, and the direction from one to the other.
        where = np.empty((3, 3, len(chosen)))
        for k, (pair, posture) in enumerate(zip(chosen.tolist(), postures, strict=True)):
            result = self._measure(pair, posture)
            where[:, :, k] = result.getNearestPoint1(), result.getNearestPoint2(), result.normal
        axes, origins = frames.axis[:, :, place], frames.origin[:, :, place]
        slides = frames.prismatic[:, None, None]
        for side, sign, point in zip(self._sides, (-1.0, 1.0), where[:2], strict=True):
            arm = np.cross(axes, point - origins, axis=1)
            moved = self._moved_by[side[chosen]].T
            slope[group, :, place] += sign * (moved * np.einsum("jcN,cN->jN", np.where(slides, axes, arm), where[2])).T
        return slope

    @property
    def reach(self) -> float:
        """Distance from which on there is room enough, m."""
        return self.margin + REACH

    def rows(self, found: Nearest) -> Array:
        """Return distances within reach as rows of limits, 1 at the margin and 0 where there is room, shape (G, N)."""
        return 1.0 - (found.distance - self.margin) / REACH

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
        pairs, measure = range(len(self.pairs)), self._measure
        each = [[measure(pair, posture).min_distance for pair in pairs] for posture in self._configurations(q)]
        return np.array(each).reshape(q.shape[1], len(pairs)).T

    def nearest_of(self, posture: Array) -> str:
        """Say which pair is nearest at a posture (n,)."""
        distance = self.all_distances(posture[:, None])[:, 0]
        first, second, _ = self.pairs[int(np.argmin(distance))]
        return (
            f"{_link(self, first)} comes within {distance.min():.4g} m of {_link(self, second)}, where {self.margin:g} m "
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
                least = min(least, float(alone.nearest(q[:, part], least).distance.min()))
        return least


@dataclass(frozen=True, eq=False)
class Nearest:
    """Smallest distances of groups at postures, and of which pairs they are.

    Attributes
    ----------
    distance : ndarray, shape (G, N)
        m; negative where shapes overlap, and what was asked as reach where none is nearer.
    pair : ndarray of int, shape (G, N)
        Which it is of all pairs; -1 where none is nearer than the reach.
    """

    distance: Array
    pair: NDArray[np.intp]


def clearance_of(
    robot: Robot,
    lower: Array,
    upper: Array,
    *,
    margin: float,
    floor: float = -np.inf,
    boxes: Sequence[Box] = (),
) -> Clearance:
    """Choose the pairs of shapes that a motion keeps apart.

    Shapes of one body and of links that a joint connects are not watched, nor are two shapes of the arm that overlap both
    at the neutral posture and in the middle of the ranges, or are never 2 cm (or the margin) apart; nor any pair that, in
    every posture tried, touches, or is nearer than the margin without touching.

    Parameters
    ----------
    robot : Robot
    lower, upper : ndarray, shape (n,)
        Ranges, rad or m.
    margin : float
        m.
    floor : float
        Height, m.
    boxes : sequence of Box

    Raises
    ------
    UsageError
        If the margin is negative, or a box has no size.
    """
    if not 0.0 <= margin < np.inf:
        raise UsageError(f"clearance {margin:g} m: expected 0 or more")
    for centre, edges in boxes:
        if not (np.all(np.isfinite(centre)) and np.all(np.isfinite(edges)) and min(edges) > 0.0):
            raise UsageError(f"box at {centre} with edges {edges}: expected finite places and edges above 0, in m")
    kept = tuple((_triple(centre), _triple(edges)) for centre, edges in boxes)
    watched = Clearance(robot, float(margin), float(floor), kept, (), ())
    unwatched = "Collisions were not looked for: {}; rehearse the motion slowly."
    try:
        shapes = _shapes_about(robot, watched.floor, watched.boxes)
    except RobotError as error:
        return replace(watched, notes=(unwatched.format(error),))
    moved = [shape.parentJoint for shape in shapes.geometryObjects]
    if not any(moved):
        return replace(watched, notes=(unwatched.format(f"{robot.urdf.name} has no collision shapes"),))
    bare = bare_links(robot)
    notes = (f"Links without a collision shape are not watched: {', '.join(bare)}.",) if bare else ()
    obstacles = [*(["floor"] if np.isfinite(floor) else []), *(f"box{k + 1}" for k in range(len(boxes)))]
    count, found = shapes.ngeoms - len(obstacles), shapes.geometryObjects
    pairs = [
        (i, j, "self")
        for i in range(count)
        for j in range(i + 1, count)
        if moved[i] != moved[j]
        and not _hangs(robot.model, found[i], found[j])
        and not _hangs(robot.model, found[j], found[i])
    ]
    pairs += [(i, count + k, name) for k, name in enumerate(obstacles) for i in range(count) if moved[i]]
    if not pairs:
        return replace(watched, notes=(unwatched.format("all links that have shapes hang on one another"),))
    return _parted(replace(watched, pairs=tuple(pairs), notes=notes), lower, upper)


def _hangs(model: pin.Model, shape: pin.GeometryObject, on: pin.GeometryObject) -> bool:
    """Whether a joint that moves connects a shape's link to that of another; what is fixed to either is a link of its own."""
    joint = model.frames[model.frames[shape.parentFrame].parentFrame]
    return bool(joint.type == pin.FrameType.JOINT and joint.parentFrame == on.parentFrame)


def _parted(watched: Clearance, lower: Array, upper: Array) -> Clearance:
    """Leave out the pairs that touch where the designer of the arm let them, and those that no motion parts."""
    drawn = np.random.default_rng(0).uniform(lower, upper, (POSTURES, len(lower)))
    postures = np.vstack([np.clip(np.zeros(len(lower)), lower, upper), 0.5 * (lower + upper), drawn]).T
    distance = watched.all_distances(postures)
    own = np.array([group == "self" for *_, group in watched.pairs])
    near = np.all(distance < min(watched.margin, TOUCHING), axis=1)
    touching = own & (near | np.all(distance[:, :2] <= 0.0, axis=1)) | np.all(distance <= 0.0, axis=1)
    # What comes apart and collides is watched, though the margin be more than it can have: the design then says so.
    touching |= np.all((distance > 0.0) & (distance < watched.margin), axis=1)
    names = [_link(watched, shape) for shape in range(watched.shapes.ngeoms)]
    left_out = sorted({
        f"{names[first]} and {names[second]}"
        for (first, second, _), never in zip(watched.pairs, touching, strict=True) if never
    })  # fmt: skip
    kept = tuple(pair for pair, never in zip(watched.pairs, touching, strict=True) if not never)
    room = distance[~touching].min(axis=1) - watched.margin
    likely = room < SPREAD * np.ptp(distance[~touching], axis=1)
    said = f"Not kept {watched.margin:g} m apart, as they touch by design, or never: {{}}."
    notes = (*watched.notes, said.format("; ".join(left_out))) if left_out else watched.notes
    return replace(watched, pairs=kept, notes=notes, likely=tuple(likely.tolist()))


def _link(watched: Clearance, shape: int) -> str:
    """Return the link of a shape, or the name of an obstacle."""
    found = watched.shapes.geometryObjects[shape]
    frame = found.parentFrame
    return str(watched.robot.model.frames[frame].name) if 0 < frame < watched.robot.model.nframes else str(found.name)


def _triple(numbers: Sequence[float]) -> tuple[float, float, float]:
    x, y, z = map(float, numbers)
    return x, y, z


@lru_cache(maxsize=4)
def _shapes_about(robot: Robot, floor: float, boxes: tuple[Box, ...]) -> pin.GeometryModel:
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
