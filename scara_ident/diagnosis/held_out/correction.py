"""The correction of a held-out recording where each recording has its own: estimated on its first part."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scara_ident.diagnosis.candidates.candidates import Candidate, CandidateColumns, columns_at_hand
from scara_ident.diagnosis.fitting.correction import MAX_CORRECTIONS, Correction, corrected
from scara_ident.diagnosis.selection.search import Search
from scara_ident.effects import Scene
from scara_ident.estimation import Estimate
from scara_ident.estimation.observations import Observations, observe
from scara_ident.estimation.run_variation import DELAY
from scara_ident.motion.prepared import PreparedData

# Median of the square of a standard normal variable.
MEDIAN_SQUARE = 0.455


def own_correction(
    found: Search, after: Estimate, training: PreparedData, heads: PreparedData, scene: Scene, names: tuple[str, ...]
) -> tuple[Correction, list[str]]:
    """Return what each held-out recording says is to be taken out of it, and that in words.

    It is drawn towards the mean of the training recordings as far as first parts of these say other than the whole of them
    (Efron and Morris 1975). One that says nothing is taken for that mean.

    Parameters
    ----------
    found : Search
        With a correction of which each recording has its own.
    after : Estimate
        Of the model with the effects found.
    training, heads : PreparedData
        First parts of those recordings that are long enough, fitted and held out.
    scene : Scene
        That knows when they began.
    names : tuple of str
        Of all that are held out.
    """
    assert found.correction is not None
    candidate, column = found.correction.candidate, found.correction.candidate.effect.coefficients[0]
    mean, apart = float(np.mean(found.correction.value)), float(np.var(found.correction.value, ddof=1))

    def corrections_of(data: PreparedData) -> dict[str, tuple[float, float]]:
        each = observe(found.base, data).each if data.recordings else ()
        return {one.name: _fitted_alone(found, candidate, one, scene, after) for one in each}

    known = corrections_of(training)
    off = np.array([value - found.correction.of(name)[0] for name, (value, _) in known.items()])
    # Of a normal distribution the median square is this share of the mean; what happened in one of them does not count.
    wrong = float(np.median(off**2)) / MEDIAN_SQUARE if len(off) else np.inf

    def drawn(determined: float, variance: float) -> float:
        return mean + (apart / (apart + max(wrong, variance)) * (determined - mean) if apart > 0.0 else 0.0)

    own = {name: drawn(*determined) for name, determined in corrections_of(heads).items()}
    value = np.array([own.get(name, mean) for name in names])
    notes = [
        f"{name}: {column.name} {x:.3g} {column.unit} by its first third"
        if name in own
        else f"{name}: its first third is too short to determine its {column.name}; the mean of the others is used"
        for name, x in zip(names, value, strict=True)
    ]
    return Correction(candidate, value, names), notes


def _fitted_alone(
    found: Search, candidate: Candidate, one: Observations, scene: Scene, after: Estimate
) -> tuple[float, float]:
    """Return the coefficient that leaves the least of one recording once it is taken out, all parameters held, and its variance.

    What runs differ by besides is noise. All joints tell the same of one recording: what errors of the parameters make each tell
    is how unsure that is (DerSimonian and Laird 1986).
    """
    here, rows, data = replace(scene, columns=columns_at_hand(one)), CandidateColumns(one), one.data
    # In a scene of this recording alone there is one column.
    (late,) = rows.rows(replace(here, start={one.name: scene.start[one.name]}), [candidate])
    others = rows.rows(here, found.chosen)
    stop = np.cumsum([one.parameters, *(len(next(iter(item.values()))) for item in others)])
    differing = None if after.variation is None else after.variation.without(DELAY).on(one, after.value)
    whole, last = 0.0, np.inf
    aims, sizes = np.zeros(len(late)), np.zeros(len(late))
    for _ in range(MAX_CORRECTIONS):
        for place, (joint, (column,)) in enumerate(late.items()):
            left = one.joints[joint].left(after.value)
            for item, a, b in zip(others, stop[:-1], stop[1:], strict=True):
                if joint in item:
                    left = left - after.value[a:b] @ item[joint]
            both = after.weights[joint] * np.array([column, left])
            own, rest = both if differing is None else differing.whitened(joint, both)
            aims[place], sizes[place] = own @ rest, own @ own
        if not np.any(sizes):
            return whole, np.inf
        more = float(np.sum(aims) / np.sum(sizes))
        if abs(more) >= last or candidate.effect.settled(np.array([more])):
            break
        whole, last = whole + more, abs(more)
        one = one.with_torque(corrected(data, Correction(candidate, np.array([whole]), (one.name,))))
    determined = sizes > 0.0
    apart = float(np.sum((aims[determined] - more * sizes[determined]) ** 2 / sizes[determined]))
    scatter = max(1.0, apart / (np.count_nonzero(determined) - 1)) if np.count_nonzero(determined) > 1 else 1.0
    return whole, scatter / float(np.sum(sizes))
