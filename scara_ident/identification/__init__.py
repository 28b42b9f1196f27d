"""From recordings to parameters."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from scara_ident.registry import Registry

ESTIMATORS: Registry[Callable[..., Any]] = Registry(
    "method",
    "scara_ident.estimators",
    {
        "ols": "scara_ident.estimation.least_squares:ols",
        "wls": "scara_ident.estimation.least_squares:wls",
        "rls": "scara_ident.estimation.recursive:rls",
        "consistent": "scara_ident.estimation.consistent.estimator:consistent",
    },
)
"""Functions from `Observations` to an `Estimate`, by the name of the method.

A function may also return the estimate with a `History` of how it came about.
"""
