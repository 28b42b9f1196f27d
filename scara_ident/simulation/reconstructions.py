"""Reconstructions of L1, L2 and CI, the working trajectories of Indri et al. 2002, for the SCARA03.

The paper draws them in a figure that is lost and prints of them only the duration, the range of q2, the four peaks of
Table 1 and the indexes J_d and J_k. The paths here, with a trapezoidal law, were found by least squares on those
figures and nothing else; other paths may fit as well. They are not the paper's trajectories, and everything that
shows them must say so.
"""

from __future__ import annotations

from dataclasses import dataclass

from scara_ident.errors import UsageError
from scara_ident.paper import TRAJECTORIES
from scara_ident.paper.tables import DURATION
from scara_ident.robot.robot import Robot, load_robot
from scara_ident.simulation.laws import MotionLaw
from scara_ident.simulation.paths import circle, line
from scara_ident.simulation.reference import ReferenceMotion

# Where the elbow is sought: q2 is positive on all three.
ELBOW = (1.2, 1.3)


@dataclass(frozen=True)
class LinePath:
    """There and back along a line; points in the base's frame, m."""

    start: tuple[float, float]
    end: tuple[float, float]
    law: MotionLaw


@dataclass(frozen=True)
class CirclePath:
    """Around a circle; m, rad."""

    centre: tuple[float, float]
    radius: float
    start_angle: float
    turns: float
    law: MotionLaw


RECONSTRUCTIONS: dict[str, LinePath | CirclePath] = {
    "L1": LinePath((-0.5478, 0.2694), (0.1834, 0.3844), MotionLaw("trapezoidal", 0.2385, 2, 0.2749)),
    "L2": LinePath((-0.1155, 0.3317), (-0.2339, 0.5524), MotionLaw("trapezoidal", 0.2758, 2, 0.1078)),
    "CI": CirclePath((-0.1265, 0.4627), 0.1403, 1.57, 2.0, MotionLaw("trapezoidal", 0.0816, 1, 0.1673)),
}


def reconstruction(name: str, robot: Robot | None = None, *, rate: float = 1000.0) -> ReferenceMotion:
    """Return the reconstruction of one of the paper's working trajectories.

    Parameters
    ----------
    name : {"L1", "L2", "CI"}
    robot : Robot, optional
        The SCARA03, by default the embedded one; links of 0.33 m are what the paths were found for.
    rate : float
        Samples per second.

    Raises
    ------
    UsageError
        Another name, or an arm of another number of joints.
    """
    if name not in RECONSTRUCTIONS:
        raise UsageError(f"no reconstruction of {name!r}; there are {', '.join(RECONSTRUCTIONS)}")
    robot = load_robot() if robot is None else robot
    if robot.n != 2:
        raise UsageError(f"{robot.name} has {robot.n} joints; the reconstruction of {name} is for the SCARA03's two")
    path = RECONSTRUCTIONS[name]
    duration = DURATION[TRAJECTORIES.index(name)]
    if isinstance(path, LinePath):
        return line(robot, path.start, path.end, duration, near=ELBOW, law=path.law, rate=rate, name=name)
    return circle(
        robot, path.centre, path.radius, duration, near=ELBOW, start_angle=path.start_angle, turns=path.turns,
        law=path.law, rate=rate, name=name,
    )  # fmt: skip
