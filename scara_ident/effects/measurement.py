"""What the measurement of torque does wrong: it bends, it is scaled, it is late."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from scara_ident.effects.effect import Member, NonlinearParameter, Parameter
from scara_ident.effects.signals import Scene, Signals
from scara_ident.model.terms import Column
from scara_ident.motion.motion import UNIFORM_TOLERANCE, differentiate
from scara_ident.recording.audit.samples import GAP_STEPS
from scara_ident.recording.recording import Recording

Array = NDArray[np.float64]

# The derivative of the predicted torque keeps this many times the band, so that the band itself is left alone.
DERIVATIVE_BAND = 3.0
# No controller lives with a longer lag than this many seconds, or than this many samples where those last longer.
LONGEST_DELAY = 0.05
LONGEST_DELAY_SAMPLES = 5.0
# Torque constants of one arm that differ by more than this are a wrong unit, not a mismatch.
LARGEST_MISMATCH = 0.5
# Torque that is held from one sample to the next, or averaged over one, is up to this many samples off its time stamp.
SAMPLING = 1.0


@dataclass(frozen=True)
class TorqueSensorNonlinearity:
    """A torque channel that is not straight: ``recorded = u + cubic u^3``.

    Above zero for a motor that saturates, so that its current says more than its torque; below zero for a channel
    that compresses. The column is the cube of the predicted torque, which is exact once the prediction is that of
    the model fitted together with it.
    """

    @property
    def name(self) -> str:
        """Name in the table of effects."""
        return "torque_sensor_nonlinearity"

    @property
    def nonlinear(self) -> tuple[NonlinearParameter, ...]:
        """It has no nonlinear parameter."""
        return ()

    def members(self, scene: Scene) -> tuple[Member, ...]:
        """One per joint."""
        return tuple(Member(j) for j in range(scene.robot.n))

    def columns(self, scene: Scene, member: Member) -> tuple[Column, ...]:
        """One column: the cubic coefficient."""
        joint = scene.robot.joints[member.joint or 0]
        return (Column("cubic", joint, _per_square(scene, member), f"cube of the torque in what {joint} records"),)

    def regressor(self, signals: Signals, member: Member) -> Array:
        """Return the cube of the predicted torque, shape (n, 1, N)."""
        j = member.joint or 0
        return signals.row(j, [signals.predicted[j] ** 3])

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """What is recorded grows with the torque, up to the torque limit."""
        limit = float(scene.robot.torque_limit[member.joint or 0])
        if np.isfinite(limit) and value[0] + 2.0 * std[0] < -1.0 / limit**2:
            return "the recorded torque would change sign below the torque limit"
        return None

    def parameters(self, scene: Scene, member: Member, value: Array, covariance: Array) -> Mapping[str, Parameter]:
        """Return the cubic coefficient."""
        return {"cubic": Parameter(float(value[0]), _std(covariance), _per_square(scene, member))}

    def description(self, scene: Scene, member: Member) -> str:
        """Say what it is."""
        return "a torque measurement, or torque constant, that depends on the torque"


@dataclass(frozen=True)
class TorqueGainMismatch:
    """A torque scale that differs from the first joint's: ``recorded = ratio u``.

    A scale that is wrong for all joints alike goes into all parameters; what the first joint's torque says of the
    parameters that it shares with this one tells the ratio, weakly.
    """

    @property
    def name(self) -> str:
        """Name in the table of effects."""
        return "torque_gain_mismatch"

    @property
    def nonlinear(self) -> tuple[NonlinearParameter, ...]:
        """It has no nonlinear parameter."""
        return ()

    def members(self, scene: Scene) -> tuple[Member, ...]:
        """One per joint after the first."""
        return tuple(Member(j) for j in range(1, scene.robot.n))

    def columns(self, scene: Scene, member: Member) -> tuple[Column, ...]:
        """One column: how much the ratio differs from 1."""
        joint = scene.robot.joints[member.joint or 0]
        return (Column("ratio_less_one", joint, "1", f"torque scale of {joint} over the first joint's, less 1"),)

    def regressor(self, signals: Signals, member: Member) -> Array:
        """Return the predicted torque, shape (n, 1, N)."""
        j = member.joint or 0
        return signals.row(j, [signals.predicted[j]])

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """Torque constants of one arm are not that far apart."""
        if abs(value[0]) > LARGEST_MISMATCH + 2.0 * std[0]:
            return f"a torque scale that differs by {value[0]:+.0%} from the first joint's is no mismatch"
        return None

    def parameters(self, scene: Scene, member: Member, value: Array, covariance: Array) -> Mapping[str, Parameter]:
        """Return the ratio."""
        return {"ratio": Parameter(1.0 + float(value[0]), _std(covariance), "1")}

    def description(self, scene: Scene, member: Member) -> str:
        """Say what it is."""
        return "a torque scale that differs from the first joint's"


@dataclass(frozen=True)
class TimeDelay:
    """Effort that is recorded later than position: ``recorded(t) = u(t - delay)``, of all joints or of one.

    To first order ``recorded = u - delay du/dt``. Terms of even order are out of phase with it, so that what is left
    is ``delay^3/6``; shifting the data by what was found and looking again removes that too (see `shifted`).
    """

    @property
    def name(self) -> str:
        """Name in the table of effects."""
        return "time_delay"

    @property
    def nonlinear(self) -> tuple[NonlinearParameter, ...]:
        """It has no nonlinear parameter."""
        return ()

    def members(self, scene: Scene) -> tuple[Member, ...]:
        """One for all joints together, then one per joint."""
        n = scene.robot.n
        return (Member(None), *(Member(j) for j in range(n) if n > 1))

    def columns(self, scene: Scene, member: Member) -> tuple[Column, ...]:
        """One column: the delay."""
        joint = None if member.joint is None else scene.robot.joints[member.joint]
        return (Column("delay", joint, "s", f"delay of the effort of {joint or 'all joints'} behind position"),)

    def regressor(self, signals: Signals, member: Member) -> Array:
        """Return ``-du/dt`` of the predicted torque, shape (n, 1, N)."""
        rows = slice(None) if member.joint is None else slice(member.joint, member.joint + 1)
        rate, band = signals.motion.rate, DERIVATIVE_BAND * signals.scene.band
        cut = band if band < 0.45 * rate else None
        result = np.zeros((signals.scene.robot.n, 1, signals.motion.samples))
        result[rows, 0] = -differentiate(signals.predicted[rows], rate, cut)[1]
        return result

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """No loop is that late."""
        longest = max(LONGEST_DELAY, LONGEST_DELAY_SAMPLES / scene.rate)
        if abs(value[0]) > longest + 2.0 * std[0]:
            return f"a delay of {value[0]:.3g} s is longer than any measurement's"
        return None

    def parameters(self, scene: Scene, member: Member, value: Array, covariance: Array) -> Mapping[str, Parameter]:
        """Return the delay."""
        return {"delay": Parameter(float(value[0]), _std(covariance), "s")}

    def description(self, scene: Scene, member: Member) -> str:
        """Say what it is."""
        return "effort that is recorded later than position"


def within_sampling(delay: float, rate: float) -> bool:
    """Return whether a delay is no longer than a sample: a matter of how samples are taken, to correct but not to name.

    Parameters
    ----------
    delay : float
        s.
    rate : float
        Samples per second.
    """
    return abs(delay) * rate <= SAMPLING


def shifted(recording: Recording, delay: float, joints: Sequence[int] | None = None) -> Recording:
    """Return a recording whose effort is moved back by a delay: the effort at t is that recorded at t + delay.

    Uniform stretches are shifted in the frequency domain, after odd reflection at their ends, and so lose nothing at
    any frequency; jittered ones are interpolated by a cubic spline. Nothing is moved across gaps.

    Parameters
    ----------
    recording : Recording
    delay : float
        s, positive where effort lags position.
    joints : sequence of int, optional
        Places of the joints whose effort is moved; by default all.

    Returns
    -------
    Recording
    """
    if recording.effort is None or delay == 0.0:
        return recording
    rows = np.arange(len(recording.effort)) if joints is None else np.asarray(joints, dtype=np.intp)
    effort = recording.effort.copy()
    step = np.diff(recording.time)
    median = float(np.median(step))
    bounds = [0, *(np.flatnonzero(step > GAP_STEPS * median) + 1).tolist(), len(recording.time)]
    for start, stop in pairwise(bounds):
        if stop - start < 4:
            continue
        part = slice(start, stop)
        time = recording.time[part]
        ideal = np.linspace(time[0], time[-1], len(time))
        if np.max(np.abs(time - ideal)) <= UNIFORM_TOLERANCE * median:
            effort[rows, part] = _advanced(recording.effort[rows, part], delay / float(ideal[1] - ideal[0]))
        else:
            from scipy.interpolate import CubicSpline

            at = np.clip(time + delay, time[0], time[-1])
            effort[rows, part] = CubicSpline(time, recording.effort[rows, part], axis=1)(at)
    return replace(recording, effort=effort)


def _advanced(signal: Array, steps: float) -> Array:
    """Return a uniform signal ``steps`` samples earlier, shape (k, N)."""
    count = signal.shape[1]
    reach = min(count - 1, int(np.ceil(abs(steps))) + 64)
    head = 2.0 * signal[:, :1] - signal[:, reach:0:-1]
    tail = 2.0 * signal[:, -1:] - signal[:, -2 : -reach - 2 : -1]
    extended = np.concatenate([head, signal, tail], axis=1)
    length = extended.shape[1]
    # Without its chord the continued signal closes on itself; the chord is shifted as the line that it is.
    slope = (extended[:, -1:] - extended[:, :1]) / (length - 1)
    ramp = extended[:, :1] + slope * np.arange(length)
    spectrum = np.fft.rfft(extended - ramp, axis=1)
    phase = np.exp(2j * np.pi * np.fft.rfftfreq(length) * steps)
    if length % 2 == 0:
        phase[-1] = phase[-1].real
    moved = np.fft.irfft(spectrum * phase, length, axis=1) + ramp + slope * steps
    return np.asarray(moved[:, reach : reach + count])


def _std(covariance: Array) -> float:
    return float(np.sqrt(covariance[0, 0]))


def _per_square(scene: Scene, member: Member) -> str:
    unit = scene.robot.torque_unit(member.joint or 0)
    return f"1/({unit})^2" if " " in unit else f"1/{unit}^2"
