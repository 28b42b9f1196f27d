"""How large effects must be for the diagnosis to let them in, from rows that need not be recorded yet.

Standard errors alone do not decide. A column that lives in few blocks of time leaves the test few degrees of freedom, and
then takes more of them; a share of the squared residual has to go, on trajectories that the effect was not fitted to; and
most of these must say so. Of all of it the expectation follows from products of columns in blocks: with the rows of unit
noise, coefficients a, W the products of what the model leaves of the columns and W_f those in fold f, coefficients of the
other folds are expected to remove ``a' W_f a - tr(W_f (W - W_f)^-1)`` of the squares of the fold.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.diagnosis.candidates.candidates import Rows, with_columns
from scara_ident.diagnosis.criteria import CRITERIA, SelectionCriteria
from scara_ident.diagnosis.testing.cluster_test import min_sizes, surely_needed
from scara_ident.diagnosis.testing.fitted_model import FittedModel, products_of
from scara_ident.effects import Scene
from scara_ident.estimation.information import Information, merge, triangular
from scara_ident.estimation.joint_rows import JointRows
from scara_ident.inquiry.answerability import Inquiry
from scara_ident.inquiry.questions import Suspect, all_suspects
from scara_ident.motion.rest import Bands

# Directions of a few columns below this share of the largest are not known without a fold.
_RANK = 1e-9
# The largest effect that is too small to speak of is looked for to this share.
SIZE_TOLERANCE = 0.01
# Blocks of time of one inquiry: more of longer recordings are taken together, which says no more than there is.
MAX_BLOCKS = 200


@dataclass(frozen=True, eq=False)
class Blocks:
    """Rows of unit noise of all columns of an inquiry, in blocks of time.

    Attributes
    ----------
    tables : tuple of ndarray, shape (columns, N)
        Of each joint.
    starts : tuple of ndarray of int, shape (blocks + 1,)
        Where each block begins among the rows of a joint.
    owner, trajectory : ndarray of int, shape (blocks,)
        Recording and trajectory of each block.
    parts : tuple of Blocks
        Which these are one after the other, where they are.
    stands_for : ndarray, shape (n,), or None
        Of each joint the rows that one table stands for, see `in_short`; None where each joint has its own.
    """

    tables: tuple[Array, ...]
    starts: tuple[NDArray[np.intp], ...]
    owner: NDArray[np.intp]
    trajectory: NDArray[np.intp]
    parts: tuple[Blocks, ...] = ()
    stands_for: Array | None = None

    @property
    def counts(self) -> Array:
        """Rows of each joint, shape (n,)."""
        own = [float(table.shape[1]) for table in self.tables]
        return np.array(own) if self.stands_for is None else self.stands_for

    def with_more(self, other: Blocks) -> Blocks:
        """Return both, the other's recordings being of other trajectories."""
        starts = (np.append(a, a[-1] + b[1:]) for a, b in zip(self.starts, other.starts, strict=True))
        return Blocks(
            tuple(np.concatenate(pair, axis=1) for pair in zip(self.tables, other.tables, strict=True)),
            tuple(starts),
            np.append(self.owner, self.owner.max(initial=-1) + 1 + other.owner),
            np.append(self.trajectory, self.trajectory.max(initial=-1) + 1 + other.trajectory),
            (self, other),
            None if self.stands_for is None or other.stands_for is None else self.stands_for + other.stands_for,
        )

    def in_short(self, parts: int) -> Blocks:
        """Return a triangular factor of all joints for each of so many parts of every recording, in place of their blocks.

        They have the same products of columns in a tenth of the rows, but no more say how evidence is spread over a part.
        """
        part = _parts(self.owner, parts)
        first = np.flatnonzero(np.diff(self.owner, prepend=-1) | np.diff(part, prepend=-1))
        factors = []
        for begin, end in pairwise([*first.tolist(), len(self.owner)]):
            rows = [table[:, own[begin] : own[end]] for table, own in zip(self.tables, self.starts, strict=True)]
            factors.append(triangular(np.vstack([_factor(some) for some in rows])).T)
        starts = np.cumsum([0, *(factor.shape[1] for factor in factors)])
        table = np.concatenate(factors, axis=1)
        return Blocks((table,), (starts,), self.owner[first], self.trajectory[first], stands_for=self.counts)

    def fewer(self) -> Blocks:
        """Return neighbouring blocks of a recording together, so that there are not many more than `MAX_BLOCKS`."""
        size = -(-len(self.owner) // MAX_BLOCKS)
        if size <= 1:
            return self
        bounds = [0, *(np.flatnonzero(np.diff(self.owner)) + 1).tolist(), len(self.owner)]
        first = np.concatenate([np.arange(a, b, size) for a, b in pairwise(bounds)])
        starts = tuple(np.append(own[first], own[-1]) for own in self.starts)
        return Blocks(self.tables, starts, self.owner[first], self.trajectory[first])

    def fitted(self, columns: Sequence[int] | NDArray[np.intp], parts: int) -> FittedModel:
        """Return a model of some of the columns, to be tried beside; the torque takes no part."""
        joints = []
        for table, starts in zip(self.tables, self.starts, strict=True):
            own = table[columns]
            acting = np.flatnonzero(np.any(own != 0.0, axis=1))
            rows = np.concatenate([own[acting], np.zeros((1, table.shape[1]))])
            joints.append(JointRows(acting, rows, starts, np.diff(starts).astype(float)))
        fold = self.trajectory if np.any(self.trajectory) else _parts(self.owner, parts)
        return FittedModel(tuple(joints), len(columns), self.owner, fold, np.ones(len(joints)))

    @cached_property
    def information(self) -> Information:
        """The triangular factor of all rows."""
        if self.parts:
            return merge([part.information for part in self.parts])
        factor = triangular(np.vstack([_factor(table) for table in self.tables]))
        return Information(np.hstack([factor, np.zeros((len(factor), 1))]), float(np.sum(self.counts)))

    def rows(self, columns: slice) -> Rows:
        """Return some columns on the rows of the joints that they act on."""
        return {j: table[columns] for j, table in enumerate(self.tables) if np.any(table[columns])}


def _parts(owner: NDArray[np.intp], parts: int) -> NDArray[np.intp]:
    """Return in which of so many parts of its recording each block is."""
    count = np.bincount(owner)
    begin = np.cumsum(count) - count
    return np.asarray((np.arange(len(owner)) - begin[owner]) * parts // np.maximum(1, count[owner]))


def _factor(table: Array) -> Array:
    """Return the triangular factor of the rows of columns, shape (m, columns)."""
    acting = np.flatnonzero(np.any(table != 0.0, axis=1))
    own = triangular(table[acting].T)
    found = np.zeros((len(own), len(table)))
    found[:, acting] = own
    return found


def known_blocks(inquiry: Inquiry, bands: Bands) -> Blocks | None:
    """Return the rows of the recordings at hand in bands, which a further one may widen; None where there are none."""
    if inquiry.columns is None:
        return None
    columns = inquiry.columns.at(bands)
    observations = columns.observations
    added = inquiry.rows(lambda wanted: columns.rows(inquiry.scene, wanted))
    total = observations.parameters + sum(len(next(iter(rows.values()))) for rows in added)
    rate = min(part.rate for part in observations.data.stretches)
    tables = []
    for rows, noise in zip(with_columns(observations, added), inquiry.noise, strict=True):
        table = np.zeros((total, rows.table.shape[1]))
        table[rows.columns] = rows.table[:-1] / np.sqrt(noise * rate)
        tables.append(table)
    names = observations.data.trajectories
    place = np.array([names.index(label) for label in observations.data.labels], dtype=np.intp)
    starts = tuple(rows.starts for rows in observations.joints)
    return Blocks(tuple(tables), starts, observations.owner, place[observations.owner]).fewer()


def believed(inquiry: Inquiry, blocks: Blocks) -> dict[str, float]:
    """Return how many times as large as the diagnosis needs it is each effect that may be below the limit, by label.

    That it is let in, that it is not too small to speak of, and that none of the others asked for is taken for it.

    Parameters
    ----------
    inquiry : Inquiry
    blocks : Blocks
        All rows: those of the recordings at hand, and of motions to be recorded. In short they do not say how many standard
        errors the test takes; as few as with any are then taken for it.
    """
    asked = all_suspects([item for item in inquiry.questions if item.kind == "below_limit"])
    p, names = len(inquiry.scene.model.columns), [item.label for item in inquiry.suspects]
    found: dict[str, float] = {}
    # What the model has is tried beside the model without it.
    alone = [[item] for item in asked if item.label in inquiry.labels_in_model]
    for some in ([item for item in asked if item.label not in inquiry.labels_in_model], *alone):
        without = {item.label for item in some}
        beside = [
            np.arange(p + own.start, p + own.stop)
            for (own, _), item in zip(inquiry.places, inquiry.in_model, strict=False)
            if item.label not in without
        ]
        places = [inquiry.places[names.index(item.label)][0] for item in some]
        times = times_believed(
            blocks.fitted(np.concatenate([np.arange(p), *beside]), CRITERIA.parts),
            [blocks.rows(slice(p + own.start, p + own.stop)) for own in places],
            [inquiry.just_seen[item.label] for item in some],
            [_count(blocks.counts, item.candidate.member.joint) for item in some],
            inquiry.tried,
            tested=blocks.stands_for is None,
        )
        found |= dict(zip((item.label for item in some), times.tolist(), strict=True))
    apart = times_apart(inquiry, asked, blocks.information)
    return {
        item.label: min(found[item.label], apart.get(item.label, np.inf), _times_negligible(inquiry.scene, item))
        for item in asked
    }


def _count(counts: Array, joint: int | None) -> float:
    """Return the rows of a joint, or of all where an effect is of none."""
    return float(np.sum(counts) if joint is None else counts[joint])


def _times_negligible(scene: Scene, item: Suspect) -> float:
    """Return how many times as large an effect is as the largest that is too small to speak of; inf where none is."""
    effect, member, value = item.candidate.effect, item.candidate.member, np.asarray(item.value)
    small, large = 1e-12, 1e12
    if effect.negligible(scene, member, small * value) is None:
        return np.inf
    while large > (1.0 + SIZE_TOLERANCE) * small:
        size = float(np.sqrt(small * large))
        small, large = (small, size) if effect.negligible(scene, member, size * value) is None else (size, large)
    return 1.0 / large


def times_apart(
    inquiry: Inquiry, asked: Sequence[Suspect], rows: Information, criteria: SelectionCriteria = CRITERIA
) -> dict[str, float]:
    """Return how many times as large as the diagnosis needs it each effect is, to be distinguished from the nearest other.

    Parameters
    ----------
    inquiry : Inquiry
    asked : sequence of Suspect
        Those in the model are left out.
    rows : Information
        Of all columns of the inquiry, rows of unit noise.
    criteria : SelectionCriteria
    """
    others = [item for item in asked if item.label not in inquiry.labels_in_model]
    names = [item.label for item in inquiry.suspects]
    places = {item.label: inquiry.places[names.index(item.label)] for item in others}
    # Below what the model has the factor holds what that leaves.
    start = max((wide.stop for _, wide in inquiry.places[: len(inquiry.in_model)]), default=0)
    left = rows.factor[len(inquiry.scene.model.columns) + start :, len(inquiry.scene.model.columns) : -1]
    torque = np.hstack([left[:, places[item.label][0]] @ inquiry.just_seen[item.label] for item in others] or [left])
    whole = np.sum(torque**2, axis=0)
    owner = np.repeat(np.arange(len(others)), [inquiry.just_seen[item.label].shape[1] for item in others])
    nearest = np.full(len(others), np.inf)
    for k, item in enumerate(others):
        columns = left[:, places[item.label][1]]
        basis, singular, _ = np.linalg.svd(
            columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300), full_matrices=False
        )
        basis = basis[:, singular > np.sqrt(_RANK)]
        apart = np.clip(whole - np.sum((basis.T @ torque) ** 2, axis=0), 0.0, None)
        # Of more squares than another may leave none is taken for another.
        far = np.divide(apart, (1.0 - criteria.min_share) * whole, out=np.zeros(len(whole)), where=whole > 0.0)
        squares = np.maximum(apart / (2.0 * criteria.alike) ** 2, far)
        inverse = np.divide(1.0, squares, out=np.full(len(whole), np.inf), where=squares > 0.0)
        mean = np.bincount(owner, inverse, len(others)) / np.bincount(owner, minlength=len(others))
        mean[k] = 0.0
        nearest = np.minimum(nearest, np.divide(1.0, np.sqrt(mean), out=np.full(len(others), np.inf), where=mean > 0.0))
    return dict(zip((item.label for item in others), nearest.tolist(), strict=True))


def times_believed(
    model: FittedModel,
    candidates: Sequence[Rows],
    axes: Sequence[Array],
    counts: Sequence[float],
    tried: int,
    criteria: SelectionCriteria = CRITERIA,
    *,
    tested: bool = True,
) -> Array:
    """Return how many times as large as the diagnosis needs it each effect is, shape (g,); below 1 it stays open.

    Parameters
    ----------
    model : FittedModel
        On rows of unit noise, see `Blocks.fitted`.
    candidates : sequence of mapping of int to ndarray, shape (k, N)
        Columns of each on the rows of every joint that it acts on.
    axes : sequence of ndarray, shape (k, r)
        Coefficients that each may have; the mean of the squared sizes needed over them counts.
    counts : sequence of float
        Rows of the joint whose each is.
    tried : int
        Candidates that the diagnosis tries.
    criteria : SelectionCriteria
    tested : bool, optional
        Whether it is followed how many standard errors the test takes with the blocks of the model, in most of the time; else as
        few as with any.
    """
    result = np.zeros(len(candidates))
    seen = [place for place, rows in enumerate(candidates) if rows]
    widths = [len(axes[place]) for place in seen]
    for k in dict.fromkeys(widths):
        group = [place for place, width in zip(seen, widths, strict=True) if width == k]
        found = products_of(model, [candidates[place] for place in group])
        whole = np.sum(found.columns, axis=1)
        outside = np.max(np.diagonal(whole, axis1=1, axis2=2) / np.maximum(found.sizes, np.finfo(float).tiny), axis=1)
        chance = criteria.family_error / tried
        sizes = min_sizes(model, found, chance) if tested else np.full(len(group), surely_needed(k, chance))
        folds = np.array([np.sum(found.columns[:, model.fold == f], axis=1) for f in range(model.folds)])
        costs = _costs(folds, whole - folds)
        for g, place in enumerate(group):
            if outside[g] < criteria.min_outside:
                continue
            each = (folds[:, g], costs[:, g], float(sizes[g]), counts[place], criteria)
            squares = [_needed_square(axis, whole[g], *each) for axis in axes[place].T]
            result[place] = 1.0 / np.sqrt(np.mean(squares))
    return result


def _needed_square(
    value: Array, whole: Array, folds: Array, costs: Array, errors: float, count: float, criteria: SelectionCriteria
) -> float:
    """Return the square of the multiple of a value at which all that is asked of an effect is expected."""
    excited = np.trace(folds, axis1=1, axis2=2)
    voting = excited >= criteria.abstains * np.mean(excited)
    helps, costs = np.einsum("i,fij,j->f", value, folds[voting], value), costs[voting]
    in_all, share = float(value @ whole @ value), criteria.min_gain / (1.0 - criteria.min_gain)
    if in_all <= 0.0:
        return np.inf
    rest = np.sum(helps) - share * (in_all - np.sum(helps))
    gain = (share * count + (1.0 + share) * np.sum(costs)) / rest if rest > 0.0 else np.inf
    least = max(0, int(np.ceil(criteria.min_votes * len(helps))) - 1)
    votes = np.sort(np.divide(costs, helps, out=np.full(len(helps), np.inf), where=helps > 0.0))[least]
    return float(max(errors**2 / in_all, gain, votes))


def _costs(folds: Array, others: Array) -> Array:
    """Return by how much errors of coefficients of the other folds are expected to worsen a fold, shape (f, g)."""
    size = np.sqrt(np.maximum(np.diagonal(others, axis1=2, axis2=3), 0.0))
    size = np.where(size == 0.0, 1.0, size)
    scale = size[..., :, None] * size[..., None, :]
    if folds.shape[-1] == 1:
        inverse = np.divide(1.0, others, out=np.zeros_like(others), where=others > 0.0)
    else:
        inverse = np.linalg.pinv(others / scale, rcond=_RANK, hermitian=True) / scale
    return np.asarray(np.sum(folds * inverse, axis=(2, 3)))
