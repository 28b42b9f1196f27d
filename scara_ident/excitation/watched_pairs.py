"""Which pairs of shapes a motion keeps apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pinocchio as pin

from scara_ident.arrays import Array
from scara_ident.errors import RobotError, UsageError
from scara_ident.excitation.clearance import Box, Clearance, link_of, shapes_about
from scara_ident.robot.collision_shapes import bare_links
from scara_ident.robot.robot import Robot

# Random postures at which pairs are looked at.
POSTURES = 100
# A pair is likely to come near if its least distance there is so much of the range of its distances, or less.
SPREAD = 0.5
# Links of the arm that are never further apart than this touch by design, m.
TOUCHING = 0.02
# How a note begins that says why nothing at all is watched.
UNWATCHED = "Collisions were not checked"


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
    unwatched = UNWATCHED + ": {}; run the motion slowly first."
    try:
        shapes = shapes_about(robot, watched.floor, watched.boxes)
    except RobotError as error:
        return replace(watched, notes=(unwatched.format(error),))
    moved = [shape.parentJoint for shape in shapes.geometryObjects]
    bare = bare_links(robot)
    obstacles = [*(["floor"] if np.isfinite(floor) else []), *(f"box{k + 1}" for k in range(len(boxes)))]
    count, found = shapes.ngeoms - len(obstacles), shapes.geometryObjects
    if not any(moved):
        lacks = f"{robot.urdf.name} has no collision shapes"
        if count:
            lacks += " on the links that move" + (f" ({', '.join(bare)})" if bare else "")
        return replace(watched, notes=(unwatched.format(lacks),))
    notes = (f"Links without a collision shape are not checked: {', '.join(bare)}.",) if bare else ()
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
        return replace(watched, notes=(unwatched.format("all links that have shapes are neighbours"), *notes))
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
    names = [link_of(watched, shape) for shape in range(watched.shapes.ngeoms)]
    left_out = sorted({
        f"{names[first]} and {names[second]}"
        for (first, second, _), never in zip(watched.pairs, touching, strict=True) if never
    })  # fmt: skip
    kept = tuple(pair for pair, never in zip(watched.pairs, touching, strict=True) if not never)
    room = distance[~touching].min(axis=1) - watched.margin
    likely = room < SPREAD * np.ptp(distance[~touching], axis=1)
    said = f"Not kept {watched.margin:g} m apart, because they touch by design or are closer in every posture: {{}}."
    notes = (*watched.notes, said.format("; ".join(left_out))) if left_out else watched.notes
    return replace(watched, pairs=kept, notes=notes, likely=tuple(likely.tolist()))


def _triple(numbers: Sequence[float]) -> tuple[float, float, float]:
    x, y, z = map(float, numbers)
    return x, y, z
