"""Effects whose columns depend on the estimate: how their torque changes with the parameters that they depend on.

Such a torque is a product of coefficients and of the base model's parameters, and both are estimated. The columns say how it
changes with the coefficients. How it changes with the parameters is said here: what is unsure of these is then in what is
unsure of the coefficients.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.effects.parameters import Member
from scara_ident.effects.signals import Signals

if TYPE_CHECKING:
    from scara_ident.effects.effect import Effect

# Step of a difference, as a share of a joint's largest torque: columns are linear or nearly so, and rounding is far below.
STEP = 1e-5

# Places among the base model's parameters, shape (m,), and derivatives by these, shape (m, N).
Slopes: TypeAlias = tuple[NDArray[np.intp], Array]
# Of each joint that they act on, by its place; derivatives by all other parameters are zero.
EstimateSlopes: TypeAlias = Mapping[int, Slopes]


def predicted_slopes(signals: Signals, joint: int) -> Slopes:
    """Return the derivatives of what `Signals.predicted` has for a joint."""
    return signals.scene.model.active[joint], signals.columns[joint]


def some_slopes(slopes: Slopes, places: NDArray[np.intp]) -> Slopes:
    """Return of derivatives those by some of the parameters, in their order."""
    own, rows = slopes
    kept = np.isin(own, places)
    return own[kept], rows[kept]


def slopes_by_differences(effect: Effect, signals: Signals, member: Member, value: Array) -> EstimateSlopes:
    """Return `Effect.estimate_slopes` of any family, by central differences of its columns.

    Parameters
    ----------
    value : ndarray, shape (k,)
        Coefficients.
    """
    scene = signals.scene
    steps = np.full(len(scene.value), np.inf)
    for own, rows, torque in zip(scene.model.active, signals.columns, signals.predicted, strict=True):
        sizes = np.max(np.abs(rows), axis=1)
        moving = sizes > 0.0
        # Small beside the torque of each joint, whose square may be in the columns.
        largest = float(np.max(np.abs(torque))) or 1.0
        steps[own[moving]] = np.minimum(steps[own[moving]], STEP * largest / sizes[moving])
    acting = np.flatnonzero(np.isfinite(steps))
    found = {joint: np.zeros((len(acting), signals.motion.samples)) for joint in effect.rows(scene, member)}
    for k, place in enumerate(acting):
        step = float(steps[place])
        for side in (1.0, -1.0):
            moved = scene.value.copy()
            moved[place] += side * step
            there = signals.at(replace(scene, value=moved))
            for joint, columns in effect.by_joint(there, member).items():
                found[joint][k] += side / (2.0 * step) * (value @ np.array(columns))
    return {joint: (acting, rows) for joint, rows in found.items()}
