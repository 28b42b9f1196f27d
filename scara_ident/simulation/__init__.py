"""The virtual arm: closed-loop recordings of an arm whose parameters and effects are known.

>>> from scara_ident.simulation import parse_effect, read_trajectory, simulate, virtual_arm
>>> arm = virtual_arm()
>>> arm.robot.name
'scara03'
"""

from scara_ident.simulation.arm import Controller, VirtualArm, ideal, on_side
from scara_ident.simulation.defaults import virtual_arm
from scara_ident.simulation.effects import CATALOGUE, EFFECTS, Effect, parse_effect
from scara_ident.simulation.laws import MotionLaw
from scara_ident.simulation.paths import PathError, circle, line
from scara_ident.simulation.reconstructions import RECONSTRUCTIONS, reconstruction
from scara_ident.simulation.reference import ReferenceMotion, read_trajectory, sampled
from scara_ident.simulation.runs import RunState, TorqueNoise
from scara_ident.simulation.simulate import SimulationResult, free_motion, simulate
from scara_ident.simulation.true_motion import TrueMotion
from scara_ident.simulation.truth import truth, write_simulation

__all__ = [
    "CATALOGUE",
    "Controller",
    "EFFECTS",
    "Effect",
    "MotionLaw",
    "PathError",
    "RECONSTRUCTIONS",
    "ReferenceMotion",
    "RunState",
    "SimulationResult",
    "TorqueNoise",
    "TrueMotion",
    "VirtualArm",
    "circle",
    "free_motion",
    "ideal",
    "line",
    "on_side",
    "parse_effect",
    "read_trajectory",
    "reconstruction",
    "sampled",
    "simulate",
    "truth",
    "virtual_arm",
    "write_simulation",
]
