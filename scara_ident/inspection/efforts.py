"""Which of several efforts of a log is taken, and why: a torque, a current, or what a controller computed."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from scara_ident.arrays import Array
from scara_ident.inspection.names import COMPUTED, CURRENT, TORQUE, Meaning
from scara_ident.inspection.signals import Signal
from scara_ident.robot.units import DRIVE

# A torque is a multiple of a current where this share of its scatter is left: by rounding, and by a torque constant that falls with the current.
SAME_SIGNAL = 0.02


def is_computed(said: Meaning) -> bool:
    """Tell whether a name says that an effort was computed by a model, and so is no measurement."""
    return said.quantity == "effort" and bool(said.words & COMPUTED)


def is_torque(said: Meaning) -> bool:
    """Tell whether a name is of a torque or force: ``TorqueCur`` without a unit is of the current that makes a torque."""
    if said.unit is not None:
        return said.unit not in DRIVE
    return bool(said.words & TORQUE) and not said.words & CURRENT


def why_taken(
    taken: Signal, other: Signal, meanings: Mapping[str, Meaning], numbers: Mapping[str, Array]
) -> str:  # fmt: skip
    """Say why one effort was taken and not another that is a current or was computed; empty where there is nothing to say."""
    best, second = (meanings[next(iter(signal.columns.values()))] for signal in (taken, other))
    if is_computed(second) and not is_computed(best):
        return f"{other.pattern} is computed and not measured, by its name"
    if best.measured and not second.measured and is_torque(second):
        return f"{taken.pattern} is measured, by its name"
    if not is_torque(best) or is_torque(second) or second.commanded or best.commanded:
        return ""
    reason = "a torque needs no effort_gain"
    if all(
        _is_multiple(numbers[taken.columns[k]], numbers[other.columns[k]]) for k in taken.columns.keys() & other.columns
    ):
        return f"{reason}, and here it is a multiple of {other.pattern}"
    return (
        f"{reason}, but is no measurement if the controller computes it from a model; "
        f"then state {other.pattern} under recording: effort"
    )


def _is_multiple(torque: Array, current: Array) -> bool:
    """Tell whether one signal is the other times a constant, but for an offset; also where it does not change."""
    good = np.isfinite(torque) & np.isfinite(current)
    torque, current = torque[good], current[good]
    if len(torque) < 3:
        return False
    torque, current = torque - np.mean(torque), current - np.mean(current)
    power = float(current @ current)
    gain = float(torque @ current) / power if power > 0.0 else 0.0
    return float(np.linalg.norm(torque - gain * current)) <= SAME_SIGNAL * float(np.linalg.norm(torque))
