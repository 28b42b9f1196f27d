"""How far, how fast and how hard the joints moved in recordings: beyond that a model is extrapolated."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from scara_ident.arrays import Array
from scara_ident.motion.prepared import PreparedData
from scara_ident.robot.robot import Robot

# A law of friction says little else a tenth beyond the fastest sample that it was fitted to.
FASTER = 1.1


@dataclass(frozen=True, eq=False)
class RecordedRange:
    """Where the joints were, and how fast they moved.

    Attributes
    ----------
    lower, upper : ndarray, shape (n,)
        Smallest and largest position, rad or m.
    speed : ndarray, shape (n,)
        Largest, rad/s or m/s.
    acceleration : ndarray, shape (n,)
        Largest, either way, rad/s^2 or m/s^2.
    """

    lower: Array
    upper: Array
    speed: Array
    acceleration: Array

    def entry(self, robot: Robot) -> dict[str, Any]:
        """Return it as plain values, joint by joint; see `range_of_entry`."""
        rows = zip(self.lower, self.upper, self.speed, self.acceleration, strict=True)
        names = ("position", "speed", "acceleration")
        return {
            joint: dict(zip(names, ([float(low), float(high)], float(v), float(a)), strict=True))
            for joint, (low, high, v, a) in zip(robot.joints, rows, strict=True)
        }


def recorded_range(data: PreparedData) -> RecordedRange:
    """Return the range of recordings, by their filtered motion without the ends of each stretch.

    Parameters
    ----------
    data : PreparedData
    """
    parts = [part for part in data.stretches if part.usable]
    inner = [slice(part.trim, part.samples - part.trim) for part in parts]
    q = [part.motion.q[:, own] for part, own in zip(parts, inner, strict=True)]
    return RecordedRange(
        np.min([np.min(each, axis=1) for each in q], axis=0),
        np.max([np.max(each, axis=1) for each in q], axis=0),
        _largest(part.motion.v[:, own] for part, own in zip(parts, inner, strict=True)),
        _largest(part.motion.a[:, own] for part, own in zip(parts, inner, strict=True)),
    )


def range_of_entry(entry: Mapping[str, Any], robot: Robot) -> RecordedRange:
    """Return the range that a result file holds.

    Raises
    ------
    KeyError
        If it lacks a joint or a quantity.
    """
    rows = [(*entry[joint]["position"], entry[joint]["speed"], entry[joint]["acceleration"]) for joint in robot.joints]
    return RecordedRange(*np.array(rows, dtype=float).T)


def faster_than_recorded(known: RecordedRange | None, speed: Array, robot: Robot, motion: str = "The motion is") -> str:
    """Say which joints move clearly faster than in the recordings that a model was fitted to, "" where none does.

    Parameters
    ----------
    known : RecordedRange or None
        Of the recordings; None where it is not known, as of results of earlier versions.
    speed : ndarray, shape (n,)
        Largest of the motion, rad/s or m/s.
    motion : str, optional
        How the sentence begins.
    """
    beyond = np.flatnonzero(speed > FASTER * known.speed).tolist() if known is not None else []
    if known is None or not beyond:
        return ""
    said = (
        f"{robot.joints[j]} {speed[j]:.3g} {robot.position_unit(j)}/s, recorded {known.speed[j]:.3g}" for j in beyond
    )
    return f"{motion} faster than the recordings that the model was fitted to, so that friction is extrapolated: {'; '.join(said)}."


def _largest(signals: Iterable[Array]) -> Array:
    return np.asarray(np.max([np.max(np.abs(each), axis=1) for each in signals], axis=0))
