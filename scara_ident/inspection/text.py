"""A first ``robot.yaml`` with comments that say what was guessed and what is left to state."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from scara_ident.inspection.guess import Guess
from scara_ident.inspection.signals import Signal
from scara_ident.robot.robot import Robot
from scara_ident.robot.rotors import GUESS_FACTOR
from scara_ident.robot.signal_map import PARTIAL, fill
from scara_ident.robot.units import DRIVE, table_of

_PLAIN = re.compile(r"[A-Za-z_][A-Za-z0-9_-]*")
# Words that YAML takes for truth values or for nothing.
_TAKEN = frozenset(["y", "n", "yes", "no", "on", "off", "true", "false", "null"])


def description_text(guess: Guess, robot: Robot, described: Mapping[str, Any], urdf: Path, recording: Path) -> str:
    """Write a robot description.

    Parameters
    ----------
    robot : Robot
        All joints of the URDF.
    described : mapping
        The key ``recording``; see `mapping`.
    urdf : Path
        As it is to stand in the file.
    recording : Path
        The file that was inspected, named in a comment.
    """
    lines = [
        f"# First description of {_line(robot.name)}, guessed by `scara-ident inspect` from {_line(recording.name)} and the URDF.",
        "# Check every line; the program cannot know the values marked STATE.",
        f"urdf: {_word(str(urdf))}",
        "",
        *_side(robot),
        "",
        *_joints_words(robot),
    ]
    lines += _rotor_words(guess, robot)
    lines += _joints(guess, robot)
    if guess.locked and guess.joints:
        lines += ["", *_locked(guess)]
    lines += ["", *_recording(described, has_clock=guess.time is not None)]
    lines += ["", "# gravity: [0, 0, -9.81]   # in the base frame; state it if the base is not upright"]
    for kind, said in (("missing", guess.problems), ("note", guess.notes)):
        lines += [f"# {kind}: {_line(text)}" for text in said]
    return "\n".join(lines) + "\n"


def _line(text: str) -> str:
    """Return a text that stays in the comment that it stands in."""
    return " ".join(text.split())


def mapping(guess: Guess, robot: Robot) -> dict[str, Any]:
    """Return the key ``recording`` of a guess; empty where the columns are the contract's, in SI."""
    result: dict[str, Any] = {}
    if guess.time is not None and (guess.time, guess.time_unit) != ("time", "s"):
        result["time"] = {"column": guess.time, "unit": guess.time_unit}
    for quantity, signal in guess.signals.items():
        described = _signal(signal, guess, robot)
        if described:
            result[quantity] = described
    return result


def _side(robot: Robot) -> list[str]:
    if all(robot.reduction == 1.0):
        return [
            "# Side of the gear on which effort is measured, motor or joint. Without a known gear both are the same;",
            "# STATE the reductions below and the side if it is the motor's.",
            "effort_side: joint",
        ]
    return [
        "# STATE on which side of the gear effort is measured: motor or joint. Remove the # of the right line.",
        "# effort_side: motor",
        "# effort_side: joint",
    ]


def _joints_words(robot: Robot) -> list[str]:
    """Say what stands at the joints, of those that slide in metres."""
    first = (
        "# Joints to identify, in order. reduction: motor turns per joint turn (from the URDF's transmissions, else 1);"
    )
    if not np.any(robot.prismatic):
        return [first, "# effort_gain: torque in N m = effort_gain x recorded effort."]
    return [
        first,
        "# of a joint that slides motor rad per metre: 2 pi over a screw's lead or a linear motor's pole pitch, 1 over the",
        "# radius of a pinion or pulley. effort_gain: torque in N m, or force in N, = effort_gain x recorded effort.",
    ]


def _rotor_words(guess: Guess, robot: Robot) -> list[str]:
    if all(robot.rotor_stated[k] for k in guess.joints):
        return []
    slides = ", kg where it slides" if any(robot.prismatic[k] for k in guess.joints) else ""
    return [
        "# STATE rotor_inertia, kg m^2 of the rotor with shaft, brake and wave generator, on the motor's side of the gear",
        f"# (with reduction 1: seen at the joint{slides}). Gear loss, elasticity and backlash depend on it. The numbers behind # are",
        f"# guesses from the effort limits, good to a factor of {GUESS_FACTOR:g}: if not stated, the search starts from them.",
    ]


def _rotor(robot: Robot, joint: int) -> str:
    """Return the guess of a rotor's inertia that nobody stated, on the motor's side of the reduction in the file."""
    if robot.rotor_stated[joint]:
        return ""
    guess = robot.rotor_guess
    value = float(guess.armature[joint] / robot.reduction[joint] ** 2)
    source = "effort limit" if guess.by_limit[joint] else "links' inertia"
    return f"rotor_inertia: {value:.1e} from the {source}" if value > 0.0 else ""


