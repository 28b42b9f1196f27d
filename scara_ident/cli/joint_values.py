"""Options that give values of joints, such as ``--torque joint1=1.5``."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial, wraps
from inspect import Parameter, signature
from typing import TYPE_CHECKING, Any, get_type_hints

from scara_ident.cli import options
from scara_ident.errors import UsageError

if TYPE_CHECKING:
    from scara_ident.excitation import Limits
    from scara_ident.robot.robot import Robot

Range = tuple[float, float]
Triple = tuple[float, float, float]
_OPTIONS = {
    "velocities": "--velocity", "accelerations": "--acceleration", "jerks": "--jerk", "torques": "--torque",
    "powers": "--power",
}  # fmt: skip


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


def limits_by_joint(ranges: Sequence[str] | None, **numbers: Sequence[str] | None) -> dict[str, Any]:
    """Read the limits of joints by kind: ``velocities=`` words of ``--velocity``, and so on."""
    return {"ranges": joint_ranges(ranges, "--range")} | {
        kind: joint_numbers(words, _OPTIONS[kind]) for kind, words in numbers.items()
    }


def motion_limits(
    robot: Robot,
    ranges: options.Ranges = None,
    velocities: options.Velocities = None,
    accelerations: options.Accelerations = None,
    jerks: options.Jerks = None,
    torques: options.Torques = None,
    share: options.Share = 0.8,
    floor: options.Floor = None,
    boxes: options.Boxes = None,
    clearance: options.Clearance = 0.01,
    tool: options.Tool = None,
    tool_acceleration: options.ToolAcceleration = None,
    tool_speed: options.ToolSpeed = None,
) -> Limits:
    """Return the limits of a motion from the words of their options."""
    from scara_ident.excitation import limits_of

    return limits_of(
        robot,
        **limits_by_joint(ranges, velocities=velocities, accelerations=accelerations, jerks=jerks, torques=torques),
        share=share,
        floor=-math.inf if floor is None else floor,
        boxes=_boxes(boxes, "--box"),
        clearance=clearance,
        tool=tool,
        tool_acceleration=tool_acceleration,
        tool_speed=math.inf if tool_speed is None else tool_speed,
    )


def with_motion_limits(command: Callable[..., Any]) -> Callable[..., Any]:
    """Return a command with the options of `motion_limits` instead of its argument ``limits``, a function of the robot."""
    # The robot and the limits are no options, and their modules take time to import.
    unread = {"Robot": Any, "Limits": Any}
    types = get_type_hints(motion_limits, localns=unread, include_extras=True)
    given = [p.replace(annotation=types[p.name]) for p in list(signature(motion_limits).parameters.values())[1:]]

    @wraps(command)
    def limited(*arguments: Any, **words: Any) -> Any:
        limits = {each.name: words.pop(each.name, each.default) for each in given}
        return command(*arguments, limits=partial(motion_limits, **limits), **words)

    own = get_type_hints(command, localns=unread, include_extras=True)
    found: list[Parameter] = []
    for each in signature(command).parameters.values():
        found += given if each.name == "limits" else [each.replace(annotation=own[each.name])]
    return options.with_signature(limited, found)


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
