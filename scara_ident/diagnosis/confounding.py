"""Effects that these recordings cannot tell apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scara_ident.diagnosis.bank import Candidate, stack, with_candidates
from scara_ident.diagnosis.decision import Decision, decide
from scara_ident.diagnosis.examination import examine, left_over
from scara_ident.diagnosis.search import Search, refine
from scara_ident.evidence import gather_all

Array = NDArray[np.float64]

# Two effects cannot be told apart when their errors differ by less than this many standard errors, and the
# other removes at least this share of what the effect found removes.
STANDARD_ERRORS = 2.0
LEAST_SHARE = 0.8


@dataclass(frozen=True)
class Rival:
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


def rivals(result: Search, weights: Array) -> list[tuple[Rival, ...]]:
    """Return for each effect that stayed those that these recordings cannot tell from it.

    Parameters
    ----------
    result : Search
    weights : ndarray, shape (n,)

    Returns
    -------
    list of tuple of Rival
    """
    best: dict[str, Decision] = {}
    for decision in result.decisions:
        held = best.get(decision.label)
        if held is None or decision.examination.gain > held.examination.gain:
            best[decision.label] = decision
    others = {label: item.candidate for label, item in best.items()}
    return [
        _rivals_of(result, weights, list(result.chosen[:k] + result.chosen[k + 1 :]), found, others)
        for k, found in enumerate(result.chosen)
    ]


def _rivals_of(
    result: Search, weights: Array, rest: list[Candidate], found: Candidate, others: dict[str, Candidate]
) -> tuple[Rival, ...]:
    scene = result.scene
    # All scan points of the others: without the effect found, another point may be the best.
    pool = [decision.candidate for decision in result.decisions]
    candidates = [found, *pool]
    extended, bank = with_candidates(scene, [*rest, *candidates])
    rows = stack(gather_all(extended, result.recordings, result.bands), weights)
    base = len(scene.model.columns)
    groups = [list(range(base + place.start, base + place.stop)) for place in bank.places]
    fixed = [*range(base), *(k for group in groups[: len(rest)] for k in group)]
    tested = groups[len(rest) :]
    examined = examine(rows, fixed, tested)
    judged = [decide(item, result_, scene, result.tried) for item, result_ in zip(candidates, examined, strict=True)]
    own = judged[0]
    reference = left_over(rows, fixed, tested[0])
    best: dict[str, tuple[Decision, list[int]]] = {}
    for decision, group in zip(judged[1:], tested[1:], strict=True):
        held = best.get(decision.label)
        if decision.accepted and (held is None or decision.examination.gain > held[0].examination.gain):
            best[decision.label] = (decision, group)
    near = {label: item for label, item in best.items() if item[0].gain > 0.5 * LEAST_SHARE * own.gain}
    refined = refine(
        scene, result.recordings, result.bands, weights, rest, [item[0] for item in near.values()], result.tried
    )
    found_rivals = []
    for (label, (_, group)), decision in zip(near.items(), refined, strict=True):
        worse = left_over(rows, fixed, group) - reference
        error = float(np.sqrt(len(worse) * np.var(worse)))
        alike = decision.gain >= LEAST_SHARE * own.gain and abs(float(np.sum(worse))) < STANDARD_ERRORS * error
        if alike or decision.gain >= own.gain:
            found_rivals.append(
                Rival(label, decision.candidate.effect.name, decision.candidate.joint(scene), decision.gain, own.gain)
            )
    return tuple(sorted(found_rivals, key=lambda rival: -rival.gain))


def names(groups: Sequence[Rival]) -> list[str]:
    """Return the names of effects in a group, each once."""
    return list(dict.fromkeys(rival.effect for rival in groups))
