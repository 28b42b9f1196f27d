"""Is anything missing? The part of the residual that repeats, against the part that does not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scara_ident.model.model import TorqueModel
from scara_ident.motion.motion import stretches
from scara_ident.motion.prepared import rows_of, trim_of
from scara_ident.motion.repeatability import LARGEST_SHIFT, alignment
from scara_ident.recording.recording import Recording

Array = NDArray[np.float64]


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
    p_value : float
        That nothing repeats; F test with the band's degrees of freedom.
    by_trajectory : tuple of (str, float)
        The missing rms trajectory by trajectory.
    """

    joint: str
    noise: float
    missing: float
    p_value: float
    by_trajectory: tuple[tuple[str, float], ...]


def lack_of_fit(
    model: TorqueModel, value: Array, recordings: Sequence[Recording], bands: Sequence[float | None]
) -> tuple[LackOfFit, ...]:
    """Test each joint for lack of fit.

    Repetitions of a trajectory are aligned in time. The residual's mean over R repetitions holds what repeats and
    1/R of the noise; its scatter about the mean is the noise. A residual low-passed at f over T seconds has about
    2 f T independent values, which are the degrees of freedom.

    Parameters
    ----------
    model : TorqueModel
    value : ndarray, shape (p,)
        Its parameters.
    recordings : sequence of Recording
    bands : sequence of float or None, one per joint

    Returns
    -------
    tuple of LackOfFit
        One per joint; empty without repetitions.
    """
    from scipy.special import fdtrc

    groups: dict[str, list[tuple[Array, NDArray[np.bool_], float]]] = {}
    for trajectory, repetitions in _repetitions(recordings).items():
        aligned = _aligned_residuals(model, value, repetitions, bands)
        if aligned is not None:
            groups[trajectory] = aligned
    if not groups:
        return ()
    found = []
    for j, joint in enumerate(model.robot.joints):
        repeating = scatter = freedom = noise_freedom = samples = excess = 0.0
        by_trajectory = []
        for trajectory, aligned in groups.items():
            used = np.all([mask[j] for _, mask, _ in aligned], axis=0)
            if not np.any(used):
                continue
            residual = np.array([series[j][used] for series, _, _ in aligned])
            count, rate = len(residual), aligned[0][2]
            mean = residual.mean(axis=0)
            pure = float(np.mean(np.var(residual, axis=0, ddof=1)))
            band = bands[j]
            independent = residual.shape[1] * (1.0 if band is None else min(1.0, 2.0 * band / rate))
            size = residual.shape[1]
            missing = float(np.mean(mean**2)) - pure / count
            by_trajectory.append((trajectory, float(np.sqrt(max(missing, 0.0)))))
            repeating += count * float(np.mean(mean**2)) * independent
            scatter += pure * independent * (count - 1)
            freedom += independent
            noise_freedom += independent * (count - 1)
            samples += size
            excess += missing * size
        if not samples or scatter == 0.0:
            continue
        ratio = (repeating / freedom) / (scatter / noise_freedom)
        found.append(
            LackOfFit(
                joint,
                float(np.sqrt(scatter / noise_freedom)),
                float(np.sqrt(max(excess / samples, 0.0))),
                float(fdtrc(freedom, noise_freedom, ratio)),
                tuple(by_trajectory),
            )
        )
    return tuple(found)


def _repetitions(recordings: Sequence[Recording]) -> dict[str, list[Recording]]:
    groups: dict[str, list[Recording]] = {}
    for recording in recordings:
        groups.setdefault(recording.trajectory, []).append(recording)
    return {trajectory: group for trajectory, group in groups.items() if len(group) > 1}


def _aligned_residuals(
    model: TorqueModel, value: Array, group: Sequence[Recording], bands: Sequence[float | None]
) -> list[tuple[Array, NDArray[np.bool_], float]] | None:
    parts = [max(stretches(recording), key=lambda part: len(part.time)) for recording in group]
    first = parts[0]
    aligned = []
    for part in parts:
        shift = 0
        if part is not first:
            if abs(part.rate / first.rate - 1.0) > 1e-3:
                continue
            found = alignment(first.position, part.position, round(LARGEST_SHIFT * first.rate))
            if found is None:
                continue
            shift = found
        rows = rows_of(model, part, bands)
        residual = np.array([banded[-1] - value @ banded[:-1] for banded in rows.banded])
        used = ~rows.rest
        trim = trim_of(part, bands)
        used[:, :trim] = used[:, -trim:] = False
        aligned.append((np.roll(residual, shift, axis=1), _rolled(used, shift), part.rate))
    length = min(series.shape[1] for series, _, _ in aligned)
    cut = [(series[:, :length], used[:, :length], rate) for series, used, rate in aligned]
    return cut if len(cut) > 1 else None


def _rolled(used: NDArray[np.bool_], shift: int) -> NDArray[np.bool_]:
    moved = np.roll(used, shift, axis=1)
    if shift > 0:
        moved[:, :shift] = False
    elif shift < 0:
        moved[:, shift:] = False
    return moved
