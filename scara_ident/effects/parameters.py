"""What an effect is described by: its members, coefficients and parameters, and what a figure shows it over."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from scara_ident.arrays import Array
from scara_ident.effects.symmetric_power import interval


@dataclass(frozen=True)
class Parameter:
    """A physical parameter of an effect: its value, standard deviation and unit.

    Attributes
    ----------
    symmetric_power : float
        The power of it that the data tell: 1 itself, -1 its reciprocal, 0 its logarithm; see `scara_ident.effects.symmetric_power`.
    """

    value: float
    std: float
    unit: str
    symmetric_power: float = 1.0

    @property
    def interval(self) -> tuple[float, float] | None:
        """Where it is with 95 %, an open end infinite; None where that is the value give or take two standard deviations."""
        return interval(self.value, self.std, self.symmetric_power)

    def entry(self) -> dict[str, Any]:
        """Return it as JSON has it, an open end None."""
        found = {"value": self.value, "std": self.std, "unit": self.unit}
        ends = self.interval
        return found if ends is None else {**found, "interval": [end if np.isfinite(end) else None for end in ends]}


@dataclass(frozen=True)
class NonlinearParameter:
    """A nonlinear parameter of an effect.

    Attributes
    ----------
    name : str
        As in the table of effects; with an underscore before it, it shapes the columns and is not reported.
    unit : str
        May hold the words of `Effect.words`, as ``{position}`` for rad or m.
    lower, upper : float
        What a real arm can have, see `Effect.limits`; refinement stays within.
    logarithmic : bool
        Whether it is scanned and refined on a logarithmic scale.
    of_length : bool
        Whether it is a way of the joint: of one that slides ``lower`` and ``upper`` are multiples of `Scene.radian`.
    symmetric_power : float or None
        The power of it that the data tell, see `Parameter`; None for what it is refined in, its logarithm or itself.
    jumps : bool
        Whether it is an instant, s, at which the columns jump.
    """

    name: str
    unit: str
    lower: float
    upper: float
    logarithmic: bool = True
    of_length: bool = False
    symmetric_power: float | None = None
    jumps: bool = False

    def parameter(self, value: float, std: float, unit: str) -> Parameter:
        """Return it as a physical parameter."""
        symmetric_power = (0.0 if self.logarithmic else 1.0) if self.symmetric_power is None else self.symmetric_power
        return Parameter(value, std, unit, symmetric_power)


@dataclass(frozen=True)
class Coefficient:
    """One linear coefficient of an effect: what its column is called.

    Attributes
    ----------
    name : str
    unit, meaning : str
        May hold the words of `Effect.words`: ``{joint}``, ``{torque}`` and ``{position}`` (its units), ``{partner}``,
        and nonlinear parameters by name, such as ``{order:g}``.
    positive : str
        Why it cannot be negative on a real arm; empty where it can.
    largest : float
        Size that it has at the most on a real arm.
    too_large : str
        What is wrong with a larger one; may hold ``{value}`` and the words.
    """

    name: str
    unit: str = "{torque}"
    meaning: str = ""
    positive: str = ""
    largest: float = np.inf
    too_large: str = ""


@dataclass(frozen=True)
class SpectralLine:
    """A line of a joint's residual: so many periods per motor turn (``order``), or Hz (``frequency``)."""

    kind: Literal["order", "frequency"]
    position: float


@dataclass(frozen=True)
class View:
    """The signal over which an effect shows itself in a figure.

    Attributes
    ----------
    signal : str
        A signal of the joint; ``reversal`` is the travel since its last reversal, ``order`` and ``frequency`` are
        spectra, ``own`` is the torque of the effect itself.
    along : bool
        Whether torque is taken in the direction of motion.
    distance : str or None
        The physical parameter that says over which distance after a reversal the effect acts.
    """

    signal: Literal[
        "own", "position", "velocity", "acceleration", "time", "torque", "torque rate", "load", "reversal", "order", "frequency"
    ] = "own"  # fmt: skip
    along: bool = False
    distance: str | None = None


OWN = View()
"""An effect that is shown over nothing but its own torque."""


@dataclass(frozen=True)
class Interval:
    """A stretch of a recording in which something acts.

    Attributes
    ----------
    recording : int
        Place of the recording in the scene.
    start, stop : float
        Seconds since the recording began.
    start_std, stop_std : float
        How sure they are, s; 0 where the recording itself begins or ends there.
    joint : int or None
        The only joint whose torque it counts for; None for all.
    """

    recording: int
    start: float
    stop: float
    start_std: float = 0.0
    stop_std: float = 0.0
    joint: int | None = None


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
        A second joint, for effects of one joint on another; of an effect without a joint the number of a group.
    intervals : tuple of Interval
        In which alone it acts, of an effect that acts in some; see `Effect.in_intervals`.
    """

    joint: int | None
    nonlinear: tuple[float, ...] = ()
    partner: int | None = None
    intervals: tuple[Interval, ...] = ()

    @property
    def place(self) -> int:
        """Place of its joint; an error for a member that belongs to no one joint."""
        if self.joint is None:
            raise ValueError(f"{self} belongs to no one joint")
        return self.joint

    @property
    def partner_place(self) -> int:
        """Place of its partner; an error for a member without one."""
        if self.partner is None:
            raise ValueError(f"{self} has no partner")
        return self.partner


@dataclass(frozen=True, eq=False)
class Tie:
    """What an effect's only coefficient is by its nonlinear parameters and by the rigid bodies.

    Attributes
    ----------
    value : float
    slopes : ndarray, shape (p + 1 + s,)
        Derivatives by the parameters of the rigid bodies, by the armature where these do not tell it, and by the nonlinear
        parameters.
    """

    value: float
    slopes: Array


def deviation(covariance: Array, place: int = 0) -> float:
    """Return the standard deviation of one coefficient."""
    return float(np.sqrt(max(covariance[place, place], 0.0)))
