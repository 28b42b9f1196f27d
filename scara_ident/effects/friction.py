"""Friction beyond a polynomial of the joint's own speed: Stribeck, asymmetric, by position, by other joints."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from scara_ident.arrays import Array
from scara_ident.effects.effect import DOUBT_STDS, Effect
from scara_ident.effects.parameters import Coefficient, Member, NonlinearParameter, Parameter, View
from scara_ident.effects.signals import Scene, Signals
from scara_ident.effects.sinusoid import Sinusoid, min_amplitude, sine_and_cosine
from scara_ident.model.terms import Column, Friction

# Stribeck velocities tried, as shares of the joint's largest speed; above the last-but-widest a polynomial spans it.
STRIBECK_SHARES = (0.006, 0.015, 0.04, 0.1, 0.25)
# Stribeck velocities, as shares of the largest speed, above which it is friction at any speed.
WIDEST_STRIBECK = 0.5
# Least Stribeck velocity of a joint that slides, as a share of its largest speed.
SLOWEST_STRIBECK = 1e-4
# Friction that a joint has only at low speed is not larger than this many times its Coulomb friction.
LARGEST_STRIBECK_SHARE = 2.0
# A joint that travels less, rad, shows no friction that varies with its position.
SHORTEST_TRAVEL = 0.3
# On arms with more joints than this only neighbours drive each other's friction.
ALL_PAIRS_UP_TO = 3


def friction_places(scene: Scene, joint: int) -> dict[int, int]:
    """Return where a joint's friction stands among the base model's parameters, by power of speed; empty without a term of it."""
    for term in scene.model.terms:
        if isinstance(term, Friction):
            first = scene.model.place(term).start + joint * len(term.powers)
            return {power: first + k for k, power in enumerate(term.powers)}
    return {}


def friction_of(scene: Scene, joint: int) -> dict[int, float]:
    """Return the present estimate of a joint's friction: coefficient by power of speed; empty without a friction term."""
    return {power: float(scene.value[place]) for power, place in friction_places(scene, joint).items()}


def friction_torque(signals: Signals, joint: int, powers: Collection[int] | None = None) -> Array:
    """Return the friction of a joint as the present estimate predicts it, or some powers of speed of it, recorded side, shape (N,)."""
    v = signals.scene.robot.drive_sign[joint] * signals.motion.v[joint]
    torque = np.zeros_like(v)
    for power, value in friction_of(signals.scene, joint).items():
        if powers is None or power in powers:
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


def not_all_of_coulomb(
    scene: Scene, joint: int, value: Array, std: Array, builds_up: str, smallest: float, largest: float
) -> str | None:
    """Say so where what builds up is surely less or more than these shares of the Coulomb friction that then slides."""
    coulomb = friction_of(scene, joint).get(0)
    if coulomb is None:
        return None
    # Directly after a reversal all dry friction builds up, that of low speed too.
    slow = sum(
        item.value[0] for item in scene.beside if isinstance(item.effect, Stribeck) and item.member.place == joint
    )
    if value[0] + DOUBT_STDS * std[0] < smallest * max(coulomb, 0.0):
        return f"only a small part of the Coulomb friction would build up {builds_up}, but all of it must"
    if value[0] - DOUBT_STDS * std[0] > largest * (max(coulomb, 0.0) + max(slow, 0.0)):
        beside = " and that at low speed" if slow > 0.0 else ""
        return f"it would be more than {largest:g} times the Coulomb friction{beside}"
    return None


class AtLowSpeed(Effect):
    """Friction that is another one below a velocity."""

    nonlinear = (NonlinearParameter("velocity", "{position}/s", 1e-4, 5.0),)
    of_state = True
    view = View("velocity")
    experiment = "run at eight or more constant speeds, each a constant factor below the one before, down to the slowest possible"
    # Velocities tried, as shares of the joint's largest speed.
    shares: ClassVar[tuple[float, ...]] = ()

    def scan(self, scene: Scene, joint: int) -> Iterable[tuple[float, ...]]:
        """Return shares of the joint's largest speed."""
        return ((share * float(scene.speed[joint]),) for share in self.shares)

    def limits(self, scene: Scene, member: Member) -> tuple[tuple[float, float], ...]:
        """Return shares of the largest speed of a joint that slides, whose speeds may be those of a stage or of a gantry."""
        if not scene.robot.prismatic[member.place]:
            return super().limits(scene, member)
        speed = float(scene.speed[member.place])
        return ((SLOWEST_STRIBECK * speed, speed),)

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """Say so where the joint is never fast against the velocity."""
        wrong = super().inadmissible(scene, member, value, std)
        if wrong is None and member.nonlinear[0] > WIDEST_STRIBECK * scene.speed[member.place]:
            return "the joint never moves much faster than this speed"
        return wrong


