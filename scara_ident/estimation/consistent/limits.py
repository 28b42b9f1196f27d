"""Known masses and bounded centres of mass, as cones on the standard parameters."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from scara_ident.errors import UsageError
from scara_ident.estimation.consistent.cones import Affine, Cones
from scara_ident.estimation.consistent.options import ConsistentOptions, Ellipsoid
from scara_ident.estimation.consistent.shapes import visual_boxes
from scara_ident.robot.robot import Robot

Array = NDArray[np.float64]


def body_limits(robot: Robot, options: ConsistentOptions) -> Cones:
    """Collect what the options say of masses and centres of mass.

    Parameters
    ----------
    robot : Robot
    options : ConsistentOptions

    Returns
    -------
    Cones
        On the 11 n standard parameters, each scaled to its tolerance or size.

    Raises
    ------
    UsageError
        If a link or joint does not exist.
    RobotError
        If the visual shape of a link is asked for and cannot be had.
    """
    unknowns = 11 * robot.n
    rows: list[Affine] = []
    if options.total_mass is not None:
        rows.append(_between(_mass(range(robot.n), unknowns), *options.total_mass))
    for name, (value, tolerance) in options.link_mass.items():
        rows.append(_between(_mass([body_of(robot, name, "link_mass")], unknowns), value, tolerance))
    parts = [Cones.linear(Affine.stacked(rows, unknowns))]
    if options.com == "visual":
        boxes = visual_boxes(robot)
        parts += [Cones.linear(_box(i, low, high, unknowns)) for i, (low, high) in enumerate(boxes)]
    elif not isinstance(options.com, str):
        parts += [_ellipsoid(body_of(robot, name, "com"), e, unknowns) for name, e in options.com.items()]
    return Cones.stacked(parts, unknowns)


def body_of(robot: Robot, name: str, option: str) -> int:
    """Return the place of a body by its link's or joint's name.

    Raises
    ------
    UsageError
        If there is no such link or joint.
    """
    for names in (robot.links, robot.joints):
        if name in names:
            return names.index(name)
    known = ", ".join(robot.links)
    raise UsageError(f"{option}: {name!r} is neither an identified link nor joint; the links are {known}")


def _mass(bodies: Iterable[int], unknowns: int) -> Array:
    row = np.zeros(unknowns)
    row[[10 * i for i in bodies]] = 1.0
    return row


def _between(row: Array, value: float, tolerance: float) -> Affine:
    rows = np.array([row, -row]) / tolerance
    return Affine(rows, np.array([1.0 - value / tolerance, 1.0 + value / tolerance]))


def _box(body: int, low: Array, high: Array, unknowns: int) -> Affine:
    rows = np.zeros((6, unknowns))
    for axis in range(3):
        width = high[axis] - low[axis]
        rows[axis, [10 * body, 10 * body + 1 + axis]] = -low[axis] / width, 1.0 / width
        rows[3 + axis, [10 * body, 10 * body + 1 + axis]] = high[axis] / width, -1.0 / width
    return Affine(rows, np.zeros(6))


def _ellipsoid(body: int, ellipsoid: Ellipsoid, unknowns: int) -> Cones:
    rows = np.zeros((4, unknowns))
    rows[0, 10 * body] = 1.0
    for axis, (centre, radius) in enumerate(zip(ellipsoid.centre, ellipsoid.radii, strict=True)):
        if not radius > 0.0:
            raise UsageError(f"com: a radius of {radius:g} m; expected a length above 0")
        rows[1 + axis, [10 * body, 10 * body + 1 + axis]] = -centre / radius, 1.0 / radius
    none = Affine.none(unknowns)
    return Cones(none, none, Affine(rows, np.zeros(4)))
