"""The estimate of a model with effects as it is reported, with the uncertainty of everything that was fitted with it.

A fit of columns that are held knows nothing of what nonlinear parameters take up, nor of columns that follow the estimate. The
model that is linear in all of these does, and the parameters of effects come from it: so do all others.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scara_ident.diagnosis.evidence.outcome import Outcome
from scara_ident.diagnosis.fitting.at_estimate import at_estimate
from scara_ident.diagnosis.fitting.effect_parameters import LinearParameters
from scara_ident.diagnosis.testing.selection_step import observed_at_every_sample
from scara_ident.estimation.information import weighted


def with_whole_estimate(outcome: Outcome, linear: LinearParameters) -> Outcome:
    """Return an outcome at the parameters of the whole model.

    Parameters
    ----------
    outcome : Outcome
    linear : LinearParameters
        Of `Search.whole`: what was taken out of the data is last, and no part of the estimate.

    Returns
    -------
    Outcome
        Its columns follow these parameters, so that what it predicts is what they say.
    """
    found, after = outcome.search, outcome.after
    own = slice(len(after.value))
    value, undetermined, training = after.value, after.undetermined, outcome.training
    followed = None
    if found.chosen:
        value, undetermined = linear.value[own], linear.undetermined[own]
        found = replace(found, step=replace(found.step, scene=at_estimate(found.scene, found.chosen, value)))
        training = observed_at_every_sample(found.step)
    covariance = linear.covariance[own, own].copy()
    covariance[np.diag_indices_from(covariance)] = np.where(undetermined, np.inf, np.diag(covariance))
    after = replace(
        after,
        model=training.model,
        value=value,
        covariance=covariance,
        undetermined=undetermined,
        std_kind=linear.std_kind,
        noise_bias=None if linear.noise_bias is None else linear.noise_bias[own],
    )
    if found.chosen:
        rows = weighted(after.rows(training), after.weights)
        followed = value - rows.solve().value
        after = replace(after, followed=followed, information=rows.moved(followed))
    return replace(outcome, search=found, after=after, training=training)
