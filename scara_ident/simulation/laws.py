"""How fast a path is gone through: the share of the way gone, as a function of time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from scara_ident.arrays import Array
from scara_ident.errors import UsageError


@dataclass(frozen=True)
class MotionLaw:
    """From rest to rest, once or there and back.

    Attributes
    ----------
    kind : {"quintic", "trapezoidal"}
        Quintic: zero velocity and acceleration at both ends. Trapezoidal: constant acceleration, speed, deceleration;
        its acceleration jumps, its velocity does not.
    acceleration_share : float
        Share of the time that the trapezoidal law accelerates, and that it decelerates; 0 to 0.5.
    passes : int
        How often the path is gone through, every second time backwards.
    rest_share : float
        Share of every pass at rest, half before and half after the motion; 0 to less than 1.
    """

    kind: Literal["quintic", "trapezoidal"] = "quintic"
    acceleration_share: float = 0.25
    passes: int = 1
    rest_share: float = 0.0

    def __post_init__(self) -> None:
        if self.kind not in ("quintic", "trapezoidal"):
            raise UsageError(f"motion law {self.kind!r}: expected quintic or trapezoidal")
        if not 0.0 < self.acceleration_share <= 0.5:
            raise UsageError(f"acceleration_share is {self.acceleration_share:g}; expected more than 0 and at most 0.5")
        if self.passes < 1:
            raise UsageError(f"passes is {self.passes}; expected 1 or more")
        if not 0.0 <= self.rest_share < 1.0:
            raise UsageError(f"rest_share is {self.rest_share:g}; expected 0 or more and less than 1")

    def __call__(self, time: Array, duration: float) -> tuple[Array, Array, Array]:
        """Return the share of the way (0 to 1) and its two time derivatives, each of shape (N,).

        Parameters
        ----------
        time : ndarray, shape (N,)
            s, from 0 to ``duration``.
        duration : float
            Of all passes, s.
        """
        period = duration / self.passes
        turn = np.clip(np.floor(time / period), 0, self.passes - 1)
        rest = self.rest_share
        moving = (1.0 - rest) * period
        x = (time - turn * period - 0.5 * rest * period) / moving
        still = (x < 0.0) | (x > 1.0)
        s, rate, change = self._once(np.clip(x, 0.0, 1.0))
        back = turn % 2 == 1
        sign = np.where(still, 0.0, np.where(back, -1.0, 1.0))
        return np.where(back, 1.0 - s, s), sign * rate / moving, sign * change / moving**2

    def _once(self, x: Array) -> tuple[Array, Array, Array]:
        if self.kind == "quintic":
            s = x**3 * (10.0 + x * (-15.0 + 6.0 * x))
            return s, 30.0 * (x * (1.0 - x)) ** 2, 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x)
        ramp = self.acceleration_share
        top = 1.0 / (1.0 - ramp)
        change = top / ramp
        start, end = x < ramp, x > 1.0 - ramp
        s = np.where(
            start, 0.5 * change * x * x, np.where(end, 1.0 - 0.5 * change * (1.0 - x) ** 2, top * (x - ramp / 2))
        )
        rate = np.where(start, change * x, np.where(end, change * (1.0 - x), top))
        return s, rate, np.where(start, change, np.where(end, -change, 0.0))
