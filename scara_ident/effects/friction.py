"""Friction beyond a polynomial of the joint's own speed: at low speed, by direction, by position, of other joints."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from scara_ident.effects.effect import Member, NonlinearParameter, Parameter
from scara_ident.effects.signals import Scene, Signals
from scara_ident.model.terms import Column, Friction
from scara_ident.model.terms.term import per_speed

Array = NDArray[np.float64]

# Stribeck velocities tried, as shares of the joint's largest speed; above the last-but-widest a polynomial spans it.
STRIBECK_SHARES = (0.006, 0.015, 0.04, 0.1, 0.25)
WIDEST_STRIBECK = 0.5
# Friction that a joint has only at low speed is not larger than this many times its Coulomb friction.
MOST_STRIBECK = 2.0
# A joint that travels less, rad, shows no friction that varies with its position.
SHORTEST_TRAVEL = 0.3
# On arms with more joints than this only neighbours drive each other's friction.
ALL_PAIRS_UP_TO = 3


def friction_of(scene: Scene, joint: int) -> dict[int, float]:
    """Return the present estimate of a joint's friction: coefficient by power of speed; empty without a friction term."""
    for term in scene.model.terms:
        if isinstance(term, Friction):
            first = scene.model.place(term).start + joint * len(term.powers)
            return {power: float(scene.value[first + k]) for k, power in enumerate(term.powers)}
    return {}


def friction_torque(signals: Signals, joint: int) -> Array:
    """Return the friction of a joint as the present estimate predicts it, recorded side, shape (N,)."""
    v = signals.scene.robot.drive_sign[joint] * signals.motion.v[joint]
    torque = np.zeros_like(v)
    for power, value in friction_of(signals.scene, joint).items():
        torque += value * np.sign(v) * np.abs(v) ** power
    return np.asarray(torque)


def friction_slope(signals: Signals, joint: int) -> Array:
    """Return the derivative of a joint's friction by its velocity away from standstill, recorded side, shape (N,)."""
    speed = np.abs(signals.motion.v[joint])
    slope = np.zeros_like(speed)
    for power, value in friction_of(signals.scene, joint).items():
        if power:
            slope += power * value * speed ** (power - 1)
    return np.asarray(slope * signals.scene.robot.drive_sign[joint])


def moving(scene: Scene) -> list[int]:
    """Return the joints that move at all."""
    return [j for j in range(scene.robot.n) if scene.speed[j] > 0.0 and scene.travel[j] > 0.0]


def deviation(covariance: Array, place: int = 0) -> float:
    """Return the standard deviation of one coefficient."""
    return float(np.sqrt(max(covariance[place, place], 0.0)))


@dataclass(frozen=True)
class Stribeck:
    """More friction at low speed: ``u = amplitude sign(v) exp(-(v/velocity)^2)``.

    Armstrong-Helouvry, Dupont, Canudas de Wit (1994), "A survey of models, analysis tools and compensation methods".
    """

    @property
    def name(self) -> str:
        """Name in the table of effects."""
        return "stribeck"

    @property
    def nonlinear(self) -> tuple[NonlinearParameter, ...]:
        """The speed at which it has fallen to 1/e."""
        return (NonlinearParameter("velocity", "rad/s", 1e-4, 5.0),)

    def members(self, scene: Scene) -> tuple[Member, ...]:
        """Every joint, at shares of its largest speed."""
        return tuple(Member(j, (share * float(scene.speed[j]),)) for j in moving(scene) for share in STRIBECK_SHARES)

    def columns(self, scene: Scene, member: Member) -> tuple[Column, ...]:
        """One column: the amplitude."""
        j = member.joint or 0
        joint = scene.robot.joints[j]
        return (Column("amplitude", joint, scene.robot.torque_unit(j), f"further friction of {joint} near rest", True),)

    def regressor(self, signals: Signals, member: Member) -> Array:
        """Return ``sign(v) exp(-(v/velocity)^2)``, shape (n, 1, N)."""
        j = member.joint or 0
        ratio = signals.motion.v[j] / member.nonlinear[0]
        return signals.row(j, [signals.sign[j] * np.exp(-np.minimum(ratio * ratio, 700.0))])

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """Friction falls with speed here, by a share of what there is."""
        j = member.joint or 0
        if value[0] < -2.0 * std[0]:
            return "friction would fall towards rest"
        if member.nonlinear[0] > WIDEST_STRIBECK * scene.speed[j]:
            return "the joint is never fast against this speed"
        coulomb = friction_of(scene, j).get(0)
        if coulomb is not None and value[0] - 2.0 * std[0] > MOST_STRIBECK * max(coulomb, 0.0):
            return f"it would be more than {MOST_STRIBECK:g} times the Coulomb friction"
        return None

    def parameters(self, scene: Scene, member: Member, value: Array, covariance: Array) -> Mapping[str, Parameter]:
        """Return the amplitude."""
        unit = scene.robot.torque_unit(member.joint or 0)
        return {"amplitude": Parameter(float(value[0]), deviation(covariance), unit)}

    def description(self, scene: Scene, member: Member) -> str:
        """Say what it is."""
        return "more friction at low speed (Stribeck)"


