"""Effects that these recordings cannot tell apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scara_ident.diagnosis.candidate_tests import left_over
from scara_ident.diagnosis.candidates import Candidate
from scara_ident.diagnosis.search import Beside, Search, best_of_each, refine
from scara_ident.diagnosis.table import Table, tabulate, tabulate_candidates

Array = NDArray[np.float64]

# Two effects cannot be told apart when their errors differ by less than this many standard errors, and the
# other removes at least this share of what the effect found removes.
STANDARD_ERRORS = 2.0
LEAST_SHARE = 0.8


@dataclass(frozen=True)
class Confounder:
    """An effect that would do nearly as well as one that was found.

    Attributes
    ----------
    label, effect : str
    joint : str or None
    gain : float
        Share of the squared residual that it removes in the place of the effect found.
    found_gain : float
        What the effect found removes.
    """

    label: str
    effect: str
    joint: str | None
    gain: float
    found_gain: float


def confounders(result: Search, weights: Array) -> list[tuple[Confounder, ...]]:
    """Return for each effect that stayed those that these recordings cannot tell from it.

    Parameters
    ----------
    result : Search
    weights : ndarray, shape (n,)

    Returns
    -------
    list of tuple of Confounder
    """
    table = tabulate(result.base, result.recordings, result.bands)
    pool = [decision.candidate for decision in result.decisions]
    columns, places = tabulate_candidates(result.scene, [*result.chosen, *pool], result.recordings, result.bands)
    count = len(result.chosen)
    return [
        _confounders_of(result, weights, table, columns, places[:count], places[count:], k, pool) for k in range(count)
    ]


def _confounders_of(
    result: Search,
    weights: Array,
    table: Table,
    columns: Array,
    chosen: Sequence[slice],
    others: Sequence[slice],
    found: int,
    pool: Sequence[Candidate],
) -> tuple[Confounder, ...]:
    scene = result.scene
    rest = [columns[:, place] for k, place in enumerate(chosen) if k != found]
    beside = Beside(
        scene,
        result.recordings,
        result.bands,
        table.beside(np.hstack([table.columns[:, :0], *rest])),
        weights,
        result.tried,
    )
    own = beside.judge([result.chosen[found]], columns, [chosen[found]])[0]
    judged = beside.judge(pool, columns, others)
    near = [
        item for item in best_of_each(judged).values() if item.accepted and item.gain > 0.5 * LEAST_SHARE * own.gain
    ]
    refined = refine(beside, near)
    rows = [_left_over(beside, item.candidate) for item in (own, *refined)]
    found_confounders = []
    for decision, left in zip(refined, rows[1:], strict=True):
        worse = left - rows[0]
        error = float(np.sqrt(len(worse) * np.var(worse)))
        alike = decision.gain >= LEAST_SHARE * own.gain and abs(float(np.sum(worse))) < STANDARD_ERRORS * error
        if decision.accepted and (alike or decision.gain >= own.gain):
            found_confounders.append(
                Confounder(
                    decision.label,
                    decision.candidate.effect.name,
                    decision.candidate.joint(scene),
                    decision.gain,
                    own.gain,
                )
            )
    return tuple(sorted(found_confounders, key=lambda confounder: -confounder.gain))


def _left_over(beside: Beside, candidate: Candidate) -> Array:
    """Squared residual of every block with a candidate in the model."""
    columns, _ = tabulate_candidates(beside.scene, [candidate], beside.recordings, beside.bands)
    rows = beside.table.beside(columns).weighted(beside.weights)
    return left_over(rows)
