"""Errors of the torque measurement: nonlinearity, wrong scale, delay."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, ClassVar

import numpy as np

from scara_ident.arrays import Array
from scara_ident.effects.effect import DOUBT_STDS, Effect
from scara_ident.effects.following import EstimateSlopes, predicted_slopes
from scara_ident.effects.links import shared
from scara_ident.effects.parameters import Coefficient, Member, Parameter, View, deviation
from scara_ident.effects.position_filter import FILTERED, PositionFilter
from scara_ident.effects.scale_groups import scale_groups
from scara_ident.effects.signals import Scene, Signals
from scara_ident.effects.torque_filter import TorqueFilter
from scara_ident.motion.low_pass import derivative
from scara_ident.motion.motion import UNIFORM_TOLERANCE
from scara_ident.motion.spline import cubic_spline
from scara_ident.motion.transfer import through
from scara_ident.recording.audit.samples import GAP_STEPS
from scara_ident.recording.recording import Recording

# No controller lives with a longer lag than this many seconds.
LONGEST_DELAY = 0.05
# It may have this many samples where those last longer: a slow log is late by whole samples.
LONGEST_DELAY_SAMPLES = 5.0
# Torque scales of one arm that differ by more than this factor, either way, are a wrong unit, not a mismatch.
LARGEST_MISMATCH = 2.0
# Of so few joints that share parameters either may be the one whose scale is wrong; of more, most agree.
MAX_AMBIGUOUS_JOINTS = 2
# Torque that is held from one sample to the next, or averaged over one, is up to this many samples off its time stamp.
SAMPLING = 1.0
# Data are corrected until a further delay is below this, s.
DELAY_STEP = 2e-5


class TorqueSensorNonlinearity(Effect):
    """A nonlinear torque channel: ``recorded = u + cubic u^3``.

    ``cubic`` is positive for a motor that saturates, so that its current is larger than its torque indicates, and
    negative for a channel that compresses. The column is the cube of the predicted torque; it is exact once the
    prediction comes from the model that was fitted together with it.
    """

    power: ClassVar[int] = 3

    name = "torque_sensor_nonlinearity"
    summary = "a torque measurement, or torque constant, that depends on the torque"
    coefficients = (
        Coefficient("cubic", "1/{square}", "coefficient of the cubed torque in the recorded torque of {joint}"),
    )
    at_rest = True
    follows_estimate = True
    fitted_first = True
    of_state = True
    view = View("torque")
    experiment = "hold a known load at several torques, or repeat with a payload at the same speed"

    def words(self, scene: Scene, member: Member) -> dict[str, Any]:
        """Add the unit of the torque's square."""
        unit = scene.robot.torque_unit(member.place)
        return super().words(scene, member) | {"square": f"({unit})^2" if " " in unit else f"{unit}^2"}

    def signal_columns(self, signals: Signals, member: Member) -> Iterable[Array]:
        """Return the power of the predicted torque."""
        return [signals.predicted[member.place] ** self.power]

    def estimate_slopes(self, signals: Signals, member: Member, value: Array) -> EstimateSlopes:
        """Return those of the power."""
        places, rows = predicted_slopes(signals, member.place)
        slope = self.power * value[0] * signals.predicted[member.place] ** (self.power - 1)
        return {member.place: (places, slope * rows)}

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """Say so where what is recorded does not grow with the torque, up to the largest that the recordings hold."""
        # As near to none as may be.
        least = np.sign(value[0]) * max(abs(value[0]) - DOUBT_STDS * std[0], 0.0)
        for torque in _torque_range(scene, member.place):
            if np.isfinite(torque) and 1.0 + self.power * least * torque ** (self.power - 1) < 0.0:
                return f"the recorded torque would not grow with the true torque up to {torque:.2g} {scene.robot.torque_unit(member.place)}"
        return None


