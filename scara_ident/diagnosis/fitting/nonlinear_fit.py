"""Joint fit of the nonlinear parameters of all effects in a model, by trust-region steps.

The method is that of Levenberg (Quarterly of Applied Mathematics 2, 1944) and Marquardt (J. SIAM 11, 1963) with the radius of Moré
(Lecture Notes in Mathematics 630, 1978); what linear parameters take up is no part of a step's length (Golub and Pereyra, SIAM J.
Numerical Analysis 10, 1973).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.diagnosis.fitting.at_estimate import at_estimate, estimate_of, without_others
from scara_ident.diagnosis.fitting.linearised import (
    Linearised,
    follow_estimate,
    linear_model,
    moved_candidate,
    with_estimate_slopes,
)
from scara_ident.diagnosis.fitting.present_model import present_model
from scara_ident.diagnosis.testing.selection_step import SelectionStep

# Steps of Gauss and Newton; most fits settle in three, and a search has further ones. A tied effect comes from far away.
MAX_STEPS, MAX_TIED_STEPS = 6, 24
# Standard deviations: a step that is shorter for every parameter is the last.
SETTLED_STDS = 0.1
# Residual variances of a row: where the linear model promises no more, no parameter is further than a fifth of its standard deviation
# from where it leads, and where gears meet their stops the error is no smoother than that.
NEGLIGIBLE_GAIN = 0.04
# A rise of the squared error by more than this share turns a step back; loads that settle may raise it by less.
MAX_RISE = 1e-5
# A step that lowers the squared error by a smaller share is the last of a coarse fit.
MIN_DECREASE = 0.03
# Of what the linear model promises: a step that kept more may be longer next, and one that kept less was too long.
GROW_RATIO, SHRINK_RATIO = 0.75, 0.25
# A step that is turned back is tried again with no smaller share of its length.
MIN_STEP_SHARE = 0.1
# No step is tried that is a smaller share of one that nothing holds back.
MIN_RADIUS = 0.01


def tune(step: SelectionStep, *, coarse: bool = False) -> SelectionStep:
    """Fit the nonlinear parameters of all effects in a model together, and settle the loads that they depend on.

    Parameters
    ----------
    step : SelectionStep
    coarse : bool, optional
        Whether near the best is enough, as for a candidate that is only judged.

    Returns
    -------
    SelectionStep
        With the parameters fitted, and the scene at the estimate that goes with them.
    """
    if not step.chosen:
        return step
    step = replace(step, scene=without_others(step.scene, step.chosen))
    settling = _settling(step)
    best: Linearised | None = None
    way, radius, cut = np.zeros(0), np.inf, False
    tied = any(item.effect.tie(step.scene, item.member) is not None for item in step.chosen)
    for _ in range(MAX_TIED_STEPS if tied else MAX_STEPS):
        present = present_model(step)
        if best is not None:
            radius = _radius(radius, best.length(way), _kept(best, present.error, way))
        if best is not None and present.error > (1.0 + MAX_RISE) * best.error:
            if radius < MIN_RADIUS * best.length(best.step()):
                break
        else:
            little = best is not None and best.error - present.error < MIN_DECREASE * best.error
            if coarse and little and not cut:
                # Near enough, without a look at where it might go on to.
                return step
            best = linear_model(present)
            whole, std = best.step(), best.solve()[1]
            if _is_short(best, whole, std, settling):
                if _is_cut(best, whole):
                    break
                # So short a step needs no look at where it leads.
                step = _moved(step, best, whole)
                return replace(step, scene=at_estimate(step.scene, step.chosen, whole[: best.linear]))
            # Where the way is longer than a step may be, how little one gains says nothing of the whole, of which the model does.
            if coarse and little and best.gain(whole) < MIN_DECREASE:
                break
        way = best.step(radius)
        if radius < np.inf and _is_short(best, way, std, settling):
            # Where the error does not do what the model promises, shorter steps tell nothing.
            break
        cut = _is_cut(best, way)
        step = _moved(step, best, way)
    assert best is not None
    step = replace(step, scene=at_estimate(best.scene, best.chosen, best.value), chosen=best.chosen)
    return step if coarse else _settled(step)


def _settled(step: SelectionStep) -> SelectionStep:
    """Return a step that did not settle by itself with the linear parameters settled, the nonlinear ones as they are.

    Columns that are made anew of each estimate lead there slowly where their effect is strong: these steps know how they change.
    """
    best, error = step, np.inf
    for _ in range(MAX_STEPS):
        present = present_model(step)
        if not follow_estimate(present) or present.error > error:
            break
        state = with_estimate_slopes(step, linear_model(present))
        best, error = step, present.error
        started, std = estimate_of(step.scene, step.chosen), state.solve()[1][: state.linear]
        # What follows it is compared, which is the base model's.
        own = slice(0, step.observations.parameters)
        if np.all(np.abs(state.value[own] - started[own]) <= SETTLED_STDS * std[own]):
            break
        step = replace(step, scene=at_estimate(step.scene, step.chosen, state.value))
    return best


def _is_short(state: Linearised, way: Array, std: Array, settling: NDArray[np.intp]) -> bool:
    """Whether a way is so short that it needs no look at where it leads.

    Linear parameters that columns follow are to be near; nonlinear ones each, or so that all of them together promise next to nothing.
    """
    linear = np.abs(way[: state.linear] - estimate_of(state.scene, state.chosen))
    if np.any(linear[settling] > SETTLED_STDS * std[settling]):
        return False
    changes = zip(state.unknowns, way[state.linear :], strict=True)
    steps = np.array([abs(item.moved(x) - item.value) for item, x in changes])
    return bool(np.all(steps <= SETTLED_STDS * std[state.linear :])) or state.gain(way) * state.rows <= NEGLIGIBLE_GAIN


def _is_cut(state: Linearised, way: Array) -> bool:
    """Whether a way ends where the linear model holds no further, and not at a bound."""
    return any(abs(x) >= item.reach for item, x in zip(state.unknowns, way[state.linear :], strict=True))


def _kept(before: Linearised, error: float, way: Array) -> float:
    """Return the share of what the linear model promised that a way kept; negative where the error rose."""
    # A promise is a share of the error: one below rounding is none.
    promised = max(before.gain(way), np.finfo(float).eps)
    return (before.error - error) / (promised * before.error)


def _radius(radius: float, length: float, kept: float) -> float:
    """Return how long the next step may be after one of a length that kept such a share of its promise."""
    if kept < 0.0:
        # Where the parabola through both errors, with the promised slope, has its least.
        return length * max(MIN_STEP_SHARE, 0.5 / (1.0 - kept))
    if kept < SHRINK_RATIO:
        return 0.5 * length
    return max(radius, 2.0 * length) if kept > GROW_RATIO else radius


def _settling(step: SelectionStep) -> NDArray[np.intp]:
    """Return the places of the linear parameters that columns follow: of the base model, and of effects that gears transmit."""
    stop = step.observations.parameters
    places = [np.arange(stop)]
    loaded = any(item.effect.geared_joint(item.member) is not None for item in step.chosen)
    for item in step.chosen:
        start, stop = stop, stop + len(item.effect.columns(step.scene, item.member))
        if loaded and item.effect.on_links and item.effect.geared_joint(item.member) is None:
            places.append(np.arange(start, stop))
    return np.concatenate(places)


def _moved(step: SelectionStep, state: Linearised, way: Array) -> SelectionStep:
    """Return a step after a way from its linear model."""
    chosen = list(state.chosen)
    armatures = dict(state.scene.armatures)
    for item, change in zip(state.unknowns, way[state.linear :], strict=True):
        value = item.moved(change)
        if item.owner is None:
            armatures[item.place] = float(np.exp(value))
        else:
            chosen[item.owner] = moved_candidate(chosen[item.owner], item.place, value)
    scene = at_estimate(state.scene, chosen, way[: state.linear])
    return replace(step, scene=replace(scene, armatures=armatures), chosen=tuple(chosen))
