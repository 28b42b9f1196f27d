"""Candidates: members of families of effects, and all of them as one term."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from scara_ident.effects import Effect, EffectTerm, Member, Scene, Signals
from scara_ident.model.terms import Column
from scara_ident.motion.motion import Motion

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Candidate:
    """A member of a family that might be what the model lacks.

    Attributes
    ----------
    effect : Effect
    member : Member
    """

    effect: Effect
    member: Member

    def joint(self, scene: Scene) -> str | None:
        """Name of the joint that it belongs to."""
        return None if self.member.joint is None else scene.robot.joints[self.member.joint]

    def label(self, scene: Scene) -> str:
        """Name of effect and joints, the same for all members that differ in nonlinear parameters only."""
        joint = self.joint(scene)
        if joint is None:
            # Members without a joint are told apart by what they are.
            several = self.member.partner is not None
            return (
                f"{self.effect.name} ({self.effect.description(scene, self.member)})" if several else self.effect.name
            )
        partner = "" if self.member.partner is None else f" by {scene.robot.joints[self.member.partner]}"
        return f"{self.effect.name} of {joint}{partner}"

    def at(self, nonlinear: Sequence[float]) -> Candidate:
        """Return the member with other nonlinear parameters."""
        return replace(self, member=replace(self.member, nonlinear=tuple(float(x) for x in nonlinear)))

    def term(self, scene: Scene) -> EffectTerm:
        """Return it as a term of a model."""
        return EffectTerm(self.effect, self.member, scene)


@dataclass(frozen=True, eq=False)
class Bank:
    """Candidates as one term; what they share is computed once per stretch of motion."""

    scene: Scene
    candidates: tuple[Candidate, ...]

    @property
    def name(self) -> str:
        """Name of the term."""
        return "candidates"

    @cached_property
    def terms(self) -> tuple[EffectTerm, ...]:
        """The candidates as terms."""
        return tuple(candidate.term(self.scene) for candidate in self.candidates)

    @cached_property
    def columns(self) -> tuple[Column, ...]:
        """Columns of all candidates."""
        return tuple(column for term in self.terms for column in term.columns)

    @cached_property
    def pattern(self) -> NDArray[np.bool_]:
        """Which entries can differ from zero, shape (n, k)."""
        if not self.terms:
            return np.zeros((self.scene.robot.n, 0), dtype=bool)
        return np.concatenate([term.pattern for term in self.terms], axis=1)

    @cached_property
    def places(self) -> tuple[slice, ...]:
        """Where each candidate's columns stand."""
        bounds = np.cumsum([0, *(len(term.columns) for term in self.terms)])
        return tuple(slice(int(a), int(b)) for a, b in zip(bounds[:-1], bounds[1:], strict=True))

    def regressor(self, motion: Motion) -> Array:
        """Return the columns of all candidates, shape (n, k, N)."""
        signals = Signals(self.scene, motion)
        result = np.zeros((self.scene.robot.n, len(self.columns), motion.samples))
        for candidate, place in zip(self.candidates, self.places, strict=True):
            result[:, place] = candidate.effect.regressor(signals, candidate.member)
        return result
