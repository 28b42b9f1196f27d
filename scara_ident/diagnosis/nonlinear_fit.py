"""Fitting the nonlinear parameters of all effects in a model together, by Gauss and Newton.

Armatures are among them: where the base model cannot tell a rotor from its link, the load that a gear transmits follows
from the nominal rotor inertia only, which a data sheet gives without shaft, brake and wave generator, and which is
guessed where nobody states it (`scara_ident.robot.rotors`). It enters with that uncertainty as a prior: its logarithm is
a parameter with a normal distribution, and what that costs stands in the standard deviations of the effects' parameters.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from scara_ident.arrays import Array
from scara_ident.diagnosis.candidates import Candidate, CandidateColumns, Rows, with_columns
from scara_ident.effects import Scene
from scara_ident.effects.links import largest_armature
from scara_ident.estimation.information import Information, weighted
from scara_ident.estimation.observations import JointRows
from scara_ident.robot.rotors import GUESS_FACTOR
from scara_ident.threads import one_blas_thread, side_by_side

# Step for the derivative by a nonlinear parameter, as a share of it: small beside its curvature, large beside rounding.
DERIVATIVE_STEP = 1e-3
# A longer one for an armature's logarithm: the flights in a clearance begin and end at samples, which a short step does not move.
ARMATURE_STEP = 2e-2
# Steps of Gauss and Newton; most fits settle in three, and a search has further ones.
ROUNDS = 6
# Standard deviations by which the last step may still move something: less is of no account.
SETTLED = 0.1
# A step moves a parameter by no more than this share of it, and an armature's logarithm by this: the linear model holds no further.
LONGEST_STEP = 0.5
# A rise of the squared error by more than this share turns a step back; loads that settle may raise it by less.
RISE = 1e-5
# An armature stays within so many standard deviations of its prior.
WIDEST = 4.0
# Directions whose singular value, columns scaled to unit length, is below this share of the largest take no step.
STEPLESS = 1e-9


@dataclass(frozen=True)
class Unknown:
    """A nonlinear parameter.

    Attributes
    ----------
    owner : int or None
        Place of the effect whose it is; None for the logarithm of an armature.
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
        if self.owner is None:
            return ARMATURE_STEP
        return DERIVATIVE_STEP * (abs(self.value) if self.value else self.upper - self.lower)

    def moved(self, change: float) -> float:
        """Return its value after a step, within its bounds and not too far at once."""
        reach = LONGEST_STEP if self.owner is None else LONGEST_STEP * abs(self.value) if self.value else np.inf
        return float(np.clip(self.value + np.clip(change, -reach, reach), self.lower, self.upper))


