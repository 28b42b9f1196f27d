"""Effects worth a look that are not believed, and what would settle them."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from scara_ident.diagnosis.acceptance import Decision
from scara_ident.diagnosis.noise_check import BY_NOISE
from scara_ident.diagnosis.search import Search
from scara_ident.diagnosis.selection_step import best_of_each

# Of more than this many, the most gaining first, nobody reads the rest; nothing is decided by it.
MOST = 6
# What settles an effect that noise may make: the motion that shows it best shows as much of that.
LESS_NOISE = "record positions with less noise: a finer encoder, time stamps with all their digits"


@dataclass(frozen=True)
class TentativeEffect:
    """An effect that is not in the model.

    Attributes
    ----------
    why : str
        Why it is not believed.
    settled_by : str
        What to record.
    gain : float
        Share of the squared residual of its joints that it would remove on data that it was not fitted to.
    p_value : float
        Corrected for the candidates tried.
    decision : Decision or None
        With its member and coefficients, where it was judged.
    """

    effect: str
    joint: str | None
    description: str
    why: str
    settled_by: str
    gain: float
    p_value: float
    decision: Decision | None = None


def tentative_effects(
    found: Search, demoted: Sequence[Decision], believed: Collection[tuple[str, str | None]]
) -> tuple[TentativeEffect, ...]:
    """Return the effects that an arm could have and that these recordings do not settle, the most gaining first.

    Parameters
    ----------
    demoted : sequence of Decision
        On effects that were let in and did not stay.
    believed : collection of (str, str or None)
        Name and joint of the effects in the model, which are not listed again.
    """
    scene = found.scene
    # Scan points of an effect that was refined and refused must not bring it back.
    tried = {item.label: item for item in demoted}
    best = [item for item in best_of_each(found.decisions).values() if item.tentative and item.label not in tried]
    best += tried.values()
    result = []
    for decision in sorted(best, key=lambda item: -item.gain):
        candidate = decision.candidate
        name, joint = candidate.effect.name, candidate.joint(scene)
        if (name, joint) not in believed:
            p_value = min(1.0, decision.examination.p_value * found.tried)
            words = candidate.effect.description(scene, candidate.member)
            settled = LESS_NOISE if decision.why.startswith(BY_NOISE) else candidate.effect.experiment
            result.append(TentativeEffect(name, joint, words, decision.why, settled, decision.gain, p_value, decision))
    return tuple(result[:MOST])
