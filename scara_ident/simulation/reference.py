"""The motion that the virtual arm is asked to follow."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from scara_ident.arrays import Array
from scara_ident.errors import RecordingError
from scara_ident.recording.audit.clock import HUGE
from scara_ident.recording.files.parquet_csv import column_names, read_columns
from scara_ident.robot.robot import Robot

# Positions, velocities and accelerations in SI units beyond this are no motion of an arm.
MAX_MAGNITUDE = 1e9
# Samples that a simulated run may have: most of three hours at 1 kHz.
MAX_SAMPLES = 10_000_000


@dataclass(frozen=True, eq=False)
class ReferenceMotion:
    """A wanted motion of the joints.

    Attributes
    ----------
    name : str
        Of the trajectory, as in ``OJD``.
    joints : tuple of str
        In the robot's order.
    time : ndarray, shape (N,)
        s, from 0, strictly increasing.
    position, velocity, acceleration : ndarray, shape (n, N)
        rad (m) and derivatives, of which each must be the derivative of the one before.

    Raises
    ------
    RecordingError
        If shapes disagree, a value is not finite or beyond `MAX_MAGNITUDE`, or time does not grow.
    """

    name: str
    joints: tuple[str, ...]
    time: Array
    position: Array
    velocity: Array
    acceleration: Array

    def __post_init__(self) -> None:
        shape = (len(self.joints), len(self.time))
        for name in ("position", "velocity", "acceleration"):
            values = getattr(self, name)
            if values.shape != shape:
                raise RecordingError(f"{self.name}: {name} has shape {values.shape}; joints and time ask for {shape}")
            if not np.all(np.abs(values) < HUGE):
                raise RecordingError(f"{self.name}: {name} has a value that is not finite; give a complete motion")
            if np.any(np.abs(values) > MAX_MAGNITUDE):
                raise RecordingError(
                    f"{self.name}: {name} reaches {np.max(np.abs(values)):.3g}, which is impossible for an arm; give it in rad, m and s"
                )
        # What is not finite has no differences.
        if len(self.time) < 2 or not np.all(np.abs(self.time) < HUGE) or not np.all(np.diff(self.time) > 0):
            raise RecordingError(f"{self.name}: time must have at least two samples and grow strictly")

    @property
    def duration(self) -> float:
        """Length in s."""
        return float(self.time[-1] - self.time[0])

    def at(self, time: Array) -> ReferenceMotion:
        """Return the motion at other times within its own, by quintic Hermite interpolation (C2)."""
        if len(time) == len(self.time) and np.array_equal(time, self.time):
            return self
        place = np.clip(np.searchsorted(self.time, time, side="right") - 1, 0, len(self.time) - 2)
        h = self.time[place + 1] - self.time[place]
        s = (time - self.time[place]) / h
        x, v, a = (
            [np.asarray(y[:, place]), np.asarray(y[:, place + 1])]
            for y in (self.position, self.velocity, self.acceleration)
        )
        # The quintic through both ends with both derivatives, in powers of s.
        c0, c1, c2 = x[0], v[0] * h, 0.5 * a[0] * h * h
        d0 = x[1] - c0 - c1 - c2
        d1 = v[1] * h - c1 - 2.0 * c2
        d2 = a[1] * h * h - 2.0 * c2
        c3, c4, c5 = 10 * d0 - 4 * d1 + 0.5 * d2, -15 * d0 + 7 * d1 - d2, 6 * d0 - 3 * d1 + 0.5 * d2
        position = c0 + s * (c1 + s * (c2 + s * (c3 + s * (c4 + s * c5))))
        velocity = (c1 + s * (2 * c2 + s * (3 * c3 + s * (4 * c4 + s * 5 * c5)))) / h
        acceleration = (2 * c2 + s * (6 * c3 + s * (12 * c4 + s * 20 * c5))) / (h * h)
        return replace(self, time=time, position=position, velocity=velocity, acceleration=acceleration)

    def every(self, ticks: int) -> ReferenceMotion:
        """Return each ``ticks``-th sample, from the first."""
        signals = (np.ascontiguousarray(x[:, ::ticks]) for x in (self.position, self.velocity, self.acceleration))
        return ReferenceMotion(self.name, self.joints, self.time[::ticks].copy(), *signals)

    def held(self, before: float, after: float, rate: float = 1000.0) -> ReferenceMotion:
        """Return the motion with the arm at its first position before it and at its last after it, s."""
        lead, tail = round(before * rate), round(after * rate)
        step = 1.0 / rate
        start = self.time[0]
        time = np.concatenate(
            [np.arange(lead) * step, self.time - start + lead * step,
             self.time[-1] - start + lead * step + step * np.arange(1, tail + 1)]
        )  # fmt: skip

        def padded(values: Array, hold: bool) -> Array:
            ends = (values[:, :1], values[:, -1:]) if hold else (np.zeros((len(values), 1)),) * 2
            return np.concatenate([np.repeat(ends[0], lead, 1), values, np.repeat(ends[1], tail, 1)], axis=1)

        return replace(
            self,
            time=time,
            position=padded(self.position, True),
            velocity=padded(self.velocity, False),
            acceleration=padded(self.acceleration, False),
        )


def sampled(
    name: str,
    robot: Robot,
    function: Callable[[Array], tuple[Array, Array, Array]],
    duration: float,
    rate: float = 1000.0,
) -> ReferenceMotion:
    """Sample a motion given as a function of time.

    Parameters
    ----------
    name : str
    robot : Robot
    function : callable
        From times (N,) to position, velocity and acceleration, each of shape (n, N).
    duration : float
        s.
    rate : float
        Samples per second.
    """
    time = np.arange(round(duration * rate) + 1) / rate
    return ReferenceMotion(name, robot.joints, time, *(np.asarray(y, dtype=float) for y in function(time)))


def read_trajectory(path: Path | str, robot: Robot) -> ReferenceMotion:
    """Read a ``trajectory.csv``: time, and position, velocity and acceleration of every joint.

    Raises
    ------
    RecordingError
        In one line: the file and the column that is missing, or samples that are not finite or not in order.
    """
    path = Path(path)
    names = column_names(path)
    wanted = {kind: [f"{joint}.{kind}" for joint in robot.joints] for kind in ("position", "velocity", "acceleration")}
    for name in ["time", *(name for group in wanted.values() for name in group)]:
        if name not in names:
            raise RecordingError(
                f"{path}: no column {name!r}; a trajectory has time and, for every joint, position, velocity and "
                "acceleration"
            )
    columns = read_columns(path, ["time", *(name for group in wanted.values() for name in group)])
    time = np.asarray(columns["time"])
    # One that does not begin at a time is refused as it is.
    start = time[0] if len(time) and np.isfinite(time[0]) else 0.0
    try:
        return ReferenceMotion(
            path.stem, robot.joints, time - start,
            *(np.array([columns[name] for name in group]) for group in wanted.values()),
        )  # fmt: skip
    except RecordingError as error:
        raise RecordingError(f"{path}: {error}") from None
