"""From recorded positions to motion: uniform time, low-passed positions, velocities and accelerations."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array, median
from scara_ident.errors import RecordingError
from scara_ident.manners import Frozen
from scara_ident.motion.encoder_steps import encoder_step
from scara_ident.motion.low_pass import differentiate
from scara_ident.motion.spline import cubic_spline
from scara_ident.recording.audit.samples import GAP_STEPS
from scara_ident.recording.long_file import cut_long
from scara_ident.recording.recording import Recording
from scara_ident.threads import LONG_ARRAY, THREADS, side_by_side, threads_for, works_alone

# A time step that differs by less than this share from the median is not jitter.
UNIFORM_TOLERANCE = 1e-3
# Between two gaps a joint that travels less than this share of what it does in the whole recording is held by its servo.
HELD_SHARE = 1e-3


@dataclass(frozen=True, eq=False, repr=False)
class Motion(Frozen):
    """A stretch of motion without gaps, at uniform time steps.

    Attributes
    ----------
    name, trajectory : str
        The recording it belongs to, and that recording's trajectory.
    time : ndarray, shape (N,)
        s.
    q, v, a : ndarray, shape (n, N)
        Position, velocity and acceleration in the order of the robot's joints.
    torque : ndarray, shape (n, N) or None
        Recorded torque, not filtered.
    rate : float
        Samples per second.
    fade : ndarray, shape (n, N), or None
        Weight of every sample of each joint's torque, 0 where the joint stands still and friction is unknown, see
        `fading`; None if not given.
    cuts : tuple of float or None, one per joint
        Low-pass of the positions, Hz; empty if not filtered.
    """

    name: str
    trajectory: str
    time: Array
    q: Array
    v: Array
    a: Array
    torque: Array | None
    rate: float
    fade: Array | None = None
    cuts: tuple[float | None, ...] = ()
    # A copy of other positions has no such.
    _same: Motion | None = field(default=None, init=False, repr=False)

    @property
    def samples(self) -> int:
        """Number of samples."""
        return len(self.time)

    @property
    def kinematics(self) -> Motion:
        """The first of the motions that differ only in torque; results that depend only on the state are kept under it."""
        return self if self._same is None else self._same

    def with_torque(self, torque: Array | None) -> Motion:
        """Return the motion with another recorded torque, shape (n, N)."""
        found = replace(self, torque=torque)
        vars(found)["_same"] = self.kinematics
        return found

    def decimated(self, every: int, torque: Array | None) -> Motion:
        """Return every so many samples, from the first on, with the torque given at these, shape (n, ceil(N / every))."""
        q, v, a = (np.ascontiguousarray(part[:, ::every]) for part in (self.q, self.v, self.a))
        fade = None if self.fade is None else np.ascontiguousarray(self.fade[:, ::every])
        time = self.time[::every]
        return Motion(self.name, self.trajectory, time, q, v, a, torque, self.rate / every, fade, self.cuts)

    def part(self, start: int, stop: int) -> Motion:
        """Return the samples from ``start`` to before ``stop``."""
        window = slice(start, stop)
        return Motion(
            self.name,
            self.trajectory,
            self.time[window],
            self.q[:, window],
            self.v[:, window],
            self.a[:, window],
            None if self.torque is None else self.torque[:, window],
            self.rate,
            None if self.fade is None else self.fade[:, window],
            self.cuts,
        )


@dataclass(frozen=True, eq=False)
class Stretch:
    """A gapless part of a recording on a uniform time grid, before any filter.

    Attributes
    ----------
    name, trajectory : str
        The recording it belongs to, and that recording's trajectory.
    time : ndarray, shape (N,)
        s.
    position : ndarray, shape (n, N)
    torque : ndarray, shape (n, N) or None
    rate : float
        Samples per second.
    source : slice
        Samples of the recording that it was made of.
    clipped : ndarray of bool, shape (n, N), or False
        Where a torque is at the value at which the recording is clipped, or stuck most of the time.
    idle : ndarray of bool, shape (n,), or False
        Joints that are held by their servos all the while: of a tremor nothing is learnt, however fast it is beside itself.
    steps : tuple of float or None, one per joint
        In which its encoder has the recorded positions, see `encoder_step`; empty where nobody looked.
    """

    name: str
    trajectory: str
    time: Array
    position: Array
    torque: Array | None
    rate: float
    source: slice
    clipped: NDArray[np.bool_] | bool = False
    idle: NDArray[np.bool_] | bool = False
    steps: tuple[float | None, ...] = ()
    _filtered: dict[tuple[int, float | None], tuple[Array, Array, Array]] = field(default_factory=dict, repr=False)
    _thinned: dict[int, Stretch] = field(default_factory=dict, repr=False)

    def filtered(self, joint: int, cut: float | None) -> tuple[Array, Array, Array]:
        """Return position, velocity and acceleration of a joint, low-passed at ``cut`` Hz, made once."""
        if (joint, cut) not in self._filtered:
            self.filter_all({joint: cut})
        return self._filtered[joint, cut]

    def forget_filtered(self, cuts: Collection[float | None]) -> None:
        """Forget what was low-passed at some cut-offs, which nothing asks for any more."""
        for key in [key for key in self._filtered if key[1] in cuts]:
            del self._filtered[key]

    def filter_all(self, cuts: Mapping[int, float | None]) -> None:
        """Low-pass positions of joints, each at its cut-off in Hz, those of one cut-off together."""
        missing = [item for item in cuts.items() if item not in self._filtered]
        groups = [[joint for joint, own in missing if own == cut] for cut in dict.fromkeys(cut for _, cut in missing)]
        if self.position.shape[1] >= LONG_ARRAY and not works_alone():
            # Of one recording alone its joints are what two threads share.
            groups = [group[k::THREADS] for group in groups for k in range(min(THREADS, len(group)))]

        def of_some(joints: list[int]) -> tuple[Array, Array, Array]:
            return differentiate(self.position[joints], self.rate, cuts[joints[0]])

        with threads_for(self.position.shape[1]):
            made = side_by_side(of_some, groups)
        for joints, parts in zip(groups, made, strict=True):
            self._filtered.update(
                {(joint, cuts[joint]): own for joint, own in zip(joints, zip(*parts, strict=True), strict=True)}
            )


def stretches(recording: Recording) -> tuple[Stretch, ...]:
    """Cut a recording at its gaps and put each part on a uniform time grid.

    Positions with time jitter are interpolated by a cubic spline, torque linearly, at the sample rate, which includes
    dropped samples.

    Parameters
    ----------
    recording : Recording

    Returns
    -------
    tuple of Stretch
        At least one; parts of fewer than four samples are left out.

    Raises
    ------
    RecordingError
        If no part is long enough.
    """
    step = np.diff(recording.time)
    middle = median(step)
    # Nothing is interpolated across a gap.
    cuts = np.flatnonzero(step > GAP_STEPS * middle) + 1
    bounds = cut_long(sorted({0, *cuts.tolist(), *recording.cuts, len(recording.time)}))
    # On another time grid positions are between the steps.
    steps = tuple(encoder_step(row) for row in recording.position)
    idle = np.isin(np.arange(len(recording.joints)), [joint for item in recording.findings for joint in item.idle])
    least = HELD_SHARE * np.ptp(recording.position, axis=1)
    found = []
    for start, stop in pairwise(bounds):
        if stop - start < 4:
            continue
        held = idle | (np.ptp(recording.position[:, start:stop], axis=1) < least)
        found.append(replace(_uniform(recording, start, stop, middle), idle=held, steps=steps))
    if not found:
        raise RecordingError(f"{recording.path or recording.name}: no four samples in a row without a gap in time")
    return tuple(found)


def _uniform(recording: Recording, start: int, stop: int, step: float) -> Stretch:
    source = slice(start, stop)
    time, position = recording.time[source], recording.position[:, source]
    count = len(time)
    ideal = time[0] + (time[-1] - time[0]) / (count - 1) * np.arange(count)
    if np.max(np.abs(time - ideal)) > UNIFORM_TOLERANCE * step:
        # The median of jittered steps is off by up to a per cent; the number of steps is not.
        steps = int(np.sum(np.maximum(np.rint(np.diff(time) / step), 1.0)))
        ideal = np.linspace(time[0], time[-1], steps + 1)
        position = cubic_spline(time, position, ideal)
    rate = (len(ideal) - 1) / (ideal[-1] - ideal[0])
    torque = _torque_at(recording, source, ideal, step)
    clipped = _clipped_at(recording, source, ideal)
    return Stretch(recording.name, recording.trajectory, ideal, position, torque, float(rate), source, clipped)


def _clipped_at(recording: Recording, source: slice, grid: Array) -> NDArray[np.bool_] | bool:
    """Tell where a grid has torques of clipped samples, from the values that the audit found to be clipped or stuck."""
    bounds = [finding.clipped for finding in recording.findings if finding.clipped is not None]
    if recording.effort is None or not bounds:
        return False
    clipped = np.zeros((len(recording.joints), len(grid)), dtype=bool)
    for joint, torque in bounds:
        at = (recording.effort[joint, source] == torque).astype(float)
        clipped[joint] |= np.interp(grid, recording.time[source], at) > 0.0
    return clipped


def _torque_at(recording: Recording, source: slice, grid: Array, step: float) -> Array | None:
    """Return the effort of a part of a recording on a uniform grid, as it is where the samples lie on it."""
    if recording.effort is None:
        return None
    time, effort = recording.time[source], recording.effort[:, source]
    if len(time) == len(grid) and np.max(np.abs(time - grid)) <= UNIFORM_TOLERANCE * step:
        return effort
    return np.array([np.interp(grid, time, row) for row in effort])


def with_effort_of(stretch: Stretch, recording: Recording) -> Stretch:
    """Return a stretch with the effort of another recording of the same samples; the motion is shared."""
    middle = median(np.diff(recording.time))
    return replace(stretch, torque=_torque_at(recording, stretch.source, stretch.time, middle))


def torque_of(stretch: Stretch) -> Array:
    """Return the recorded torque of a stretch, shape (n, N).

    Raises
    ------
    RecordingError
        If no effort was recorded.
    """
    if stretch.torque is None:
        raise RecordingError(f"{stretch.name}: no effort was recorded; it is needed to identify")
    return stretch.torque


def motion_of(stretch: Stretch, cuts: Sequence[float | None]) -> Motion:
    """Filter and differentiate the positions of a stretch.

    Parameters
    ----------
    stretch : Stretch
    cuts : sequence of float or None, one per joint
        Cutoff frequency of each joint's position in Hz; None: not filtered.

    Returns
    -------
    Motion
        On the whole time grid of the stretch; its ends contain an extrapolation.
    """
    wanted = dict(zip(range(len(stretch.position)), cuts, strict=True))
    stretch.filter_all(wanted)
    parts = [stretch.filtered(*item) for item in wanted.items()]
    q, v, a = (np.array([part[k] for part in parts]) for k in range(3))
    # What is held of them is this, once.
    stretch._filtered.update(zip(wanted.items(), zip(q, v, a, strict=True), strict=True))
    found = Motion(stretch.name, stretch.trajectory, stretch.time, q, v, a, stretch.torque, stretch.rate)
    return replace(found, cuts=tuple(cuts))


def thinned(stretch: Stretch, step: int) -> Stretch:
    """Return means over ``step`` samples in a row, of position and torque alike; the motion is made once.

    White noise keeps its density below the new rate: a mean has 1/step of the samples' power. A stretch of fewer than four
    such means stays as it is.
    """
    if step == 1 or len(stretch.time) < 4 * step:
        return stretch
    if step not in stretch._thinned:
        stretch._thinned[step] = Stretch(
            stretch.name,
            stretch.trajectory,
            _means(stretch.time, step),
            _means(stretch.position, step),
            None,
            stretch.rate / step,
            stretch.source,
            stretch.clipped if isinstance(stretch.clipped, bool) else _means(stretch.clipped.astype(float), step) > 0.0,
            stretch.idle,
            stretch.steps,
        )
    torque = None if stretch.torque is None else _means(stretch.torque, step)
    return replace(stretch._thinned[step], torque=torque)


def _means(signal: Array, step: int) -> Array:
    count = signal.shape[-1] // step
    return np.asarray(signal[..., : count * step].reshape(*signal.shape[:-1], count, step).mean(axis=-1))