@dataclass(frozen=True, eq=False)
class Linearised:
    """A model with effects, linear in all its parameters about the present nonlinear ones.

    Attributes
    ----------
    scene : Scene
    chosen : tuple of Candidate
    unknowns : tuple of Unknown
    places : tuple of slice
        Columns of each effect.
    joints : tuple of JointRows
        Columns of the base model, of the effects, and the change of the torque per unit of each nonlinear parameter.
    information : Information
        Of all weighted rows; its parameters are k linear ones, then s nonlinear ones.
    """

    scene: Scene
    chosen: tuple[Candidate, ...]
    unknowns: tuple[Unknown, ...]
    places: tuple[slice, ...]
    joints: tuple[JointRows, ...]
    information: Information

    @property
    def linear(self) -> int:
        """Number of linear parameters k."""
        return self.information.parameters - len(self.unknowns)

    @cached_property
    def value(self) -> Array:
        """Linear parameters that fit best at the present nonlinear ones, shape (k,)."""
        return self.information.select(range(self.linear)).solve().value

    @cached_property
    def rows(self) -> int:
        """Number of rows."""
        return sum(rows.table.shape[1] for rows in self.joints)

    @cached_property
    def variance(self) -> float:
        """Mean squared residual of a weighted row."""
        value = np.concatenate([self.value, np.zeros(len(self.unknowns))])
        return self.information.residual_sum(value) / self.rows

    @property
    def error(self) -> float:
        """Squared residual with what the priors add to it."""
        prior = sum(((item.value - item.nominal) / item.spread) ** 2 for item in self.unknowns)
        return self.variance * (self.rows + prior)

    @property
    def prior(self) -> Information:
        """Rows of the priors on the nonlinear parameters, as weighty as measured rows."""
        known = [k for k, item in enumerate(self.unknowns) if np.isfinite(item.spread)]
        rows = np.zeros((len(known), self.information.parameters + 1))
        for row, k in enumerate(known):
            item = self.unknowns[k]
            weight = np.sqrt(self.variance) / item.spread
            rows[row, self.linear + k] = weight
            rows[row, -1] = weight * (item.nominal - item.value)
        return Information(rows, 0.0)

    def solve(self) -> tuple[Array, Array]:
        """Return the best change of the nonlinear parameters and the white standard deviations of all parameters."""
        rows = np.vstack([self.information.factor, self.prior.factor])
        columns, target = rows[:, :-1], rows[:, -1]
        size = np.linalg.norm(columns, axis=0)
        size[size == 0.0] = 1.0
        left, singular, right = np.linalg.svd(columns / size, full_matrices=False)
        kept = singular > STEPLESS * singular[0]
        half = right[kept].T / singular[kept]
        best = half @ (left[:, kept].T @ target) / size
        return best[self.linear :], np.sqrt(self.variance * np.sum(half**2, axis=1)) / size


def linearise(
    scene: Scene, columns: CandidateColumns, weights: Array, chosen: Sequence[Candidate], rotor_inertia_std: float
) -> Linearised:
    """Return the linear model about the present nonlinear parameters.

    Parameters
    ----------
    scene : Scene
    columns : CandidateColumns
        On the rows of the base model.
    weights : ndarray, shape (n,)
    chosen : sequence of Candidate
    rotor_inertia_std : float
        Standard deviation of a stated rotor inertia, as a share of it.
    """
    observations = columns.observations
    unknowns = _unknowns(scene, chosen, rotor_inertia_std)
    own = columns.rows(scene, chosen)
    bounds = observations.parameters + np.cumsum([0, *(len(next(iter(rows.values()))) for rows in own)])
    places = tuple(slice(int(a), int(b)) for a, b in zip(bounds[:-1], bounds[1:], strict=True))
    joints = with_columns(observations, own)
    linear = int(bounds[-1])
    value = _pooled(joints, linear, weights).solve().value
    changes = [_change(scene, columns, chosen, item, places, value) for item in unknowns]
    extended = tuple(_beside(rows, joint, changes, linear) for joint, rows in enumerate(joints))
    information = _pooled(extended, linear + len(unknowns), weights)
    return Linearised(scene, tuple(chosen), unknowns, places, extended, information)


def _pooled(joints: Sequence[JointRows], parameters: int, weights: Array) -> Information:
    with one_blas_thread():
        return weighted(side_by_side(lambda rows: rows.information(parameters), joints), weights)


def _change(
    scene: Scene,
    columns: CandidateColumns,
    chosen: Sequence[Candidate],
    item: Unknown,
    places: Sequence[slice],
    value: Array,
) -> dict[int, Array]:
    """Return the change of each joint's torque per unit of a nonlinear parameter, shape (N,)."""
    total: dict[int, Array] = {}
    for owner, place in enumerate(places):
        if item.owner is not None and owner != item.owner:
            continue
        sides: list[Rows] = []
        for sign in (1.0, -1.0):
            at = item.value + sign * item.step
            if item.owner is None:
                sides += columns.rows(_with_armature(scene, item.place, float(np.exp(at))), [chosen[owner]])
            else:
                sides += columns.rows(scene, [_moved_candidate(chosen[owner], item.place, at)])
        for joint in sides[0]:
            change = value[place] @ (sides[0][joint] - sides[1][joint]) / (2.0 * item.step)
            total[joint] = total.get(joint, 0.0) + change
    return total


