"""Losses of the gear that grow with the torque that it transmits."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from scara_ident.arrays import Array
from scara_ident.effects.effect import Effect
from scara_ident.effects.following import EstimateSlopes, predicted_slopes, some_slopes
from scara_ident.effects.links import usual_link_inertia
from scara_ident.effects.parameters import Coefficient, Member, NonlinearParameter, View
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


class TransmissionLoss(Effect):
    """A share of the transmitted torque is lost in the gear, against the motion.

    With the efficiency eta the motor sees tau_l / eta when it drives and tau_l eta when it is driven, which is
    ``sqrt(1 + c^2) tau_l + c |tau_l| sign(v)`` with ``eta = sqrt(1 + c^2) - c`` and the transmitted torque tau_l, which
    leaves out the own rotor's inertia. The first term is of second order; its c is a nonlinear parameter that meets
    the coefficient when it is refined, so that no gain of this joint's torque is left over.

    A load that swings fast about a small one loses the mean of its size, which is not the size of its mean: what the recorded torque
    has beyond the low-pass of the positions is in the first term; without a torque it is left out.
    Hamon, Gautier, Garrec (2011), "New dry friction model with load- and velocity-dependence".
    """

    name = "transmission_loss"
    summary = "gear loss that grows with the transmitted torque"
    coefficients = (
        Coefficient(
            "loss_coefficient", "1", "share of the transmitted torque lost in {joint}",
            "a gear cannot give energy: the lost share is negative",
            LARGEST_LOSS_SHARE, "over three quarters of the torque would be lost",
        ),
    )  # fmt: skip
    nonlinear = (NonlinearParameter("_lost_share", "1", 0.005, LARGEST_LOSS_SHARE, of_coefficient=True),)
    at_rest = True
    follows_estimate = True
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
        j, share = member.place, member.nonlinear[0]
        size = np.abs(swinging_load(signals, j))
        return [size * signals.sign[j] + (np.sqrt(1.0 + share**2) - 1.0) / share * signals.load(j)]

    def estimate_slopes(self, signals: Signals, member: Member, value: Array) -> EstimateSlopes:
        """Return those by the rigid bodies, which load the gear but for the own rotor; what else acts on links is held."""
        j, share, scene = member.place, member.nonlinear[0], signals.scene
        place = scene.model.place(scene.model.rigid_body)
        bodies = np.arange(place.start, place.stop)
        places, rows = some_slopes(predicted_slopes(signals, j), bodies)
        rotor = scene.armature_slopes(j)[places - place.start, None] * scene.robot.row_scale[j] * signals.motion.a[j]
        along = np.sign(swinging_load(signals, j)) * signals.sign[j] + (np.sqrt(1.0 + share**2) - 1.0) / share
        return {j: (places, value[0] * along * (rows - rotor))}

    def geared_joint(self, member: Member) -> int:
        """Return its joint."""
        return member.place
