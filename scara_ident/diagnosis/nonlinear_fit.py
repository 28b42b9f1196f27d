"""Fitting the nonlinear parameters of all effects in a model together, by steps that are held back where they led too far.

The method is that of Levenberg (Quarterly of Applied Mathematics 2, 1944) and Marquardt (J. SIAM 11, 1963); what linear parameters
take up is no part of what holds a step back (Golub and Pereyra, SIAM J. Numerical Analysis 10, 1973).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.diagnosis.at_estimate import at_estimate, estimate_of, without_others
from scara_ident.diagnosis.linearised import Linearised, linearise, moved_candidate, with_estimate_slopes
from scara_ident.diagnosis.selection_step import SelectionStep

# Steps of Gauss and Newton; most fits settle in three, and a search has further ones. A tied effect comes from far away.
ROUNDS, TIED_ROUNDS = 6, 24
# Standard deviations: a step that is shorter for every parameter is the last.
SETTLED = 0.1
# Residual variances of a row: where the linear model promises no more, no parameter is further than a fifth of its standard deviation
# from where it leads, and where gears meet their stops the error is no smoother than that.
NOTHING = 0.04
# A rise of the squared error by more than this share turns a step back; loads that settle may raise it by less.
RISE = 1e-5
# A step that lowers the squared error by a smaller share is the last of a coarse fit.
LEAST_FALL = 0.03
# No step is tried that is held back more: it would be a hundredth as long as one that nothing holds.
MOST_DAMPING = 100.0


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
    share, damping, turned_back = 1.0, 0.0, False
    tied = any(item.effect.tie(step.scene, item.member) is not None for item in step.chosen)
    for _ in range(TIED_ROUNDS if tied else ROUNDS):
        now = linearise(step)
        before, turned_back = turned_back, best is not None and now.error > (1.0 + RISE) * best.error
        if best is not None and turned_back:
            # A step as long as half of the last, where that is not cut short.
            damping = 2.0 * damping + 1.0
            if damping > MOST_DAMPING:
                break
            way = best.solve(damping)[0]
        else:
            way, std = now.solve()
            # Where the way is longer than a step may be, how little one gains says nothing of the whole, of which the model does.
            near = coarse and (share == 1.0 or now.gain(way) < LEAST_FALL)
            arrived = near and best is not None and best.error - now.error < LEAST_FALL * best.error
            best = now
            if _is_short(now, way, std, settling):
                if _share(now, way) < 1.0:
                    break
                # So short a step needs no look at where it leads.
                step = _moved(step, now, way, 1.0)
                return replace(step, scene=at_estimate(step.scene, step.chosen, way[: now.linear]))
            if arrived:
                break
            # A longer one after two that went well: after one alone every other step would be turned back.
            damping = damping if before else 0.5 * max(damping - 1.0, 0.0)
            if damping:
                way = now.solve(damping)[0]
        share = _share(best, way)
        step = _moved(step, best, way, share)
    assert best is not None
    step = replace(step, scene=at_estimate(best.scene, best.chosen, best.value), chosen=best.chosen)
    return step if coarse else _settled(step)


def _settled(step: SelectionStep) -> SelectionStep:
    """Return a step that did not settle by itself with the linear parameters settled, the nonlinear ones as they are.

    Columns that are made anew of each estimate lead there slowly where their effect is strong: these steps know how they change.
    """
    best, error = step, np.inf
    for _ in range(ROUNDS):
        plain = linearise(step)
        state = with_estimate_slopes(step, plain)
        if state is plain or plain.error > error:
            break
        best, error = step, plain.error
        started, std = estimate_of(step.scene, step.chosen), state.solve()[1][: state.linear]
        # What follows it is compared, which is the base model's.
        own = slice(0, step.observations.parameters)
        if np.all(np.abs(state.value[own] - started[own]) <= SETTLED * std[own]):
            break
        step = replace(step, scene=at_estimate(step.scene, step.chosen, state.value))
    return best


def _is_short(state: Linearised, way: Array, std: Array, settling: NDArray[np.intp]) -> bool:
    """Whether a way is so short that it needs no look at where it leads.

    Linear parameters that columns follow are to be near; nonlinear ones each, or so that all of them together promise next to nothing.
    """
    linear = np.abs(way[: state.linear] - estimate_of(state.scene, state.chosen))
    if np.any(linear[settling] > SETTLED * std[settling]):
        return False
    changes = zip(state.unknowns, way[state.linear :], strict=True)
    steps = np.array([abs(item.moved(x) - item.value) for item, x in changes])
    return bool(np.all(steps <= SETTLED * std[state.linear :])) or state.gain(way) * state.rows <= NOTHING


def _share(state: Linearised, way: Array) -> float:
    """Return how much of a way may be gone at once."""
    return min([1.0, *(item.share(x) for item, x in zip(state.unknowns, way[state.linear :], strict=True))])


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


def _moved(step: SelectionStep, state: Linearised, way: Array, share: float) -> SelectionStep:
    """Return a step after a share of a way from its linear model, the nonlinear parameters within their bounds."""
    chosen = list(state.chosen)
    armatures = dict(state.scene.armatures)
    for item, change in zip(state.unknowns, way[state.linear :], strict=True):
        value = item.moved(share * change)
        if item.owner is None:
            armatures[item.place] = float(np.exp(value))
        else:
            chosen[item.owner] = moved_candidate(chosen[item.owner], item.place, value)
    old = estimate_of(state.scene, state.chosen)
    scene = at_estimate(state.scene, chosen, old + share * (way[: len(old)] - old))
    return replace(step, scene=replace(scene, armatures=armatures), chosen=tuple(chosen))
