"""Torques and readings that are periodic in the motor's angle or in time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scara_ident.effects.effect import Member, NonlinearParameter, Parameter
from scara_ident.effects.friction import amplitude_and_phase, friction_slope, moving
from scara_ident.effects.links import rigid_torque, shared
from scara_ident.effects.signals import Scene, Signals
from scara_ident.model.terms import Column

Array = NDArray[np.float64]

# Orders that gears and motors have; others are found in the residual's spectrum.
ORDERS = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 12.0)
ENCODER_ORDERS = (1.0, 2.0)
# A line is looked for where the travel holds this many periods, and where the joint at this share of its largest
# speed leaves it within the band.
LEAST_PERIODS = 2.0
SLOW_SHARE = 0.03
# Above this share of the sample rate a sampled sine is another one.
FASTEST = 0.4
# Steps that differentiate the torque by position (rad or m) and, as a share of the largest speed or 1, by velocity.
POSITION_STEP = 1e-5
SPEED_STEP = 1e-4
# No encoder errs by more than this, rad of the motor; beyond it the linear form ends too.
LARGEST_ECCENTRICITY = 0.1


@dataclass(frozen=True)
class TorqueRipple:
    """A torque periodic in the motor's angle: ``u = amplitude sin(order theta_m + phase)``, theta_m = N q.

    N has the gear's sign, and q is zero where the joint's position is. The phase is one for all recordings, as with
    an encoder that knows its place in the turn.
    """

    @property
    def name(self) -> str:
        """Name in the table of effects."""
        return "torque_ripple"

    @property
    def nonlinear(self) -> tuple[NonlinearParameter, ...]:
        """Periods per motor turn."""
        return (NonlinearParameter("order", "1 / motor turn", 0.05, 1000.0, False),)

    def members(self, scene: Scene) -> tuple[Member, ...]:
        """Every joint at the orders of gears and motors, as far as they can be seen."""
        return tuple(Member(j, (order,)) for j in moving(scene) for order in ORDERS if _visible(scene, j, order))

    def resolution(self, scene: Scene, member: Member) -> tuple[float, ...]:
        """Return how far apart two orders must be to be told apart: one over the motor turns covered."""
        return (_order_resolution(scene, member.joint or 0),)

    def columns(self, scene: Scene, member: Member) -> tuple[Column, ...]:
        """Two columns, sine and cosine."""
        j = member.joint or 0
        joint, unit = scene.robot.joints[j], scene.robot.torque_unit(j)
        return tuple(
            Column(
                f"ripple_{part}", joint, unit, f"{part} of {member.nonlinear[0]:g} times the motor's angle of {joint}"
            )
            for part in ("sine", "cosine")
        )

    def regressor(self, signals: Signals, member: Member) -> Array:
        """Return sine and cosine of the order times the motor's angle, shape (n, 2, N)."""
        j, order = member.joint or 0, member.nonlinear[0]
        angle = order * signals.motor_turns[j]
        seen = _seen(signals, j, order)
        return signals.row(j, [seen * np.sin(angle), seen * np.cos(angle)])

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """Any amplitude within the torque limit is possible."""
        limit = float(scene.robot.torque_limit[member.joint or 0])
        if float(np.hypot(*value)) - 2.0 * float(np.max(std)) > limit:
            return "the ripple would be larger than the torque limit"
        return None

    def parameters(self, scene: Scene, member: Member, value: Array, covariance: Array) -> Mapping[str, Parameter]:
        """Return amplitude and phase."""
        amplitude, phase = amplitude_and_phase(value, covariance)
        unit = scene.robot.torque_unit(member.joint or 0)
        return {"amplitude": Parameter(*amplitude, unit), "phase": Parameter(*phase, "rad")}

    def description(self, scene: Scene, member: Member) -> str:
        """Say what it is."""
        return f"a torque ripple of {member.nonlinear[0]:.4g} periods per motor turn"


