"""The motions that the command line knows by name."""

from __future__ import annotations

from pathlib import Path

from scara_ident.errors import UsageError
from scara_ident.paper import OJD, OJK
from scara_ident.robot.robot import Robot
from scara_ident.simulation.reference import ReferenceMotion, read_trajectory, sampled

_FORMULAS = {"OJK": OJK, "OJD": OJD}
_RECONSTRUCTIONS = ("CI", "L1", "L2")


def named_motion(word: str, robot: Robot) -> ReferenceMotion:
    """Return a motion: that of a trajectory.csv, or on the SCARA03 one of the paper's by its name.

    Raises
    ------
    UsageError
        If it is neither.
    """
    if Path(word).is_file():
        return read_trajectory(Path(word), robot)
    if word not in _FORMULAS and word not in _RECONSTRUCTIONS:
        known = ", ".join((*_FORMULAS, *_RECONSTRUCTIONS))
        raise UsageError(f"trajectory {word!r}: no such file, and not one of {known}")
    if robot.n != 2:
        raise UsageError(f"trajectory {word!r} is the paper's, for its two joints; {robot.name} has {robot.n}")
    if word in _FORMULAS:
        return sampled(word, robot, _FORMULAS[word].motion, _FORMULAS[word].duration)
    from scara_ident.simulation.reconstructions import reconstruction

    return reconstruction(word, robot)
