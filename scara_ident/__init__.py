"""Identify the dynamic model of a robot arm from measured motion.

The public names, loaded when they are used::

    from scara_ident import identify, load_robot, read_recordings

    robot = load_robot("robot.yaml")
    result = identify(robot, read_recordings(["logs/*.parquet"], robot))
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from scara_ident.base_parameters import BaseParameters, check_base_parameters, find_base_parameters
    from scara_ident.errors import ScaraIdentError
    from scara_ident.estimators import Estimate, ols, rls, wls
    from scara_ident.evidence import Evidence, gather, gather_all
    from scara_ident.identification import Identification, identify
    from scara_ident.information import Information, merge
    from scara_ident.model import TorqueModel, build_model
    from scara_ident.motion import Motion, motion_of, stretches
    from scara_ident.recording import Recording, read_recording, read_recordings, write_recording
    from scara_ident.regressor import RegressorKernel, build_kernel
    from scara_ident.robot import Robot, load_robot

__version__ = "0.1.0"

_HOMES = {
    "BaseParameters": "base_parameters",
    "find_base_parameters": "base_parameters",
    "check_base_parameters": "base_parameters",
    "ScaraIdentError": "errors",
    "Estimate": "estimators",
    "ols": "estimators",
    "rls": "estimators",
    "wls": "estimators",
    "Evidence": "evidence",
    "gather": "evidence",
    "gather_all": "evidence",
    "Identification": "identification",
    "identify": "identification",
    "Information": "information",
    "merge": "information",
    "TorqueModel": "model",
    "build_model": "model",
    "Motion": "motion",
    "motion_of": "motion",
    "stretches": "motion",
    "Recording": "recording",
    "read_recording": "recording",
    "read_recordings": "recording",
    "write_recording": "recording",
    "RegressorKernel": "regressor",
    "build_kernel": "regressor",
    "Robot": "robot",
    "load_robot": "robot",
}

__all__ = [*sorted(_HOMES), "__version__"]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'scara_ident' has no attribute {name!r}")
    value = getattr(import_module(f"scara_ident.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
