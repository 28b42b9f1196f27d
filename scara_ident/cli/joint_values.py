"""Options that give values of joints, such as ``--torque joint1=1.5``."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from scara_ident.errors import UsageError

if TYPE_CHECKING:
    from scara_ident.excitation import Limits
    from scara_ident.robot.robot import Robot

Range = tuple[float, float]
Triple = tuple[float, float, float]


def joint_numbers(words: Sequence[str] | None, option: str) -> dict[str, float]:
    """Read ``JOINT=NUMBER`` words of an option."""
    return {name: _number(text, option, word) for word in words or () for name, text in [_parted(word, option)]}


def joint_ranges(words: Sequence[str] | None, option: str) -> dict[str, Range]:
    """Read ``JOINT=LOWER..UPPER`` words of an option."""
    found: dict[str, Range] = {}
    for word in words or ():
        name, text = _parted(word, option)
        lower, dots, upper = text.partition("..")
        if not dots:
            raise UsageError(f"{option} {word}: expected JOINT=LOWER..UPPER, such as joint1=-1.5..1.5")
        found[name] = (_number(lower, option, word), _number(upper, option, word))
    return found


def numbers(word: str | None, option: str) -> list[float] | None:
    """Read numbers parted by commas; None where nothing is given."""
    return None if word is None else [_number(text, option, word) for text in word.split(",")]


def motion_limits(
    robot: Robot,
    *,
    ranges: Sequence[str] | None,
    velocities: Sequence[str] | None,
    accelerations: Sequence[str] | None,
    jerks: Sequence[str] | None,
    torques: Sequence[str] | None,
    boxes: Sequence[str] | None,
    floor: float | None,
    **more: Any,
) -> Limits:
    """Return the limits of a motion from the words of their options; ``more`` are arguments of `limits_of`."""
    from scara_ident.excitation import limits_of

    return limits_of(
        robot,
        ranges=joint_ranges(ranges, "--range"),
        velocities=joint_numbers(velocities, "--velocity"),
        accelerations=joint_numbers(accelerations, "--acceleration"),
        jerks=joint_numbers(jerks, "--jerk"),
        torques=joint_numbers(torques, "--torque"),
        boxes=_boxes(boxes, "--box"),
        floor=-math.inf if floor is None else floor,
        **more,
    )


def _boxes(words: Sequence[str] | None, option: str) -> list[tuple[Triple, Triple]]:
    """Read ``X,Y,Z,DX,DY,DZ`` words of an option: centres and edges."""
    found = []
    for word in words or ():
        values = numbers(word, option) or []
        if len(values) != 6:
            raise UsageError(f"{option} {word}: expected X,Y,Z,DX,DY,DZ, such as 0.6,0,0.2,0.4,0.4,0.4")
        x, y, z, *edges = values
        found.append(((x, y, z), (edges[0], edges[1], edges[2])))
    return found


def _parted(word: str, option: str) -> tuple[str, str]:
    name, sign, text = word.partition("=")
    if not (name and sign and text):
        raise UsageError(f"{option} {word}: expected JOINT=VALUE, such as joint1=1.5")
    return name, text


def _number(text: str, option: str, word: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise UsageError(f"{option} {word}: {text!r} is not a number") from None
