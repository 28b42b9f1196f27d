"""A model with effects, linearised in its nonlinear parameters.

Columns of an effect may follow from the bodies as strongly as from its own parameters, as an elastic joint's do. Such an
effect is tied: it says what its coefficient is and what its torque changes by, and the columns of the bodies take that up.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.diagnosis.candidates.candidates import Candidate, CandidateColumns, Rows
from scara_ident.diagnosis.candidates.finite_columns import torque_slope
from scara_ident.diagnosis.candidates.unknowns import Unknown
from scara_ident.diagnosis.fitting.present_model import PresentModel, pooled, present_model
from scara_ident.diagnosis.fitting.trust_region import least_squares, length, within_radius
from scara_ident.diagnosis.testing.fitted_model import FittedModel
from scara_ident.diagnosis.testing.selection_step import SelectionStep
from scara_ident.effects import Scene, Tie
from scara_ident.estimation.information import Information, merge
from scara_ident.estimation.joint_rows import JointRows

# A row that ties a coefficient is so many times as weighty as all rows that it acts on.
TIGHTNESS = 1e3


@dataclass(frozen=True, eq=False)
class Linearised:
    """A model with effects, linear in all its parameters about the present nonlinear ones.

    Attributes
    ----------
    present : PresentModel
        The same without derivatives.
    joints : tuple of JointRows
        Columns of the base model, of the effects, and the change of the torque per unit of each nonlinear parameter.
    information : Information
        Of all weighted rows, with offsets of runs as noise; its parameters are k linear ones, then s nonlinear ones.
    ties : Information
        Rows that hold the coefficients of tied effects to what the nonlinear parameters and the rigid bodies say of them.
    """

    present: PresentModel
    joints: tuple[JointRows, ...]
    information: Information
    ties: Information

    @property
    def scene(self) -> Scene:
        """That of its step."""
        return self.present.scene

    @property
    def chosen(self) -> tuple[Candidate, ...]:
        """The effects."""
        return self.present.chosen

    @property
    def unknowns(self) -> tuple[Unknown, ...]:
        """The nonlinear parameters."""
        return self.present.unknowns

    @property
    def places(self) -> tuple[slice, ...]:
        """Columns of each effect."""
        return self.present.places

    @property
    def error(self) -> float:
        """Squared residual at the present nonlinear parameters, see `PresentModel.error`."""
        return self.present.error

    @property
    def linear(self) -> int:
        """Number of linear parameters k."""
        return self.information.parameters - len(self.unknowns)

    @property
    def value(self) -> Array:
        """Linear parameters that fit best at the present nonlinear ones, shape (k,); none of what was taken out of the data."""
        return self.best[: self.linear]

    @cached_property
    def best(self) -> Array:
        """The same, and no change of the nonlinear ones, shape (k + s,)."""
        return _solved(self.information, self.ties, self._fitted)

    @cached_property
    def least(self) -> Array:
        """These with what is left of what was taken out of the data, shape (k + s,): blocks scatter about the least squares."""
        return self.best if np.all(self._fitted == self._free) else _solved(self.information, self.ties, self._free)

    @property
    def _free(self) -> NDArray[np.bool_]:
        return np.arange(self.information.parameters) < self.linear

    @property
    def _fitted(self) -> NDArray[np.bool_]:
        return np.append(self.present.fitted, np.zeros(len(self.unknowns), dtype=bool))

    @cached_property
    def rows(self) -> int:
        """Number of rows."""
        return sum(rows.table.shape[1] for rows in self.joints)

    @cached_property
    def variance(self) -> float:
        """Mean squared residual of a weighted row."""
        return self.information.residual_sum(self.best) / self.rows

    def _prior_sum(self, changes: Array) -> float:
        """Return what the priors add to the squared residual after changes of the nonlinear parameters."""
        pairs = zip(self.unknowns, changes, strict=True)
        return float(self.variance * sum(((item.value + x - item.nominal) / item.spread) ** 2 for item, x in pairs))

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
        return merge([Information(rows, 0.0), self.ties])

    def gain(self, way: Array) -> float:
        """Return the share of the squared residual, with what the priors add, that parameters as `solve` returns them promise to remove."""
        left = self.information.residual_sum(way) + self._prior_sum(way[self.linear :])
        return 1.0 - left / (self.variance * self.rows + self._prior_sum(np.zeros(len(self.unknowns))))

    def solve(self) -> tuple[Array, Array]:
        """Return the best parameters, nonlinear ones as a change, and the white standard deviations of all.

        Those at a bound that would leave it stay there, and all others are the best beside them.
        """
        _, root, by, columns, target = self._apart
        changes, own, _ = least_squares(columns, target)
        stuck = np.array(
            [item.moved(x) == item.value for item, x in zip(self.unknowns, changes, strict=True)], dtype=bool
        )
        if np.any(stuck):
            changes, own, _ = least_squares(np.where(stuck, 0.0, columns), target)
        linear = np.sum(root**2, axis=1) + np.sum((by @ own) ** 2, axis=1)
        return self._way(changes), np.sqrt(self.variance * np.append(linear, np.sum(own**2, axis=1)))

    def step(self, radius: float = np.inf) -> Array:
        """Return the best parameters that one step may reach, nonlinear ones as a change.

        Parameters
        ----------
        radius : float, optional
            How long it may be, see `length`.
        """
        *_, columns, target = self._apart
        return self._way(within_radius(columns, target, [item.room for item in self.unknowns], radius))

    def length(self, way: Array) -> float:
        """Return how long a way is: of changes of nonlinear parameters, each times what rows tell of it beside the linear ones."""
        return length(self._apart[3], way[self.linear :])

    @cached_property
    def _apart(self) -> tuple[Array, Array, Array, Array, Array]:
        """Linear parameters at no change of the nonlinear ones, the root of their covariance, what they lose by each of these, (k, s).

        Last come the columns of the nonlinear ones and the target beside what linear ones reach.
        """
        rows = np.vstack([self.information.factor, self.prior.factor])
        theirs, target = rows[:, self.linear : -1], rows[:, -1]
        value, root, basis = least_squares(rows[:, : self.linear], target)
        by = root @ (basis.T @ theirs)
        return value, root, by, theirs - basis @ (basis.T @ theirs), target - basis @ (basis.T @ target)

    def _way(self, changes: Array) -> Array:
        value, _, by, _, _ = self._apart
        return np.concatenate([value - by @ changes, changes])


def linearise(step: SelectionStep) -> Linearised:
    """Return the model of a step, linear about the present nonlinear parameters."""
    return linear_model(present_model(step))


def linear_model(present: PresentModel) -> Linearised:
    """Return the model at its present nonlinear parameters as one that is linear about them."""
    step, scene, chosen, unknowns = present.step, present.scene, present.chosen, present.unknowns
    columns, joints = step.columns, present.joints
    linear, total = present.linear, present.linear + len(unknowns)
    slopes: dict[int, Rows] = {}
    rows = []
    for owner, (candidate, tie) in enumerate(zip(chosen, present.ties, strict=True)):
        if tie is not None:
            slopes[owner] = columns.slopes(scene, candidate)
            bodies, own = scene.model.place(scene.model.rigid_body), present.places[owner].start
            by_bodies = {joint: each[: bodies.stop - bodies.start] for joint, each in slopes[owner].items()}
            joints = _with_slopes(joints, by_bodies, bodies.start, scene)
            size = _size(joints, own, step.weights)
            rows.append(TIGHTNESS * size * _tie_row(scene, chosen, unknowns, owner, tie, own, linear))
    ties = Information(np.array(rows).reshape(-1, total + 1), 0.0)
    held = Information(np.delete(ties.factor, np.s_[linear:total], axis=1), 0.0)
    information = pooled(joints, linear, step) if slopes else present.information
    value = _solved(information, held, present.fitted)
    changes = [_change(scene, columns, chosen, item, present.places, value, slopes) for item in unknowns]
    extended = tuple(_beside(rows, joint, changes, linear) for joint, rows in enumerate(joints))
    return Linearised(present, extended, pooled(extended, total, step), ties)


def follow_estimate(present: PresentModel) -> bool:
    """Whether columns of any effect follow the parameters of the base model, other than by a tie."""
    pairs = zip(present.chosen, present.ties, strict=True)
    return any(item.effect.follows_estimate and tie is None for item, tie in pairs)


def with_estimate_slopes(step: SelectionStep, state: Linearised) -> Linearised:
    """Return the model of a step, linear about the parameters of the base model too where columns follow these.

    Parameters
    ----------
    state : Linearised
        As `linearise` returns it, to which such columns are given.
    """
    if not follow_estimate(state.present):
        return state
    scene, joints = step.scene, state.joints
    for candidate, place, tie in zip(step.chosen, state.places, state.present.ties, strict=True):
        if candidate.effect.follows_estimate and tie is None:
            value = state.value[place]
            # The torque of what was taken out of the data is zero, whatever the parameters are.
            slopes = step.columns.estimate_slopes(scene, candidate, value) if np.any(value) else {}
            joints = _with_slopes(joints, slopes, 0, scene)
    information = pooled(joints, state.information.parameters, step)
    return replace(state, joints=joints, information=information)


def freed_model(step: SelectionStep) -> FittedModel:
    """Return a fitted model in which nonlinear parameters may move with all others, as far as it is linear in them.

    What takes up most of what is missing by a wrong value of them leaves nothing of it to candidates beside them as they are.
    """
    state = linearise(step)
    return step.fitted(state.joints, state.information.parameters)


def _solved(information: Information, ties: Information, fitted: NDArray[np.bool_]) -> Array:
    """Return the parameters that fit best, ties kept; those not fitted are zero."""
    value, places = np.zeros(len(fitted)), np.flatnonzero(fitted)
    held = Information(ties.factor[:, [*places, -1]], 0.0)
    value[places] = merge([information.select(places), held]).solve().value
    return value


def _with_slopes(joints: Sequence[JointRows], slopes: Rows, start: int, scene: Scene) -> tuple[JointRows, ...]:
    """Return rows whose columns of the base model have what an effect's torque changes by with its parameters.

    The torque has it too, at the present parameters, so that what is left stays what it is.

    Parameters
    ----------
    slopes : dict of ndarray, shape (k, N)
        Of each joint that has some, by k parameters of the base model.
    start : int
        Place of the first of these.
    """
    found = []
    for joint, rows in enumerate(joints):
        if joint not in slopes:
            found.append(rows)
            continue
        own = slopes[joint]
        some = np.arange(start, start + len(own))
        missing = some[~np.isin(some, rows.columns) & np.any(own != 0.0, axis=1)]
        places = np.concatenate([rows.columns, missing])
        table = np.concatenate([rows.table[:-1], np.zeros((len(missing), rows.table.shape[1])), rows.table[-1:]])
        inside = (places >= start) & (places < start + len(own))
        table[:-1][inside] += own[places[inside] - start]
        table[-1] += scene.value[some] @ own
        found.append(JointRows(places, table, rows.starts, rows.counts))
    return tuple(found)


def _tie_row(
    scene: Scene,
    chosen: Sequence[Candidate],
    unknowns: Sequence[Unknown],
    owner: int,
    tie: Tie,
    column: int,
    linear: int,
) -> Array:
    """Return the row that ties an effect's coefficient, shape (k + s + 1,)."""
    place = scene.model.place(scene.model.rigid_body)
    by_bodies = tie.slopes[: place.stop - place.start]
    row = np.zeros(linear + len(unknowns) + 1)
    row[column] = 1.0
    row[place] = -by_bodies
    row[-1] = tie.value - by_bodies @ scene.value[place]
    for k, item in enumerate(unknowns):
        which, factor = _slope_of(scene, chosen, item, owner)
        if which is not None:
            row[linear + k] = -factor * tie.slopes[which]
    return row


