"""What is wrong with the measurement rather than with the arm."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from scara_ident.errors import UsageError
from scara_ident.simulation.arm import VirtualArm
from scara_ident.simulation.effects.effect import BY_ARM, Effect, vacant
from scara_ident.simulation.plant import PlantDraft


@dataclass(frozen=True)
class TimeDelay(Effect):
    """Effort that is recorded later than position: ``recorded(t) = u(t - delay)``; of the whole arm or of a joint."""

    name: ClassVar[str] = "time_delay"
    units: ClassVar[dict[str, str]] = {"delay": "s"}
    whole_arm = "may be"
    delay: float = 0.004

    def apply(self, arm: VirtualArm, draft: PlantDraft) -> None:
        """Set the delay of one joint or of all."""
        rows = slice(None) if self.joint is None else slice(self.place(arm), self.place(arm) + 1)
        vacant(self, float(np.abs(draft.delay[rows]).max()))
        draft.delay[rows] = self.delay


@dataclass(frozen=True)
class TorqueFilter(Effect):
    """Effort of the whole arm that is recorded after a low-pass filter of first order: ``time_constant dr/dt + r = u``."""

    name: ClassVar[str] = "torque_filter"
    units: ClassVar[dict[str, str]] = {"time_constant": "s"}
    bounds: ClassVar[dict[str, tuple[float, float]]] = {"time_constant": (0.0, 1.0)}
    whole_arm = "always"
    time_constant: float = 0.01

    def apply(self, arm: VirtualArm, draft: PlantDraft) -> None:
        """Set the time constant of all joints."""
        vacant(self, float(draft.lag.max()))
        draft.lag[:] = self.time_constant


@dataclass(frozen=True)
class PositionFilter(Effect):
    """Positions of all joints that are recorded after a low-pass filter of first order: ``time_constant dr/dt + r = q``.

    The controller works with the positions before the filter.
    """

    name: ClassVar[str] = "position_filter"
    units: ClassVar[dict[str, str]] = {"time_constant": "s"}
    bounds: ClassVar[dict[str, tuple[float, float]]] = {"time_constant": (0.0, 1.0)}
    whole_arm = "always"
    time_constant: float = 0.01

    def apply(self, arm: VirtualArm, draft: PlantDraft) -> None:
        """Set the time constant."""
        vacant(self, draft.position_lag)
        draft.position_lag = self.time_constant


@dataclass(frozen=True)
class TorqueSensorNonlinearity(Effect):
    """A torque that is recorded as ``u + square u^2 + cubic u^3``."""

    name: ClassVar[str] = "torque_sensor_nonlinearity"
    units: ClassVar[dict[str, str]] = {"cubic": "1/(N m)^2", "square": "1/(N m)"}
    arrays: ClassVar[dict[str, str]] = {"cubic": "cubic", "square": "square"}
    cubic: float = BY_ARM
    square: float = 0.0

    def sizes(self, arm: VirtualArm, joint: int) -> dict[str, float]:
        """Give a cubic of a tenth at the usual torque, where no square is given."""
        return {"cubic": 0.0 if self.square else float(0.1 / arm.torque_scale[joint] ** 2)}


@dataclass(frozen=True)
class TorqueGainMismatch(Effect):
    """A torque scale that is ``ratio`` times the first joint's."""

    name: ClassVar[str] = "torque_gain_mismatch"
    units: ClassVar[dict[str, str]] = {"ratio": "1"}
    bounds: ClassVar[dict[str, tuple[float, float]]] = {"ratio": (1e-6, np.inf)}
    ratio: float = 1.1

    def first_choice(self, arm: VirtualArm) -> str:
        """Take the second joint: the first is what the others are compared with."""
        return arm.robot.joints[min(1, arm.robot.n - 1)]

    def apply(self, arm: VirtualArm, draft: PlantDraft) -> None:
        """Set the gain."""
        if arm.robot.n < 2:
            raise UsageError(f"{self.name}: {arm.robot.name} has one joint; a ratio of scales needs two")
        if self.joint == arm.robot.joints[0]:
            raise UsageError(
                f"{self.name}: the ratio is to the first joint's scale; name a joint other than {self.joint}"
            )
        j = self.place(arm)
        vacant(self, draft.gain[j], 1.0)
        draft.gain[j] = self.ratio


@dataclass(frozen=True)
class OffsetDrift(Effect):
    """A torque offset that grows in time: ``rate t``."""

    name: ClassVar[str] = "offset_drift"
    units: ClassVar[dict[str, str]] = {"rate": "N m/s"}
    shares: ClassVar[dict[str, float]] = {"rate": 0.01}
    arrays: ClassVar[dict[str, str]] = {"rate": "drift"}
    rate: float = BY_ARM


@dataclass(frozen=True)
class EncoderEccentricity(Effect):
    """An encoder that errs once (``order`` times) per motor turn: ``measured = q + amplitude sin(order N q + phase)``.

    The controller sees the measured position too.
    """

    name: ClassVar[str] = "encoder_eccentricity"
    units: ClassVar[dict[str, str]] = {"amplitude": "rad", "order": "1 / motor turn", "phase": "rad"}
    bounds: ClassVar[dict[str, tuple[float, float]]] = {"amplitude": (0.0, np.inf), "order": (0.0, np.inf)}
    amplitude: float = BY_ARM
    order: float = 1.0
    phase: float = 0.2

    def sizes(self, arm: VirtualArm, joint: int) -> dict[str, float]:
        """Give three thousandths of a motor turn's radian."""
        return {"amplitude": float(0.003 / abs(arm.robot.reduction[joint]))}

    def apply(self, arm: VirtualArm, draft: PlantDraft) -> None:
        """Set the sensor's error."""
        j = self.place(arm)
        vacant(self, draft.sensors["eccentricity"][j])
        draft.sensors["eccentricity"][j] = self.amplitude
        draft.sensors["eccentricity_order"][j] = self.order * draft.reduction[j]
        draft.sensors["eccentricity_phase"][j] = self.phase


@dataclass(frozen=True)
class JointZero(Effect):
    """A position with another zero than the URDF's: the joint stands ``offset`` further than is recorded.

    The controller works with the recorded position, so that the arm follows the reference as far off.
    """

    name: ClassVar[str] = "joint_zero"
    units: ClassVar[dict[str, str]] = {"offset": "rad"}
    ways: ClassVar[dict[str, float]] = {"offset": 0.05}
    arrays: ClassVar[dict[str, str]] = {"offset": "zero"}
    offset: float = BY_ARM

    def first_choice(self, arm: VirtualArm) -> str:
        """Take the second joint: of no arm with a vertical first axis the torque depends on where that points."""
        return arm.robot.joints[min(1, arm.robot.n - 1)]
