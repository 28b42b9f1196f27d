"""Slow changes within a run: friction that warms up, an offset that drifts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

import numpy as np

from scara_ident.arrays import Array
from scara_ident.effects.effect import DOUBT_STDS, Effect
from scara_ident.effects.following import EstimateSlopes, predicted_slopes, some_slopes
from scara_ident.effects.friction import friction_of, friction_places, friction_torque
from scara_ident.effects.parameters import Coefficient, Member, NonlinearParameter, Parameter, View, deviation
from scara_ident.effects.position import offset_of
from scara_ident.effects.signals import Scene, Signals
from scara_ident.model.terms import Column

Part: TypeAlias = Literal["all", "coulomb", "viscous"]

# Time constants tried, as shares of the longest run: 2.5 times apart, which refinement bridges.
WARM_UP_SHARES = (0.06, 0.16, 0.4, 1.0)
# A time constant above this many runs is not seen to end.
LONGEST_WARM_UP = 4.0
# Friction of a cold gear is not more than this many times that of a warm one, less one.
LARGEST_WARM_UP_SHARE = 3.0
# Friction of a warming gear loses no more than this share of itself in a second. A lubricant loses some 3.5 % of its
# viscosity by kelvin, so that a quarter takes 7 K/s: 3 kW of friction for each kilogram of steel.
FASTEST_WARM_UP = 0.25
# Least power of speed of what warms up, by the parts that a heated gear may lose: the grip of seals and preloaded bearings, the drag
# of the lubricant, or both in one proportion.
MIN_POWER: dict[Part, float] = {"all": 0.0, "coulomb": 0.0, "viscous": 1.0}
# What these parts are called.
PARTS: dict[Part, str] = {
    "all": "friction",
    "coulomb": "Coulomb friction",
    "viscous": "friction that grows with speed",
}
# A drift within this many standard deviations of none is an offset.
DRIFT_STDS = 3.0


@dataclass(frozen=True)
class WarmUp(Effect):
    """Friction that is larger when a run starts: the steady friction times ``1 + share exp(-t/time_constant)``.

    The column is the friction that the present estimate predicts, times ``exp(-t/time_constant)``. An estimate without
    the effect takes the mean over the run as the steady friction; with an estimate that includes the effect, the
    coefficient is the share.

    If only the Coulomb friction warms up, or only the friction that grows with speed, and this explains significantly
    more, this law is used: the share is of that part, and ``speed_power`` 0 or 1, the least power of speed that warms
    up, is among the parameters. If two laws explain as much, the difference between them is part of the standard
    deviations.

    Attributes
    ----------
    part : {"all", "coulomb", "viscous"}
        What of the friction warms up: as a whole, Coulomb friction, or what grows with speed.
    """

    part: Part = "all"

    name = "warm_up"
    summary = "friction that falls during a run (warm-up)"
    coefficients = (
        Coefficient(
            "share", "1", "additional {part} of {joint} at the start of a run, as a share",
            "friction would be smaller when the run starts",
            LARGEST_WARM_UP_SHARE, f"friction would fall to less than a {1.0 + LARGEST_WARM_UP_SHARE:.0f}th in the run",
        ),
    )  # fmt: skip
    nonlinear = (NonlinearParameter("time_constant", "s", 0.05, 1e5),)
    follows_estimate = True
    view = View("time", along=True)
    experiment = "run the same trajectory cold and again after half an hour of motion, with the time of day recorded"

    def joints(self, scene: Scene) -> list[int]:
        """Return the joints with friction."""
        return [j for j in super().joints(scene) if friction_of(scene, j)]

    def scan(self, scene: Scene, joint: int) -> Iterable[tuple[float, ...]]:
        """Return shares of the longest run."""
        return ((share * scene.duration,) for share in WARM_UP_SHARES)

    def signal_columns(self, signals: Signals, member: Member) -> Iterable[Array]:
        """Return the predicted friction, or that part of it, times ``exp(-t/time_constant)``."""
        friction = friction_torque(signals, member.place, self._places(signals.scene, member.place))
        return [friction * np.exp(-signals.time / member.nonlinear[0])]

    def estimate_slopes(self, signals: Signals, member: Member, value: Array) -> EstimateSlopes:
        """Return those by the joint's friction."""
        own = np.array(list(self._places(signals.scene, member.place).values()), dtype=np.intp)
        places, rows = some_slopes(predicted_slopes(signals, member.place), own)
        return {member.place: (places, value[0] * np.exp(-signals.time / member.nonlinear[0]) * rows)}

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """Say so where friction rises, or falls by too much, too fast or too late."""
        wrong = super().inadmissible(scene, member, value, std)
        if wrong is not None:
            return wrong
        least = max(float(value[0]) - DOUBT_STDS * float(std[0]), 0.0)
        if least / (1.0 + least) > FASTEST_WARM_UP * member.nonlinear[0]:
            return f"friction would fall faster than by {FASTEST_WARM_UP:.0%} a second, and no gear warms up so fast"
        late = member.nonlinear[0] > LONGEST_WARM_UP * scene.duration
        return "the recordings are too short to show where it ends" if late else None

    def other_laws(self) -> tuple[Effect, ...]:
        """Return the families by which other parts of the friction warm up."""
        return tuple(WarmUp(part) for part in MIN_POWER if part != self.part)

    def law(self) -> Mapping[str, Parameter]:
        """Return the least power of speed that warms up, where it is not friction as a whole."""
        return {} if self.part == "all" else {"speed_power": Parameter(MIN_POWER[self.part], 0.0, "1")}

    def description(self, scene: Scene, member: Member) -> str:
        """Add what of the friction warms up, where it is not the whole."""
        return super().description(scene, member) + ("" if self.part == "all" else f": {PARTS[self.part]} alone")

    def words(self, scene: Scene, member: Member) -> dict[str, Any]:
        """Add what of the friction warms up."""
        return {**super().words(scene, member), "part": PARTS[self.part]}

    def _places(self, scene: Scene, joint: int) -> dict[int, int]:
        """Return where the friction that warms up stands among the base model's parameters, by power of speed."""
        own = friction_places(scene, joint)
        return own if self.part == "all" else {k: own[k] for k in own if (k == 0) == (self.part == "coulomb")}


