"""Estimators: evidence in, estimate out; one function and one file each."""

from scara_ident.estimators.consistent import ConsistentEstimate, ConsistentOptions, consistent, links, possibility
from scara_ident.estimators.estimate import Estimate, JointError
from scara_ident.estimators.least_squares import ols, wls
from scara_ident.estimators.recursive import History, rls

__all__ = [
    "ConsistentEstimate",
    "ConsistentOptions",
    "Estimate",
    "History",
    "JointError",
    "consistent",
    "links",
    "ols",
    "possibility",
    "rls",
    "wls",
]
