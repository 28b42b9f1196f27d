"""Settings of an online identification: its filter, its forgetting, and its alarm."""

from __future__ import annotations

import math
from dataclasses import dataclass

from scara_ident.errors import UsageError
from scara_ident.online.filtered import HIGHEST_BAND, RowFilter, row_filter
from scara_ident.online.state import Forgetting


@dataclass(frozen=True)
class OnlineSettings:
    """How an online identification works.

    Attributes
    ----------
    rate : float
        Samples per second.
    block : int
        Samples absorbed together; a change is looked for after each block. With a band a block is of whole rows, four or more,
        two for each period of the band.
    forgetting : {"directional", "exponential", "none"}
        See `Memory.forgotten`.
    memory : float
        s after which what is old weighs 1/e, while the motion excites.
    dependent : float
        Samples that one independent sample stands for: 1 for white noise; of noise that passed a filter ``rate / (2 b)`` with
        its noise bandwidth b, which is the integral of its squared gain over frequency, Hz: of a Butterworth filter of order n at B Hz
        ``B x / sin(x)`` with ``x = pi / (2 n)``, of one of order 2 run both ways 0.83 B. With a band rows are independent
        if the torque's noise is flat within it: then it stays 1.
    false_alarms : float
        Of the detector, per hour of motion.
    window : float
        s that the detector averages over.
    renewal : float
        Weight of what is known once an alarm was raised, so that parameters follow what changed.
    band : float or None
        Hz within which both sides of the equation of motion are compared, at most a tenth of the rate, see
        `scara_ident.online.filtered`. Raw positions and torques are given then, and nothing else. By default nothing is filtered.
    """

    rate: float = 1000.0
    block: int = 64
    forgetting: Forgetting = "directional"
    memory: float = 600.0
    dependent: float = 1.0
    false_alarms: float = 0.01
    window: float = 0.5
    renewal: float = 0.01
    band: float | None = None

    def __post_init__(self) -> None:
        for name in ("rate", "block", "memory", "dependent", "false_alarms", "window"):
            if not getattr(self, name) > 0:
                raise UsageError(f"online: {name} is {getattr(self, name)}; expected a positive number")
        if self.block != int(self.block):
            raise UsageError(f"online: block is {self.block}; expected a whole number of samples")
        if self.forgetting not in ("directional", "exponential", "none"):
            raise UsageError(f"online: forgetting is {self.forgetting!r}; expected directional, exponential or none")
        if self.band is not None and not 0.0 < self.band <= HIGHEST_BAND * self.rate:
            raise UsageError(
                f"online: band is {self.band} at {self.rate:g} samples/s; expected a frequency above 0 and up to "
                f"{HIGHEST_BAND * self.rate:g} Hz, or None"
            )
        if not 0.0 < self.renewal <= 1.0:
            raise UsageError(f"online: renewal is {self.renewal}; expected a weight above 0 and up to 1")

    @property
    def row_filter(self) -> RowFilter | None:
        """What makes rows of raw samples; None without a band."""
        return None if self.band is None else row_filter(self.rate, self.band, int(self.block))

    @property
    def new(self) -> int:
        """Samples from one block to the next."""
        return int(self.block) if self.row_filter is None else self.row_filter.new

    @property
    def keep(self) -> float:
        """Weight that what is known keeps over a block in a motion that excites."""
        return math.exp(-self.new / (self.rate * self.memory))

    @property
    def share(self) -> float:
        """Weight of a new block in the detector's averages."""
        return min(1.0, self.new / (self.rate * self.window))

    @property
    def blocks_between(self) -> float:
        """Blocks between false alarms on average."""
        return 3600.0 * self.rate / (self.new * self.false_alarms)
