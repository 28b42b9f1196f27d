"""Where the signals of a recording stand in a file, and what their numbers are in SI."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from scara_ident.arrays import Array
from scara_ident.errors import RobotError
from scara_ident.robot.description import MotionDescription, RecordingDescription, SignalDescription, TimeDescription
from scara_ident.robot.units import COUNT, TIME, Unit, find_unit, table_of

SIGNALS = ("position", "velocity", "acceleration", "effort", "temperature", "link_position")
# Which some joints may have and others not.
PARTIAL = ("link_position",)
# What a pattern may hold: the joint's name, its place in the robot description from 0, and from 1.
PLACEHOLDERS = ("{joint}", "{index}", "{number}")
# A rated torque is within this factor of the URDF's limit; below this share of it, it is that of one per cent.
RATED_SPREAD, RATED_MIN = 5.0, 0.1


@dataclass(frozen=True)
class Channel:
    """One column of a file; value in SI = factor * number + offset."""

    column: str
    factor: float = 1.0
    offset: float = 0.0

    def si(self, numbers: Array) -> Array:
        """Convert recorded numbers, shape (N,), to SI."""
        if self.factor == 1.0 and self.offset == 0.0:
            return numbers
        return self.factor * numbers + self.offset


@dataclass(frozen=True)
class Channels:
    """The columns of a recording.

    Attributes
    ----------
    position, velocity, acceleration, effort, temperature, link_position : tuple of Channel
        One for each joint, in the robot's order. Efforts are converted to N m (N), or to A where a gain makes torque
        of them.
    declared : tuple of str
        Signals that the robot description names, and its time, in one order; the others have the contract's columns, if any.
    topic : str or None
        Topic of the bag that holds them.
    rate : float or None
        Rows in a second, where the robot description states that instead of a column of time.
    """

    time: Channel
    position: tuple[Channel, ...]
    velocity: tuple[Channel, ...]
    acceleration: tuple[Channel, ...]
    effort: tuple[Channel, ...]
    temperature: tuple[Channel, ...]
    link_position: tuple[Channel, ...]
    declared: tuple[str, ...] = ()
    topic: str | None = None
    rate: float | None = None

    def of(self, signal: str) -> tuple[Channel, ...]:
        """Return the channels of a signal, one for each joint."""
        channels: tuple[Channel, ...] = getattr(self, signal)
        return channels


def contract_channels(joints: Sequence[str]) -> Channels:
    """Return the columns ``time`` and ``<joint>.<signal>``, in SI."""
    signals = {signal: tuple(Channel(f"{joint}.{signal}") for joint in joints) for signal in SIGNALS}
    return _channels(Channel("time"), signals)


def build_channels(
    description: RecordingDescription,
    source: Path,
    joints: Sequence[str],
    *,
    prismatic: Sequence[bool],
    reduction: Sequence[float],
    has_gain: Sequence[bool],
) -> Channels:
    """Build the channels that a robot description declares.

    Parameters
    ----------
    description : RecordingDescription
        The key ``recording``.
    source : Path
        The robot description, named in errors.
    joints : sequence of str
        The n identified joints.
    prismatic, reduction, has_gain : sequences of length n
        Whether a joint translates; motor turns per joint turn; whether an ``effort_gain`` is given for it.

    Raises
    ------
    RobotError
        In one line: file, key and what was expected.
    """
    time = description.time or TimeDescription()
    table = table_of("time", linear=False)
    unit = find_unit(time.unit, table)
    if unit is None:
        _refuse(source, "time.unit", f"{time.unit!r} is not known; expected one of {', '.join(table)}")
    built: dict[str, tuple[Channel, ...]] = {}
    for signal in SIGNALS:
        described: SignalDescription | None = getattr(description, signal)
        if described is None:
            built[signal] = tuple(Channel(f"{joint}.{signal}") for joint in joints)
            continue
        reader = _Signal(signal, described, source, joints)
        columns = reader.columns()
        built[signal] = tuple(
            reader.channel(columns[k], joint, bool(prismatic[k]), float(reduction[k]), bool(has_gain[k]))
            for k, joint in enumerate(joints)
        )
    declared = tuple(name for name in ("time", *SIGNALS) if getattr(description, name) is not None)
    clock = Channel(time.column, unit.factor)
    channels = _channels(clock, built, declared, description.topic, time.rate)
    _refuse_shared(channels, source, joints)
    return channels


def recording_entry(channels: Channels, joints: Sequence[str]) -> dict[str, Any]:
    """Return the key ``recording`` of a robot description from which `build_channels` builds the same channels.

    All is in SI units on the joint side: what counts, gears and units make of the numbers is in ``scale`` and ``offset``.
    """
    entry: dict[str, Any] = {} if channels.topic is None else {"topic": channels.topic}
    if channels.rate is not None:
        entry["time"] = {"rate": channels.rate}
    elif "time" in channels.declared:
        unit = next(unit.name for unit in TIME.values() if unit.factor == channels.time.factor)
        entry["time"] = {"column": channels.time.column, "unit": unit}
    for signal in SIGNALS:
        if signal not in channels.declared:
            continue
        own = dict(zip(joints, channels.of(signal), strict=True))
        parts: dict[str, dict[str, Any]] = {"columns": {joint: channel.column for joint, channel in own.items()}}
        if any(channel.factor != 1.0 for channel in own.values()):
            parts["scale"] = {joint: channel.factor for joint, channel in own.items()}
        if any(channel.offset != 0.0 for channel in own.values()):
            parts["offset"] = {joint: channel.offset for joint, channel in own.items()}
        entry[signal] = parts
    return entry


def _channels(
    time: Channel,
    signals: Mapping[str, tuple[Channel, ...]],
    declared: tuple[str, ...] = (),
    topic: str | None = None,
    rate: float | None = None,
) -> Channels:
    return Channels(
        time=time,
        position=signals["position"],
        velocity=signals["velocity"],
        acceleration=signals["acceleration"],
        effort=signals["effort"],
        temperature=signals["temperature"],
        link_position=signals["link_position"],
        declared=declared,
        topic=topic,
        rate=rate,
    )


@dataclass(frozen=True)
class _Signal:
    """One signal of a description on its way to channels."""

    name: str
    described: SignalDescription
    source: Path
    joints: Sequence[str]

    def columns(self) -> list[str]:
        described, joints = self.described, self.joints
        for key in ("columns", "unit", "scale", "offset", "counts_per_turn"):
            value = getattr(described, key, None)
            if isinstance(value, dict):
                self._refuse_unknown(key, value)
        if described.columns is not None:
            for joint in joints:
                if joint not in described.columns and self.name not in PARTIAL:
                    self.refuse(f"columns.{joint}", "missing; every identified joint needs its column")
            # A joint that may lack the signal lacks the column of that name.
            return [described.columns.get(joint, f"{joint}.{self.name}") for joint in joints]
        pattern = described.column or f"{{joint}}.{self.name}"
        if len(joints) > 1 and not any(mark in pattern for mark in PLACEHOLDERS):
            self.refuse(
                "column",
                f"{pattern!r} is one column for {len(joints)} joints; put {{joint}} (or {{index}}, from 0, or "
                "{number}, from 1) into it, or list them under columns",
            )
        return [fill(pattern, joint, index) for index, joint in enumerate(joints)]

    def channel(self, column: str, joint: str, prismatic: bool, reduction: float, has_gain: bool) -> Channel:
        described = self.described
        motor = isinstance(described, MotionDescription) and described.side == "motor"
        unit = self._unit(joint, linear=prismatic and not motor)
        if unit.needs_gain and not has_gain:
            self.refuse(
                "unit",
                f"{unit.name} is no torque; give {joint} its effort_gain (N m per {unit.name.removeprefix('m')})"
                if unit.name in ("A", "mA")
                else f"{unit.name} is no torque; give {joint} its effort_gain (the rated torque in N m)",
            )
        factor = unit.factor * self._counts(joint, unit)
        if motor:
            factor /= reduction
        scale, shift = _of(described.scale, joint, 1.0), _of(described.offset, joint, 0.0)
        return Channel(column, factor * scale, factor * shift + unit.offset)

    def _unit(self, joint: str, *, linear: bool) -> Unit:
        table = table_of(self.name, linear=linear)
        word = _of(self.described.unit, joint, None)
        if word is None:
            return next(iter(table.values()))
        unit = find_unit(word, table)
        if unit is None:
            key = f"unit.{joint}" if isinstance(self.described.unit, dict) else "unit"
            what = "translates" if linear else "turns"
            side = " (at the motor)" if getattr(self.described, "side", "joint") == "motor" else ""
            self.refuse(
                key, f"{word!r} is no unit of {self.name} of {joint}, which {what}{side}; one of {', '.join(table)}"
            )
        return unit

    def _counts(self, joint: str, unit: Unit) -> float:
        counts = _of(getattr(self.described, "counts_per_turn", None), joint, None)
        if not unit.name.startswith(COUNT):
            if counts is not None:
                self.refuse("counts_per_turn", f"belongs to encoder counts, and the unit is {unit.name}; remove one")
            return 1.0
        if counts is None:
            self.refuse("counts_per_turn", f"missing for {joint}; the unit is {unit.name}")
        return 1.0 / float(counts)

    def _refuse_unknown(self, key: str, given: Mapping[str, Any]) -> None:
        for joint in given:
            if joint not in self.joints:
                near = get_close_matches(joint, self.joints, n=1)
                hint = f"did you mean {near[0]}?" if near else f"they are {', '.join(self.joints)}"
                self.refuse(f"{key}.{joint}", f"not one of the joints to identify; {hint}")

    def refuse(self, key: str, reason: str) -> NoReturn:
        _refuse(self.source, f"{self.name}.{key}", reason)


def check_rated_torque(
    described: SignalDescription | None, joints: Sequence[str], gain: Array, limit: Array, source: Path
) -> None:
    """Refuse a gain that is the torque of one per cent (permille) where that of a hundred (a thousand) is asked for.

    Parameters
    ----------
    described : SignalDescription or None
        Of the effort.
    gain : ndarray, shape (n,)
        ``effort_gain``: with such a unit the rated torque, N m (N).
    limit : ndarray, shape (n,)
        Effort limit of the URDF where effort is recorded; infinite where there is none.
    source : Path
        The robot description, named in errors.

    Raises
    ------
    RobotError
    """
    for joint, value, bound in zip(joints, np.abs(gain), limit, strict=True):
        word = None if described is None else _of(described.unit, joint, None)
        unit = None if word is None else find_unit(word, table_of("effort", linear=False))
        # A gain of 1 states nothing yet: it stands in a first description.
        if unit is None or unit.name not in ("%", "permille") or not np.isfinite(bound) or value == 1.0:
            continue
        whole = value / unit.factor
        if value < RATED_MIN * bound and bound / RATED_SPREAD < whole < RATED_SPREAD * bound:
            raise RobotError(
                f"{source}: joints.{joint}.effort_gain: {value:g} N m would be the rated torque (100 %), and the URDF's "
                f"limit is {bound:.4g} N m; with unit {unit.name} write the torque at 100 %: {whole:g} if this is N m per "
                f"{unit.name}"
            )


def fill(pattern: str, joint: str, index: int) -> str:
    """Put a joint into a pattern."""
    return pattern.replace("{joint}", joint).replace("{index}", str(index)).replace("{number}", str(index + 1))


def _of(value: Any, joint: str, default: Any) -> Any:
    if isinstance(value, dict):
        return value.get(joint, default)
    return default if value is None else value


def _refuse_shared(channels: Channels, source: Path, joints: Sequence[str]) -> None:
    taken: dict[str, str] = {}
    places = [("time", channels.time)]
    for signal in SIGNALS:
        places += [(f"{signal} of {joint}", c) for joint, c in zip(joints, channels.of(signal), strict=True)]
    for place, channel in places:
        if channel.column in taken:
            key = place.split(" ")[0]
            _refuse(
                source, key, f"column {channel.column!r} is the {taken[channel.column]} and the {place}; correct one"
            )
        taken[channel.column] = place


def _refuse(source: Path, key: str, reason: str) -> NoReturn:
    raise RobotError(f"{source}: recording.{key}: {reason}")
