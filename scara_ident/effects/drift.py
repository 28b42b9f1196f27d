"""What changes slowly in a run: friction that warms up, an offset that drifts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scara_ident.effects.effect import Member, NonlinearParameter, Parameter
from scara_ident.effects.friction import deviation, friction_of, friction_torque, moving
from scara_ident.effects.signals import Scene, Signals
from scara_ident.model.terms import Column, Offset

Array = NDArray[np.float64]

# Time constants tried, as shares of the longest run.
WARM_UP_SHARES = (0.06, 0.16, 0.4, 1.0)
# A time constant above this many runs is not seen to end.
LONGEST_WARM_UP = 4.0
# Friction of a cold gear is not more than this many times that of a warm one, less one.
MOST_WARM_UP = 3.0


@dataclass(frozen=True)
class WarmUp:
    """Friction that is larger when a run starts: the steady friction times ``1 + share exp(-t/time_constant)``.

    The column is the friction that the present estimate predicts, times ``exp(-t/time_constant)``. An estimate made
    without the effect takes the mean over the run for the steady friction; with the estimate made with it, the
    coefficient is the share.
    """

    @property
    def name(self) -> str:
        """Name in the table of effects."""
        return "warm_up"

    @property
    def nonlinear(self) -> tuple[NonlinearParameter, ...]:
        """The time constant."""
        return (NonlinearParameter("time_constant", "s", 0.05, 1e5),)

    def members(self, scene: Scene) -> tuple[Member, ...]:
        """Every joint with friction, at shares of the longest run."""
        return tuple(
            Member(j, (share * scene.duration,))
            for j in moving(scene)
            if friction_of(scene, j)
            for share in WARM_UP_SHARES
        )

    def columns(self, scene: Scene, member: Member) -> tuple[Column, ...]:
        """One column: the share."""
        joint = scene.robot.joints[member.joint or 0]
        return (Column("share", joint, "1", f"further friction of {joint} at the start of a run, as a share", True),)

    def regressor(self, signals: Signals, member: Member) -> Array:
        """Return the predicted friction times ``exp(-t/time_constant)``, shape (n, 1, N)."""
        j = member.joint or 0
        return signals.row(j, [friction_torque(signals, j) * np.exp(-signals.time / member.nonlinear[0])])

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """Friction falls as a gear warms up."""
        if value[0] < -2.0 * std[0]:
            return "friction would be smaller when the run starts"
        if value[0] - 2.0 * std[0] > MOST_WARM_UP:
            return f"friction would fall to less than a {1.0 + MOST_WARM_UP:.0f}th in the run"
        if member.nonlinear[0] > LONGEST_WARM_UP * scene.duration:
            return "the recordings are too short to see it end"
        return None

    def parameters(self, scene: Scene, member: Member, value: Array, covariance: Array) -> Mapping[str, Parameter]:
        """Return the share."""
        return {"share": Parameter(float(value[0]), deviation(covariance), "1")}

    def description(self, scene: Scene, member: Member) -> str:
        """Say what it is."""
        return "friction that falls as the run goes on"


@dataclass(frozen=True)
class OffsetDrift:
    """A torque offset that grows in the run: ``u = rate t``, t from the start of each recording."""

    @property
    def name(self) -> str:
        """Name in the table of effects."""
        return "offset_drift"

    @property
    def nonlinear(self) -> tuple[NonlinearParameter, ...]:
        """It has no nonlinear parameter."""
        return ()

    def members(self, scene: Scene) -> tuple[Member, ...]:
        """One per joint."""
        return tuple(Member(j) for j in range(scene.robot.n))

    def columns(self, scene: Scene, member: Member) -> tuple[Column, ...]:
        """One column, of time, and that of the constant where the model has none."""
        j = member.joint or 0
        joint, unit = scene.robot.joints[j], scene.robot.torque_unit(j)
        rate = Column("rate", joint, f"{unit}/s", f"growth of the torque offset of {joint} in a run")
        start = Column("start", joint, unit, f"torque offset of {joint} at the start of a run")
        return (rate,) if _has_offset(scene) else (rate, start)

    def regressor(self, signals: Signals, member: Member) -> Array:
        """Return the time since the start, and one where the model has no offset, shape (n, k, N)."""
        columns = [signals.time]
        if not _has_offset(signals.scene):
            columns.append(np.ones_like(signals.time))
        return signals.row(member.joint or 0, columns)

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """Any rate that leaves the torque within its limit is possible; a constant alone is no drift."""
        if len(value) > 1 and abs(value[0]) < 3.0 * std[0]:
            return "it is an offset, which the model lacks, rather than a drift"
        limit = float(scene.robot.torque_limit[member.joint or 0])
        if (abs(value[0]) - 2.0 * std[0]) * scene.duration > limit:
            return "the offset would outgrow the torque limit"
        return None

    def parameters(self, scene: Scene, member: Member, value: Array, covariance: Array) -> Mapping[str, Parameter]:
        """Return the rate."""
        unit = f"{scene.robot.torque_unit(member.joint or 0)}/s"
        return {"rate": Parameter(float(value[0]), deviation(covariance), unit)}

    def description(self, scene: Scene, member: Member) -> str:
        """Say what it is."""
        return "a torque offset that drifts in the run"


def _has_offset(scene: Scene) -> bool:
    return any(isinstance(term, Offset) for term in scene.model.terms)
