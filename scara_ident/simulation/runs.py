"""Differences from run to run on one arm, and the noise of the recorded torque."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from scara_ident.arrays import Array
from scara_ident.errors import UsageError
from scara_ident.simulation.arm import VirtualArm
from scara_ident.simulation.plant import PlantDraft

# A heavy-tailed noise is Student's t with this many degrees of freedom: one sample in 200 beyond four standard deviations.
HEAVY_FREEDOM = 3.0


@dataclass(frozen=True)
class TorqueNoise:
    """How the noise of the recorded torque is distributed; its standard deviation is the arm's ``torque_noise``.

    Attributes
    ----------
    kind : {"white", "coloured", "heavy"}
        Normal and independent; normal and autoregressive of order 1; independent, Student's t with 3 degrees of
        freedom.
    correlation_time : float
        s, after which the autocorrelation of coloured noise has fallen to 1/e.
    """

    kind: Literal["white", "coloured", "heavy"] = "white"
    correlation_time: float = 0.01

    def __post_init__(self) -> None:
        if self.kind not in ("white", "coloured", "heavy"):
            raise UsageError(f"torque noise is {self.kind!r}; expected white, coloured or heavy")
        if not self.correlation_time > 0.0:
            raise UsageError(f"correlation time is {self.correlation_time:g} s; expected a positive number")

    def draw(self, random: np.random.Generator, shape: tuple[int, int], rate: float) -> Array:
        """Return noise of unit variance.

        Parameters
        ----------
        shape : (int, int)
            Joints and samples.
        rate : float
            Samples per second.

        Returns
        -------
        ndarray, of that shape
            Stationary from the first sample on.
        """
        if self.kind == "heavy":
            unit = np.sqrt((HEAVY_FREEDOM - 2.0) / HEAVY_FREEDOM)
            return np.asarray(unit * random.standard_t(HEAVY_FREEDOM, size=shape))
        white = random.normal(size=shape)
        if self.kind == "white":
            return white
        keep = float(np.exp(-1.0 / (rate * self.correlation_time)))
        drive = np.sqrt(1.0 - keep**2) * white
        drive[:, 0] = white[:, 0]
        # Over a second to import, and seldom wanted.
        from scipy.signal import lfilter

        return np.asarray(lfilter([1.0], [1.0, -keep], drive, axis=1))


@dataclass(frozen=True, eq=False)
class RunState:
    """In what one run differs from the arm as it is described; rows in the robot's order.

    Attributes
    ----------
    friction : ndarray, shape (n,)
        Factor on the friction polynomial.
    torque_scale : ndarray, shape (n,)
        Factor on the recorded torque.
    torque_offset : ndarray, shape (n,)
        Added to the recorded torque, N m.
    delay : float
        Time by which all recorded torques lag, s.
    """

    friction: Array
    torque_scale: Array
    torque_offset: Array
    delay: float = 0.0

    def of(self, arm: VirtualArm) -> VirtualArm:
        """Return the arm with this run's friction."""
        return replace(arm, friction=arm.friction * self.friction[:, None])

    def measure(self, arm: VirtualArm, draft: PlantDraft) -> None:
        """Add what differs in the torque's measurement."""
        back = np.argsort(arm.robot.order)
        draft.gain *= self.torque_scale[back]
        draft.shift += self.torque_offset[back]
        draft.delay += self.delay
