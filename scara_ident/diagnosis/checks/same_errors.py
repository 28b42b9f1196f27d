"""Whether the residuals of two models differ by no more than chance or position noise."""

from __future__ import annotations

import numpy as np

from scara_ident.diagnosis.checks.noise_check import noise_left
from scara_ident.diagnosis.testing.acceptance import Decision
from scara_ident.diagnosis.testing.moments import moments_of_blocks
from scara_ident.diagnosis.testing.selection_step import SelectionStep

# Differences below this share of the squared residual without an effect are rounding: models with the same span leave
# the same.
ROUNDING = 1e-9


def same(own: tuple[SelectionStep, Decision], other: tuple[SelectionStep, Decision]) -> bool:
    """Whether the errors of two models, each a candidate beside a step, differ by no more than chance or noise makes.

    What either lacks is the same in every repetition of a motion: these count as one.
    """
    worse = np.bincount(moments_of_blocks(own[0])[2], other[1].examination.left - own[1].examination.left)
    difference, least = float(np.sum(worse)), own[0].criteria.alike * float(np.sqrt(len(worse) * np.var(worse)))
    if abs(difference) < max(least, ROUNDING * float(np.sum(own[0].model.squares))):
        return True
    # The noise of the positions is in the columns of one more than in those of the other.
    grown, own_grown = (noise_left(step, decision.candidate) for step, decision in (other, own))
    return abs(difference - grown + own_grown) < least
