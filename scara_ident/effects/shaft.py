"""A shaft or gear that turns with two neighbouring joints together, as wrists that are driven through one another have."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from scara_ident.arrays import Array
from scara_ident.effects.coupling import unspanned_pairs
from scara_ident.effects.effect import Effect
from scara_ident.effects.parameters import Coefficient, Member
from scara_ident.effects.signals import Scene, Signals
from scara_ident.model.terms import Column

# A part of a shaft is seen to be there this many standard deviations from none: 0.3 % two-sided.
SEEN_STDS = 3.0


@dataclass(frozen=True)
class CoupledShaft(Effect):
    """Inertia and friction of a shaft that turns with the sum or the difference of two joints' motions.

    With ``w = v_j + s v_k``, s = 1 or -1, its torque ``J dw/dt + viscous w + coulomb sign(w)`` loads joint j, and s times it
    loads joint k, both at the joint (Janot, Vandanjon, Gautier 2014, on the wrist of a TX40). It is reported only if
    its friction is significant; inertia alone is a separate effect. A short run determines the friction on both joints
    well before the inertia. If the links' inertia includes that of the shaft, as with parallel axes, only the friction
    can be found.
    """

    way: Literal["sum", "difference"] = "sum"

    name = "coupled_shaft"
    summary = "a shaft that turns with {way}{joint} and {partner}"
    coefficients = (
        Coefficient("inertia", "{inertia}", "inertia of {source}", "its inertia would be negative"),
        Coefficient("viscous", "{effort} s/{length}", "viscous friction of {source}", "friction would push"),
        Coefficient("coulomb", "{effort}", "dry friction of {source}", "friction would push"),
    )
    of_state = True
    experiment = "move each of the two joints alone while the other holds still, then both together"

    @property
    def side(self) -> float:
        """1 for the sum of both motions, -1 for the difference."""
        return 1.0 if self.way == "sum" else -1.0

    def members(self, scene: Scene) -> tuple[Member, ...]:
        """Return the neighbours that move alike, both turning or both sliding."""
        moving, slides = self.joints(scene), scene.robot.prismatic
        return tuple(Member(j, (), j + 1) for j in moving if j + 1 in moving and slides[j] == slides[j + 1])

    def rows(self, scene: Scene, member: Member) -> list[int]:
        """Return the two joints."""
        return [member.place, member.partner_place]

    def words(self, scene: Scene, member: Member) -> dict[str, Any]:
        """Add units at the joint, and what turns."""
        found = super().words(scene, member)
        found["way"] = "" if self.way == "sum" else "the difference of "
        slides = bool(scene.robot.prismatic[member.place])
        units = {"inertia": "kg" if slides else "kg m^2", "effort": "N" if slides else "N m"}
        source = f"what turns with {found['way']}{found['joint']} and {found['partner']}"
        return found | units | {"source": source, "length": scene.robot.position_unit(member.place)}

    def columns(self, scene: Scene, member: Member) -> tuple[Column, ...]:
        """Describe inertia, where the links' does not span it, viscous and Coulomb friction."""
        return super().columns(scene, member)[self._first(scene, member) :]

    def signal_columns(self, signals: Signals, member: Member) -> Iterable[Array]:
        """Return what each unit loads the two joints with."""
        rows, motion = self.rows(signals.scene, member), signals.motion
        j, k = rows
        arm = np.array([1.0, self.side]) * signals.scene.robot.row_scale[rows]
        speed, acceleration = (part[j] + self.side * part[k] for part in (motion.v, motion.a))
        found = []
        for turning in (acceleration, speed, np.sign(speed))[self._first(signals.scene, member) :]:
            found.append(np.zeros_like(motion.v))
            found[-1][rows] = arm[:, None] * turning
        return found

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """Say so where a part is negative, or no friction is seen, so that another effect says all that is."""
        first = self._first(scene, member)
        for item, x, spread in zip(self.coefficients[first:], value, std, strict=True):
            if x < -SEEN_STDS * spread:
                return item.positive
        seen = value > SEEN_STDS * std
        return None if np.any(seen[1 - first :]) else "no friction that depends on both joints is seen"

    def _first(self, scene: Scene, member: Member) -> int:
        """Return 1 where the base model spans the inertia, else 0."""
        return int((member.place, member.partner_place) not in unspanned_pairs(scene.model.rigid_body))
