"""Identified models by one who knows."""

from __future__ import annotations

from typing import Any

import numpy as np

from scara_ident.estimation.information import Information
from scara_ident.export.identified_model import Entry, IdentifiedModel
from scara_ident.model.model import TorqueModel, build_model
from scara_ident.simulation import virtual_arm
from scara_ident.simulation.truth import _complete_parameters

SPRING = {
    "effect": "spring",
    "joint": "joint1",
    "parameters": {"stiffness": {"value": 0.4, "std": 0.01}, "rest_position": {"value": 0.1, "std": 0.01}},
}


def known_as(model: TorqueModel, value: np.ndarray, *, found: tuple[Entry, ...] = (), **more: Any) -> IdentifiedModel:
    """A model with these parameters, each known to a thousandth, on no observations."""
    n, p = model.robot.n, len(value)
    return IdentifiedModel(
        model=model, value=value, covariance=np.diag(1e-6 * value**2), before=value, undetermined=np.zeros(p, dtype=bool),
        weights=np.ones(n), fitted=(Information.empty(p),) * n, training=(Information.empty(p),) * n, validation=(Information.empty(p),) * n, standard=None,
        found=found, **{"bands": (None,) * n, "rms": np.full(n, np.nan), **more},
    )  # fmt: skip


def with_spring() -> IdentifiedModel:
    """The virtual SCARA03 with a spring."""
    arm = virtual_arm()
    model = build_model(arm.robot, "complete")
    return known_as(model, np.array(_complete_parameters(arm)), found=(SPRING,), bands=(25.0, 25.0))