@dataclass(frozen=True)
class Stribeck(AtLowSpeed):
    """More friction at low speed: ``u = amplitude sign(v) exp(-(v/velocity)^2)``.

    Armstrong-Helouvry, Dupont, Canudas de Wit (1994), "A survey of models, analysis tools and compensation methods",
    which has both exponents. If ``exp(-|v|/velocity)`` explains significantly more, this law is used and ``exponent`` 1
    is among the parameters. Amplitude and velocity depend on the law: if both laws explain as much, the difference
    between them is part of the standard deviations.

    Attributes
    ----------
    exponent : {2, 1}
        Of the speed over the velocity.
    """

    exponent: Literal[1, 2] = 2

    name = "stribeck"
    summary = "more friction at low speed (Stribeck)"
    coefficients = (
        Coefficient(
            "amplitude",
            "{torque}",
            "additional friction of {joint} at low speed",
            "friction would be smaller at low speed",
        ),
    )
    shares = STRIBECK_SHARES

    def signal_columns(self, signals: Signals, member: Member) -> Iterable[Array]:
        """Return ``sign(v) exp(-|v/velocity|^exponent)``."""
        j = member.place
        ratio = signals.motion.v[j] / member.nonlinear[0]
        return [signals.sign[j] * np.exp(-(ratio * ratio) if self.exponent == 2 else -np.abs(ratio))]

    def other_laws(self) -> tuple[Effect, ...]:
        """Return the family of the other exponent."""
        return (Stribeck(1 if self.exponent == 2 else 2),)

    def law(self) -> Mapping[str, Parameter]:
        """Return the exponent where it is not 2."""
        return {} if self.exponent == 2 else {"exponent": Parameter(float(self.exponent), 0.0, "1")}

    def description(self, scene: Scene, member: Member) -> str:
        """Add the law where it is not that with the exponent 2."""
        return super().description(scene, member) + ("" if self.exponent == 2 else ", as exp(-|v|/velocity)")

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """Say so where friction does not fall with speed, by a share of what there is."""
        wrong = super().inadmissible(scene, member, value, std)
        if wrong is not None:
            return wrong
        coulomb = friction_of(scene, member.place).get(0)
        if coulomb is not None and value[0] - DOUBT_STDS * std[0] > LARGEST_STRIBECK_SHARE * max(coulomb, 0.0):
            return f"it would be more than {LARGEST_STRIBECK_SHARE:g} times the Coulomb friction"
        return None

    def or_else(self, scene: Scene, member: Member, value: Array) -> str:
        """Say so where friction as a whole never falls with speed, as Stribeck's does."""
        own, velocity = friction_of(scene, member.place), member.nonlinear[0]
        if not own:
            return ""
        ratio = np.linspace(0.05, 3.0, 60)
        power = self.exponent
        slope = -power * value[0] / velocity * ratio ** (power - 1) * np.exp(-(ratio**power))
        for k, each in own.items():
            if k:
                slope = slope + k * each * (ratio * velocity) ** (k - 1)
        if np.min(slope) < 0.0:
            return ""
        return "; the total friction never falls with speed: it may be friction that grows less and less with speed"


class AsymmetricFriction(Effect):
    """Viscous friction that differs by direction of the drive: ``u = viscous_difference/2 |v|``.

    Coulomb friction that differs by direction cannot be distinguished from the torque offset.
    """

    name = "asymmetric_friction"
    summary = "viscous friction that differs by direction"
    coefficients = (
        Coefficient(
            "viscous_difference", "{torque} s/{position}",
            "viscous friction of {joint} in the drive's positive direction minus that in the negative",
        ),
    )  # fmt: skip
    of_state = True
    view = View("velocity")
    experiment = "run the same path in both directions at several constant speeds"

    def signal_columns(self, signals: Signals, member: Member) -> Iterable[Array]:
        """Return ``|v|/2``."""
        return [0.5 * np.abs(signals.motion.v[member.place])]

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """Say so where friction does not brake in both directions at the largest speed."""
        speed = float(scene.speed[member.place])
        friction = sum(a * speed**power for power, a in friction_of(scene, member.place).items())
        if 0.5 * speed * (abs(value[0]) - DOUBT_STDS * std[0]) > max(friction, 0.0):
            return "friction would drive the joint in one direction"
        return None


