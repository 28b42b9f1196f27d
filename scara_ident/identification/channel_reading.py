"""Another reading of the recorded channels: signs, exchanged joints, and positions that count from elsewhere."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from scara_ident.arrays import Array
from scara_ident.estimation.observations import Observations, observe
from scara_ident.motion.prepared import PreparedData, PreparedStretch

Signal = Literal["effort", "position", "effort and position"]

# Turns by which a convention puts the zero of a joint elsewhere, in quarters of one.
QUARTERS = (1, -1, 2)


@dataclass(frozen=True)
class JointReading:
    """How the channels of one joint are read.

    Attributes
    ----------
    effort, position : {1, -1}
        Factor of the recorded one.
    quarters : int
        Quarter turns that are added to the position, after its factor.
    """

    effort: int = 1
    position: int = 1
    quarters: int = 0

    @property
    def axis_turned(self) -> bool:
        """Whether both signs are opposite, as of a joint whose axis is."""
        return self.effort < 0 and self.position < 0

    @property
    def signal(self) -> Signal | None:
        """The signals of opposite sign, if any are."""
        if self.axis_turned:
            return "effort and position"
        return "effort" if self.effort < 0 else "position" if self.position < 0 else None

    def then(self, other: JointReading) -> JointReading:
        """Return this reading, and another of what it reads, as one."""
        quarters = quarter_turns(other.position * self.quarters + other.quarters)
        return JointReading(self.effort * other.effort, self.position * other.position, quarters)


# Of every joint one.
Reading = tuple[JointReading, ...]


def as_mapped(joints: int) -> Reading:
    """Return the reading of the mapping."""
    return (JointReading(),) * joints


def has_zeros(reading: Reading) -> bool:
    """Tell whether any position counts from elsewhere."""
    return any(own.quarters for own in reading)


def turned(joints: int, signal: Signal, joint: int) -> Reading:
    """Return the reading with a signal of one joint of opposite sign."""
    own = JointReading(-1 if "effort" in signal else 1, -1 if "position" in signal else 1)
    return with_joint(as_mapped(joints), joint, own)


def quarter_turns(count: int) -> int:
    """Return quarter turns without whole ones: none, one either way, or two."""
    return (count + 1) % 4 - 1


def with_joint(reading: Reading, joint: int, own: JointReading) -> Reading:
    """Return a reading with that of one joint replaced."""
    return (*reading[:joint], own, *reading[joint + 1 :])


def offsets(reading: Reading) -> Array:
    """Return what is added to each position, rad, shape (n,)."""
    return 0.5 * np.pi * np.array([own.quarters for own in reading])


def signs(reading: Reading) -> tuple[Array, Array]:
    """Return the factors of efforts and positions, shape (n,) each."""
    return np.array([float(own.effort) for own in reading]), np.array([float(own.position) for own in reading])


def observed_as(held: Observations, reading: Reading) -> Observations:
    """Return what recordings say of a model in another reading."""
    effort, position = signs(reading)
    shift = offsets(reading)

    def read(part: PreparedStretch) -> PreparedStretch:
        stretch = replace(
            part.stretch,
            position=position[:, None] * part.stretch.position + shift[:, None],
            torque=effort[:, None] * part.torque,
            _filtered={},
            _thinned={},
        )
        return part.with_positions_of(stretch, position, shift)

    if np.all(position > 0.0) and not np.any(shift):
        return held.with_torque(
            _changed(
                held.data,
                lambda part: part.with_torque_of(
                    replace(part.stretch, torque=effort[:, None] * part.torque, _thinned={})
                ),
            )
        )
    return observe(held.model, _changed(held.data, read))


def observed_exchanged(held: Observations, signal: Signal, joints: tuple[int, int]) -> Observations:
    """Return what recordings say of a model with a signal of two joints exchanged."""
    order = np.arange(len(held.joints))
    order[list(joints)] = joints[::-1]

    def read(part: PreparedStretch) -> PreparedStretch:
        torque = part.torque[order] if "effort" in signal else part.torque
        if "position" not in signal:
            return part.with_torque_of(replace(part.stretch, torque=torque, _thinned={}))
        own = part.stretch
        stretch = replace(
            own,
            position=own.position[order],
            torque=torque,
            # What is known of positions goes with them.
            idle=own.idle if isinstance(own.idle, bool) else own.idle[order],
            steps=tuple(own.steps[k] for k in order) if own.steps else (),
            _filtered={},
            _thinned={},
        )
        return PreparedStretch(stretch, part.bands)

    data = _changed(held.data, read)
    return held.with_torque(data) if signal == "effort" else observe(held.model, data)


def _changed(data: PreparedData, read: Callable[[PreparedStretch], PreparedStretch]) -> PreparedData:
    recordings = [replace(item, stretches=tuple(map(read, item.stretches))) for item in data.recordings]
    return replace(data, recordings=tuple(recordings))
