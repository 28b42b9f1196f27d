"""Joints whose drives are coupled mechanically, beyond friction."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from typing import Any

import numpy as np

from scara_ident.arrays import Array
from scara_ident.effects.effect import Effect
from scara_ident.effects.following import EstimateSlopes, predicted_slopes
from scara_ident.effects.parameters import Coefficient, Member
from scara_ident.effects.signals import Scene, Signals
from scara_ident.effects.spanned import Span, random_motion, rows_by_sample
from scara_ident.model.terms import RigidBody

# On arms of more joints only neighbours and the joints after them are tried: drives run through them.
NEIGHBOUR_REACH = 2


class InertiaCoupling(Effect):
    """Inertia that two joints turn together: torque of one proportional to the other's acceleration, both ways.

    A rotor or shaft that turns with the sum of two joints' motions, such as in a wrist that is driven through its
    neighbour, causes this torque, in addition to what it adds to each joint's own inertia. The sign is that of the sum
    or difference with which the shaft turns.
    """

    name = "inertia_coupling"
    summary = "inertia that turns with this joint and with {partner}"
    coefficients = (Coefficient("inertia", "{inertia}", "inertia that turns with both {joint} and {partner}"),)
    of_state = True
    not_simulated = "each rotor of the virtual arm turns with one joint"

    def members(self, scene: Scene) -> tuple[Member, ...]:
        """Return the pairs of joints where the base model does not span it."""
        return tuple(Member(j, (), k) for j, k in unspanned_pairs(scene.model.rigid_body))

    def rows(self, scene: Scene, member: Member) -> list[int]:
        """Return the two joints."""
        return [member.place, member.partner_place]

    def words(self, scene: Scene, member: Member) -> dict[str, Any]:
        """Add the unit of the shared inertia."""
        slides = int(np.count_nonzero(scene.robot.prismatic[self.rows(scene, member)]))
        return super().words(scene, member) | {"inertia": ("kg m^2", "kg m", "kg")[slides]}

    def signal_columns(self, signals: Signals, member: Member) -> Iterable[Array]:
        """Return each joint's acceleration on the other."""
        return [
            _exchanged(signals.scene.robot.row_scale, signals.motion.a, *self.rows(signals.scene, member))
        ]  # fmt: skip


class DriveCoupling(Effect):
    """A drive that also carries a share of another joint's torque.

    If the drive of joint k runs through joint j, as in wrists, or reacts on it, as a belt from the base does, j's motor
    carries a share of k's joint torque. Crosstalk between torque channels looks the same.
    """

    name = "drive_coupling"
    summary = "a drive that carries a share of the torque of {partner}"
    coefficients = (
        Coefficient(
            "share", "1", "share of the torque of {partner} on {joint}, both at the joint",
            largest=1.0, too_large="it would be more than the whole torque of the other joint",
        ),
    )  # fmt: skip
    follows_estimate = True
    of_state = True
    not_simulated = "each motor of the virtual arm drives one joint"

    def members(self, scene: Scene) -> tuple[Member, ...]:
        """Return every joint with every neighbour."""
        n = scene.robot.n
        return tuple(Member(j, (), k) for j in range(n) for k in (j - 1, j + 1) if 0 <= k < n)

    def signal_columns(self, signals: Signals, member: Member) -> Iterable[Array]:
        """Return the other joint's predicted torque, brought to this joint's side of the gear."""
        j, k = member.place, member.partner_place
        scale = signals.scene.robot.row_scale
        return [signals.predicted[k] * (scale[j] / scale[k])]

    def estimate_slopes(self, signals: Signals, member: Member, value: Array) -> EstimateSlopes:
        """Return those of the other joint's torque."""
        j, k = member.place, member.partner_place
        scale = signals.scene.robot.row_scale
        places, rows = predicted_slopes(signals, k)
        return {j: (places, value[0] * (scale[j] / scale[k]) * rows)}


def _exchanged(scale: Array, a: Array, j: int, k: int) -> Array:
    result = np.zeros_like(a)
    result[j] = scale[j] * a[k]
    result[k] = scale[k] * a[j]
    return result


@lru_cache(maxsize=16)
def unspanned_pairs(term: RigidBody) -> tuple[tuple[int, int], ...]:
    """Return the pairs of joints whose shared inertia the rigid bodies' columns do not span, from random states."""
    robot = term.robot
    motion = random_motion(robot, np.random.default_rng(0), 20 + 2 * len(term.columns))
    span = Span.of(rows_by_sample(term.regressor(motion)))
    pairs = [(j, k) for j in range(robot.n) for k in range(j + 1, min(robot.n, j + NEIGHBOUR_REACH + 1))]
    columns = {pair: _exchanged(robot.row_scale, motion.a, *pair)[:, None] for pair in pairs}
    return tuple(pair for pair in pairs if span.carriers(rows_by_sample(columns[pair])) is None)
