"""Transmission losses that grow with the transmitted torque."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from scara_ident.arrays import Array
from scara_ident.effects.effect import Effect
from scara_ident.effects.following import Slopes
from scara_ident.effects.links import rigid_rows, usual_link_inertia
from scara_ident.effects.parameters import Coefficient, Member, NonlinearParameter, Parameter, Tie, View
from scara_ident.effects.signals import Scene, Signals

# A gear that loses more of the torque is broken.
LARGEST_LOSS_SHARE = 0.75


def swinging_load(signals: Signals, joint: int) -> Array:
    """Return the torque that the gear of a joint transmits, with what it swings by beyond the filtered motion, shape (N,).

    Of a torque that swings so fast a gear passes on the link's share of the inertia, the rotor takes up its own.
    """
    load, swing = signals.load(joint), signals.swing(joint)
    if not np.any(swing):
        return load
    link, rotor = max(usual_link_inertia(signals.scene, joint), 0.0), max(signals.scene.armature(joint), 0.0)
    return load + (link / (link + rotor) if link > 0.0 else 0.0) * swing


def second_order(share: float) -> float:
    """Return the gain of the transmitted torque that goes with a share lost, per share: half the share where it is small."""
    return float(share / (1.0 + np.sqrt(1.0 + share**2)))


@dataclass(frozen=True)
class TransmissionLoss(Effect):
    """A share of the transmitted torque is lost in the gear, against the motion.

    With the efficiency eta the motor sees tau_l / eta when the motor drives the load and tau_l eta when the load drives
    the motor. This is ``sqrt(1 + c^2) tau_l + c |tau_l| sign(v)`` with ``eta = sqrt(1 + c^2) - c`` and the transmitted
    torque tau_l, which does not contain the joint's own rotor inertia. The first term is of second order; its c is a
    nonlinear parameter to which the coefficient is tied. If it were free, it would act as a gain of this joint's
    torque.

    If the load oscillates fast about a small mean, the loss follows the mean of its absolute value, which is not the
    absolute value of its mean. Therefore the part of the recorded torque above the low-pass of the positions is
    included in the first term; without a recorded torque it is left out.
    Hamon, Gautier, Garrec (2011), "New dry friction model with load- and velocity-dependence".

    If ``c |tau_l| sign(v)`` alone, with the same loss in both directions of power, explains significantly more, this
    law is used and ``loss_order`` 1 is among the parameters. Otherwise a scale of this joint's torque would compensate
    a second order that is not there.

    Attributes
    ----------
    loss_order : {2, 1}
        Up to which order of c there are terms: 1 without the gain of the transmitted torque.
    """

    loss_order: Literal[1, 2] = 2

    name = "transmission_loss"
    summary = "gear loss that grows with the transmitted torque"
    coefficients = (
        Coefficient(
            "loss_coefficient", "1", "share of the transmitted torque lost in {joint}",
            "the lost share is negative, but a gear cannot give energy",
            LARGEST_LOSS_SHARE, "more than three quarters of the torque would be lost",
        ),
    )  # fmt: skip
    nonlinear = (NonlinearParameter("_lost_share", "1", 0.0, LARGEST_LOSS_SHARE),)
    at_rest = True
    follows_estimate = True
    fitted_first = True
    of_load = True
    of_state = True
    watched = True
    view = View("load", along=True)
    experiment = "accelerate hard at low speed, then the same path with a known payload: a gear's loss grows with the load, friction does not"

    def scan(self, scene: Scene, joint: int) -> Iterable[tuple[float, ...]]:
        """Return three shares."""
        return ((0.05,), (0.15,), (0.4,))

    def signal_columns(self, signals: Signals, member: Member) -> Iterable[Array]:
        """Return ``|tau_l| sign(v)`` with its share of the second-order term."""
        j, gain = member.place, self._has_gain * second_order(member.nonlinear[0])
        return [np.abs(swinging_load(signals, j)) * signals.sign[j] + gain * signals.load(j)]

    def passes_on(self, member: Member, value: Array, driving: float) -> float:
        """Return the inverse of its law: of a torque that the motor sees beyond its rotor and friction it names what is transmitted."""
        share = float(value[0])
        return 1.0 / (1.0 + self._has_gain * second_order(share) * share + share * driving)

    def tie(self, scene: Scene, member: Member) -> Tie:
        """Return the share that is lost."""
        bodies = len(scene.model.rigid_body.columns)
        return Tie(member.nonlinear[0], np.append(np.zeros(bodies + 1), 1.0))

    def slopes(self, signals: Signals, member: Member) -> Iterable[Slopes]:
        """Return the derivatives with the share that multiplies the column as it is; what else acts on links is held, and what swings."""
        j, share, scene = member.place, member.nonlinear[0], signals.scene
        along = np.sign(swinging_load(signals, j)) * signals.sign[j] + self._has_gain * second_order(share)
        by_rotor = -scene.robot.row_scale[j] * signals.motion.a[j]
        term, root = scene.model.rigid_body, np.sqrt(1.0 + share**2)
        bodies, armature = np.flatnonzero(term.pattern[j]), len(term.columns)
        by_bodies = along * (rigid_rows(signals)[j] + scene.armature_slopes(j)[bodies, None] * by_rotor)
        by_share = self._has_gain * signals.load(j) / (root * (1.0 + root))
        rows = np.vstack([by_bodies, along * by_rotor, by_share])
        own = np.append(bodies, [armature, armature + 1]), share * rows
        none = np.zeros(0, dtype=np.intp), np.zeros((0, len(by_rotor)))
        return [own if k == j else none for k in range(scene.robot.n)]

    def other_laws(self) -> tuple[Effect, ...]:
        """Return the law of the other order."""
        return (TransmissionLoss(1 if self._has_gain else 2),)

    def law(self) -> Mapping[str, Parameter]:
        """Return the order where it is not 2."""
        return {} if self._has_gain else {"loss_order": Parameter(float(self.loss_order), 0.0, "1")}

    def description(self, scene: Scene, member: Member) -> str:
        """Add the law where it is not that of the order 2."""
        return super().description(scene, member) + (
            ""
            if self._has_gain
            else ", with the same loss whether the motor drives the load or the load drives the motor"
        )

    @property
    def _has_gain(self) -> bool:
        return self.loss_order == 2

    def geared_joint(self, member: Member) -> int:
        """Return its joint."""
        return member.place
