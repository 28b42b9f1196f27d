"""Payloads taken up and put down in any of the recordings, as often as it happens."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from scara_ident.arrays import Array
from scara_ident.effects.interval_search import carried
from scara_ident.effects.links import shared
from scara_ident.effects.parameters import Member, NonlinearParameter, Parameter
from scara_ident.effects.payload import FreePayloadChange, shown_of
from scara_ident.effects.signals import Scene, Signals

# So many intervals are said in words.
MAX_SENTENCES = 3


@dataclass(frozen=True)
class PayloadInIntervals(FreePayloadChange):
    """One body that the last link carries in intervals of recordings, mounted anyhow.

    The intervals follow from the torque, see `carried`. Where the arm rests about an instant it is known as badly as that
    lasts.
    """

    summary = "a payload in {intervals}"
    nonlinear: ClassVar[tuple[NonlinearParameter, ...]] = ()
    in_intervals = True

    def members(self, scene: Scene) -> tuple[Member, ...]:
        """Return the one that the torque tells."""
        shown = shown_of(scene.robot)
        found = shared(scene, ("carried", shown), lambda: carried(scene, shown))
        return (Member(None, intervals=found),) if found else ()

    def words(self, scene: Scene, member: Member) -> dict[str, Any]:
        """Add the intervals: each if they are few."""
        names = list(scene.start)
        said = [
            f"{names[item.recording]} from {item.start:.2f} " + (f"to {item.stop:.2f} s" if item.stop_std else "s on")
            for item in member.intervals
        ]
        if len(said) > MAX_SENTENCES:
            within = dict.fromkeys(names[item.recording] for item in member.intervals)
            said = [f"{len(said)} intervals of {', '.join(within)}"]
        return super().words(scene, member) | {"intervals": "; ".join(said)}

    def acting(self, signals: Signals, member: Member) -> Array:
        """Return 1 within intervals of the recording and 0 elsewhere, over one sample, shape (n, 1, N)."""
        names, motion = list(signals.scene.start), signals.motion
        found = np.zeros((signals.scene.robot.n, 1, motion.samples))
        for item in member.intervals:
            if item.recording < len(names) and names[item.recording] == motion.name:
                since, until = (
                    np.clip((signals.time - time) * motion.rate + 0.5, 0.0, 1.0) for time in (item.start, item.stop)
                )
                found[slice(None) if item.joint is None else item.joint, 0] += since - until
        return found

    def gap(self, scene: Scene, member: Member) -> tuple[float, ...]:
        """Return nothing: it has no nonlinear parameters."""
        return ()

    def parameters(self, scene: Scene, member: Member, value: Array, covariance: Array) -> Mapping[str, Parameter]:
        """Add when the first interval begins and ends, where that is within its recording."""
        found = dict(super().parameters(scene, member, value, covariance))
        for first in member.intervals[:1]:
            ends = {"time": (first.start, first.start_std), "until": (first.stop, first.stop_std)}
            found |= {name: Parameter(time, std, "s") for name, (time, std) in ends.items() if std}
        return found
