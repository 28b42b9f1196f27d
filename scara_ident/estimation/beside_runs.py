"""Parameters and what runs differ by, fitted together."""

from __future__ import annotations

from dataclasses import replace

from scara_ident.arrays import Array
from scara_ident.estimation.estimate import Estimate
from scara_ident.estimation.least_squares import told_value_and_weights
from scara_ident.estimation.observations import Observations
from scara_ident.estimation.run_variation import RunVariation, run_variation


def beside_runs(estimate: Estimate, observations: Observations) -> Estimate:
    """Return an estimate with the value that fits beside what runs differ by, and with what they differ by beside that.

    Least squares takes some of the runs' offsets for gravity, another share in each trajectory: what is left would repeat, and
    seem to differ in friction and scale. Generalised least squares, with the differences estimated again from what it leaves
    (Aitken 1936), takes it back. Nothing else of the estimate changes, as its covariance has the differences already.

    Parameters
    ----------
    estimate : Estimate
        Of these observations.
    observations : Observations
    """
    if not estimate.variation:
        return estimate
    value = _value(observations, estimate.variation)
    again = run_variation(observations, observations.joints, value)
    if not again:
        return replace(estimate, value=value)
    return replace(estimate, value=_value(observations, again), variation=again)


def _value(observations: Observations, variation: RunVariation) -> Array:
    joints = [
        replace(rows, table=variation.whitened(joint, rows.table)) for joint, rows in enumerate(observations.joints)
    ]
    return told_value_and_weights(replace(observations, joints=tuple(joints)))[0]