class BentTorqueSensor(TorqueSensorNonlinearity):
    """A torque channel with a quadratic error: ``recorded = u + square u^2``.

    For example a torque constant, or a sensor's gain, that depends on the sign of the torque. On a joint whose load has
    one sign the cubic law explains nearly the same, and other effects may be taken for the rest.
    """

    power = 2
    coefficients = (
        Coefficient("square", "1/({torque})", "coefficient of the squared torque in the recorded torque of {joint}"),
    )


def _torque_range(scene: Scene, joint: int) -> tuple[float, float]:
    """Return the least and the largest torque that the base model says of recordings, recorded side; without any the limit's.

    A channel that bends within the range of the data need not do so by the same law up to the limit, which few recordings reach.
    """

    def found() -> tuple[float, float]:
        own = scene.value[scene.model.active[joint]]
        torques = [own @ rows[joint] for rows in scene.columns.values()]
        return min(float(np.min(u, initial=0.0)) for u in torques), max(float(np.max(u, initial=0.0)) for u in torques)

    limit = float(scene.robot.torque_limit[joint])
    return shared(scene, ("torque range", joint), found) if scene.columns else (-limit, limit)


class TorqueGainMismatch(Effect):
    """A torque scale that differs from that of the other joints: ``recorded = scale u``.

    A scale error that is common to all joints is absorbed by all parameters. Two joints whose torques depend on common
    parameters determine the ratio of their scales, though weakly; joints without common parameters, or at rest, do not
    (`scale_groups`). The joints that are not named agree with one another. ``ratio`` is the joint's scale divided by
    that of the first joint with which it has common parameters, even if that joint differs too. That joint is then
    named itself, with the ratio of its scale to that of the joints that are not named. If only two joints have common
    parameters, it is not known which scale is wrong: the second is named.
    """

    name = "torque_gain_mismatch"
    summary = "a torque scale that differs from the other joints', relative to the first joint's"
    coefficients = (
        Coefficient("ratio_less_one", "1", "torque scale of {joint} divided by that of the joints that agree, minus 1"),
    )
    follows_estimate = True
    of_state = True
    view = View("torque")
    experiment = "repeat with a known payload: it gives all joints the same scale"

    def description(self, scene: Scene, member: Member) -> str:
        """Say over whose scale it is given: two joints that both differ from the others may have the same."""
        first = _compared(scene, member)[0]
        if member.joint == first:
            return "a torque scale that differs from the other joints', relative to that of the joints not named"
        return (
            f"a torque scale that differs from the other joints', relative to that of {scene.robot.joints[first]}"
            if first
            else self.summary
        )

    def joints(self, scene: Scene) -> list[int]:
        """Return all joints whose scale another's tells; of two the second, as either explains what the other does."""
        groups = [group for group in _groups(scene) if len(group) > 1]
        return sorted(j for group in groups for j in (group if len(group) > MAX_AMBIGUOUS_JOINTS else group[1:]))

    def or_else(self, scene: Scene, member: Member, value: Array) -> str:
        """Say of two joints that it may be the other one."""
        return (
            ""
            if len(_compared(scene, member)) > MAX_AMBIGUOUS_JOINTS
            else "; with two joints it is not known which scale is wrong"
        )

    def or_else_beside(self, member: Member, value: Array, others: Sequence[tuple[Effect, Member, Array]]) -> str:
        """Name a gear that loses another share where it is driven: such a scale beside a share that is lost either way is one."""
        for effect, other, size in others:
            if effect.geared_joint(other) != member.joint:
                continue
            passed = [effect.passes_on(other, size, driving) for driving in (1.0, -1.0)]
            drives, driven = ((1.0 + float(value[0])) / share - 1.0 if share else 0.0 for share in passed)
            if drives > 0.0 > driven:
                return f"; or the gear loses {drives:.1%} of the torque when the motor drives the load and {-driven:.1%} when the load drives the motor"
        return ""

    def signal_columns(self, signals: Signals, member: Member) -> Iterable[Array]:
        """Return the predicted torque."""
        return [signals.predicted[member.place]]

    def estimate_slopes(self, signals: Signals, member: Member, value: Array) -> EstimateSlopes:
        """Return the coefficient times those of the predicted torque."""
        places, rows = predicted_slopes(signals, member.place)
        return {member.place: (places, value[0] * rows)}

    def estimated_beside(self, scene: Scene, member: Member) -> Member | None:
        """Return that of the first joint, to whose scale the ratio is."""
        first = _compared(scene, member)[0]
        return None if member.joint == first else Member(first)

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """Say so of a scale that no two torque constants of an arm differ by."""
        spread = DOUBT_STDS * std[0]
        if 1.0 / LARGEST_MISMATCH - spread <= 1.0 + value[0] <= LARGEST_MISMATCH + spread:
            return None
        return f"a torque scale {1.0 + value[0]:.3g} times that of the other joints is too far from 1 for this effect"

    def parameters(self, scene: Scene, member: Member, value: Array, covariance: Array) -> Mapping[str, Parameter]:
        """Return the ratio: to the first joint's scale, of which ``value[1]`` says by how much it differs where it does."""
        scale = 1.0 + value
        if len(value) == 1:
            return {"ratio": Parameter(float(scale[0]), deviation(covariance), "1")}
        ratio = float(scale[0] / scale[1])
        slope = np.array([1.0, -ratio]) / scale[1]
        return {"ratio": Parameter(ratio, float(np.sqrt(max(slope @ covariance @ slope, 0.0))), "1")}