class PositionDependentFriction(Sinusoid):
    """Coulomb friction that varies once per turn of the joint: a0 times ``1 + share sin(q + phase)``.

    Where the joint translates, q is ``pi`` times its position over its travel in the recordings. The columns are
    ``sign(v) sin q`` and ``sign(v) cos q``; share is their amplitude over the present estimate of a0.
    """

    name = "position_dependent_friction"
    summary = "Coulomb friction that varies with the joint's position"
    coefficients = sine_and_cosine(
        "dry_{part}", "Coulomb friction of {joint} that varies with the {part} of its position"
    )
    of_state = True
    view = View("position", along=True)
    experiment = (
        "run over the whole range at constant speed in both directions: half the difference of the torques is friction"
    )

    def joints(self, scene: Scene) -> list[int]:
        """Return the joints with Coulomb friction that travel far enough."""
        far = scene.robot.prismatic | (scene.travel >= SHORTEST_TRAVEL)
        return [j for j in super().joints(scene) if far[j] and 0 in friction_of(scene, j)]

    def signal_columns(self, signals: Signals, member: Member) -> Iterable[Array]:
        """Return ``sign(v) sin q`` and ``sign(v) cos q``."""
        j = member.place
        angle = signals.motion.q[j]
        if signals.scene.robot.prismatic[j]:
            angle = np.pi / signals.scene.travel[j] * angle
        return [signals.sign[j] * np.sin(angle), signals.sign[j] * np.cos(angle)]

    def description(self, scene: Scene, member: Member) -> str:
        """Say of a joint that slides what its phase is of."""
        if not scene.robot.prismatic[member.place]:
            return super().description(scene, member)
        return f"{super().description(scene, member)}, over a period of {2.0 * scene.travel[member.place]:.4g} m"

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """Say so where friction does not brake at every position."""
        coulomb = friction_of(scene, member.place).get(0, 0.0)
        return (
            "friction would drive the joint at some positions"
            if min_amplitude(value, std) > max(coulomb, 0.0)
            else None
        )

    def parameters(self, scene: Scene, member: Member, value: Array, covariance: Array) -> Mapping[str, Parameter]:
        """Return share and phase; the share's standard deviation leaves out that of a0."""
        coulomb = friction_of(scene, member.place).get(0, 0.0)
        scale = 1.0 / coulomb if coulomb > 0.0 else np.nan
        found = super().parameters(scene, member, value, covariance)
        amplitude = found["amplitude"]
        return {"share": Parameter(amplitude.value * scale, amplitude.std * scale, "1"), "phase": found["phase"]}


@dataclass(frozen=True)
class FrictionCoupling(Effect):
    """Friction of a joint driven by another joint's velocity: ``u_j = viscous w + coulomb sign(w)``.

    w is the other joint's velocity v_k. If one motor moves with two joints, as in belt drives and wrists, w is the sum
    or difference ``v_j + v_k``, ``v_j - v_k`` in the direction of the drive; its linear part in v_j then adds to the
    joint's own viscous friction.
    """

    way: Literal["other", "sum", "difference"] = "other"

    name = "friction_coupling"
    summary = "friction driven by {source}"
    coefficients = (
        Coefficient("viscous", "{torque} s/{length}", "friction of {joint} by {source}"),
        Coefficient("coulomb", "{torque}", "dry friction of {joint} by {source}", "friction would push"),
    )
    of_state = True
    experiment = "move the other joint alone while this one holds still"

    def members(self, scene: Scene) -> tuple[Member, ...]:
        """Return pairs of joints: all on small arms, else neighbours."""
        robot, joints = scene.robot, self.joints(scene)
        reach = robot.n if robot.n <= ALL_PAIRS_UP_TO else 1
        return tuple(
            Member(j, (), k)
            for j in joints
            for k in joints
            if 0 < abs(j - k) <= reach and (self.way == "other" or robot.prismatic[j] == robot.prismatic[k])
        )

    def words(self, scene: Scene, member: Member) -> dict[str, Any]:
        """Add whose velocity drives it."""
        found = super().words(scene, member)
        source = "the velocity of {partner}"
        if self.way != "other":
            source = f"the {self.way} of the velocities of {{joint}} and {{partner}}"
        length = scene.robot.position_unit(member.partner_place)
        return {**found, "source": source.format(**found), "length": length}

    def columns(self, scene: Scene, member: Member) -> tuple[Column, ...]:
        """Describe viscous and Coulomb friction; that of another joint, which reacts on this one, has either sign."""
        both = super().columns(scene, member)
        if self.way != "other":
            return both
        return tuple(Column(item.name, item.joint, item.unit, item.meaning) for item in both)

    def signal_columns(self, signals: Signals, member: Member) -> Iterable[Array]:
        """Return ``w`` and ``sign(w)``."""
        j, k = member.place, member.partner_place
        v = signals.motion.v
        if self.way == "other":
            w = v[k]
        else:
            w = signals.scene.robot.drive_sign[j] * (v[j] + v[k] if self.way == "sum" else v[j] - v[k])
        return [w, np.sign(w)]

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """Say so where friction of a motor pushes it; what another joint drives may have either sign."""
        if self.way == "other":
            return None
        speed = float(scene.speed[member.place] + scene.speed[member.partner_place])
        fast, sure = value[1] + speed * value[0], float(np.hypot(std[1], speed * std[0]))
        return "friction would push" if fast < -DOUBT_STDS * sure else super().inadmissible(scene, member, value, std)
