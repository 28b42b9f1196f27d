"""Nonlinear parameters of the effects in a model, all fitted together with its linear ones by Gauss and Newton.

To the nonlinear parameters of the effects come the armatures of joints whose gear they depend on: where the base model
cannot tell a rotor from its link, the load that a gear transmits follows from the nominal rotor inertia only, which a
data sheet gives without shaft, brake and wave generator. It enters with that uncertainty as a prior.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from scara_ident.diagnosis.candidates import Candidate
from scara_ident.diagnosis.table import Table, tabulate_candidates
from scara_ident.effects import Scene
from scara_ident.recording.recording import Recording

Array = NDArray[np.float64]

# Standard deviation of a nominal rotor inertia, as a share of it.
ARMATURE_STD = 0.2
# Step for the derivative by a nonlinear parameter, as a share of it.
DERIVATIVE_STEP = 1e-3
# A longer one for an armature: the flights in a clearance begin and end at samples, which a short step does not move.
ARMATURE_STEP = 2e-2
# Steps of Gauss and Newton, and by how many standard deviations the last one may still move something.
ROUNDS = 6
SETTLED = 0.1
# A step moves a parameter by no more than this share of it.
LONGEST_STEP = 0.5
# A rise of the squared error by more than this share turns a step back; loads that settle may raise it by less.
RISE = 1e-5


@dataclass(frozen=True)
class Unknown:
    """A nonlinear parameter.

    Attributes
    ----------
    owner : int or None
        Place of the effect whose it is; None for an armature.
    place : int
        Which of the effect's, or the joint.
    value : float
    lower, upper : float
    nominal, spread : float
        Prior mean and standard deviation; infinite spread without one.
    """

    owner: int | None
    place: int
    value: float
    lower: float
    upper: float
    nominal: float = 0.0
    spread: float = np.inf

    @property
    def step(self) -> float:
        """For a derivative."""
        share = ARMATURE_STEP if self.owner is None else DERIVATIVE_STEP
        return share * (abs(self.value) if self.value else self.upper - self.lower)


@dataclass(frozen=True, eq=False)
class Linearised:
    """A model with effects, linear in all its parameters about the present nonlinear ones.

    Attributes
    ----------
    scene : Scene
    chosen : tuple of Candidate
    unknowns : tuple of Unknown
    table : Table
        Columns of the base model, then of the effects, weighted.
    places : tuple of slice
        Columns of each effect in the table.
    value : ndarray, shape (k,)
        Linear parameters that fit best at the present nonlinear ones.
    derivatives : ndarray, shape (N, s)
        Change of the torque per unit of each nonlinear parameter.
    """

    scene: Scene
    chosen: tuple[Candidate, ...]
    unknowns: tuple[Unknown, ...]
    table: Table
    places: tuple[slice, ...]
    value: Array
    derivatives: Array

    @property
    def columns(self) -> Array:
        """Columns of all parameters, linear first, shape (N, k + s)."""
        return np.hstack([self.table.columns, self.derivatives])

    @cached_property
    def variance(self) -> float:
        """Mean squared residual of a row."""
        left = self.table.torque - self.table.columns @ self.value
        return float(np.mean(left**2))

    @property
    def error(self) -> float:
        """Squared residual with what the priors add to it."""
        prior = sum(((item.value - item.nominal) / item.spread) ** 2 for item in self.unknowns)
        return self.variance * (len(self.table.torque) + prior)

    @property
    def prior(self) -> tuple[Array, Array]:
        """Rows of the priors on the nonlinear parameters, and their right-hand side, as weighty as measured rows."""
        known = [k for k, item in enumerate(self.unknowns) if np.isfinite(item.spread)]
        rows = np.zeros((len(known), len(self.value) + len(self.unknowns)))
        aim = np.zeros(len(known))
        for row, k in enumerate(known):
            item = self.unknowns[k]
            weight = np.sqrt(self.variance) / item.spread
            rows[row, len(self.value) + k] = weight
            aim[row] = weight * (item.nominal - item.value)
        return rows, aim

    def solve(self) -> tuple[Array, Array]:
        """Return the best change of the nonlinear parameters and the white standard deviations of all parameters."""
        rows, aim = self.prior
        columns = np.vstack([self.columns, rows])
        target = np.concatenate([self.table.torque, aim])
        size = np.linalg.norm(columns, axis=0)
        size[size == 0.0] = 1.0
        left, singular, right = np.linalg.svd(columns / size, full_matrices=False)
        kept = singular > 1e-9 * singular[0]
        half = right[kept].T / singular[kept]
        best = half @ (left[:, kept].T @ target) / size
        return best[len(self.value) :], np.sqrt(self.variance * np.sum(half**2, axis=1)) / size


def linearise(
    scene: Scene,
    recordings: Sequence[Recording],
    bands: Sequence[float | None],
    base: Table,
    weights: Array,
    chosen: Sequence[Candidate],
) -> Linearised:
    """Return the linear model about the present nonlinear parameters.

    Parameters
    ----------
    scene : Scene
    recordings : sequence of Recording
    bands : sequence of float or None, one per joint
    base : Table
        Rows of the base model, not weighted.
    weights : ndarray, shape (n,)
    chosen : sequence of Candidate
    """
    unknowns = _unknowns(scene, chosen)
    nonlinear = [item for item in unknowns if item.owner is not None]
    variants = [
        _moved_candidate(chosen[item.owner], item.place, item.value + sign * item.step)
        for item in nonlinear
        if item.owner is not None
        for sign in (1.0, -1.0)
    ]
    columns, places = tabulate_candidates(scene, [*chosen, *variants], recordings, bands)
    size = base.columns.shape[1]
    own = [slice(size + place.start, size + place.stop) for place in places[: len(chosen)]]
    stop = places[len(chosen) - 1].stop if chosen else 0
    table = base.beside(columns[:, :stop]).weighted(weights)
    value = _solve(table.columns, table.torque)
    of_row = weights[table.joint]
    changes = []
    for k, item in enumerate(nonlinear):
        up, down = (columns[:, places[len(chosen) + 2 * k + side]] for side in (0, 1))
        changes.append((up - down) @ value[own[item.owner or 0]] / (2.0 * item.step))
    for item in unknowns[len(nonlinear) :]:
        up, down = (
            tabulate_candidates(_with_armature(scene, item, sign), chosen, recordings, bands)[0] for sign in (1.0, -1.0)
        )
        changes.append((up - down) @ value[size:] / (2.0 * item.step))
    derivatives = np.column_stack(changes) * of_row[:, None] if changes else np.zeros((len(of_row), 0))
    return Linearised(scene, tuple(chosen), unknowns, table, tuple(own), value, derivatives)


def tune(
    scene: Scene,
    recordings: Sequence[Recording],
    bands: Sequence[float | None],
    base: Table,
    weights: Array,
    chosen: Sequence[Candidate],
) -> tuple[Scene, list[Candidate]]:
    """Fit the nonlinear parameters of all effects in a model together, and settle the loads that they depend on.

    Parameters
    ----------
    scene, recordings, bands, base, weights, chosen
        See `linearise`.

    Returns
    -------
    tuple of (Scene, list of Candidate)
        With the parameters fitted.
    """
    if not chosen:
        return scene, []
    size = base.columns.shape[1]
    best: Linearised | None = None
    change = np.zeros(0)
    for _ in range(ROUNDS):
        now = linearise(scene, recordings, bands, base, weights, chosen)
        if best is not None and now.error > (1.0 + RISE) * best.error:
            change = 0.5 * change
            scene, chosen = _moved(best, change)
            continue
        moved = np.inf
        change, std = now.solve()
        if best is not None:
            past = np.concatenate([now.value[:size] - best.value[:size], change])
            spread = np.concatenate([std[:size], std[len(now.value) :]])
            moved = float(np.max(np.abs(past) / np.maximum(spread, np.finfo(float).tiny)))
        best = now
        if moved < SETTLED:
            break
        scene, chosen = _moved(best, change)
    assert best is not None
    return replace(best.scene, value=best.value[:size]), list(best.chosen)


def _unknowns(scene: Scene, chosen: Sequence[Candidate]) -> tuple[Unknown, ...]:
    """Return the nonlinear parameters of the effects, then the armatures."""
    found = [
        Unknown(owner, place, candidate.member.nonlinear[place], parameter.lower, parameter.upper)
        for owner, candidate in enumerate(chosen)
        for place, parameter in enumerate(candidate.effect.nonlinear)
    ]
    joints = (candidate.effect.geared_joint(candidate.member) for candidate in chosen)
    for joint in dict.fromkeys(joint for joint in joints if joint is not None):
        nominal = scene.nominal_armature(joint)
        if scene.told_armature(joint) is None and nominal > 0.0:
            found.append(
                Unknown(
                    None, joint, scene.armature(joint), 0.1 * nominal, 3.0 * nominal, nominal, ARMATURE_STD * nominal
                )
            )
    return tuple(found)


def _moved(state: Linearised, change: Array) -> tuple[Scene, list[Candidate]]:
    """Return scene and effects with the nonlinear parameters changed, within their bounds and not too far at once."""
    chosen = list(state.chosen)
    armatures = dict(state.scene.armatures)
    for item, step in zip(state.unknowns, change, strict=True):
        reach = LONGEST_STEP * abs(item.value) if item.value else np.inf
        value = float(np.clip(item.value + np.clip(step, -reach, reach), item.lower, item.upper))
        if item.owner is None:
            armatures[item.place] = value
        else:
            chosen[item.owner] = _moved_candidate(chosen[item.owner], item.place, value)
    size = len(state.scene.model.columns)
    return replace(state.scene, value=state.value[:size], armatures=armatures), chosen


def _moved_candidate(candidate: Candidate, place: int, value: float) -> Candidate:
    nonlinear = list(candidate.member.nonlinear)
    nonlinear[place] = value
    return candidate.at(nonlinear)


def _with_armature(scene: Scene, item: Unknown, sign: float) -> Scene:
    return replace(scene, armatures={**scene.armatures, item.place: item.value + sign * item.step})


def _solve(columns: Array, target: Array) -> Array:
    size = np.linalg.norm(columns, axis=0)
    size[size == 0.0] = 1.0
    return np.asarray(np.linalg.lstsq(columns / size, target, rcond=1e-10)[0] / size)
