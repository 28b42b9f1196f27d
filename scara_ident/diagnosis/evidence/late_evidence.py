"""Whether torque is late in all runs alike: a delay that the model lacks counts as variation between runs, and is none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from scara_ident.diagnosis.criteria import CRITERIA, SelectionCriteria
from scara_ident.diagnosis.evidence.evidence import Evidence
from scara_ident.estimation import Estimate
from scara_ident.estimation.observations import Observations
from scara_ident.estimation.run_variation import KINDS, late_alike, late_words


def late_evidence(
    shown: Sequence[Evidence], after: Estimate, training: Observations, criteria: SelectionCriteria = CRITERIA
) -> tuple[Evidence, ...]:
    """Take back that a residual is noise on joints that lag, or lead, by more than a sample in all runs alike.

    Parameters
    ----------
    shown : sequence of Evidence
        By joint.
    after : Estimate
        With what runs differ by.
    training : Observations
        Of the training recordings, with the effects found.
    criteria : SelectionCriteria, optional
        A delay that makes less than ``min_gain`` of the squared residual is let pass, as it is as an effect.
    """
    if after.variation is None:
        return tuple(shown)
    # A sample more or less is how torque is sampled.
    period = max((1.0 / part.rate for part in training.data.stretches), default=np.inf)
    found = []
    for item, own, rows in zip(shown, after.variation.joints, training.joints, strict=True):
        late = 0.0 if own is None else late_alike(own)
        if item.shown and own is not None and abs(late) > period:
            made = float(np.sum((late * own.directions[KINDS.index("delay")]) ** 2))
            rest = float(np.sum((rows.left(after.value) - own.off) ** 2))
            if made > criteria.min_gain * (made + rest):
                why = f"it {late_words(own, late)} in all runs, and no effect in the model explains that"
                item = replace(item, shown=False, by="", why=why)
        found.append(item)
    return tuple(found)
