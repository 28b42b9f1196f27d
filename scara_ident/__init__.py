"""Identify the dynamic model of a robot arm from measured motion, and find what the model lacks.

The public names, loaded when they are used::

    from scara_ident import diagnose, export_urdf, identify, load_robot, read_recordings

    robot = load_robot("robot.yaml")
    recordings = read_recordings(["logs/*.parquet"], robot)
    result = identify(robot, recordings, method="consistent")
    export_urdf(result, "identified.urdf")
    print(diagnose(robot, recordings).verdict)
"""

from __future__ import annotations

import logging
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from scara_ident.diagnosis.diagnose import Diagnosis, diagnose
    from scara_ident.effects.catalogue import available_effects, effects_named
    from scara_ident.effects.effect import Effect
    from scara_ident.errors import (
        ArgumentError,
        EstimationError,
        RecordingError,
        RobotError,
        ScaraIdentError,
        UsageError,
    )
    from scara_ident.estimation.consistent.estimator import ConsistentEstimate, consistent
    from scara_ident.estimation.consistent.options import ConsistentOptions
    from scara_ident.estimation.estimate import Estimate
    from scara_ident.estimation.information import Information, merge
    from scara_ident.estimation.least_squares import ols, wls
    from scara_ident.estimation.observations import Observations, observe
    from scara_ident.estimation.recursive import rls
    from scara_ident.estimation.residuals import Residuals
    from scara_ident.excitation.design import Design, design_excitation
    from scara_ident.excitation.output import write_trajectory
    from scara_ident.excitation.search import Effort
    from scara_ident.export.robots import export_mjcf, export_urdf
    from scara_ident.export.saved_estimate import load_estimate
    from scara_ident.identification.compare import Comparison, compare
    from scara_ident.identification.identify import Identification, identify
    from scara_ident.model.base_parameters import BaseParameters, check_base_parameters, find_base_parameters
    from scara_ident.model.model import TorqueModel, build_model
    from scara_ident.model.regressor.kernel import RegressorKernel, build_kernel
    from scara_ident.motion.motion import Motion, motion_of, stretches
    from scara_ident.motion.prepared import PreparedData, prepare
    from scara_ident.recording.recording import Recording, read_recording, read_recordings, write_recording
    from scara_ident.recording.tables import read_arrays, read_frame
    from scara_ident.robot.robot import Robot, load_robot
    from scara_ident.simulation.arm import VirtualArm
    from scara_ident.simulation.defaults import virtual_arm
    from scara_ident.simulation.effects import parse_effect
    from scara_ident.simulation.named import named_motion
    from scara_ident.simulation.simulate import SimulationResult, simulate

__version__ = "0.2.0"

# What a library has to say goes to the user's handlers, if there are any; the command prints it itself.
logging.getLogger("scara_ident").addHandler(logging.NullHandler())

_NAMES = {
    "errors": ("ScaraIdentError", "RecordingError", "RobotError", "UsageError", "ArgumentError", "EstimationError"),
    "robot.robot": ("Robot", "load_robot"),
    "recording.recording": ("Recording", "read_recording", "read_recordings", "write_recording"),
    "recording.tables": ("read_arrays", "read_frame"),
    "motion.motion": ("Motion", "motion_of", "stretches"),
    "motion.prepared": ("PreparedData", "prepare"),
    "model.base_parameters": ("BaseParameters", "check_base_parameters", "find_base_parameters"),
    "model.model": ("TorqueModel", "build_model"),
    "model.regressor.kernel": ("RegressorKernel", "build_kernel"),
    "estimation.information": ("Information", "merge"),
    "estimation.observations": ("Observations", "observe"),
    "estimation.estimate": ("Estimate",),
    "estimation.least_squares": ("ols", "wls"),
    "estimation.residuals": ("Residuals",),
    "estimation.recursive": ("rls",),
    "estimation.consistent.estimator": ("ConsistentEstimate", "consistent"),
    "estimation.consistent.options": ("ConsistentOptions",),
    "identification.identify": ("Identification", "identify"),
    "identification.compare": ("Comparison", "compare"),
    "effects.catalogue": ("available_effects", "effects_named"),
    "effects.effect": ("Effect",),
    "diagnosis.diagnose": ("Diagnosis", "diagnose"),
    "excitation.design": ("Design", "design_excitation"),
    "excitation.output": ("write_trajectory",),
    "excitation.search": ("Effort",),
    "export.robots": ("export_mjcf", "export_urdf"),
    "export.saved_estimate": ("load_estimate",),
    "simulation.defaults": ("virtual_arm",),
    "simulation.arm": ("VirtualArm",),
    "simulation.effects": ("parse_effect",),
    "simulation.named": ("named_motion",),
    "simulation.simulate": ("SimulationResult", "simulate"),
}
_HOMES = {name: module for module, names in _NAMES.items() for name in names}

__all__ = [*sorted(_HOMES), "__version__"]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'scara_ident' has no attribute {name!r}")
    value = getattr(import_module(f"scara_ident.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
