"""Which signals a residual depends on: shrunken means over bins, judged on trajectories that they were not taken from."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.diagnosis.criteria import CRITERIA, SelectionCriteria
from scara_ident.diagnosis.testing.lack_of_fit import above_zero, block_length
from scara_ident.estimation.residuals import Residuals
from scara_ident.model.model import TorqueModel
from scara_ident.motion.motion import Motion
from scara_ident.robot.robot import Robot


@dataclass(frozen=True)
class Dependence:
    """How much of a joint's residual signals explain.

    Attributes
    ----------
    joint : str
    signals : tuple of str
        One or two signals.
    explained : float
        Share of the squared residual that they explain on trajectories held out.
    rms : float
        The same as an rms torque, N m or N.
    p_value : float
        That they explain nothing, over all that was tried: Student's t test over blocks of time.
    """

    joint: str
    signals: tuple[str, ...]
    explained: float
    rms: float
    p_value: float


def screen(model: TorqueModel, residuals: Residuals, criteria: SelectionCriteria = CRITERIA) -> tuple[Dependence, ...]:
    """Rank what each joint's residual depends on.

    Parameters
    ----------
    model : TorqueModel
        Any; its robot names the signals.
    residuals : Residuals
    criteria : SelectionCriteria, optional

    Returns
    -------
    tuple of Dependence
        All single signals and pairs of every joint, the most explaining first.
    """
    found: list[Dependence] = []
    pair_bins = criteria.pair_bins
    for j, joint in enumerate(model.robot.joints):
        residual, signals, fold, block = _samples(model.robot, residuals, j, criteria.parts)
        if len(residual) < criteria.min_per_bin * pair_bins**2 or not np.any(residual):
            continue
        total = float(np.mean(residual**2))
        singles = {name: _bins(values, criteria.single_bins) for name, values in signals.items()}
        coarse = {name: _bins(values, pair_bins) for name, values in signals.items()}
        sets: list[tuple[tuple[str, ...], NDArray[np.intp]]] = [((name,), bins) for name, bins in singles.items()]
        sets += [((one, other), coarse[one] * pair_bins + coarse[other]) for one, other in combinations(signals, 2)]
        for names, bins in sets:
            saved = _saved(residual, bins, fold, criteria.shrinkage)
            share = float(np.mean(saved)) / total
            p_value = min(
                1.0, above_zero(np.asarray(np.bincount(block, saved), dtype=float)) * len(sets) * model.robot.n
            )
            found.append(Dependence(joint, names, share, float(np.sqrt(max(share, 0.0) * total)), p_value))
    return tuple(sorted(found, key=lambda item: -item.explained))


def _samples(
    robot: Robot, residuals: Residuals, j: int, only_parts: int
) -> tuple[Array, dict[str, Array], NDArray[np.intp], NDArray[np.intp]]:
    """Residual of a joint within its band at independent times, the signals then, and fold and block of each."""
    data = residuals.data
    trajectories = data.trajectories
    error, signals, fold = [], [], []
    blocks: list[NDArray[np.intp]] = []
    parts = zip(residuals.banded, residuals.predicted, strict=True)
    for label, item in zip(data.labels, data.recordings, strict=True):
        begin = float(item.recording.time[0])
        for part in item.stretches:
            banded, predicted = next(parts)
            places = np.arange(part.trim, part.samples - part.trim, part.steps[j])
            places = places[~part.rest[j][places]]
            error.append(banded[j][places])
            length = block_length(part.rate, data.bands[j])
            blocks.append((places - part.trim) // length + (blocks[-1][-1] + 1 if blocks and len(blocks[-1]) else 0))
            signals.append(_signals(robot, part.motion, predicted[j], j, begin, places))
            fold.append(np.full(len(places), trajectories.index(label)))
    merged = {name: np.concatenate([part[name] for part in signals]) for name in signals[0]}
    residual = np.concatenate(error)
    groups = np.concatenate(fold)
    if len(trajectories) == 1:
        groups = np.arange(len(residual)) * only_parts // max(1, len(residual))
    # Blocks without a sample are none.
    numbers = np.unique(np.concatenate(blocks), return_inverse=True)[1]
    return residual, merged, groups, np.asarray(numbers, dtype=np.intp)


def _signals(
    robot: Robot, motion: Motion, predicted: Array, j: int, begin: float, places: NDArray[np.intp]
) -> dict[str, Array]:
    found: dict[str, Array] = {}
    for i, name in enumerate(robot.joints):
        found[f"position of {name}"] = motion.q[i][places]
        found[f"velocity of {name}"] = motion.v[i][places]
        found[f"acceleration of {name}"] = motion.a[i][places]
    found["predicted torque"] = predicted[places]
    found["time"] = motion.time[places] - begin
    if abs(robot.reduction[j]) != 1.0:
        found["motor angle"] = np.mod(robot.reduction[j] * motion.q[j][places], 2.0 * np.pi)
    return found


def _bins(values: Array, count: int) -> NDArray[np.intp]:
    edges = np.quantile(values, np.linspace(0.0, 1.0, count + 1)[1:-1])
    return np.asarray(np.searchsorted(edges, values), dtype=np.intp)


def _saved(residual: Array, bins: NDArray[np.intp], fold: NDArray[np.intp], shrinkage: float) -> Array:
    """Fall of the squared residual of every sample by the bins' means of the other folds, shape (N,)."""
    size = int(bins.max()) + 1
    folds = int(fold.max()) + 1
    place = fold * size + bins
    count = np.bincount(place, minlength=folds * size).reshape(folds, size)
    total = np.bincount(place, residual, folds * size).reshape(folds, size)
    mean = (total.sum(axis=0) - total) / (count.sum(axis=0) - count + shrinkage)
    return np.asarray(residual**2 - (residual - mean[fold, bins]) ** 2)