@dataclass(frozen=True)
class EncoderEccentricity:
    """An encoder that errs periodically with the motor: it reads ``q + e``, ``e = amplitude sin(order theta_m + phase)``.

    The arm's torque is that of ``q - e`` with its derivatives. To first order in e it differs by

        du = -(du/dq e + du/dv e' + du/da e''),  e' = n v cos(..),  e'' = n a cos(..) - n^2 v^2 sin(..),  n = order N,

    so that at constant speed it grows with the square of the speed, where a ripple stays as it is. All joints that
    the joint's acceleration acts on feel it.
    """

    @property
    def name(self) -> str:
        """Name in the table of effects."""
        return "encoder_eccentricity"

    @property
    def nonlinear(self) -> tuple[NonlinearParameter, ...]:
        """Periods per motor turn."""
        return (NonlinearParameter("order", "1 / motor turn", 0.05, 1000.0, False),)

    def members(self, scene: Scene) -> tuple[Member, ...]:
        """Every joint at one and two periods per motor turn, as far as they can be seen."""
        return tuple(
            Member(j, (order,)) for j in moving(scene) for order in ENCODER_ORDERS if _visible(scene, j, order)
        )

    def resolution(self, scene: Scene, member: Member) -> tuple[float, ...]:
        """Return how far apart two orders must be to be told apart: one over the motor turns covered."""
        return (_order_resolution(scene, member.joint or 0),)

    def rows(self, member: Member) -> slice:
        """Return that all joints feel it."""
        return slice(None)

    def columns(self, scene: Scene, member: Member) -> tuple[Column, ...]:
        """Two columns, sine and cosine of the error."""
        j = member.joint or 0
        joint, unit = scene.robot.joints[j], _length(scene, member)
        return tuple(
            Column(f"encoder_{part}", joint, unit, f"{part} of the error of {joint}'s encoder over the motor's turn")
            for part in ("sine", "cosine")
        )

    def regressor(self, signals: Signals, member: Member) -> Array:
        """Return the change of torque per amplitude of sine and of cosine, shape (n, 2, N)."""
        j, order = member.joint or 0, member.nonlinear[0]
        motion = signals.motion
        per_turn = order * signals.scene.robot.reduction[j]
        angle = per_turn * motion.q[j]
        sine, cosine = np.sin(angle), np.cos(angle)
        by_q, by_v, by_a = _slopes(signals, j)
        speed, square = per_turn * motion.v[j], (per_turn * motion.v[j]) ** 2
        push = per_turn * motion.a[j]
        seen = _seen(signals, j, order)
        of_sine: Array = by_q * sine + by_v * (speed * cosine) + by_a * (push * cosine - square * sine)
        of_cosine: Array = by_q * cosine - by_v * (speed * sine) - by_a * (push * sine + square * cosine)
        return np.asarray(-np.stack([seen * of_sine, seen * of_cosine], axis=1))

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """No encoder errs by much of a turn."""
        at_motor = abs(float(scene.robot.reduction[member.joint or 0])) * max(member.nonlinear[0], 1.0)
        if at_motor * (float(np.hypot(*value)) - 2.0 * float(np.max(std))) > LARGEST_ECCENTRICITY:
            return "no encoder errs by that much"
        return None

    def parameters(self, scene: Scene, member: Member, value: Array, covariance: Array) -> Mapping[str, Parameter]:
        """Return amplitude and phase."""
        amplitude, phase = amplitude_and_phase(value, covariance)
        return {"amplitude": Parameter(*amplitude, _length(scene, member)), "phase": Parameter(*phase, "rad")}

    def description(self, scene: Scene, member: Member) -> str:
        """Say what it is."""
        return f"an encoder that errs {member.nonlinear[0]:.4g} times per motor turn"


