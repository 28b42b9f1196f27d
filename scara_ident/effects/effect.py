"""What an effect is: a term of the torque equation that the base model may lack.

A member of a family has fixed nonlinear parameters and is linear in its coefficients, so that all members of all
families are columns of one regressor. A family knows which members to try, how the coefficients become physical
parameters, and which of them no real arm can have.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from scara_ident.effects.signals import Scene, Signals
from scara_ident.model.terms import Column
from scara_ident.motion.motion import Motion

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Parameter:
    """A physical parameter of an effect: its value, standard deviation and unit."""

    value: float
    std: float
    unit: str


@dataclass(frozen=True)
class NonlinearParameter:
    """A nonlinear parameter of an effect.

    Attributes
    ----------
    name : str
        As in the table of effects.
    unit : str
    lower, upper : float
        What a real arm can have; refinement stays within.
    logarithmic : bool
        Whether it is scanned and refined on a logarithmic scale.
    """

    name: str
    unit: str
    lower: float
    upper: float
    logarithmic: bool = True


@dataclass(frozen=True)
class Member:
    """One member of a family: a joint and values of the nonlinear parameters.

    Attributes
    ----------
    joint : int or None
        Place of the joint in ``robot.joints``; None where the effect belongs to no one joint.
    nonlinear : tuple of float
        One value per parameter of the family.
    partner : int or None
        A second joint, for effects of one joint on another.
    """

    joint: int | None
    nonlinear: tuple[float, ...] = ()
    partner: int | None = None


class Effect(Protocol):
    """A family of terms with one physical cause."""

    @property
    def name(self) -> str:
        """Name in the table of effects."""
        ...

    @property
    def nonlinear(self) -> tuple[NonlinearParameter, ...]:
        """Nonlinear parameters."""
        ...

    def members(self, scene: Scene) -> tuple[Member, ...]:
        """Return the members worth trying on this robot and these recordings."""
        ...

    def columns(self, scene: Scene, member: Member) -> tuple[Column, ...]:
        """Describe the k columns of a member."""
        ...

    def regressor(self, signals: Signals, member: Member) -> Array:
        """Return the columns of a member, shape (n, k, N), on the side of the recorded torque."""
        ...

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """Say why coefficients cannot be those of a real arm; None where they can.

        A coefficient within two standard deviations of what is possible is possible.
        """
        ...

    def parameters(self, scene: Scene, member: Member, value: Array, covariance: Array) -> Mapping[str, Parameter]:
        """Turn coefficients (k,) and their covariance (k, k) into the effect's physical parameters.

        The nonlinear parameters are added by the caller, who knows how sure they are.
        """
        ...

    def description(self, scene: Scene, member: Member) -> str:
        """Say in a few words what the effect is, for a person."""
        ...


@runtime_checkable
class Resolved(Protocol):
    """A family whose nonlinear parameters have narrow peaks, such as orders and frequencies."""

    def resolution(self, scene: Scene, member: Member) -> tuple[float, ...]:
        """Return, for every parameter, how far apart two values must be to be told apart."""
        ...


@runtime_checkable
class Geared(Protocol):
    """A family that depends on the torque behind a gear, and so on how much of an inertia is the rotor's."""

    def geared_joint(self, member: Member) -> int:
        """Return the place of the joint whose gear it is."""
        ...


@runtime_checkable
class Resonant(Protocol):
    """A family whose columns hold in a band that ends below a resonance."""

    def resonance(self, member: Member) -> float:
        """Return the frequency of the resonance, Hz."""
        ...


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
        """Which joints the columns act on, shape (n, k): its own, or all where it has none."""
        n, k = self.scene.robot.n, len(self.columns)
        if self.member.joint is None:
            return np.ones((n, k), dtype=bool)
        pattern = np.zeros((n, k), dtype=bool)
        pattern[getattr(self.effect, "rows", lambda member: [member.joint])(self.member)] = True
        return pattern

    def regressor(self, motion: Motion) -> Array:
        """Return the columns on a stretch of motion, shape (n, k, N)."""
        return self.effect.regressor(Signals(self.scene, motion), self.member)
