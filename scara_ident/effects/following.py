"""How the torque of effects changes with what it depends on: the parameters of the base model, and the motion of the links.

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
from scara_ident.motion.motion import Motion

if TYPE_CHECKING:
    from scara_ident.effects.effect import Effect

# Step of a difference, as a share of a joint's largest torque: columns are linear or nearly so, and rounding is far below.
STEP = 1e-5

# Step that differentiates a torque by position, rad or m: near the cube root of rounding, where a central difference errs least.
POSITION_STEP = 1e-5
# Step that differentiates it by velocity, as a share of the largest speed or 1; it is quadratic, so that any is exact.
SPEED_STEP = 1e-4

# Places among the base model's parameters, shape (m,), and derivatives by these, shape (m, N).
Slopes: TypeAlias = tuple[NDArray[np.intp], Array]
# Of each joint that they act on, by its place; derivatives by all other parameters are zero.
EstimateSlopes: TypeAlias = Mapping[int, Slopes]
# Derivatives by the position of a joint, shape (n, N), and its velocity and acceleration where the torque depends on these.
LinkSlopes: TypeAlias = tuple[Array] | tuple[Array, Array, Array]


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


def link_slopes_by_differences(
    effect: Effect, signals: Signals, member: Member, value: Array, joint: int
) -> LinkSlopes:
    """Return `Effect.link_slopes` of any family, by differences of its torque."""
    motion = signals.motion

    def torque(k: int, step: float) -> Array:
        q, v, a = state = (motion.q.copy(), motion.v.copy(), motion.a.copy())
        state[k][joint] += step
        moved = Motion(motion.name, motion.trajectory, motion.time, q, v, a, None, motion.rate)
        return effect.torque_on_links(Signals(signals.scene, moved), member, value)

    def differentiated(k: int, step: float) -> Array:
        return (torque(k, step) - torque(k, -step)) / (2.0 * step)

    by_q = differentiated(0, POSITION_STEP)
    if effect.of_position:
        return (by_q,)
    by_v = differentiated(1, SPEED_STEP * max(float(np.max(np.abs(motion.v))), 1.0))
    return by_q, by_v, torque(2, 1.0) - effect.torque_on_links(signals, member, value)
