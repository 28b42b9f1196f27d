"""Estimating how runs, or parts of them, differ from one another beyond noise.

How far runs lie from one another along each kind of difference is a variance component (Searle, Casella and McCulloch 1992,
"Variance Components"), estimated by restricted maximum likelihood. A component that chance explains is left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.estimation.joint_rows import JointRows
from scara_ident.estimation.observations import Observations
from scara_ident.estimation.run_variation import (
    DELAY,
    KINDS,
    MIN_RUNS,
    OFFSET,
    RANK,
    SCALE,
    JointVariation,
    RunVariation,
    directions_of,
)
from scara_ident.estimation.shared_delays import SharedDelays, shared_delays
from scara_ident.estimation.variance_components import components, differing, expected
from scara_ident.motion.low_pass import noise_share
from scara_ident.recording.pieces import of_one_run
from scara_ident.threads import side_by_side

# Beside delays that joints share reversals and viscous friction are free in every run.
FREE_KINDS = 2


def run_variation(
    observations: Observations,
    joints: Sequence[JointRows],
    value: Array,
    *,
    taken: Array | None = None,
    of_two: bool = False,
) -> RunVariation:
    """Estimate how runs differ.

    Parameters
    ----------
    observations : Observations
        Of the base model.
    joints : sequence of JointRows
        Its rows, with those of further columns.
    value : ndarray, shape (p,)
        Parameters of all these columns.
    taken : ndarray, shape (n,), optional
        How many of the runs' offsets on each joint the parameters take up, see `scara_ident.estimation.run_offsets`; by
        default their mean.
    of_two : bool, optional
        Whether the offsets of two runs are estimated too: by two, other differences may be the parameters'.
    """
    runs = len(observations.data.recordings)
    if runs < (2 if of_two else MIN_RUNS):
        return RunVariation((None,) * len(joints))
    firsts = np.searchsorted(observations.owner, np.arange(runs + 1))
    found = variation_between(observations, joints, value, firsts, taken=taken)
    if not any(item is not None and item.std[DELAY] > 0.0 for item in found.joints):
        return found
    return replace(found, delays=_shared(observations, joints, value, firsts, found))


def variation_between(
    observations: Observations,
    joints: Sequence[JointRows],
    value: Array,
    firsts: NDArray[np.intp],
    known: RunVariation | None = None,
    *,
    taken: Array | None = None,
) -> RunVariation:
    """Estimate how groups of blocks that follow each other differ.

    Parameters
    ----------
    observations, joints, value, taken
        See `run_variation`.
    firsts : ndarray of int, shape (groups + 1,)
        The block with which each group begins, and the number of blocks.
    known : RunVariation, optional
        What runs differ by, which is taken off before.
    """
    # Where blocks are triangular factors, or no samples are kept, the rows are not beside those that directions are made of.
    if not observations.raw or any(rows.sizes is not None for rows in joints):
        return RunVariation((None,) * len(joints))
    # Made once, and not in two threads.
    _ = observations.late(value[: observations.parameters])

    def of_joint(joint: int, rows: JointRows) -> _Sums | None:
        directions = directions_of(observations, joint, rows, value)
        item = None if known is None else known.joints[joint]
        left = rows.left(value) - (0.0 if item is None else item.off)
        found = _sums(directions, left, rows.starts, firsts)
        return None if found is None else replace(found, passed=_passed(observations, joint))

    sums = side_by_side(of_joint, range(len(joints)), joints)
    lost = np.ones(len(joints)) if taken is None else taken
    determined = [(item, off) for item, off in zip(sums, lost, strict=True) if item is not None]
    estimated = iter(_estimated(*zip(*determined, strict=True)) if determined else ())
    found = [None if item is None else next(estimated) for item in sums]
    reaches = [np.inf if band is None else 1.0 / (2.0 * np.pi * band) for band in observations.data.bands]
    pairs = zip(found, reaches, strict=True)
    return RunVariation(tuple(None if item is None else replace(item, reach=reach) for item, reach in pairs))


def _shared(
    observations: Observations, joints: Sequence[JointRows], value: Array, firsts: NDArray[np.intp], found: RunVariation
) -> SharedDelays | None:
    """Return the delays of runs that joints tell together, beside what else runs differ by, free reversals and viscous friction."""
    if not observations.raw or any(rows.sizes is not None for rows in joints):
        return None
    pieces = of_one_run([item.recording for item in observations.data.recordings])
    if not np.any(pieces):
        # One clock, and one delay: what its pieces differ by along it is something else.
        return SharedDelays(np.zeros(len(pieces)), 0.0, 1.0, 0.0)
    late_reversals = observations.late_reversals(value[: observations.parameters])

    def of_joint(joint: int, rows: JointRows) -> _Sums | None:
        # Joints of added rows have those of the model first.
        viscous = np.sum(rows.table[: len(observations.joints[joint].columns)][observations.of_speed(joint, 1)], axis=0)
        directions = np.vstack([directions_of(observations, joint, rows, value), late_reversals[joint], viscous])
        return _sums(directions, rows.left(value), rows.starts, firsts)

    pairs = zip(side_by_side(of_joint, range(len(joints)), joints), found.joints, strict=True)
    determined = [(own, item) for own, item in pairs if own is not None and own.back[DELAY] > 0.0]
    if not determined:
        return None
    kinds = len(KINDS)
    priors = np.zeros((len(determined), kinds + FREE_KINDS))
    for place, (own, item) in enumerate(determined):
        if item is not None:
            priors[place, :kinds] = (item.std / np.where(own.back[:kinds] > 0.0, own.back[:kinds], np.inf)) ** 2
        priors[place, kinds:] = np.where(own.back[kinds:] > 0.0, np.inf, 0.0)
    rms = np.array([np.sqrt(np.mean(own.directions**2, axis=1)) for own, _ in determined])
    return shared_delays(
        np.array([own.products for own, _ in determined]),
        np.array([own.aims for own, _ in determined]),
        priors,
        np.array([own.back[DELAY] for own, _ in determined]),
        DELAY,
        rms[:, DELAY] / np.maximum(rms[:, SCALE], np.finfo(float).tiny),
        pieces,
    )


@dataclass(frozen=True, eq=False)
class _Sums:
    """Of one joint, in units of the noise of one row: what its runs say of differences along each direction.

    Attributes
    ----------
    directions : ndarray, shape (kinds, N)
    products : ndarray, shape (runs, kinds, kinds)
    aims : ndarray, shape (runs, kinds)
    back : ndarray, shape (kinds,)
        The unit of each direction; 0 where a kind does nothing.
    memory : float
        See `JointVariation.memory`.
    bounds : ndarray of int, shape (runs + 1,)
    passed : float
        How many rows stand for an independent one where the noise is white before the low-pass: a sum of them is so much less sure.
    """

    directions: Array
    products: Array
    aims: Array
    back: Array
    noise: float
    memory: float
    bounds: NDArray[np.intp]
    passed: float = 1.0


def _passed(observations: Observations, joint: int) -> float:
    """Return the density of low-passed white noise below the band over that of as strong noise which its rows do not remember."""
    parts = [part for part in observations.data.stretches if part.usable]
    rows = np.array([len(part.kept[joint]) for part in parts], dtype=float)
    over = [1.0 / (part.steps[joint] * noise_share(part.rate, part.bands[joint])) for part in parts]
    return max(1.0, float(rows @ over / np.sum(rows))) if np.any(rows) else 1.0


def _sums(directions: Array, left: Array, starts: NDArray[np.intp], firsts: NDArray[np.intp]) -> _Sums | None:
    bounds = starts[firsts]
    runs, kinds = len(bounds) - 1, len(directions)
    size = np.sqrt(np.sum(directions**2, axis=1) / runs)
    shown = size > 0.0
    if not np.any(shown) or not np.any(left):
        return None
    found, by_residual, noise, spread = _of_runs(directions[shown] / size[shown, None], left, starts, firsts)
    if noise == 0.0:
        return None
    # The memory of the noise makes directions less sure than white noise would.
    scale = 1.0 / np.sqrt(spread)
    products, aims, back = np.zeros((runs, kinds, kinds)), np.zeros((runs, kinds)), np.zeros(kinds)
    products[:, np.outer(shown, shown)] = (found * np.outer(scale, scale)).reshape(runs, -1)
    aims[:, shown] = by_residual * scale / noise
    back[shown] = scale * noise / size[shown]
    memory = float(spread[np.count_nonzero(shown[:OFFSET])]) if shown[OFFSET] else 1.0
    return _Sums(directions, products, aims, back, noise, memory, bounds)


def _estimated(joints: Sequence[_Sums], taken: Sequence[float]) -> list[JointVariation | None]:
    """Return how runs differ on each of some joints, of which parameters take up so many offsets."""
    products, aims = np.array([item.products for item in joints]), np.array([item.aims for item in joints])
    runs = aims.shape[1]
    determined = np.array([item.back > 0.0 for item in joints])
    if runs < MIN_RUNS:
        determined &= np.arange(len(KINDS)) == OFFSET
    # Parameters are fitted to all runs, so that these lie about their own mean.
    draws = np.full(determined.shape, runs - 1.0)
    draws[:, OFFSET] = np.clip(runs - np.array(taken), 1.0, runs - 1.0)
    # What chance explains is asked with as many rows as are independent; what it does not is as large as runs lie apart.
    passed = np.array([item.passed for item in joints])[:, None, None]
    differ = differing(products / passed[..., None], aims / passed, determined, draws)
    variances = components(products, aims, differ, draws)
    means, unsure = expected(products, aims, variances)
    return [
        JointVariation(
            item.directions,
            np.sqrt(variance) * item.back,
            mean * item.back,
            item.noise,
            item.bounds,
            spread * item.back**2,
            item.memory,
            draws=float(own[OFFSET]),
        )
        if np.any(variance)
        else None
        for item, variance, mean, spread, own in zip(joints, variances, means, unsure, draws, strict=True)
    ]


def _of_runs(
    unit: Array, left: Array, starts: NDArray[np.intp], firsts: NDArray[np.intp]
) -> tuple[Array, Array, float, Array]:
    """Return per run products of directions and with the residual, the noise of a row, and its spread by its memory."""
    products, aims = [], []
    bounds = starts[firsts]
    squares = rows = 0.0
    scatter, white = np.zeros(len(unit)), np.zeros(len(unit))
    for run, (start, stop) in enumerate(zip(bounds[:-1], bounds[1:], strict=True)):
        own, rest = unit[:, start:stop], left[start:stop]
        product, aim = own @ own.T, own @ rest
        products.append(product)
        aims.append(aim)
        rest = rest - np.linalg.lstsq(product, aim, rcond=RANK)[0] @ own
        squares += float(rest @ rest)
        rows += max(0.0, stop - start - len(unit))
        blocks = starts[firsts[run] : firsts[run + 1] + 1]
        # Blocks without rows have no score.
        begins = blocks[:-1][np.diff(blocks) > 0] - start
        if len(begins):
            scatter += np.sum(np.add.reduceat(own * rest, begins, axis=1) ** 2, axis=1)
        white += np.diag(product)
    variance = squares / rows if rows else 0.0
    spread = np.maximum(1.0, scatter / np.maximum(variance * white, np.finfo(float).tiny))
    return np.array(products), np.array(aims), float(np.sqrt(variance)), spread
