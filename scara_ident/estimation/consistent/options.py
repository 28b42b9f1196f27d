"""What a user may know of the arm beyond its recordings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, get_args

from scara_ident.arrays import Array
from scara_ident.errors import UsageError
from scara_ident.manners import Frozen

FrictionShape = Literal["free", "dissipative", "lubricated"]
FrictionOption = Literal["auto", "free", "dissipative", "lubricated"]


@dataclass(frozen=True)
class Ellipsoid:
    """A region that holds a link's centre of mass.

    Attributes
    ----------
    centre : tuple of float
        In the link's frame, m.
    radii : tuple of float
        Semi-axes along the link's axes, m.
    """

    centre: tuple[float, float, float]
    radii: tuple[float, float, float]


@dataclass(frozen=True, eq=False, repr=False)
class ConsistentOptions(Frozen):
    """Options of the physically consistent estimate.

    Attributes
    ----------
    friction : {"auto", "lubricated", "dissipative", "free"} or mapping of str to one of them
        Constraint on the friction of every joint. ``dissipative``: it dissipates energy, and the motor can overcome it
        up to the velocity limit; ``lubricated``: in addition it is non-decreasing and concave in speed; ``free``: no
        constraint. By default ``auto``: lubricated unless the data contradict it, then dissipative, for each joint, see
        `scara_ident.estimation.consistent.shape`. A mapping gives it by joint; the others are ``auto``.
    speed : mapping of str to float
        Velocity limits to use instead of the URDF's, by joint, rad/s or m/s.
    total_mass : (float, float), optional
        Mass of all moving links and its tolerance, kg.
    link_mass : mapping of str to (float, float)
        Mass of a link with all that is fixed to it, and its tolerance, kg; by the name of the link or its joint.
    com : {"free", "visual"} or mapping of str to Ellipsoid
        Where the centres of mass may be: anywhere, within the bounding box of the link's visual shape, or
        within an ellipsoid, by the name of the link or its joint.
    priors : mapping of str to (float, float)
        Mean and standard deviation of parameters, by the name of the model's parameter or of a standard
        parameter such as ``m2``.
    noise : ndarray, shape (n,), optional
        Standard deviation of each joint's torque, by which its rows are divided; by default its residual in `wls`.
    prior_weight : float
        Weight of the nominal bodies relative to the data if plain least squares is not physically consistent: a change
        of a body by its own size relative to one standard deviation of the noise. With the default of 0.01 the prior
        moves directions that the data determine by less than a tenth of their standard deviation, even if the URDF is
        wrong, see
        `scara_ident.estimation.consistent.prior`.
    """

    friction: FrictionOption | Mapping[str, FrictionOption] = "auto"
    speed: Mapping[str, float] = field(default_factory=dict)
    total_mass: tuple[float, float] | None = None
    link_mass: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    com: Literal["free", "visual"] | Mapping[str, Ellipsoid] = "free"
    priors: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    noise: Array | None = None
    prior_weight: float = 0.01

    def __post_init__(self) -> None:
        super().__post_init__()
        given = (self.friction,) if isinstance(self.friction, str) else tuple(self.friction.values())
        for shape in given:
            if shape not in get_args(FrictionOption):
                raise UsageError(f"friction {shape!r}: expected one of {', '.join(get_args(FrictionOption))}")
        if isinstance(self.com, str) and self.com not in ("free", "visual"):
            raise UsageError(f"com {self.com!r}: expected free, visual or ellipsoids by link")
        if not self.prior_weight > 0.0:
            raise UsageError(f"prior_weight is {self.prior_weight:g}; expected a number above 0")
        masses = dict(self.link_mass)
        if self.total_mass is not None:
            masses["total_mass"] = self.total_mass
        for name, (value, tolerance) in masses.items():
            if not (value > 0.0 and tolerance > 0.0):
                raise UsageError(f"mass of {name}: {value:g} within {tolerance:g}; both must be above 0")
        for name, speed in self.speed.items():
            if not speed > 0.0:
                raise UsageError(f"speed of {name} is {speed:g}; expected a velocity limit above 0")
        for name, (_, std) in self.priors.items():
            if not std > 0.0:
                raise UsageError(f"prior of {name}: standard deviation {std:g}; it must be above 0")

    def friction_of(self, joint: str) -> FrictionOption:
        """Return the constraint on the friction of a joint."""
        return self.friction if isinstance(self.friction, str) else self.friction.get(joint, "auto")
