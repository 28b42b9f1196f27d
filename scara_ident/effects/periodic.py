"""Torques and readings that are periodic in the motor's angle or in time."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from scara_ident.arrays import Array
from scara_ident.effects.effect import DOUBT_STDS
from scara_ident.effects.following import EstimateSlopes
from scara_ident.effects.friction import friction_places, friction_slope
from scara_ident.effects.gravity import loaded_by_gravity
from scara_ident.effects.links import behind, rigid_slopes
from scara_ident.effects.parameters import Member, NonlinearParameter, Parameter, SpectralLine, View
from scara_ident.effects.signals import Scene, Signals
from scara_ident.effects.sinusoid import Sinusoid, min_amplitude, sine_and_cosine, sines
from scara_ident.effects.spectra import HIGHEST_FREQUENCY_SHARE
from scara_ident.model.terms import Column, joint_rows

# Orders that gears and motors have; others are found in the residual's spectrum.
ORDERS = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 12.0)
# Orders per turn of the joint that what is behind its gear has: a wheel or bearing out of centre, oval, or held at three points.
OUTPUT_ORDERS = (1.0, 2.0, 3.0)
# Orders of an encoder's error: an eccentric disc has one period per turn, an oval one two.
ENCODER_ORDERS = (1.0, 2.0)
# Periods that the travel, or the longest recording, must hold for sine and cosine to be distinguished from a slope.
PERIODS_COVERED = 2.0
# Share of the joint's largest speed at which an order must lie within the band: a joint is hardly ever slower for long.
SLOW_SHARE = 0.03
# Share of the rate up to which a line is whole; what is left of it an octave higher has its alias at 0.4 of the rate, twice
# the widest band that is chosen, and of ramps between 0.2 and 0.8 this one leaves the least in the band.
WHOLE_SHARE = 0.3
# Orders this near a whole number, as a share, are taken for it; how far the arm travels tells them to some thousandths.
WHOLE_ORDER = 5e-3
# No encoder errs by more than this, rad of the motor; beyond it the linear form ends too.
LARGEST_ECCENTRICITY = 0.1


class PerMotorTurn(Sinusoid):
    """What repeats with the motor's angle, ``order`` times per turn.

    Attributes
    ----------
    orders, output_orders : tuple of float
        Those tried, per turn of the motor and of the joint that it moves.
    """

    # From once per turn of a joint behind the largest gears.
    nonlinear = (NonlinearParameter("order", "1 / motor turn", 0.001, 1000.0, False),)
    seeded_by = "order"
    view = View("order")
    orders: ClassVar[tuple[float, ...]] = ORDERS
    output_orders: ClassVar[tuple[float, ...]] = ()

    def joints(self, scene: Scene) -> list[int]:
        """Return the joints of which it is known what a turn is: of a slide without a reduction it would be 2 pi metres."""
        known = ~scene.robot.prismatic | (np.abs(scene.robot.reduction) != 1.0)
        return [j for j in super().joints(scene) if known[j]]

    def seeds(self, scene: Scene, joint: int, line: SpectralLine) -> tuple[Member, ...]:
        """Return none of a joint of which that is not known."""
        return super().seeds(scene, joint, line) if joint in self.joints(scene) else ()

    def scan(self, scene: Scene, joint: int) -> Iterable[tuple[float, ...]]:
        """Return the orders with enough periods in the travel that lie within the band while the joint is slow."""
        return ((x,) for x in self._in_band(scene, joint) if x >= PERIODS_COVERED * _order_resolution(scene, joint))

    def doubtful(self, scene: Scene) -> tuple[Member, ...]:
        """Return those with too few periods in the travel."""
        return tuple(
            Member(j, (x,))
            for j in self.joints(scene)
            for x in self._in_band(scene, j)
            if x < PERIODS_COVERED * _order_resolution(scene, j)
        )

    def description(self, scene: Scene, member: Member) -> str:
        """Return the description, in the singular for one period, with whose turn it is where no gear is known."""
        said = super().description(scene, member).replace(" 1 periods ", " 1 period ")
        if _gearless(scene, member):
            return f"{said} (a turn of the joint: its reduction is 1)"
        per_turn = member.nonlinear[0] * abs(float(scene.robot.reduction[member.place]))
        slow = per_turn < max(self.output_orders, default=0.0) + 1.0 and not scene.robot.prismatic[member.place]
        return f"{said} ({per_turn:.3g} per turn of the joint)" if slow else said

    def _in_band(self, scene: Scene, joint: int) -> Iterable[float]:
        motor_turns = abs(float(scene.robot.reduction[joint]))
        turns_per_second = motor_turns * float(scene.speed[joint]) / (2.0 * np.pi)
        orders = dict.fromkeys((*self.orders, *(x / motor_turns for x in self._behind_gear(scene, joint))))
        return (x for x in orders if SLOW_SHARE * x * turns_per_second <= scene.band)

    def _behind_gear(self, scene: Scene, joint: int) -> tuple[float, ...]:
        """Return the orders per turn of the joint; once per turn is a counterbalance, or gravity itself, where gravity loads it."""
        if scene.robot.prismatic[joint]:
            return ()
        loaded = loaded_by_gravity(scene.robot)[joint]
        return tuple(x for x in self.output_orders if x != 1.0 or not loaded)

    def resolution(self, scene: Scene, member: Member) -> tuple[float, ...]:
        """Return one over the motor turns covered."""
        return (_order_resolution(scene, member.place),)


class TorqueRipple(PerMotorTurn):
    """A torque periodic in the motor's angle: ``u = amplitude sin(order theta_m + phase)``, theta_m = N q.

    N has the gear's sign, and q is zero at the zero of the joint's position. The phase is the same in all recordings,
    as with an absolute encoder.
    """

    name = "torque_ripple"
    summary = "a torque ripple of {order:.4g} periods per motor turn"
    watched = True
    coefficients = sine_and_cosine("ripple_{part}", "{part} of {order:g} times the motor's angle of {joint}")
    of_state = True
    experiment = "move slowly at constant speed over several of its periods, and record at a high rate"
    output_orders = OUTPUT_ORDERS

    def description(self, scene: Scene, member: Member) -> str:
        """Say behind which reduction periods would be a whole number: one that is not is often stated wrong."""
        said = super().description(scene, member)
        order, stated = member.nonlinear[0], abs(float(scene.robot.reduction[member.place]))
        whole = round(order)
        if _gearless(scene, member) or not 1 <= whole <= max(ORDERS) or abs(order / whole - 1.0) < WHOLE_ORDER:
            return said
        return f"{said}, which would be {whole} with a reduction of {stated * order / whole:.4g}"

    def signal_columns(self, signals: Signals, member: Member) -> Iterable[Array]:
        """Return sine and cosine of the order times the motor's angle."""
        j, order = member.place, member.nonlinear[0]
        seen = _seen(signals, j, order)
        return [seen * part for part in sines(signals, j, order)]

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """Say so where it leaves the torque limit behind."""
        limit = float(scene.robot.torque_limit[member.place])
        return "the ripple would be larger than the torque limit" if min_amplitude(value, std) > limit else None