@dataclass(frozen=True)
class AsymmetricFriction:
    """Viscous friction that differs by direction of the drive: ``u = viscous_difference/2 |v|``.

    Coulomb friction that differs by direction cannot be told from the torque offset.
    """

    @property
    def name(self) -> str:
        """Name in the table of effects."""
        return "asymmetric_friction"

    @property
    def nonlinear(self) -> tuple[NonlinearParameter, ...]:
        """It has no nonlinear parameter."""
        return ()

    def members(self, scene: Scene) -> tuple[Member, ...]:
        """One per joint."""
        return tuple(Member(j) for j in moving(scene))

    def columns(self, scene: Scene, member: Member) -> tuple[Column, ...]:
        """One column: the difference."""
        j = member.joint or 0
        joint = scene.robot.joints[j]
        meaning = f"viscous friction of {joint} in the drive's positive direction less that in the negative"
        return (Column("viscous_difference", joint, per_speed(scene.robot, j, 1), meaning),)

    def regressor(self, signals: Signals, member: Member) -> Array:
        """Return ``|v|/2``, shape (n, 1, N)."""
        j = member.joint or 0
        return signals.row(j, [0.5 * np.abs(signals.motion.v[j])])

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """Friction brakes in both directions at the largest speed."""
        j = member.joint or 0
        speed = float(scene.speed[j])
        friction = sum(a * speed**power for power, a in friction_of(scene, j).items())
        if 0.5 * speed * (abs(value[0]) - 2.0 * std[0]) > max(friction, 0.0):
            return "friction would push in one direction"
        return None

    def parameters(self, scene: Scene, member: Member, value: Array, covariance: Array) -> Mapping[str, Parameter]:
        """Return the difference."""
        unit = per_speed(scene.robot, member.joint or 0, 1)
        return {"viscous_difference": Parameter(float(value[0]), deviation(covariance), unit)}

    def description(self, scene: Scene, member: Member) -> str:
        """Say what it is."""
        return "viscous friction that differs by direction"


@dataclass(frozen=True)
class PositionDependentFriction:
    """Coulomb friction that varies once per turn of the joint: a0 times ``1 + share sin(q + phase)``.

    Where the joint translates, q is ``pi`` times its position over its travel in the recordings. The columns are
    ``sign(v) sin q`` and ``sign(v) cos q``; share is their amplitude over the present estimate of a0.
    """

    @property
    def name(self) -> str:
        """Name in the table of effects."""
        return "position_dependent_friction"

    @property
    def nonlinear(self) -> tuple[NonlinearParameter, ...]:
        """It has no nonlinear parameter."""
        return ()

    def members(self, scene: Scene) -> tuple[Member, ...]:
        """One per joint with Coulomb friction that travels far enough."""
        return tuple(
            Member(j)
            for j in moving(scene)
            if 0 in friction_of(scene, j) and (scene.robot.prismatic[j] or scene.travel[j] >= SHORTEST_TRAVEL)
        )

    def columns(self, scene: Scene, member: Member) -> tuple[Column, ...]:
        """Two columns, of sine and cosine."""
        j = member.joint or 0
        joint, unit = scene.robot.joints[j], scene.robot.torque_unit(j)
        return tuple(
            Column(
                f"dry_{part}", joint, unit, f"Coulomb friction of {joint} that varies with the {part} of its position"
            )
            for part in ("sine", "cosine")
        )

    def regressor(self, signals: Signals, member: Member) -> Array:
        """Return ``sign(v) sin q`` and ``sign(v) cos q``, shape (n, 2, N)."""
        j = member.joint or 0
        angle = signals.motion.q[j]
        if signals.scene.robot.prismatic[j]:
            angle = np.pi / signals.scene.travel[j] * angle
        sign = signals.sign[j]
        return signals.row(j, [sign * np.sin(angle), sign * np.cos(angle)])

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """Friction brakes at every position."""
        coulomb = friction_of(scene, member.joint or 0).get(0, 0.0)
        if float(np.hypot(*value)) - 2.0 * float(np.max(std)) > max(coulomb, 0.0):
            return "friction would push at some position"
        return None

    def parameters(self, scene: Scene, member: Member, value: Array, covariance: Array) -> Mapping[str, Parameter]:
        """Return share and phase; the share's standard deviation leaves out that of a0."""
        coulomb = friction_of(scene, member.joint or 0).get(0, 0.0)
        amplitude, phase = amplitude_and_phase(value, covariance)
        scale = 1.0 / coulomb if coulomb > 0.0 else np.nan
        return {
            "share": Parameter(amplitude[0] * scale, amplitude[1] * scale, "1"),
            "phase": Parameter(phase[0], phase[1], "rad"),
        }

    def description(self, scene: Scene, member: Member) -> str:
        """Say what it is."""
        return "Coulomb friction that varies with the joint's position"