def _compared(scene: Scene, member: Member) -> tuple[int, ...]:
    """Return the joints whose scales are compared, that of a member among them."""
    return next(group for group in _groups(scene) if member.place in group)


def _groups(scene: Scene) -> tuple[tuple[int, ...], ...]:
    return scale_groups(scene.model.rigid_body, tuple(scene.moving.tolist()))


class TimeDelay(Effect):
    """Effort that is recorded later than position: ``recorded(t) = u(t - delay)``, of all joints or of one.

    To first order ``recorded = u - delay du/dt``. Terms of even order are out of phase with it, so the remaining error
    is ``delay^3/6``. Shifting the data by the delay found and estimating again removes this too; it is done for a delay
    of all joints. A delay of at most one sample comes from the sampling: it is corrected but not counted as an effect.
    """

    name = "time_delay"
    summary = "effort that is recorded later than position"
    coefficients = (Coefficient("delay", "s", "delay of the effort of {joint} behind position"),)
    follows_estimate = True
    same_at_all_frequencies = True
    view = View("torque rate")
    experiment = "run the same path at two speeds: a delay's error grows with the third power of speed"

    def or_else(self, scene: Scene, member: Member, value: Array) -> str:
        """Say which of both is late where the delay is negative."""
        return (
            ": the delay is negative, so the position is later than the effort, for example because of its own filter"
            if value[0] < 0.0
            else ""
        )

    def members(self, scene: Scene) -> tuple[Member, ...]:
        """Return one for all joints together, then one per joint."""
        n = scene.robot.n
        return (Member(None), *(Member(j) for j in range(n) if n > 1))

    def signal_columns(self, signals: Signals, member: Member) -> Iterable[Array]:
        """Return ``-du/dt`` of the predicted torque."""
        rows = slice(None) if member.joint is None else slice(member.joint, member.joint + 1)
        change = lacking(signals, signals.predicted[rows])
        return [change if member.joint is None else change[0]]

    def of_torque(self, signals: Signals, member: Member, torque: Array) -> Array | None:
        """Return what that lacks, of all joints: all that is recorded is late, and a ripple turns what it does to the motion round."""
        return lacking(signals, torque)[:, None] if self.corrects_data(member) else None

    def estimate_slopes(self, signals: Signals, member: Member, value: Array) -> EstimateSlopes:
        """Return what each of the base model's columns lacks."""
        found = {joint: predicted_slopes(signals, joint) for joint in self.rows(signals.scene, member)}
        return {joint: (places, value[0] * lacking(signals, rows)) for joint, (places, rows) in found.items()}

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """Say so where no loop is that late."""
        longest = max(LONGEST_DELAY, LONGEST_DELAY_SAMPLES / scene.rate)
        if abs(value[0]) > longest + DOUBT_STDS * std[0]:
            return f"a delay of {value[0]:.3g} s is longer than any measurement has"
        return None

    def corrects_data(self, member: Member) -> bool:
        """Return whether it is that of all joints."""
        return member.joint is None

    def corrected(self, recording: Recording, member: Member, value: Array) -> Recording:
        """Return a recording whose effort is moved back."""
        return shifted(recording, float(value[0]), None if member.joint is None else [member.joint])

    def settled(self, value: Array) -> bool:
        """Whether the delay is below `DELAY_STEP`."""
        return abs(float(value[0])) < DELAY_STEP

    def negligible(self, scene: Scene, member: Member, value: Array) -> str | None:
        """Say so where it is no longer than a sample."""
        if abs(float(value[0])) * scene.rate > SAMPLING:
            return None
        if member.joint is not None:
            return "less than one sample: it depends on where in its period a sample is taken"
        return (
            f"effort and position are {float(value[0]) * 1e3:+.2g} ms apart, less than one sample, for example because "
            f"each sample is held until the next"
        )

    def distinguished_from(self, scene: Scene, member: Member) -> tuple[tuple[Effect, Member], ...]:
        """Return when the friction of each of its joints turns."""
        return tuple((LateTurn(), Member(joint)) for joint in self.rows(scene, member))

    def leaves(self, scene: Scene, member: Member, value: Array) -> tuple[Effect, Member, float] | None:
        """Return the rest of a filter of positions or efforts, whichever is later, if it is late by more than a sample."""
        if self.negligible(scene, member, value):
            return None
        delay = float(value[0])
        left = TorqueFilter(delay) if delay > 0.0 else PositionFilter()
        return left, Member(None), FILTERED / abs(delay)