class EncoderEccentricity(PerMotorTurn):
    """An encoder error that is periodic with the motor's angle: it reads ``q + e``, ``e = amplitude sin(order theta_m + phase)``.

    The arm's torque is that of ``q - e`` with its derivatives. To first order in e it differs by

        du = -(du/dq e + du/dv e' + du/da e''),  e' = n v cos(..),  e'' = n a cos(..) - n^2 v^2 sin(..),  n = order N,

    so that at constant speed it grows with the square of the speed, while a ripple stays the same. It changes the
    torque of all joints on which the joint's acceleration acts.
    """

    name = "encoder_eccentricity"
    summary = "an encoder error with {order:.4g} periods per motor turn"
    coefficients = sine_and_cosine(
        "encoder_{part}", "{part} of the error of {joint}'s encoder over the motor's turn", "{position}"
    )
    all_joints = True
    follows_estimate = True
    of_state = True
    experiment = "run at two constant speeds: an error of the encoder grows with the square of speed, ripple does not"
    orders = ENCODER_ORDERS

    def signal_columns(self, signals: Signals, member: Member) -> Iterable[Array]:
        """Return the change of torque per amplitude of sine and of cosine."""
        by_q, by_v, by_a = _slopes(signals, member.place)
        return [-(by_q * e + by_v * first + by_a * second) for e, first, second in self._errors(signals, member)]

    def estimate_slopes(self, signals: Signals, member: Member, value: Array) -> EstimateSlopes:
        """Return those of the bodies by their columns on either side of the recorded motion, and those of friction."""
        j, scene, motion = member.place, signals.scene, signals.motion
        term = scene.model.rigid_body
        first = scene.model.place(term).start
        error, speed_error, push_error = (
            value[0] * sine + value[1] * cosine for sine, cosine in zip(*self._errors(signals, member), strict=True)
        )
        there, back = (
            joint_rows(term, behind(motion, j, (side * error, side * speed_error, side * push_error)))
            for side in (0.5, -0.5)
        )
        found = {
            joint: (first + np.flatnonzero(acting), there[joint] - back[joint])
            for joint, acting in enumerate(term.pattern)
        }
        speed, sign = np.abs(motion.v[j]), scene.robot.drive_sign[j]
        powers = {power: place for power, place in friction_places(scene, j).items() if power}
        friction = [-sign * power * speed ** (power - 1) * speed_error for power in powers]
        places, rows = found[j]
        found[j] = np.append(places, list(powers.values())).astype(np.intp), np.vstack([rows, *friction])
        return found

    def _errors(self, signals: Signals, member: Member) -> tuple[tuple[Array, Array, Array], ...]:
        """Return what the encoder errs by, with its first two derivatives, (N,) each, per amplitude of sine and of cosine."""
        j, order, motion = member.place, member.nonlinear[0], signals.motion
        per_turn = order * signals.scene.robot.reduction[j]
        sine, cosine = (_seen(signals, j, order) * part for part in sines(signals, j, order))
        speed, push = per_turn * motion.v[j], per_turn * motion.a[j]
        return (
            (sine, speed * cosine, push * cosine - speed**2 * sine),
            (cosine, -speed * sine, -push * sine - speed**2 * cosine),
        )

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """Say so where an encoder would err by much of a turn."""
        at_motor = abs(float(scene.robot.reduction[member.place])) * max(member.nonlinear[0], 1.0)
        too_much = at_motor * min_amplitude(value, std) > LARGEST_ECCENTRICITY
        return "no encoder has so large an error" if too_much else None


