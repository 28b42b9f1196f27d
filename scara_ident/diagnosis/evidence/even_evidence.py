"""Whether one recording leaves a larger residual than all others, though each residual looks like noise."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.diagnosis.criteria import CRITERIA, SelectionCriteria
from scara_ident.diagnosis.evidence.evidence import Evidence
from scara_ident.estimation import Estimate
from scara_ident.estimation.joint_rows import JointRows
from scara_ident.estimation.noise_bias import noise_torque
from scara_ident.estimation.observations import Observations
from scara_ident.estimation.run_variation import JointVariation

# Of fewer runs one that carries something looks as runs that differ do.
MIN_RUNS = 5


def even_evidence(
    shown: Sequence[Evidence], after: Estimate, training: Observations, criteria: SelectionCriteria = CRITERIA
) -> tuple[Evidence, ...]:
    """Take back that a residual is noise where one recording leaves much more of it than all others do.

    What acts in one recording, such as a load, may be as white as noise, and no repetition shows it. Nothing is taken back
    where without what runs were found to differ by no recording stands out, nor one in what it differs by, nor where
    the repetitions of a motion leave as much, as where noise grows with the motion: what else a motion leaves more of repeats.

    Parameters
    ----------
    training : Observations
        Of the same model.
    """
    if len(training.each) < 2:
        return tuple(shown)
    rows = np.array([[item.rows for item in own.by_joint] for own in training.each])
    squares = np.array(
        [
            [item.rms(after.value) ** 2 * item.rows if item.rows else 0.0 for item in own.by_joint]
            for own in training.each
        ]
    )
    motions = np.array(training.data.labels)
    # Made where it matters only: it takes recordings that are noisier.
    made = cache(lambda place: noise_torque(training.each[place], after.value))
    found = []
    for j, item in enumerate(shown):
        left = _Left(squares[:, j], rows[:, j], motions, partial(_of_joint, made, j))
        loud = left.loudest(criteria)
        if item.shown and loud is not None and _throughout(training, j, after.value, loud[0], criteria):
            place, ratio = loud
            own = after.variation.joints[j] if after.variation is not None else None
            differing = own is not None and _as_runs_differ(own, training.joints[j], after.value, left, criteria)
            if not differing:
                name = training.each[place].name
                why = f"{name} leaves {ratio:.2g} times the error of all others"
                item = replace(item, shown=False, by="", why=why, apart=name)
        found.append(item)
    return tuple(found)


def _throughout(observations: Observations, joint: int, value: Array, place: int, criteria: SelectionCriteria) -> bool:
    """Whether a recording leaves more than all others do in most blocks of time, not in the few of a burst of noise.

    The logarithms of what blocks leave are compared (Welch 1947): bursts raise their variance, and their mean but little.
    """
    from scipy.special import stdtr

    rows = observations.joints[joint]
    squares = rows.by_block(rows.left(value) ** 2)
    filled = (squares > 0.0) & (rows.counts > 0)
    level = np.log(squares[filled] / rows.counts[filled])
    loud = observations.owner[filled] == place
    sides = [level[loud], level[~loud]]
    if min(map(len, sides)) < 2:
        return True
    variances = np.array([np.var(side, ddof=1) / len(side) for side in sides])
    if not np.any(variances):
        return True
    freedom = np.sum(variances) ** 2 / np.sum(variances**2 / [len(side) - 1.0 for side in sides])
    score = (np.mean(sides[0]) - np.mean(sides[1])) / np.sqrt(np.sum(variances))
    return float(stdtr(freedom, -score)) * len(observations.each) < criteria.significant


def _of_joint(made: Callable[[int], Array], joint: int, place: int) -> float:
    return float(made(place)[joint])


@dataclass(frozen=True, eq=False)
class _Left:
    """What each recording leaves of a joint.

    Attributes
    ----------
    squares, rows : ndarray, shape (recordings,)
        Sum of squares, of so many rows.
    motions : ndarray of str, shape (recordings,)
        The same for repetitions of one motion.
    made : callable
        Returns the rms that the noise of the positions makes in a recording.
    """

    squares: Array
    rows: Array
    motions: NDArray[np.str_]
    made: Callable[[int], float]

    def loudest(self, criteria: SelectionCriteria) -> tuple[int, float] | None:
        """Return the recording that leaves most beside all others, and how many times their rms, where that is much more."""
        from scipy.special import fdtrc

        apart = ~np.eye(len(self.rows), dtype=bool)
        ratio, level = self._beside(apart)
        others = apart @ self.rows
        # No more than its own repetitions leave stands out.
        again = apart & (self.motions[:, None] == self.motions)
        repeated = again @ self.rows > 0
        place = int(np.argmax(np.where(repeated, np.minimum(ratio, self._beside(again)[0]), ratio)))
        worse = criteria.worse_held_out**2
        if ratio[place] <= worse or (repeated[place] and self._beside(again)[0][place] <= worse):
            return None
        if len(self.rows) * float(fdtrc(self.rows[place], others[place], ratio[place])) >= criteria.significant:
            return None
        if self.squares[place] / self.rows[place] <= worse * level[place] + self.made(place) ** 2:
            return None
        return place, float(np.sqrt(ratio[place]))

    def _beside(self, others: NDArray[np.bool_]) -> tuple[Array, Array]:
        """Return the mean square of each recording as a ratio to that of others (recordings, recordings), and that; 0 where unknown."""
        rows = others @ self.rows
        level = np.divide(others @ self.squares, rows, out=np.zeros(len(rows)), where=rows > 0)
        known = (self.rows > 0) & (level > 0.0)
        return np.divide(self.squares, self.rows * level, out=np.zeros(len(rows)), where=known), level


def _as_runs_differ(
    item: JointVariation,
    joint: JointRows,
    value: Array,
    recordings: _Left,
    criteria: SelectionCriteria,
) -> bool:
    """Whether no run stands out by what is left without what runs differ by, nor by how far it lies off the others."""
    from scipy.special import fdtrc

    runs = len(item.of_run)
    if runs < MIN_RUNS or item.directions.shape[1] != joint.table.shape[1]:
        return False
    left = joint.left(value)
    rest = left - item.off
    of_run = list(zip(item.bounds[:-1], item.bounds[1:], strict=True))
    before, after = (np.array([np.sum(each[start:stop] ** 2) for start, stop in of_run]) for each in (left, rest))
    share = np.divide(after, before, out=np.ones(runs), where=before > 0.0)
    if replace(recordings, squares=share * recordings.squares).loudest(criteria) is not None:
        return False
    # A run of the same arm lies no further off the others' mean than they do: Student's t of one beside all others.
    off, unsure = item.of_run[:, item.std > 0.0], item.unsure[:, item.std > 0.0]
    count = runs - 1.0
    mean = (np.sum(off, axis=0) - off) / count
    spread = (np.sum(off**2, axis=0) - off**2 - count * mean**2) / (count - 1.0) + np.mean(unsure, axis=0)
    ratio = np.divide((off - mean) ** 2, spread * (1.0 + 1.0 / count), out=np.zeros_like(off), where=spread > 0.0)
    return off.size * float(fdtrc(1.0, count - 1.0, float(np.max(ratio, initial=0.0)))) >= criteria.significant
