"""What all effects share: a joint, sizes that may be left to the arm, and how they add themselves to it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, ClassVar, Literal, Self

from scara_ident.errors import UsageError
from scara_ident.simulation.arm import VirtualArm
from scara_ident.simulation.plant import PlantDraft

# A size that is left to the arm: `Effect.resolve` puts a number that suits the arm's torques in its place.
BY_ARM = math.nan
Vector = tuple[float, ...]


@dataclass(frozen=True)
class Effect:
    """One physical effect that a rigid body with polynomial friction and offset lacks.

    Attributes
    ----------
    joint : str or None
        The joint that it belongs to; None is the first joint, or the whole arm where `whole_arm` says so.
    recording : str or None
        The only recording that has it, ``<trajectory>_<repetition>``; None is all of them.
    """

    name: ClassVar[str] = ""
    # Parameter -> unit, in the contract's words.
    units: ClassVar[dict[str, str]] = {}
    # Parameter -> smallest and largest value; both may be reached.
    bounds: ClassVar[dict[str, tuple[float, float]]] = {}
    whole_arm: ClassVar[Literal["never", "may be", "always"]] = "never"
    # Parameter left to the arm -> share of its usual torque.
    shares: ClassVar[dict[str, float]] = {}
    # Parameter left to the arm -> multiple of what goes with a radian of the joint, see `VirtualArm.radian`.
    ways: ClassVar[dict[str, float]] = {}
    # Parameter -> array of the draft into which it is written; those that are brought to the joint side of the gear.
    arrays: ClassVar[dict[str, str]] = {}
    joint_side: ClassVar[tuple[str, ...]] = ()
    # Parameter -> its name in text and JSON, where that is no name in Python.
    spelled: ClassVar[dict[str, str]] = {}

    joint: str | None = None
    recording: str | None = field(default=None, kw_only=True, repr=False)

    @classmethod
    def parameter_names(cls) -> dict[str, str]:
        """Return the parameters in order, name in text and JSON -> attribute."""
        names = [item.name for item in fields(cls) if item.name not in ("joint", "recording")]
        return {cls.spelled.get(name, name): name for name in names}

    def sizes(self, arm: VirtualArm, joint: int) -> Mapping[str, float | Vector]:
        """Return values for the parameters that are left to the arm."""
        sizes = {key: float(share * arm.torque_scale[joint]) for key, share in self.shares.items()}
        return sizes | {key: float(way * arm.radian[joint]) for key, way in self.ways.items()}

    def first_choice(self, arm: VirtualArm) -> str:
        """Return the joint meant where none is named."""
        return arm.robot.joints[0]

    def resolve(self, arm: VirtualArm) -> Self:
        """Return the effect with its joint and all its sizes.

        Raises
        ------
        UsageError
            If the joint is unknown or a parameter is out of its bounds.
        """
        joint = self.joint
        if self.whole_arm == "always" and joint is not None:
            raise UsageError(f"{self.name} belongs to the whole arm; leave out the joint {joint!r}")
        if self.whole_arm == "never" and joint is None:
            joint = self.first_choice(arm)
        index = arm.robot.joint_index(joint) if joint is not None else 0
        sizes = self.sizes(arm, index)
        left: dict[str, Any] = {key: value for key, value in sizes.items() if _is_left(getattr(self, key))}
        resolved = replace(self, joint=joint, **left)
        for key in self.units:
            low, high = self.bounds.get(key, (-math.inf, math.inf))
            for value in _numbers(getattr(resolved, key)):
                if not math.isfinite(value) or not low <= value <= high:
                    word = self.spelled.get(key, key)
                    raise UsageError(
                        f"{self.name}: {word} is {value:g}; expected {_range(low, high)}{_unit(self.units[key])}"
                    )
        return resolved

    def place(self, arm: VirtualArm) -> int:
        """Return the row of its joint in Pinocchio's order."""
        return int(arm.robot.order[arm.robot.joint_index(self.joint or arm.robot.joints[0])])

    def apply(self, arm: VirtualArm, draft: PlantDraft) -> None:
        """Add the effect, which must be resolved, to the arm's arrays."""
        j = self.place(arm)
        for place, (key, name) in enumerate(self.arrays.items()):
            array = draft.array(name)
            if place == 0:
                vacant(self, array[j])
            array[j] = (abs(draft.scale[j]) if key in self.joint_side else 1.0) * getattr(self, key)

    def as_dict(self) -> dict[str, Any]:
        """Return name, joint and parameters, ready for JSON, and the recording where it is in one only."""
        said = {
            "effect": self.name,
            "joint": self.joint,
            "parameters": {key: getattr(self, name) for key, name in self.parameter_names().items()},
        }
        return said | ({} if self.recording is None else {"recording": self.recording})


def vacant(effect: Effect, value: float, absent: float = 0.0) -> None:
    """Refuse an effect that the joint has already."""
    if value != absent:
        raise UsageError(f"{effect.name} is given twice for {effect.joint or 'the arm'}; give it once")


def neighbour(effect: Effect, arm: VirtualArm) -> str:
    """Return the joint after the effect's, for the last joint the one before it.

    Raises
    ------
    UsageError
        If the arm has one joint.
    """
    n, j = arm.robot.n, arm.robot.joint_index(effect.joint or arm.robot.joints[0])
    if n < 2:
        raise UsageError(f"{effect.name}: {arm.robot.name} has one joint; a coupling needs two")
    return arm.robot.joints[j + 1 if j + 1 < n else j - 1]


def _numbers(value: object) -> Vector:
    """Return the numbers of a parameter, none where it is no number."""
    if isinstance(value, tuple):
        return value
    return (float(value),) if isinstance(value, (int, float)) else ()


def _is_left(value: object) -> bool:
    return any(math.isnan(number) for number in _numbers(value))


def _range(low: float, high: float) -> str:
    if math.isinf(low) and math.isinf(high):
        return "a finite number"
    if math.isinf(high):
        return f"{low:g} or more"
    return f"{low:g} to {high:g}"


def _unit(unit: str) -> str:
    return "" if unit == "1" else f" {unit}"