@dataclass(frozen=True)
class Vibration(Sinusoid):
    """A torque periodic in time, whatever the arm does: ``u = amplitude sin(2 pi frequency t + phase)``.

    t counts from the start of each recording, and the phase is the same in all recordings. This is right for a source
    that starts with the run, such as an oscillator in the controller, and other recordings can then confirm or
    contradict it. A source that runs independently has another phase in every recording. With ``free_phase`` every
    recording of the scene has its own pair of columns; then no recording confirms another, recordings outside the scene
    are not predicted, and the amplitude is the rms over the recordings. `frequency_spectrum` sums power over recordings
    and finds both kinds.

    There is no grid of frequencies, because lines become narrower with longer recordings; candidates come from the
    spectrum of the residual.
    """

    free_phase: bool = False

    name = "vibration"
    summary = "a vibration of {frequency:.4g} Hz"
    coefficients = sine_and_cosine("vibration_{part}", "{part} of {frequency:g} Hz on {joint}")
    nonlinear = (NonlinearParameter("frequency", "Hz", 0.05, 1000.0, False),)
    seeded_by = "frequency"
    view = View("frequency")
    experiment = "record at rest with the drives on: what is then periodic does not come from the motion"

    def scan(self, scene: Scene, joint: int) -> Iterable[tuple[float, ...]]:
        """Return none: lines of the residual suggest them."""
        return ()

    def seeds(self, scene: Scene, joint: int, line: SpectralLine) -> tuple[Member, ...]:
        """Return the member at a frequency that the band and the recordings can show."""
        seen = PERIODS_COVERED / scene.duration <= line.position <= HIGHEST_FREQUENCY_SHARE * scene.rate
        return super().seeds(scene, joint, line) if seen else ()

    def resolution(self, scene: Scene, member: Member) -> tuple[float, ...]:
        """Return one over the duration."""
        return (1.0 / scene.duration,)

    def columns(self, scene: Scene, member: Member) -> tuple[Column, ...]:
        """Describe sine and cosine, or those of every recording."""
        pair = super().columns(scene, member)
        if not self.free_phase:
            return pair
        return tuple(
            Column(f"{part.name}_{name}", part.joint, part.unit, f"{part.meaning} in {name}")
            for name in scene.start
            for part in pair
        )

    def signal_columns(self, signals: Signals, member: Member) -> Iterable[Array]:
        """Return sine and cosine of time; those of every recording are zero in the others."""
        angle = 2.0 * np.pi * member.nonlinear[0] * signals.time
        pair = [np.sin(angle), np.cos(angle)]
        if not self.free_phase:
            return pair
        nothing = np.zeros_like(angle)
        return [part if name == signals.motion.name else nothing for name in signals.scene.start for part in pair]

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """Say so where it leaves the torque limit behind."""
        limit = float(scene.robot.torque_limit[member.place])
        least = _rms_amplitude(value) - DOUBT_STDS * float(np.max(std))
        return "the vibration would be larger than the torque limit" if least > limit else None

    def parameters(self, scene: Scene, member: Member, value: Array, covariance: Array) -> Mapping[str, Parameter]:
        """Return amplitude, and phase where there is one."""
        if not self.free_phase:
            return super().parameters(scene, member, value, covariance)
        size = _rms_amplitude(value)
        slope = value / (size * 0.5 * len(value)) if size > 0.0 else np.zeros_like(value)
        variance = float(slope @ covariance @ slope)
        unit = scene.robot.torque_unit(member.place)
        return {"amplitude": Parameter(size, float(np.sqrt(max(variance, 0.0))), unit)}


