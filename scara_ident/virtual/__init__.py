"""The virtual arm: closed-loop recordings of an arm whose parameters and effects are known.

>>> from scara_ident.virtual import parse_effect, read_trajectory, simulate, virtual_arm
>>> arm = virtual_arm()
>>> arm.robot.name
'scara03'
"""

from __future__ import annotations

from scara_ident.virtual.arm import Controller, VirtualArm, ideal, on_side
from scara_ident.virtual.defaults import virtual_arm
from scara_ident.virtual.effects import CATALOGUE, EFFECTS, Effect, parse_effect
from scara_ident.virtual.reference import ReferenceMotion, read_trajectory, sampled
from scara_ident.virtual.simulate import SimulationResult, TrueMotion, free_motion, simulate
from scara_ident.virtual.truth import truth, write_simulation

__all__ = [
    "CATALOGUE",
    "Controller",
    "EFFECTS",
    "Effect",
    "ReferenceMotion",
    "SimulationResult",
    "TrueMotion",
    "VirtualArm",
    "free_motion",
    "ideal",
    "on_side",
    "parse_effect",
    "read_trajectory",
    "sampled",
    "simulate",
    "truth",
    "virtual_arm",
    "write_simulation",
]
