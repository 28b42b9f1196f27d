"""Lack of fit: the part of the residual that repeats, against the part that does not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.estimation.residuals import Residuals
from scara_ident.motion.prepared import PreparedStretch
from scara_ident.motion.sampling import BLOCK_PERIODS, BLOCK_SECONDS
from scara_ident.motion.trajectories import LARGEST_SHIFT, SAME_RATE, alignment

# Residual of every joint, where it was used, and samples per second.
Aligned = tuple[Array, NDArray[np.bool_], float]

# Of what may repeat at the most.
CONFIDENCE = 0.95


@dataclass(frozen=True)
class LackOfFit:
    """Lack of fit of one joint, from repetitions.

    Attributes
    ----------
    joint : str
    noise : float
        What does not repeat: pure error within the band, N m or N.
    missing : float
        What repeats and the model lacks, rms within the band; 0 where it is below what noise alone would give.
    max_missing : float
        What may repeat at the most, with 95 % confidence.
    p_value : float
        That nothing repeats: the larger of an F test with the band's degrees of freedom and of Student's t test that
        it repeats in blocks of time, which a single moment does not pass.
    by_trajectory : tuple of (str, float)
        The missing rms trajectory by trajectory.
    """

    joint: str
    noise: float
    missing: float
    max_missing: float
    p_value: float
    by_trajectory: tuple[tuple[str, float], ...]


def lack_of_fit(residuals: Residuals) -> tuple[LackOfFit, ...]:
    """Test each joint for lack of fit.

    Repetitions of a trajectory are aligned in time. The residual's mean over R repetitions holds what repeats and
    1/R of the noise; its scatter about the mean is the noise. A residual low-passed at f over T seconds has about
    2 f T independent values, which are the degrees of freedom.

    Returns
    -------
    tuple of LackOfFit
        One per joint; empty without repetitions.
    """
    groups: dict[str, list[tuple[PreparedStretch, Array]]] = {}
    banded = iter(residuals.banded)
    for label, item in zip(residuals.data.labels, residuals.data.recordings, strict=True):
        parts = [(part, next(banded)) for part in item.stretches]
        groups.setdefault(label, []).append(max(parts, key=lambda pair: pair[0].samples))
    aligned = {name: _aligned(group) for name, group in groups.items() if len(group) > 1}
    repeated = {name: group for name, group in aligned.items() if len(group) > 1}
    joints = residuals.data.recordings[0].recording.joints if repeated else ()
    found = (_of_joint(j, joint, repeated, residuals.data.bands[j]) for j, joint in enumerate(joints))
    return tuple(item for item in found if item is not None)


def _of_joint(j: int, joint: str, groups: dict[str, list[Aligned]], band: float | None) -> LackOfFit | None:
    from scipy.special import fdtrc, fdtri

    repeating = scatter = freedom = noise_freedom = samples = excess = 0.0
    by_trajectory = []
    excesses: list[Array] = []
    for trajectory, aligned in groups.items():
        used = np.all([mask[j] for _, mask, _ in aligned], axis=0)
        if not np.any(used):
            continue
        residual = np.array([series[j][used] for series, _, _ in aligned])
        count, size = residual.shape
        mean = residual.mean(axis=0)
        pure = float(np.mean(np.var(residual, axis=0, ddof=1)))
        independent = size * (1.0 if band is None else min(1.0, 2.0 * band / aligned[0][2]))
        missing = float(np.mean(mean**2)) - pure / count
        by_trajectory.append((trajectory, float(np.sqrt(max(missing, 0.0)))))
        repeating += count * float(np.mean(mean**2)) * independent
        scatter += pure * independent * (count - 1)
        freedom += independent
        noise_freedom += independent * (count - 1)
        samples += size
        excess += missing * size
        length = block_length(aligned[0][2], band)
        each = np.arange(size) // length
        part = np.bincount(each, mean**2 - np.var(residual, axis=0, ddof=1) / count)
        excesses.append(np.asarray(part[np.bincount(each) > length // 2], dtype=float))
    if not samples or scatter == 0.0:
        return None
    ratio = (repeating / freedom) / (scatter / noise_freedom)
    # Means over repetitions have that much of the noise's variance less.
    repetitions = 1.0 + noise_freedom / freedom
    most = (ratio / float(fdtri(freedom, noise_freedom, 1.0 - CONFIDENCE)) - 1.0) / repetitions
    return LackOfFit(
        joint,
        float(np.sqrt(scatter / noise_freedom)),
        float(np.sqrt(max(excess / samples, 0.0))),
        float(np.sqrt(max(most, 0.0) * scatter / noise_freedom)),
        max(float(fdtrc(freedom, noise_freedom, ratio)), above_zero(np.concatenate(excesses))),
        tuple(by_trajectory),
    )


def block_length(rate: float, band: float | None) -> int:
    """Return the samples of a block of time that is long against the memory of a band."""
    periods = 0.0 if band is None else BLOCK_PERIODS / band
    return max(1, int(rate * max(BLOCK_SECONDS, periods)))


def above_zero(values: Array) -> float:
    """Return the p-value of Student's t test that the mean of independent values, shape (N,), is above zero."""
    from scipy.special import stdtr

    if len(values) < 2:
        return 1.0
    error = float(np.std(values, ddof=1)) / np.sqrt(len(values))
    mean = float(np.mean(values))
    if error == 0.0:
        return 0.0 if mean > 0.0 else 1.0
    return float(stdtr(len(values) - 1, -mean / error))


def _aligned(group: Sequence[tuple[PreparedStretch, Array]]) -> list[Aligned]:
    """Return the repetitions of the first run's motion, moved onto it."""
    first = group[0][0]
    found = []
    for part, residual in group:
        shift: int | None = 0
        if part is not first and abs(part.rate / first.rate - 1.0) > SAME_RATE:
            continue
        if part is not first:
            shift = alignment(first.stretch.position, part.stretch.position, round(LARGEST_SHIFT * first.rate))
        if shift is None:
            continue
        found.append((np.roll(residual, shift, axis=1), _rolled(part.used, shift), part.rate))
    length = min(series.shape[1] for series, _, _ in found)
    return [(series[:, :length], used[:, :length], rate) for series, used, rate in found]


def _rolled(used: NDArray[np.bool_], shift: int) -> NDArray[np.bool_]:
    moved = np.roll(used, shift, axis=1)
    if shift > 0:
        moved[:, :shift] = False
    elif shift < 0:
        moved[:, shift:] = False
    return moved