def _rms_amplitude(value: Array) -> float:
    return float(np.sqrt(np.sum(value**2) / (0.5 * len(value))))


def _gearless(scene: Scene, member: Member) -> bool:
    """Whether the motor turns as the joint does, for all that is stated."""
    return abs(float(scene.robot.reduction[member.place])) == 1.0


def _order_resolution(scene: Scene, joint: int) -> float:
    return float(2.0 * np.pi / (abs(scene.robot.reduction[joint]) * scene.travel[joint]))


def _seen(signals: Signals, joint: int, order: float) -> Array:
    """Return the share of a line that is taken for itself and no alias, shape (N,).

    It falls without a step over an octave: a line that ended at once would leave a click within the band, which
    whatever else has that order would take away again.
    """
    per_second = np.abs(order * signals.scene.robot.reduction[joint] * signals.motion.v[joint]) / (2.0 * np.pi)
    octave = per_second / (WHOLE_SHARE * signals.motion.rate) - 1.0
    return np.asarray(0.5 + 0.5 * np.cos(np.pi * np.clip(octave, 0.0, 1.0)))


def _slopes(signals: Signals, joint: int) -> tuple[Array, Array, Array]:
    """Derivatives of all recorded torques by one joint's position, velocity and acceleration, each (n, N)."""
    by_q, by_v, by_a = rigid_slopes(signals, joint)
    with_friction = by_v.copy()
    with_friction[joint] += friction_slope(signals, joint)
    return by_q, with_friction, by_a