class LateTurn(Effect):
    """Coulomb friction of a joint that jumps later than the filtered velocity turns.

    It is no part of an arm and in no catalogue. Acceleration changes where friction jumps, and a narrow filter, which rounds that off,
    moves the time of the turn, by 1.7 ms in a band of 7 Hz; friction that builds up over a distance is late too. In so narrow a band the
    few rows where friction jumps have most of what the torque's rate has beyond the model, and would tell a delay that no other row has.
    """

    name = "late_turn"
    summary = "friction that changes sign later than the velocity"
    coefficients = (Coefficient("step_delay", "{torque} s", "Coulomb friction of {joint} times its delay"),)
    not_simulated = "it is not a property of the arm"

    def signal_columns(self, signals: Signals, member: Member) -> Iterable[Array]:
        """Return what one unit of Coulomb friction lacks for each second that it is late."""
        return lacking(signals, signals.sign[member.place : member.place + 1])


def lacking(signals: Signals, torque: Array) -> Array:
    """Return what a torque (k, N) lacks for each second that it is late, ``-du/dt``."""
    return -derivative(torque, signals.motion.rate, signals.derivative_cut, 1)


def shifted(recording: Recording, delay: float, joints: Sequence[int] | None = None) -> Recording:
    """Return a recording whose effort is moved back by a delay: the effort at t is that recorded at t + delay.

    Uniform stretches are shifted in the frequency domain, after odd reflection at their ends, and so lose nothing at
    any frequency; jittered ones are interpolated by a cubic spline. Nothing is moved across gaps.

    Parameters
    ----------
    delay : float
        s, positive where effort lags position.
    joints : sequence of int, optional
        Places of the joints whose effort is moved; by default all.
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
            at = np.clip(time + delay, time[0], time[-1])
            effort[rows, part] = cubic_spline(time, recording.effort[rows, part], at)
    return replace(recording, effort=effort)


def _advanced(signal: Array, steps: float) -> Array:
    """Return a uniform signal ``steps`` samples earlier, shape (k, N)."""
    moved, chord, slope = through(signal, lambda omega: np.exp(1j * omega * steps), int(np.ceil(abs(steps))) + 64)
    return moved + chord + slope * steps
