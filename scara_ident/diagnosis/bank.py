"""All candidates as columns of one regressor, gathered once per recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from scara_ident.effects import Effect, EffectTerm, Member, Scene, Signals
from scara_ident.evidence import Evidence
from scara_ident.information import triangular
from scara_ident.model import TorqueModel
from scara_ident.motion import Motion
from scara_ident.terms import Column

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
            return f"{self.effect.name} ({self.effect.description(scene, self.member)})" if several else self.effect.name
        partner = "" if self.member.partner is None else f" by {scene.robot.joints[self.member.partner]}"
        return f"{self.effect.name} of {joint}{partner}"

    def at(self, knobs: Sequence[float]) -> Candidate:
        """Return the member with other nonlinear parameters."""
        return replace(self, member=replace(self.member, knobs=tuple(float(x) for x in knobs)))

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


def with_candidates(scene: Scene, candidates: Sequence[Candidate]) -> tuple[TorqueModel, Bank]:
    """Return the base model with all candidates behind it."""
    bank = Bank(scene, tuple(candidates))
    return TorqueModel(f"{scene.model.name} with candidates", scene.robot, (*scene.model.terms, bank)), bank


@dataclass(frozen=True, eq=False)
class Stack:
    """Rows of all recordings, weighted, with the blocks of time they belong to.

    Attributes
    ----------
    rows : ndarray, shape (N, P + 1)
        Factors of the blocks on top of each other; the last column is the torque.
    starts : ndarray of int
        Where each block begins; the rows of all joints of a block follow each other.
    recording : ndarray of int
        Recording of each block.
    fold : ndarray of int
        Fold of each recording: trajectories, or stretches of time where there is one trajectory only.
    fold_names : tuple of str
    fold_of_block : ndarray of int
    """

    rows: Array
    starts: NDArray[np.intp]
    recording: NDArray[np.intp]
    fold_names: tuple[str, ...]
    fold_of_block: NDArray[np.intp]

    @cached_property
    def fold_factors(self) -> tuple[Array, ...]:
        """Triangular factor of the rows of each fold."""
        fold_of_row = np.repeat(self.fold_of_block, np.diff([*self.starts, len(self.rows)]))
        return tuple(triangular(self.rows[fold_of_row == fold]) for fold in range(len(self.fold_names)))


# Folds where there is one trajectory only: consecutive parts of it.
PARTS = 4


def stack(evidence: Sequence[Evidence], weights: Array) -> Stack:
    """Stack the blocks of all recordings, each joint's rows with its weight."""
    rows: list[Array] = []
    starts: list[int] = []
    recording: list[int] = []
    total = 0
    for place, item in enumerate(evidence):
        for block in item.blocks:
            if not any(part.rows for part in block):
                continue
            starts.append(total)
            recording.append(place)
            for part, weight in zip(block, weights, strict=True):
                if part.rows:
                    rows.append(weight * part.factor)
                    total += len(part.factor)
    trajectories = list(dict.fromkeys(item.trajectory for item in evidence))
    of_recording = np.array([trajectories.index(item.trajectory) for item in evidence])
    fold = of_recording[recording]
    if len(trajectories) == 1:
        trajectories = [f"part {k + 1}" for k in range(PARTS)]
        fold = np.minimum(np.arange(len(starts)) * PARTS // max(1, len(starts)), PARTS - 1)
    return Stack(np.vstack(rows), np.array(starts), np.array(recording), tuple(trajectories), fold)