@dataclass(frozen=True)
class FrictionCoupling:
    """Friction of a joint driven by another joint's velocity: ``u_j = viscous w + coulomb sign(w)``.

    w is the other joint's velocity v_k, or, where one motor moves with two joints as in belt drives and wrists, the
    sum or difference ``v_j + v_k``, ``v_j - v_k`` in the direction of the drive; the linear part in v_j then adds to
    the joint's own viscous friction.

    Attributes
    ----------
    way : {"other", "sum", "difference"}
    """

    way: Literal["other", "sum", "difference"] = "other"

    @property
    def name(self) -> str:
        """Name in the table of effects."""
        return "friction_coupling"

    @property
    def nonlinear(self) -> tuple[NonlinearParameter, ...]:
        """It has no nonlinear parameter."""
        return ()

    def members(self, scene: Scene) -> tuple[Member, ...]:
        """Pairs of joints: all on small arms, else neighbours."""
        robot = scene.robot
        reach = robot.n if robot.n <= ALL_PAIRS_UP_TO else 1
        return tuple(
            Member(j, (), k)
            for j in moving(scene)
            for k in moving(scene)
            if 0 < abs(j - k) <= reach and (self.way == "other" or robot.prismatic[j] == robot.prismatic[k])
        )

    def columns(self, scene: Scene, member: Member) -> tuple[Column, ...]:
        """Two columns, viscous and Coulomb."""
        j = member.joint or 0
        joint, source = scene.robot.joints[j], self._source(scene, member)
        # Where it is another joint's friction that reacts on this one it may have either sign.
        own = self.way != "other"
        return (
            Column("viscous", joint, self._viscous_unit(scene, member), f"friction of {joint} by {source}"),
            Column("coulomb", joint, scene.robot.torque_unit(j), f"dry friction of {joint} by {source}", own),
        )

    def regressor(self, signals: Signals, member: Member) -> Array:
        """Return ``w`` and ``sign(w)``, shape (n, 2, N)."""
        j, k = member.joint or 0, member.partner or 0
        v = signals.motion.v
        if self.way == "other":
            w = v[k]
        else:
            w = signals.scene.robot.drive_sign[j] * (v[j] + v[k] if self.way == "sum" else v[j] - v[k])
        return signals.row(j, [w, np.sign(w)])

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """Friction of a motor brakes that motor; what another joint drives may have either sign."""
        if self.way != "other":
            speed = float(scene.speed[member.joint or 0] + scene.speed[member.partner or 0])
            fast, sure = value[1] + speed * value[0], float(np.hypot(std[1], speed * std[0]))
            if value[1] < -2.0 * std[1] or fast < -2.0 * sure:
                return "friction would push"
        return None

    def parameters(self, scene: Scene, member: Member, value: Array, covariance: Array) -> Mapping[str, Parameter]:
        """Return both coefficients."""
        viscous, torque = self._viscous_unit(scene, member), scene.robot.torque_unit(member.joint or 0)
        return {
            "viscous": Parameter(float(value[0]), deviation(covariance, 0), viscous),
            "coulomb": Parameter(float(value[1]), deviation(covariance, 1), torque),
        }

    def description(self, scene: Scene, member: Member) -> str:
        """Say what it is."""
        return f"friction driven by {self._source(scene, member)}"

    def _source(self, scene: Scene, member: Member) -> str:
        joint, other = scene.robot.joints[member.joint or 0], scene.robot.joints[member.partner or 0]
        if self.way == "other":
            return f"the velocity of {other}"
        return f"the {self.way} of the velocities of {joint} and {other}"

    def _viscous_unit(self, scene: Scene, member: Member) -> str:
        length = "m" if scene.robot.prismatic[member.partner or 0] else "rad"
        return f"{scene.robot.torque_unit(member.joint or 0)} s/{length}"


def amplitude_and_phase(value: Array, covariance: Array) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return amplitude and phase of ``value[0] sin x + value[1] cos x = amplitude sin(x + phase)``, with deviations.

    Parameters
    ----------
    value : ndarray, shape (2,)
    covariance : ndarray, shape (2, 2)

    Returns
    -------
    amplitude, phase : tuple of (float, float)
        Value and standard deviation; the phase in rad, from -pi to pi.
    """
    amplitude = float(np.hypot(value[0], value[1]))
    phase = float(np.arctan2(value[1], value[0]))
    along = np.array([np.cos(phase), np.sin(phase)])
    across = np.array([-along[1], along[0]])
    spread = float(np.sqrt(max(along @ covariance @ along, 0.0)))
    turn = float(np.sqrt(max(across @ covariance @ across, 0.0))) / amplitude if amplitude > 0.0 else np.inf
    return (amplitude, spread), (phase, min(turn, np.pi / np.sqrt(3.0)))
