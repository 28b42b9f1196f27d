"""Estimators: observations in, estimate out; one function and one file each."""

from scara_ident.estimation.consistent.estimator import (
    ConsistentEstimate,
    ConsistentOptions,
    consistent,
    links,
    physical_consistency,
)
from scara_ident.estimation.estimate import Estimate, JointError
from scara_ident.estimation.least_squares import ols, wls
from scara_ident.estimation.recursive import History, rls

__all__ = [
    "ConsistentEstimate",
    "ConsistentOptions",
    "Estimate",
    "History",
    "JointError",
    "consistent",
    "links",
    "ols",
    "physical_consistency",
    "rls",
    "wls",
]