class OffsetDrift(Effect):
    """A torque offset that grows during a run: ``u = rate t``, t from the start of each recording."""

    name = "offset_drift"
    summary = "a torque offset that drifts during a run"
    coefficients = (
        Coefficient("rate", "{torque}/s", "drift rate of the torque offset of {joint} during a run"),
        Coefficient("start", "{torque}", "torque offset of {joint} at the start of a run"),
    )
    at_rest = True
    view = View("time")
    experiment = "hold still for the length of a run, at its beginning and at its end"

    def columns(self, scene: Scene, member: Member) -> tuple[Column, ...]:
        """Describe the growth, and the constant where the model has none."""
        both = super().columns(scene, member)
        return both if offset_of(scene, member.place) is None else both[:1]

    def signal_columns(self, signals: Signals, member: Member) -> Iterable[Array]:
        """Return the time since the start, and one where the model has no offset."""
        alone = offset_of(signals.scene, member.place) is not None
        return [signals.time] if alone else [signals.time, np.ones_like(signals.time)]

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """Say so where it is a constant, or leaves the torque limit behind."""
        if len(value) > 1 and abs(value[0]) < DRIFT_STDS * std[0]:
            return "it is a constant offset, which the model lacks, and not a drift"
        if (abs(value[0]) - DOUBT_STDS * std[0]) * scene.duration > float(scene.robot.torque_limit[member.place]):
            return "the offset would become larger than the torque limit"
        return None

    def parameters(self, scene: Scene, member: Member, value: Array, covariance: Array) -> Mapping[str, Parameter]:
        """Return the rate."""
        unit = f"{scene.robot.torque_unit(member.place)}/s"
        return {"rate": Parameter(float(value[0]), deviation(covariance), unit)}