def _slope_of(scene: Scene, chosen: Sequence[Candidate], item: Unknown, owner: int) -> tuple[int | None, float]:
    """Return which of a tied effect's slopes is by a nonlinear parameter, and what to multiply it with."""
    bodies = len(scene.model.rigid_body.columns)
    if item.owner == owner:
        return bodies + 1 + item.place, 1.0
    if item.owner is None and chosen[owner].effect.geared_joint(chosen[owner].member) == item.place:
        return bodies, scene.armature(item.place)
    return None, 0.0


def _size(joints: Sequence[JointRows], column: int, weights: Array) -> float:
    """Return the weighted length of a column."""
    parts = (rows.table[:-1][rows.columns == column] for rows in joints)
    return float(np.linalg.norm([w * np.linalg.norm(part) for w, part in zip(weights, parts, strict=True)]))


def _change(
    scene: Scene,
    columns: CandidateColumns,
    chosen: Sequence[Candidate],
    item: Unknown,
    places: Sequence[slice],
    value: Array,
    slopes: Mapping[int, Rows],
) -> dict[int, Array]:
    """Return the change of each joint's torque per unit of a nonlinear parameter, shape (N,)."""
    total: dict[int, Array] = {}
    for owner, place in enumerate(places):
        if item.owner is not None and owner != item.owner:
            continue
        if owner in slopes:
            which, factor = _slope_of(scene, chosen, item, owner)
            if which is not None:
                for joint, own in slopes[owner].items():
                    total[joint] = total.get(joint, 0.0) + factor * own[which]
            continue
        (middle,), sides = columns.rows(scene, [chosen[owner]]), list[Rows]()
        for sign in (1.0, -1.0):
            at = item.value + sign * item.step
            if item.owner is None:
                sides += columns.rows(_with_armature(scene, item.place, float(np.exp(at))), [chosen[owner]])
            else:
                sides += columns.rows(scene, [moved_candidate(chosen[owner], item.place, at)])
        for joint, change in torque_slope(value[place], middle, sides, item.step).items():
            total[joint] = total.get(joint, 0.0) + change
    return total


def _beside(rows: JointRows, joint: int, changes: Sequence[dict[int, Array]], first: int) -> JointRows:
    acting = [k for k, change in enumerate(changes) if joint in change]
    if not acting:
        return rows
    table = np.concatenate([rows.table[:-1], [changes[k][joint] for k in acting], rows.table[-1:]])
    return JointRows(np.concatenate([rows.columns, [first + k for k in acting]]), table, rows.starts, rows.counts)


def moved_candidate(candidate: Candidate, place: int, value: float) -> Candidate:
    """Return a candidate with another value of one of its nonlinear parameters."""
    nonlinear = list(candidate.member.nonlinear)
    nonlinear[place] = value
    return candidate.at(nonlinear)


def _with_armature(scene: Scene, joint: int, value: float) -> Scene:
    return replace(scene, armatures={**scene.armatures, joint: value})
