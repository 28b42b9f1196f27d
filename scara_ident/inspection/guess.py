"""Which columns of a file are the channels of an arm, from their names and numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import takewhile

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.inspection.chain import is_still, with_locked
from scara_ident.inspection.efforts import is_computed, is_torque, why_taken
from scara_ident.inspection.names import (
    CURRENT,
    JOINT_STATES,
    LINK_SIDE,
    TORQUE,
    Meaning,
    nameless,
    states_as_positions,
)
from scara_ident.inspection.second_encoder import second_encoder
from scara_ident.inspection.signals import Signal, groups, of_group, of_other_kind, short_together
from scara_ident.inspection.values import (
    Reading,
    averages,
    one_multiple,
    position_readings,
    slopes,
    time_unit,
    velocity_reading,
)
from scara_ident.recording.one_clock import on_one_clock
from scara_ident.robot.robot import Robot
from scara_ident.robot.units import COUNT, DRIVE, TIME, Unit, find_unit, table_of

CLOCKS = ("time", "__time", "timestamp", "t")
"""Names of clocks; where a file has several, the first of these is taken."""

# Of a format in SI: when the state was measured, and when it was received.
STATED_CLOCKS = ("time", "receive_time")

# What there is to check where the positions are a state, as in data for learning such as LeRobot's: some hold a pose, or shares of a range.
OF_STATE = "taken as positions, because nothing else is named so: check that they are angles of the joints, not a pose or shares of their range"
# What to do where a log has a file for every quantity.
APART = "if they are in a separate file, put the columns of both side by side in one file"


@dataclass
class Guess:
    """What a file seems to hold of an arm; ``problems`` keep it from being read, ``notes`` do not.

    Attributes
    ----------
    joints : list of int
        Those of the URDF that can be identified from the file.
    locked : dict of str to float or None
        The others, and where they stood, rad or m; None where the file does not say it.
    """

    time: str | None = None
    time_unit: str = "s"
    signals: dict[str, Signal] = field(default_factory=dict)
    joints: list[int] = field(default_factory=list)
    locked: dict[str, float | None] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)

    @property
    def complete(self) -> bool:
        """Whether a recording can be read by it."""
        return not self.problems


def guess(
    meanings: Mapping[str, Meaning], numbers: Mapping[str, Array], robot: Robot, *, stated: bool = False
) -> Guess:
    """Guess the channels of an arm.

    Parameters
    ----------
    meanings : mapping of str to Meaning
        Every column and what its name says. Indices beyond the arm's joints are those of joints that it has locked.
    numbers : mapping of str to ndarray
        Columns that hold numbers.
    robot : Robot
        The joints that may be identified.
    stated : bool
        Whether the format is in SI by definition, so that no unit is to be guessed.
    """
    result = Guess()
    if stated:
        # By definition too; messages of several joints may share a stamp.
        result.time = next((name for name in STATED_CLOCKS if name in numbers), None)
    else:
        _find_time(result, meanings, numbers)
    size = len(numbers[result.time]) if result.time else max((len(v) for v in numbers.values()), default=0)
    usable = {
        name: said for name, said in meanings.items() if name in numbers and len(numbers[name]) == size and size > 1
    }
    beside = ""
    for quantity in ("position", "effort", "velocity", "temperature"):
        signal = _find_signal(result, quantity, usable, numbers, robot, beside)
        if signal is None and quantity == "position":
            signal = _find_signal(result, quantity, states_as_positions(usable), numbers, robot, beside)
            if signal is not None:
                result.notes.append(f"position: {signal.pattern} {OF_STATE}")
        if signal is not None:
            result.signals[quantity] = signal
            beside = beside or signal.template
    result.notes = short_together(result.notes)
    position, effort = result.signals.get("position"), result.signals.get("effort")
    if position is None:
        listed = (
            f": columns: {{{robot.joints[0]}: column_2, ...}} and their unit; the efforts' under effort alike, and time: {{column: column_1}}"
            if nameless(meanings)
            else ""
        )
        apart = f"; {APART}" if effort is not None else ""
        result.problems.append(f"no positions found: name their columns under recording: position{listed}{apart}")
        return result
    result.joints = [k for k in range(robot.n) if k in position.columns and (effort is None or k in effort.columns)]
    if effort is None:
        result.notes.append(f"no efforts found, so this file cannot be used to identify; {APART}")
    if not result.joints:
        result.problems.append("no joint has both a position and an effort")
        return result
    efforts = {} if effort is None else effort.columns
    result.joints, result.locked, notes = with_locked(result.joints, position.columns, efforts, numbers, robot)
    result.notes += notes
    if not result.joints:
        result.problems.append("every effort is constant: record the efforts, or name their columns")
    if result.time is not None and result.joints:
        columns = [
            signal.columns[k] for signal in result.signals.values() for k in result.joints if k in signal.columns
        ]
        merged, _ = on_one_clock({name: numbers[name] for name in (result.time, *columns)}, result.time, columns)
        _find_units(result, meanings, merged, robot, stated=stated)
        behind = second_encoder(result.signals["position"], result.joints, usable, numbers, robot)
        if behind is not None:
            result.signals["link_position"] = behind
            own = ", ".join(robot.joints[k] for k in behind.columns)
            said = f"link_position: {behind.pattern} taken as a second encoder behind the gear of {own}; check it"
            result.notes.append(said)
    return result


def _find_time(result: Guess, meanings: Mapping[str, Meaning], numbers: Mapping[str, Array]) -> None:
    named = [name for name, said in meanings.items() if said.quantity == "time" and name in numbers]
    named.sort(key=lambda name: CLOCKS.index(name.lower()) if name.lower() in CLOCKS else len(CLOCKS))
    others = [name for name, said in meanings.items() if said.quantity is None and name in numbers]
    for name in (*named, *others):
        said = meanings[name].unit
        seen = time_unit(numbers[name], said)
        if seen is None or (name in others and np.any(np.diff(numbers[name]) <= 0)):
            continue
        result.time, result.time_unit = name, seen
        if said is not None and said != seen:
            result.notes.append(f"{name!r} says {said}, and its steps look like {seen}: {seen} taken")
        if name in others:
            result.notes.append(f"{name!r} is taken as the time because it increases evenly")
        return
    for name in named:
        step = np.diff(numbers[name][np.isfinite(numbers[name])])
        if len(step) and np.all(step >= 0) and np.any(step > 0):
            still = float(np.mean(step == 0))
            result.problems.append(
                f"{name!r} does not change in {still:.0%} of the rows: the clock is too coarse; record time with more digits"
            )
            return
    result.problems.append(
        "no time found: name its column and unit under recording: time, or state the rate of even rows there: "
        "time: {rate: 100}, in samples per second"
    )


def _find_signal(
    result: Guess, quantity: str, meanings: Mapping[str, Meaning], numbers: Mapping[str, Array], robot: Robot,
    beside: str,
) -> Signal | None:  # fmt: skip
    found: list[tuple[tuple[object, ...], Signal, str]] = []
    short: list[str] = []
    for order, (template, by_name, members) in enumerate(groups(quantity, meanings, robot.n)):
        signal, note = of_group(quantity, template, by_name, members, robot)
        if signal is None:
            short.append(note)
            continue
        said = meanings[next(iter(signal.columns.values()))]
        moving = sum(not is_still(numbers[column]) for column in signal.columns.values())
        rank = (
            said.commanded,
            is_computed(said),
            any(
                of_other_kind(meanings[column], quantity, bool(robot.prismatic[k]))
                for k, column in signal.columns.items()
            ),
            -moving,
            -len(signal.columns),
            bool(said.words & LINK_SIDE),
            not by_name,
            not said.measured,
            not is_torque(said),
            # Channels of one source begin alike.
            -sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], zip(template, beside, strict=False))),
            order,
        )
        found.append((rank, signal, note))
    if not found:
        result.notes += short
        return None
    found.sort(key=lambda item: item[0])
    first, best, note = found[0]
    if note:
        result.notes.append(note)
    taken = set(best.columns.values())
    others = [signal for _, signal, _ in found[1:] if not taken & set(signal.columns.values())]
    if others:
        said_of = [] if quantity != "effort" else [why_taken(best, other, meanings, numbers) for other in others]
        why = "".join(f": {reason}" for reason in list(filter(None, said_of))[:1])
        result.notes.append(f"{quantity}: {best.pattern} taken, not {', '.join(s.pattern for s in others[:3])}{why}")
    still = [robot.joints[k] for k, column in best.columns.items() if is_still(numbers[column])]
    if 0 < len(still) < len(best.columns):
        result.notes.append(f"{quantity}: constant for {', '.join(still)}; check its columns")
    if first[0] or first[1]:
        kind = "a command" if first[0] else "computed"
        result.notes.append(f"{quantity}: {best.pattern} seems to be {kind}, not a measurement, by its name")
    return best


def _find_units(
    result: Guess, meanings: Mapping[str, Meaning], numbers: Mapping[str, Array], robot: Robot, *, stated: bool
) -> None:
    assert result.time is not None
    time = TIME[result.time_unit].factor * numbers[result.time]
    position = result.signals["position"]
    good = np.isfinite(time)
    for k in result.joints:
        good &= np.isfinite(numbers[position.columns[k]])
    if np.count_nonzero(good) < 3:
        result.problems.append("the positions are hardly ever numbers at the same time")
        return
    time = time[good]
    readings: dict[int, Reading] = {}
    slope: dict[int, Array] = {}
    for linear in (False, True):
        group = [k for k in result.joints if bool(robot.prismatic[k]) == linear]
        if not group:
            continue
        values = np.array([numbers[position.columns[k]][good] for k in group])
        columns = [(k, position.columns[k]) for k in group]
        # Whatever wrote them to a file, messages of this name are in SI, and wind on over many turns.
        said = [
            _si(robot, "position", k) if stated or JOINT_STATES.search(column) else meanings[column].unit
            for k, column in columns
        ]
        reading = _position_reading(result, robot, group, time, values, said)
        readings |= dict.fromkeys(group, reading)
        if reading.unit == COUNT:
            continue
        moved = values * _factors(robot, group, "position", reading)[:, None]
        slope |= dict(zip(group, slopes(time, moved if linear else np.unwrap(moved, axis=1)), strict=True))
    sides = {reading.side for reading in readings.values()}
    if len(sides) > 1:
        result.problems.append("some positions fit the motor's side of the gear and some the joint's: state position")
    result.signals["position"] = _with(position, {k: r.unit for k, r in readings.items()}, sides.pop())
    _find_velocity_unit(result, numbers, robot, slope, good, time)
    if stated and (effort := result.signals.get("effort")) is not None:
        result.signals["effort"] = _with(effort, {k: _si(robot, "effort", k) for k in result.joints}, "joint")
    else:
        _find_effort_unit(result, meanings, robot)


def _si(robot: Robot, quantity: str, joint: int) -> str:
    return next(iter(table_of(quantity, linear=bool(robot.prismatic[joint]))))


def _position_reading(
    result: Guess, robot: Robot, group: list[int], time: Array, values: Array, said: Sequence[str | None]
) -> Reading:
    fitting = position_readings(robot, group, time, values)
    named = next((word for word in said if word is not None), None)
    kind = "translating" if robot.prismatic[group[0]] else "turning"
    if named is not None:
        agreeing = [reading for reading in fitting if reading.unit == named]
        if not agreeing:
            likely = f"; they fit {_spoken(fitting[0])}" if fitting else ""
            result.notes.append(f"position: named {named}, which does not agree with the limits in the URDF{likely}")
        return agreeing[0] if agreeing else Reading(named)
    if not fitting:
        result.problems.append(
            f"the positions of the {kind} joints do not agree with the URDF's limits in any unit: state their unit under position: unit"
        )
        return Reading(next(iter(table_of("position", linear=bool(robot.prismatic[group[0]])))))
    if fitting[0].unit == COUNT:
        result.problems.append("the positions are whole numbers, encoder counts: state position: counts_per_turn")
    elif fitting[0] != Reading("rad") and fitting[0] != Reading("m"):
        result.notes.append(f"position: the URDF's limits allow {', '.join(map(_spoken, fitting[:3]))}; check it")
    return fitting[0]


def _find_velocity_unit(
    result: Guess, numbers: Mapping[str, Array], robot: Robot, slope: Mapping[int, Array], good: NDArray[np.bool_],
    time: Array,
) -> None:  # fmt: skip
    velocity = result.signals.get("velocity")
    if velocity is None or not all(k in velocity.columns for k in result.joints):
        result.signals.pop("velocity", None)
        return
    units: dict[int, str] = {}
    sides: set[str] = set()
    for linear in (False, True):
        group = [k for k in result.joints if bool(robot.prismatic[k]) == linear and k in slope]
        if not group:
            continue
        recorded = averages(time, np.array([numbers[velocity.columns[k]][good] for k in group]))
        known = np.array([slope[k] for k in group])
        reading = velocity_reading(known, recorded, robot.reduction[group], linear=linear)
        if reading is None and one_multiple(known, recorded):
            # The audit says the factor, here and wherever the recording is read.
            reading = Reading(_si(robot, "velocity", group[0]))
        if reading is None:
            result.notes.append("velocity: not the derivative of the positions in any unit; left out")
            del result.signals["velocity"]
            return
        units |= dict.fromkeys(group, reading.unit)
        sides.add(reading.side)
    if len(units) == len(result.joints) and len(sides) == 1:
        result.signals["velocity"] = _with(velocity, units, sides.pop())
    else:
        del result.signals["velocity"]


def _find_effort_unit(result: Guess, meanings: Mapping[str, Meaning], robot: Robot) -> None:
    effort = result.signals.get("effort")
    if effort is None:
        return
    units: dict[int, str] = {}
    for k in result.joints:
        said = meanings[effort.columns[k]]
        table = table_of("effort", linear=bool(robot.prismatic[k]))
        unit: Unit | None = None if said.unit is None else find_unit(said.unit, table)
        if unit is not None:
            units[k] = unit.name
        elif said.words & CURRENT:
            units[k] = "A"
        elif said.words & TORQUE:
            units[k] = next(iter(table))
    if len(units) < len(result.joints):
        said_in = " or ".join(dict.fromkeys("N" if robot.prismatic[k] else "N m" for k in result.joints))
        result.notes.append(
            f"effort: not known whether torque or current; state effort_gain, {said_in} per recorded unit"
        )
    elif any(unit in DRIVE for unit in units.values()):
        result.notes.append("effort: not a torque but a value of the drive; effort_gain is 1 until you state it")
    result.signals["effort"] = _with(effort, units, "joint")


def _factors(robot: Robot, group: Sequence[int], quantity: str, reading: Reading) -> Array:
    motor = reading.side == "motor"
    linear = bool(robot.prismatic[group[0]]) and not motor
    unit = table_of(quantity, linear=linear).get(reading.unit)
    factor = 1.0 if unit is None else unit.factor
    return np.array([factor / (robot.reduction[k] if motor else 1.0) for k in group])


def _with(signal: Signal, units: Mapping[int, str], side: str) -> Signal:
    return Signal(signal.quantity, signal.columns, signal.template, signal.first_number, units, side)


def _spoken(reading: Reading) -> str:
    return f"{reading.unit} of the motor" if reading.side == "motor" else reading.unit
