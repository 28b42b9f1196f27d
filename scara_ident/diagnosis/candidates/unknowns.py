"""The nonlinear parameters of the effects in a model: which there are, their limits, and their priors.

Armatures are among them: where the base model cannot tell a rotor from its link, the load that a gear transmits follows
from the nominal rotor inertia only, which a data sheet gives without shaft, brake and wave generator, and which is
guessed where nobody states it (`scara_ident.robot.rotors`). It enters with that uncertainty as a prior: its logarithm is
a parameter with a normal distribution, and what that costs stands in the standard deviations of the effects' parameters.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scara_ident.diagnosis.candidates.candidates import Candidate
from scara_ident.effects import Scene
from scara_ident.effects.links import largest_armature
from scara_ident.robot.rotors import GUESS_FACTOR

# Step for the derivative by a nonlinear parameter, as a share of it: small beside its curvature, large beside rounding.
DERIVATIVE_STEP = 1e-3
# A longer one for an armature's logarithm: the flights in a clearance begin and end at samples, which a short step does not move.
ARMATURE_STEP = 2e-2
# A step moves a parameter by no more than this share of it, and an armature's logarithm by this: the linear model holds no further.
LONGEST_STEP = 0.5
# An armature stays within so many standard deviations of its prior.
WIDEST = 4.0


@dataclass(frozen=True)
class Unknown:
    """A nonlinear parameter.

    Attributes
    ----------
    owner : int or None
        Place of the effect whose it is; None for the logarithm of an armature.
    place : int
        Which of the effect's, or the joint.
    nominal, spread : float
        Prior mean and standard deviation; infinite spread without one.
    """

    owner: int | None
    place: int
    value: float
    lower: float
    upper: float
    nominal: float = 0.0
    spread: float = np.inf

    @property
    def step(self) -> float:
        """For a derivative."""
        if self.owner is None:
            return ARMATURE_STEP
        return DERIVATIVE_STEP * (abs(self.value) if self.value else self.upper - self.lower)

    @property
    def reach(self) -> float:
        """How far it may go at once: beyond that the linear model does not hold."""
        if self.owner is None:
            return LONGEST_STEP
        if self.lower < 0.0 < self.upper:
            # What may have either sign is no larger for being far from zero.
            return LONGEST_STEP * (self.upper - self.lower)
        return LONGEST_STEP * abs(self.value) if self.value else np.inf

    @property
    def room(self) -> tuple[float, float]:
        """The least and the largest change that one step may have, by its bounds and how far the linear model holds."""
        return max(self.lower - self.value, -self.reach), min(self.upper - self.value, self.reach)

    def moved(self, change: float) -> float:
        """Return its value after a step, within its bounds."""
        return float(np.clip(self.value + change, self.lower, self.upper))


def unknowns_of(scene: Scene, chosen: Sequence[Candidate], rotor_inertia_std: float) -> tuple[Unknown, ...]:
    """Return the nonlinear parameters of the effects, then the armatures."""
    found = [
        Unknown(owner, place, candidate.member.nonlinear[place], lower, upper)
        for owner, candidate in enumerate(chosen)
        for place, (lower, upper) in enumerate(candidate.effect.limits(scene, candidate.member))
    ]
    joints = [candidate.effect.geared_joint(candidate.member) for candidate in chosen]
    for joint in dict.fromkeys(joint for joint in joints if joint is not None):
        nominal = scene.nominal_armature(joint)
        if scene.known_armature(joint) is None and nominal > 0.0:
            found.append(_armature(scene, joint, nominal, rotor_inertia_std))
    return tuple(found)


def _armature(scene: Scene, joint: int, nominal: float, rotor_inertia_std: float) -> Unknown:
    """Return the logarithm of an armature as an unknown; a guess leaves the link some inertia."""
    stated = bool(scene.robot.rotor_stated[joint])
    spread = rotor_inertia_std if stated else float(np.log(GUESS_FACTOR))
    mean = float(np.log(nominal))
    lower, upper = mean - WIDEST * spread, mean + WIDEST * spread
    if not stated:
        upper = min(upper, float(np.log(largest_armature(scene, joint))))
        lower = min(lower, upper - WIDEST * spread)
    held = min(float(np.log(scene.armature(joint))), upper)
    return Unknown(None, joint, held, lower, upper, mean, spread)


def sides(candidate: Candidate) -> list[tuple[Candidate, Candidate, float]]:
    """Return for each nonlinear parameter the candidates on either side, and how far they are from it."""
    found = []
    for place, parameter in enumerate(candidate.effect.nonlinear):
        value = candidate.member.nonlinear[place]
        reach = DERIVATIVE_STEP * (abs(value) if value else parameter.upper - parameter.lower)
        moved = [list(candidate.member.nonlinear) for _ in range(2)]
        moved[0][place], moved[1][place] = value + reach, value - reach
        found.append((candidate.at(moved[0]), candidate.at(moved[1]), reach))
    return found
