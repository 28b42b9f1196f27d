"""Units of recorded channels: what one of each is in SI."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

DEGREE = np.pi / 180
TURN = 2 * np.pi
COUNT = "count"


@dataclass(frozen=True)
class Unit:
    """A unit and its SI equivalent: value in SI = factor * number + offset.

    Attributes
    ----------
    name : str
        As it stands in a robot description.
    factor, offset : float
        Conversion to SI; for encoder counts ``factor`` is that of a turn, to be divided by the counts per turn.
    needs_gain : bool
        Whether a number in this unit is a torque only after the joint's ``effort_gain``.
    """

    name: str
    factor: float
    offset: float = 0.0
    needs_gain: bool = False


def _table(*units: Unit) -> Mapping[str, Unit]:
    return MappingProxyType({unit.name: unit for unit in units})


def _per(table: Mapping[str, Unit], ending: str, *more: Unit) -> Mapping[str, Unit]:
    return _table(*(Unit(f"{unit.name}/{ending}", unit.factor) for unit in table.values()), *more)


TIME = _table(Unit("s", 1.0), Unit("ms", 1e-3), Unit("us", 1e-6), Unit("ns", 1e-9))
ANGLE = _table(Unit("rad", 1.0), Unit("deg", DEGREE), Unit("turn", TURN), Unit(COUNT, TURN))
LENGTH = _table(Unit("m", 1.0), Unit("mm", 1e-3), Unit("um", 1e-6))
ANGLE_RATE = _per(ANGLE, "s", Unit("rpm", TURN / 60))
LENGTH_RATE = _per(LENGTH, "s")
ANGLE_ACCELERATION = _per(ANGLE, "s^2")
LENGTH_ACCELERATION = _per(LENGTH, "s^2")
# What a drive reports in place of a torque: a current, or a share of a rated value.
DRIVE = _table(
    Unit("A", 1.0, needs_gain=True),
    Unit("mA", 1e-3, needs_gain=True),
    Unit("%", 1e-2, needs_gain=True),
    Unit("permille", 1e-3, needs_gain=True),
)
TORQUE = _table(Unit("N m", 1.0), Unit("mN m", 1e-3), Unit("N cm", 1e-2), Unit("kN m", 1e3), *DRIVE.values())
FORCE = _table(Unit("N", 1.0), Unit("mN", 1e-3), Unit("kN", 1e3), *DRIVE.values())
TEMPERATURE = _table(Unit("degC", 1.0), Unit("K", 1.0, -273.15))


# What units may stand in, in a table.
BRACKETS = "[](){}<> "
# Units as they are also written.
ALSO = MappingProxyType(
    {"°": "deg", "°/s": "deg/s", "grad": "deg", "grad/s": "deg/s", "u/min": "rpm", "1/min": "rpm", "tr/min": "rpm"}
)


def table_of(signal: str, *, linear: bool) -> Mapping[str, Unit]:
    """Return the units that a signal may have; the first is its SI unit.

    Parameters
    ----------
    signal : {"time", "position", "velocity", "acceleration", "effort", "temperature", "link_position"}
    linear : bool
        Whether the numbers are lengths and forces, not angles and torques.
    """
    tables = {
        "time": (TIME, TIME),
        "position": (ANGLE, LENGTH),
        "velocity": (ANGLE_RATE, LENGTH_RATE),
        "acceleration": (ANGLE_ACCELERATION, LENGTH_ACCELERATION),
        "effort": (TORQUE, FORCE),
        "temperature": (TEMPERATURE, TEMPERATURE),
        "link_position": (ANGLE, LENGTH),
    }
    return tables[signal][linear]


def find_unit(word: str, table: Mapping[str, Unit]) -> Unit | None:
    """Find a unit by its name, whatever the blanks and the sign for micro: ``Nm`` and ``N m`` are one."""
    wanted = _plain(word)
    return next((unit for name, unit in table.items() if _plain(name) == wanted), None)


def is_unit(word: str) -> bool:
    """Tell whether a word, in brackets or not, is a unit of any channel."""
    return any(_everywhere(word))


def is_si(word: str) -> bool:
    """Tell whether numbers in a unit are those in SI, whatever channel they are of."""
    found = _everywhere(word)
    return bool(found) and all(unit.factor == 1.0 and not unit.offset and not unit.needs_gain for unit in found)


def _everywhere(word: str) -> list[Unit]:
    bare = word.strip(BRACKETS)
    tables = (
        TIME,
        ANGLE,
        LENGTH,
        ANGLE_RATE,
        LENGTH_RATE,
        ANGLE_ACCELERATION,
        LENGTH_ACCELERATION,
        TORQUE,
        FORCE,
        TEMPERATURE,
    )
    found = (find_unit(ALSO.get(bare.lower(), bare), table) for table in tables)
    return [unit for unit in found if unit is not None]


def _plain(word: str) -> str:
    return "".join(word.split()).replace("\u00b5", "u").replace("\u03bc", "u").replace("²", "^2")