def _beside(rows: JointRows, joint: int, changes: Sequence[dict[int, Array]], first: int) -> JointRows:
    acting = [k for k, change in enumerate(changes) if joint in change]
    if not acting:
        return rows
    table = np.concatenate([rows.table[:-1], [changes[k][joint] for k in acting], rows.table[-1:]])
    return JointRows(np.concatenate([rows.columns, [first + k for k in acting]]), table, rows.starts, rows.counts)


def tune(
    scene: Scene, columns: CandidateColumns, weights: Array, chosen: Sequence[Candidate], rotor_inertia_std: float
) -> tuple[Scene, tuple[Candidate, ...]]:
    """Fit the nonlinear parameters of all effects in a model together, and settle the loads that they depend on.

    Parameters
    ----------
    scene, columns, weights, chosen, rotor_inertia_std
        See `linearise`.

    Returns
    -------
    tuple of (Scene, tuple of Candidate)
        With the parameters fitted.
    """
    if not chosen:
        return scene, ()
    size = columns.observations.parameters
    best: Linearised | None = None
    change = np.zeros(0)
    for _ in range(ROUNDS):
        now = linearise(scene, columns, weights, chosen, rotor_inertia_std)
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
    return replace(best.scene, value=best.value[:size]), best.chosen


def _unknowns(scene: Scene, chosen: Sequence[Candidate], rotor_inertia_std: float) -> tuple[Unknown, ...]:
    """Return the nonlinear parameters of the effects, then the armatures."""
    found = [
        Unknown(owner, place, candidate.member.nonlinear[place], parameter.lower, parameter.upper)
        for owner, candidate in enumerate(chosen)
        for place, parameter in enumerate(candidate.effect.nonlinear)
    ]
    joints = [candidate.effect.geared_joint(candidate.member) for candidate in chosen]
    for joint in dict.fromkeys(joint for joint in joints if joint is not None):
        nominal = scene.nominal_armature(joint)
        if scene.told_armature(joint) is None and nominal > 0.0:
            found.append(_armature(scene, joint, nominal, rotor_inertia_std))
    return tuple(found)


def _armature(scene: Scene, joint: int, nominal: float, rotor_inertia_std: float) -> Unknown:
    """Return the logarithm of an armature as an unknown; a guess leaves the link some inertia."""
    stated = bool(scene.robot.rotor_stated[joint])
    spread = rotor_inertia_std if stated else float(np.log(GUESS_FACTOR))
    mean = float(np.log(nominal))
    lower, upper = mean - WIDEST * spread, mean + WIDEST * spread
    if not stated:
        upper = min(upper, float(np.log(largest_armature(scene, joint))))
        lower = min(lower, upper - WIDEST * spread)
    held = min(float(np.log(scene.armature(joint))), upper)
    return Unknown(None, joint, held, lower, upper, mean, spread)


def _moved(state: Linearised, change: Array) -> tuple[Scene, tuple[Candidate, ...]]:
    """Return scene and effects with the nonlinear parameters changed, within their bounds and not too far at once."""
    chosen = list(state.chosen)
    armatures = dict(state.scene.armatures)
    for item, step in zip(state.unknowns, change, strict=True):
        value = item.moved(step)
        if item.owner is None:
            armatures[item.place] = float(np.exp(value))
        else:
            chosen[item.owner] = _moved_candidate(chosen[item.owner], item.place, value)
    size = len(state.scene.model.columns)
    return replace(state.scene, value=state.value[:size], armatures=armatures), tuple(chosen)


def _moved_candidate(candidate: Candidate, place: int, value: float) -> Candidate:
    nonlinear = list(candidate.member.nonlinear)
    nonlinear[place] = value
    return candidate.at(nonlinear)


def _with_armature(scene: Scene, joint: int, value: float) -> Scene:
    return replace(scene, armatures={**scene.armatures, joint: value})
