"""The content of a diagnosis."""

from __future__ import annotations

from typing import Any

from scara_ident.model.model import build_model
from scara_ident.simulation import virtual_arm
from scara_ident.simulation.truth import _complete_parameters


def content() -> dict[str, Any]:
    """A diagnosis of the virtual SCARA03 with a spring, by one who knows."""
    arm = virtual_arm()
    model = build_model(arm.robot, "complete")
    entries = [
        column.entry(value=value, std=1e-3 * abs(value)) | {"before": value}
        for column, value in zip(model.columns, _complete_parameters(arm), strict=True)
    ]
    spring = {"stiffness": {"value": 0.4, "std": 0.01}, "rest_position": {"value": 0.1, "std": 0.01}}
    return {
        "robot": "scara03", "model": "complete", "parameters": entries, "band_hz": {"joint1": 25.0, "joint2": 25.0},
        "effects": [{"effect": "spring", "joint": "joint1", "parameters": spring}],
    }  # fmt: skip
