"""The torque equation, linear in its parameters."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from scara_ident.registry import Registry

if TYPE_CHECKING:
    from scara_ident.model.model import TorqueModel
    from scara_ident.robot.robot import Robot

MODELS: Registry[Callable[[Robot], TorqueModel]] = Registry(
    "model",
    "scara_ident.models",
    {name: f"scara_ident.model.model:{name}" for name in ("complete", "reduced", "basic")},
)
"""Functions that build the torque model of a robot, by the name of the model."""
