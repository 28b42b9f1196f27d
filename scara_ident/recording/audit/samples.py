"""What an audit works on, and what it says."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, NoReturn

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.errors import RecordingError

if TYPE_CHECKING:
    from scara_ident.robot.robot import Robot

# Travel below this share of its range (2 pi rad, 1 m where the URDF gives none) says nothing of a joint's inertia or
# friction: the joint stands still and its servo hunts by a few counts.
IDLE_TRAVEL = 1e-3

# Numbers that differ by less than this share of their range are one: programs round them in the last digits.
ROUNDED = 1e-9

# A first time beyond this, s, is none of a run but that since an epoch: six digits of it are days.
EPOCH = 1e6

# A longer step in time, in median steps, is a gap: nothing is interpolated over it (motion.py cuts recordings there).
GAP_STEPS = 5.0


@dataclass(frozen=True, eq=False)
class Finding:
    """Something that the audit saw, and what was done about it.

    Attributes
    ----------
    kind : str
        Short name, such as ``gap``, ``jitter``, ``nan`` or ``saturation``.
    message : str
        One line for a person: what, where, what was done.
    count : int
        How many samples (gaps, joints) it concerns.
    clipped : (int, float) or None
        A joint by its place and the torque at which its effort is clipped or stuck, N m or N.
    idle : tuple of int
        Joints by their places that stand still over the whole recording.
    joint : str or None
        The joint that the message begins with, where it may be said of others alike and their numbers tell little more.
    """

    kind: str
    message: str
    count: int = 1
    clipped: tuple[int, float] | None = None
    idle: tuple[int, ...] = ()
    joint: str | None = None


def once(findings: Iterable[Finding]) -> list[Finding]:
    """Return the first finding of each kind, and of each effort that is clipped, which is left out by it."""
    found: dict[tuple[str, tuple[int, float] | None], Finding] = {}
    for finding in findings:
        found.setdefault((finding.kind, finding.clipped), finding)
    return list(found.values())


@dataclass(frozen=True, eq=False)
class Samples:
    """The rows of a file on their way through the audit.

    Attributes
    ----------
    source : str
        The file, as the user named it.
    robot : Robot
        The robot that the file is said to belong to.
    time : ndarray, shape (N,)
        Time stamps in s.
    position : ndarray, shape (n, N)
        Joint positions in rad or m, in the robot's joint order.
    effort : ndarray, shape (n, N), or None
        Efforts as they stand in the file, before any gain.
    row : ndarray of int, shape (N,)
        Number of each sample's row in the file; the first row of data is 1.
    """

    source: str
    robot: Robot
    time: Array
    position: Array
    effort: Array | None
    row: NDArray[np.intp]

    @property
    def count(self) -> int:
        """Number of samples."""
        return len(self.time)

    @property
    def interval(self) -> float:
        """Median time between samples, s."""
        return float(np.median(np.diff(self.time)))

    def kept(self, keep: NDArray[np.bool_]) -> Samples:
        """Return the samples where `keep` is true."""
        if keep.all():
            return self
        effort = None if self.effort is None else self.effort[:, keep]
        return Samples(self.source, self.robot, self.time[keep], self.position[:, keep], effort, self.row[keep])

    def channels(self) -> list[Array]:
        """Return all positions and efforts, each of shape (N,)."""
        return [*self.position, *(() if self.effort is None else self.effort)]

    def repeats(self) -> NDArray[np.bool_]:
        """Tell which samples repeat the one before in every channel, shape (N - 1,)."""
        same = np.ones(self.count - 1, dtype=bool)
        for signal in self.channels():
            same &= signal[1:] == signal[:-1]
        return same

    def where(self, index: int) -> str:
        """Name a sample for a person: its row in the file and its time."""
        return f"row {self.row[index]} ({self.clock(index)})"

    def clock(self, index: int) -> str:
        """Name the time of a sample: as it stands in the file, or from the first sample on where that counts from an epoch."""
        time, first = float(self.time[index]), float(self.time[0])
        if abs(first) < EPOCH:
            return f"{time:.6g} s"
        return f"{time - first:.6g} s after the first"

    def refuse(self, reason: str) -> NoReturn:
        """Raise that this file cannot be used."""
        raise RecordingError(f"{self.source}: {reason}")

    def idle(self) -> NDArray[np.bool_]:
        """Tell which joints stand still over the whole recording, shape (n,)."""
        idle: NDArray[np.bool_] = np.ptp(self.position, axis=1) < IDLE_TRAVEL * joint_range(self.robot)
        return idle


Checked = tuple[Samples, list[Finding]]
"""What a step of the audit leaves of the rows, and what it says."""


def joint_range(robot: Robot) -> Array:
    """Return the range of each joint, shape (n,); a turn or a metre where the URDF gives none."""
    span = robot.upper - robot.lower
    return np.where(np.isfinite(span) & (span > 0), span, np.where(robot.prismatic, 1.0, 2 * np.pi))


def speed_limit(robot: Robot) -> Array:
    """Return the velocity limit of each joint, shape (n,); infinite where the URDF gives none or 0."""
    return np.where(robot.velocity_limit > 0, robot.velocity_limit, np.inf)


def levels(values: Array) -> Array:
    """Return the different values of a signal in order, those that differ by rounding alone once."""
    found = np.unique(values)
    apart = np.diff(found) > ROUNDED * (found[-1] - found[0])
    return np.asarray(found[np.concatenate(([True], apart))])


def resolution(values: Array) -> float:
    """Return the smallest change of a signal from sample to sample; 0 where it never changes."""
    change = np.abs(np.diff(values))
    change = change[change > ROUNDED * np.ptp(values)]
    return float(np.min(change)) if len(change) else 0.0


def runs(same: NDArray[np.bool_]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Find where a signal repeats itself.

    Parameters
    ----------
    same : ndarray of bool, shape (N - 1,)
        Whether sample i + 1 equals sample i.

    Returns
    -------
    start, length : ndarray of int
        First sample of each run, and how many samples it has (at least 2).
    """
    edges = np.diff(np.concatenate(([False], same, [False])).astype(np.int8))
    start = np.flatnonzero(edges == 1)
    return start, np.flatnonzero(edges == -1) - start + 1
