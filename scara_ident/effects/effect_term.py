"""A member of a family of effects as a term of a torque model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.effects.effect import Effect
from scara_ident.effects.in_state import follows_state
from scara_ident.effects.parameters import Member
from scara_ident.effects.signals import Scene, Signals
from scara_ident.model.prediction import states
from scara_ident.model.terms import Column
from scara_ident.model.terms.term import StateTorque
from scara_ident.motion.motion import Motion


@dataclass(frozen=True, eq=False)
class EffectTerm:
    """A member of a family as a term of a torque model.

    Attributes
    ----------
    effect : Effect
    member : Member
    scene : Scene
        The robot and the estimate from which loads are predicted.
    """

    effect: Effect
    member: Member
    scene: Scene

    @property
    def name(self) -> str:
        """Name of the effect."""
        return self.effect.name

    @property
    def joint(self) -> str | None:
        """The joint it belongs to."""
        return None if self.member.joint is None else self.scene.robot.joints[self.member.joint]

    @property
    def columns(self) -> tuple[Column, ...]:
        """Columns of the regressor."""
        return self.effect.columns(self.scene, self.member)

    @property
    def pattern(self) -> NDArray[np.bool_]:
        """Which joints the columns act on, shape (n, k)."""
        pattern = np.zeros((self.scene.robot.n, len(self.columns)), dtype=bool)
        pattern[self.effect.rows(self.scene, self.member)] = True
        return pattern

    def regressor(self, motion: Motion) -> Array:
        """Return the columns on a stretch of motion, shape (n, k, N)."""
        return self.effect.regressor(Signals(self.scene, motion), self.member)

    def fill(self, motion: Motion, rows: Sequence[Array]) -> None:
        """Write the columns into those of each joint: (k, N) where they act, (0, N) where they do not."""
        self.effect.fill(Signals(self.scene, motion), self.member, rows)

    @cached_property
    def in_state(self) -> EffectTerm:
        """The term of an arm on whose links nothing acts but what one state tells: no body that it carries at times."""
        scene = self.scene
        terms = [EffectTerm(item.effect, item.member, scene) for item in scene.link_torques]
        kept = [
            item for item, term in zip(scene.link_torques, terms, strict=True) if follows_state(term.regressor, scene)
        ]
        return self if len(kept) == len(terms) else replace(self, scene=replace(scene, link_torques=tuple(kept)))

    def state_torque(self, value: Array) -> StateTorque | None:
        """Return the torque of the coefficients (k,) in one state; None where it takes more than the state."""
        term = self.in_state
        if not follows_state(term.regressor, term.scene):
            return None

        def torque(q: Array, v: Array, a: Array) -> Array:
            columns = term.regressor(states(q[:, None], v[:, None], a[:, None]))
            return np.asarray(columns[:, :, 0] @ value)

        return torque
