"""Whether a file has the positions of encoders behind the gears too."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from scara_ident.arrays import Array
from scara_ident.inspection.names import LINK_SIDE, Meaning
from scara_ident.inspection.signals import Signal, groups, of_group
from scara_ident.robot.robot import Robot
from scara_ident.robot.units import table_of

# Of a position's own spread (std) a link lags its motor by less, unless the gear is broken.
MAX_LAG = 0.02


def second_encoder(
    position: Signal,
    joints: Sequence[int],
    meanings: Mapping[str, Meaning],
    numbers: Mapping[str, Array],
    robot: Robot,
) -> Signal | None:
    """Return the positions whose names say that they are the links', and that follow those taken as the motors' do.

    Parameters
    ----------
    position : Signal
        As it was taken, with units.
    numbers : mapping of str to ndarray
        Each column has as many, on the same rows.

    Returns
    -------
    Signal or None
        Of those joints only whose columns follow; None where none does. A command follows as well, so that a name is needed.
    """
    if position.side == "motor":
        return None
    taken = set(position.columns.values())
    for template, by_name, members in groups("position", meanings, robot.n):
        said = meanings[next(iter(members.values()))]
        if taken & set(members.values()) or said.commanded or not said.words & LINK_SIDE:
            continue
        signal, _ = of_group("link_position", template, by_name, members, robot)
        if signal is None:
            continue
        columns, units = {}, {}
        for k in joints:
            if k not in signal.columns:
                continue
            table = table_of("position", linear=bool(robot.prismatic[k]))
            motor, unit = table.get(position.units[k]), meanings[signal.columns[k]].unit or position.units[k]
            if motor is None or unit not in table:
                continue
            place = motor.factor * numbers[position.columns[k]]
            lag = place - table[unit].factor * numbers[signal.columns[k]]
            if 0.0 < float(np.nanstd(lag)) < MAX_LAG * float(np.nanstd(place)):
                columns[k], units[k] = signal.columns[k], unit
        if columns:
            return Signal("link_position", columns, template, signal.first_number, units)
    return None