def _joints(guess: Guess, robot: Robot) -> list[str]:
    if not guess.joints:
        return ["# joints:", *(f"#   {_word(name)}: {{}}" for name in robot.joints)]
    effort = guess.signals.get("effort")
    lines = ["joints:"]
    for k in guess.joints:
        unit = None if effort is None else effort.units.get(k)
        entry = f"  {_word(robot.joints[k])}: {{reduction: {_number(float(robot.reduction[k]))}"
        comment = ""
        if effort is not None and (unit is None or unit in DRIVE):
            entry += ", effort_gain: 1.0"
            force = "N" if robot.prismatic[k] else "N m"
            shares = {"A": "per A", "mA": "per A", "%": "at 100 %", "permille": "at 100 %"}
            comment = f"   # STATE effort_gain, {force} {shares.get(unit or '', 'per recorded unit')}"
        rotor = _rotor(robot, k)
        if rotor:
            comment = f"{comment}; {rotor}" if comment else f"   # STATE {rotor}"
        lines.append(f"{entry}}}{comment}")
    return lines


def _locked(guess: Guess) -> list[str]:
    places = ", ".join(f"{_word(name)}: {0.0 if at is None else round(at, 6)!r}" for name, at in guess.locked.items())
    open_ = any(at is None for at in guess.locked.values())
    said = "# STATE the position of those with 0.0, rad or m: the file has no channels for them."
    return [said if open_ else "# Positions of these, rad or m, from the file.", f"locked: {{{places}}}"]


def _recording(described: Mapping[str, Any], *, has_clock: bool) -> list[str]:
    state = [] if has_clock else ["# STATE the rate, samples per second, if the rows are even: no clock was found."]
    if not described and state:
        return [*state, "# recording:", "#   time: {rate: 100}"]
    if not described:
        return ["# Columns are time, <joint>.position, <joint>.effort, in SI: no key recording is needed."]
    lines = ["# Columns of the recordings and their units.", "recording:"]
    lines += [*(f"  {line}" for line in state), *(["  # time: {rate: 100}"] if state else [])]
    for key, value in described.items():
        if not isinstance(value, dict):
            lines.append(f"  {key}: {json.dumps(value, ensure_ascii=False)}")
        elif "columns" in value:
            rest = {name: item for name, item in value.items() if name != "columns"}
            lines += [f"  {key}:", "    columns:"]
            lines += [f"      {_word(joint)}: {_quoted(column)}" for joint, column in value["columns"].items()]
            lines += [f"    {name}: {_flow(item)}" for name, item in rest.items()]
        else:
            lines.append(f"  {key}: {_flow(value)}")
    return lines


def _signal(signal: Signal, guess: Guess, robot: Robot) -> dict[str, Any]:
    own = [k for k in guess.joints if k in signal.columns]
    if len(own) < len(guess.joints) and signal.quantity not in PARTIAL:
        return {}
    joints, columns = [robot.joints[k] for k in own], [signal.columns[k] for k in own]
    result: dict[str, Any] = {}
    if columns != [f"{joint}.{signal.quantity}" for joint in joints]:
        result |= _places(signal, joints, columns, len(guess.joints))
    # The default of a robot description is the SI unit.
    usual = {
        k: next(iter(table_of(signal.quantity, linear=bool(robot.prismatic[k]) and signal.side == "joint")))
        for k in own
    }
    units = {robot.joints[k]: signal.units[k] for k in own if signal.units.get(k, usual[k]) != usual[k]}
    if units or (result and signal.units):
        every = {robot.joints[k]: signal.units.get(k, usual[k]) for k in own}
        result["unit"] = next(iter(every.values())) if len(set(every.values())) == 1 else every
    if signal.side == "motor":
        result["side"] = "motor"
    return result


def _places(signal: Signal, joints: list[str], columns: list[str], every: int) -> dict[str, Any]:
    pattern = signal.pattern
    if len(joints) == every and [fill(pattern, joint, index) for index, joint in enumerate(joints)] == columns:
        return {"column": pattern}
    return {"columns": dict(zip(joints, columns, strict=True))}


def _number(value: float) -> str:
    return str(int(value)) if value.is_integer() and abs(value) < 1e9 else repr(value)


def _flow(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_word(str(key))}: {_flow(item)}" for key, item in value.items()) + "}"
    return _quoted(value) if isinstance(value, str) and not _is_plain(value) else str(value)


def _word(text: str) -> str:
    return text if _is_plain(text) else _quoted(text)


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)


def _is_plain(text: str) -> bool:
    return bool(_PLAIN.fullmatch(text)) and text.lower() not in _TAKEN
