"""Which joints of a URDF a log's channels belong to, and which only hang on the arm: wheels, grippers."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from scara_ident.arrays import Array
from scara_ident.calling import asked_for
from scara_ident.errors import UsageError
from scara_ident.robot.description import RobotDescription
from scara_ident.robot.robot import Robot, build_robot


def arm_of(urdf: Path, pattern: str | None = None) -> Robot:
    """Return the arm of a URDF: its joints but for coupled ends (see `scara_ident.robot.mimic`), or those of a pattern.

    Parameters
    ----------
    pattern : str, optional
        Regular expression that the whole name of a joint must match.

    Raises
    ------
    RobotError
        The URDF cannot be used.
    UsageError
        The pattern is no regular expression, or no joint matches it.
    """
    whole = RobotDescription(urdf=urdf.resolve(), effort_side="joint")
    arm = build_robot(whole, urdf)
    if pattern is None:
        return arm
    names = (*arm.joints, *(name for name, _ in arm.locked))
    try:
        wanted = [name for name in names if re.fullmatch(pattern, name)]
    except re.error as error:
        raise UsageError(
            f"{asked_for('--joints')}: {pattern!r} is no regular expression: {error}; as in 'arm_.*'"
        ) from None
    if not wanted:
        raise UsageError(f"{asked_for('--joints')}: {pattern!r} matches no joint; {urdf} has {', '.join(names)}")
    return build_robot(whole.model_copy(update={"joints": dict.fromkeys(wanted)}), urdf)


def numbered_joints(robot: Robot, count: int) -> list[int] | None:
    """Return the joints that ``count`` numbered channels belong to, in order; None where that is open.

    Tried are all joints, then those without ends that hang on the arm beside others, then the longest chain: a log of an
    arm has no channels of wheels, fingers and heads. A chain counts from the base outwards, all joints as the URDF does.
    """
    ends = _is_end(robot)
    alone = [k for k in range(robot.n) if not ends[k]]
    chain = longest_chain(robot)
    for joints in (list(range(robot.n)), alone, chain):
        if len(joints) == count:
            return chain if sorted(joints) == sorted(chain) else joints
    return list(range(robot.n)) if count > robot.n else None


def with_locked(
    joints: Sequence[int],
    positions: Mapping[int, str],
    efforts: Mapping[int, str],
    numbers: Mapping[str, Array],
    robot: Robot,
) -> tuple[list[int], dict[str, float | None], list[str]]:
    """Lock joints without channels, those that neither move nor are driven, and ends beside others without effort.

    Parameters
    ----------
    joints : sequence of int
        With channels.
    positions, efforts : mapping of int to str
        Columns by joint; no efforts where the file has none.
    numbers : mapping of str to ndarray
        Columns of the file.

    Returns
    -------
    joints : list of int
        Those to identify.
    locked : dict of str to float or None
        The others and where they stood, rad or m; None where the file does not say it.
    """
    notes = []
    lacking = [robot.joints[k] for k in range(robot.n) if k not in joints]
    if lacking:
        notes.append(f"no channels for {', '.join(lacking)}: taken as locked")
    still = [k for k in joints if k in efforts and is_still(numbers[efforts[k]])]
    idle = [k for k in still if is_still(numbers[positions[k]])]
    ends = _is_end(robot)
    beside = [k for k in still if k not in idle and ends[k]]
    for group, why in (
        (idle, "position and effort are constant"),
        (beside, "carries no joint, and effort is constant"),
    ):
        if group:
            notes.append(f"{', '.join(robot.joints[k] for k in group)}: {why}: taken as locked")
    kept = [k for k in joints if k not in (*idle, *beside)]
    left = [robot.joints[k] for k in range(robot.n) if k not in kept]
    locked = {name: _place(name, numbers) for name in (*left, *(name for name, _ in robot.locked))}
    return kept, locked, notes


def is_still(values: Array) -> bool:
    """Tell whether a column has one value only, or none."""
    finite = values[np.isfinite(values)]
    return not len(finite) or bool(np.ptp(finite) == 0.0)


def longest_chain(robot: Robot) -> list[int]:
    """Return the joints of the longest serial chain, from the base outwards; the first of equal ones."""
    parents = _parents(robot)
    chains = []
    for joint in range(robot.n):
        chain = [joint]
        while parents[chain[0]] is not None:
            chain.insert(0, int(parents[chain[0]] or 0))
        chains.append(chain)
    return max(chains, key=len)


def _is_end(robot: Robot) -> list[bool]:
    parents = _parents(robot)
    return [joint not in parents and parents.count(parents[joint]) > 1 for joint in range(robot.n)]


def _parents(robot: Robot) -> Sequence[int | None]:
    """Return the joint that carries each joint; None for one on the base."""
    place = {int(index): joint for joint, index in enumerate(robot.order)}
    return [place.get(int(robot.model.parents[int(index) + 1]) - 1) for index in robot.order]


def _place(joint: str, numbers: Mapping[str, Array]) -> float | None:
    """Return where a locked joint stood, from a column that is in SI by its name."""
    values = _positions(joint, numbers)
    return float(np.median(values)) if len(values) else None


def _positions(joint: str, numbers: Mapping[str, Array]) -> Array:
    values = numbers.get(f"{joint}.position", np.zeros(0))
    return np.asarray(values[np.isfinite(values)])