@dataclass(frozen=True)
class Vibration:
    """A torque periodic in time, whatever the arm does: ``u = amplitude sin(2 pi frequency t + phase)``.

    t counts from the start of each recording, and the phase is one for all recordings: that holds for what starts
    with the run, such as a controller's own oscillator, and then other recordings can speak for or against it. What
    runs on its own has another phase in every recording. With ``free_phase`` every recording of the scene has its own
    pair of columns; no recording then speaks for another, recordings outside the scene are not predicted, and the
    amplitude is the rms over the recordings. `frequency_spectrum` sums power over recordings and so finds both.

    There is no grid of frequencies: lines are as narrow as the recordings are long, and come from the spectrum of the
    residual (see `at`).

    Attributes
    ----------
    free_phase : bool
    """

    free_phase: bool = False

    @property
    def name(self) -> str:
        """Name in the table of effects."""
        return "vibration"

    @property
    def nonlinear(self) -> tuple[NonlinearParameter, ...]:
        """The frequency."""
        return (NonlinearParameter("frequency", "Hz", 0.05, 1000.0, False),)

    def members(self, scene: Scene) -> tuple[Member, ...]:
        """Return none: see `at`."""
        return ()

    def at(self, scene: Scene, joint: int, frequency: float) -> tuple[Member, ...]:
        """Return the member of a joint at a frequency, none where the band or the recordings cannot show it."""
        seen = LEAST_PERIODS / scene.duration <= frequency <= FASTEST * scene.rate
        return (Member(joint, (frequency,)),) if seen else ()

    def resolution(self, scene: Scene, member: Member) -> tuple[float, ...]:
        """Return how far apart two frequencies must be to be told apart: one over the duration."""
        return (1.0 / scene.duration,)

    def columns(self, scene: Scene, member: Member) -> tuple[Column, ...]:
        """Return sine and cosine, or those of every recording."""
        j = member.joint or 0
        joint, unit = scene.robot.joints[j], scene.robot.torque_unit(j)
        what = f"of {member.nonlinear[0]:g} Hz on {joint}"
        if not self.free_phase:
            return tuple(Column(f"vibration_{part}", joint, unit, f"{part} {what}") for part in ("sine", "cosine"))
        return tuple(
            Column(f"vibration_{part}_{name}", joint, unit, f"{part} {what} in {name}")
            for name in scene.start
            for part in ("sine", "cosine")
        )

    def regressor(self, signals: Signals, member: Member) -> Array:
        """Return sine and cosine of time, shape (n, k, N)."""
        angle = 2.0 * np.pi * member.nonlinear[0] * signals.time
        pair = [np.sin(angle), np.cos(angle)]
        if not self.free_phase:
            return signals.row(member.joint or 0, pair)
        names = list(signals.scene.start)
        result = np.zeros((signals.scene.robot.n, 2 * len(names), signals.motion.samples))
        if signals.motion.name in names:
            place = 2 * names.index(signals.motion.name)
            result[member.joint or 0, place : place + 2] = pair
        return result

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """Any amplitude within the torque limit is possible."""
        limit = float(scene.robot.torque_limit[member.joint or 0])
        if self._amplitude(value) - 2.0 * float(np.max(std)) > limit:
            return "the vibration would be larger than the torque limit"
        return None

    def parameters(self, scene: Scene, member: Member, value: Array, covariance: Array) -> Mapping[str, Parameter]:
        """Return amplitude, and phase where there is one."""
        unit = scene.robot.torque_unit(member.joint or 0)
        if not self.free_phase:
            amplitude, phase = amplitude_and_phase(value, covariance)
            return {"amplitude": Parameter(*amplitude, unit), "phase": Parameter(*phase, "rad")}
        size = self._amplitude(value)
        slope = value / (size * 0.5 * len(value)) if size > 0.0 else np.zeros_like(value)
        variance = float(slope @ covariance @ slope)
        return {"amplitude": Parameter(size, float(np.sqrt(max(variance, 0.0))), unit)}

    def description(self, scene: Scene, member: Member) -> str:
        """Say what it is."""
        return f"a vibration of {member.nonlinear[0]:.4g} Hz"

    def _amplitude(self, value: Array) -> float:
        return float(np.sqrt(np.sum(value**2) / (0.5 * len(value))))


def _length(scene: Scene, member: Member) -> str:
    return "m" if scene.robot.prismatic[member.joint or 0] else "rad"


def _order_resolution(scene: Scene, joint: int) -> float:
    return float(2.0 * np.pi / (abs(scene.robot.reduction[joint]) * scene.travel[joint]))


def _visible(scene: Scene, joint: int, order: float) -> bool:
    """Whether a line has enough periods in the travel and lies within the band while the joint is slow."""
    slow = SLOW_SHARE * order * abs(float(scene.robot.reduction[joint])) * float(scene.speed[joint]) / (2.0 * np.pi)
    return order >= LEAST_PERIODS * _order_resolution(scene, joint) and slow <= scene.band


def _seen(signals: Signals, joint: int, order: float) -> NDArray[np.bool_]:
    """Where a sampled line is itself and no alias, shape (N,)."""
    per_second = np.abs(order * signals.scene.robot.reduction[joint] * signals.motion.v[joint]) / (2.0 * np.pi)
    return np.asarray(per_second < FASTEST * signals.motion.rate)


def _slopes(signals: Signals, joint: int) -> tuple[Array, Array, Array]:
    """Derivatives of all recorded torques by one joint's position, velocity and acceleration, each (n, N)."""

    def make() -> Array:
        scene, motion = signals.scene, signals.motion
        state = (motion.q, motion.v, motion.a)
        steps = (POSITION_STEP, SPEED_STEP * max(float(np.max(np.abs(motion.v))), 1.0), 1.0)
        found = []
        for k, step in enumerate(steps):
            up, down = [part.copy() for part in state], [part.copy() for part in state]
            up[k][joint] += step
            if k == 2:
                # Torque is linear in acceleration.
                found.append(rigid_torque(scene, motion, *up) - signals.rigid)
                continue
            down[k][joint] -= step
            found.append((rigid_torque(scene, motion, *up) - rigid_torque(scene, motion, *down)) / (2.0 * step))
        found[1][joint] += friction_slope(signals, joint)
        return np.stack(found)

    by_q, by_v, by_a = shared(signals, ("slopes", joint), make)
    return by_q, by_v, by_a
