"""Standard deviation of an instant at which a torque jumps: the jackknife over recordings.

The slope of the columns tells a standard deviation where noise is the same at all times. Where runs differ, what one run's friction
does about another instant makes the fit as good there, and no slope at the instant found shows that.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from scara_ident.arrays import Array
from scara_ident.diagnosis.testing.selection_step import SelectionStep
from scara_ident.effects import Parameter


def with_instants_of_each(step: SelectionStep, place: int, parameters: Mapping[str, Parameter]) -> dict[str, Parameter]:
    """Return the parameters of a chosen effect whose instants are no surer than the recordings agree on them.

    Parameters
    ----------
    place : int
        Of the effect among those chosen.
    """
    found = dict(parameters)
    effect = step.chosen[place].effect
    for k, item in enumerate(effect.nonlinear):
        instant = found.get(item.name)
        if item.jumps and instant is not None and 0.0 < instant.std < step.scene.duration:
            found[item.name] = replace(instant, std=max(instant.std, _jackknife(step, place, k, instant.std)))
    return found


def _jackknife(step: SelectionStep, place: int, k: int, std: float) -> float:
    """Return the standard deviation of an instant by leaving out each recording (the jackknife), s; 0 of a single one."""
    item = step.chosen[place]
    instant = item.member.nonlinear[k]
    tried = _tried(instant, std, step.scene.duration)
    squares = np.array([_squares(step, place, k, float(time)) for time in tried])
    runs = np.flatnonzero(np.any(squares > 0.0, axis=0))
    if len(runs) < 2:
        return 0.0
    without = np.sum(squares, axis=1)[:, None] - squares[:, runs]
    off = tried[np.argmin(without, axis=0)] - instant
    return float(np.sqrt((len(runs) - 1) / len(runs) * np.sum(off**2)))


def _tried(instant: float, std: float, duration: float) -> Array:
    """Return the instant and others about it within a run, twice as far off each, s."""
    steps = std * 2.0 ** np.arange(np.ceil(np.log2(duration / std)) + 1.0)
    around = np.concatenate([[instant], instant - steps, instant + steps])
    return np.asarray(around[(around > 0.0) & (around < duration)])


def _squares(step: SelectionStep, place: int, k: int, time: float) -> Array:
    """Return the weighted squared residual of every recording with the instant elsewhere and all coefficients fitted again."""
    item = step.chosen[place]
    nonlinear = (*item.member.nonlinear[:k], time, *item.member.nonlinear[k + 1 :])
    moved = replace(item, member=replace(item.member, nonlinear=nonlinear))
    model = replace(step, chosen=(*step.chosen[:place], moved, *step.chosen[place + 1 :])).model
    return np.bincount(model.owner, model.squares, len(step.observations.data.recordings)).astype(np.float64)
