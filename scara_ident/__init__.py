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
    from scara_ident.errors import ScaraIdentError
    from scara_ident.estimation import Estimate, ols, rls, wls
    from scara_ident.estimation.information import Information, merge
    from scara_ident.estimation.observations import Evidence, gather, gather_all
    from scara_ident.identification.identify import Identification, identify
    from scara_ident.model.base_parameters import BaseParameters, check_base_parameters, find_base_parameters
    from scara_ident.model.model import TorqueModel, build_model
    from scara_ident.model.regressor.kernel import RegressorKernel, build_kernel
    from scara_ident.motion.motion import Motion, motion_of, stretches
    from scara_ident.recording.recording import Recording, read_recording, read_recordings, write_recording
    from scara_ident.robot.robot import Robot, load_robot

__version__ = "0.1.0"

_HOMES = {
    "BaseParameters": "model.base_parameters",
    "find_base_parameters": "model.base_parameters",
    "check_base_parameters": "model.base_parameters",
    "ScaraIdentError": "errors",
    "Estimate": "estimation",
    "ols": "estimation",
    "rls": "estimation",
    "wls": "estimation",
    "Evidence": "estimation.observations",
    "gather": "estimation.observations",
    "gather_all": "estimation.observations",
    "Identification": "identification.identify",
    "identify": "identification.identify",
    "Information": "estimation.information",
    "merge": "estimation.information",
    "TorqueModel": "model.model",
    "build_model": "model.model",
    "Motion": "motion.motion",
    "motion_of": "motion.motion",
    "stretches": "motion.motion",
    "Recording": "recording.recording",
    "read_recording": "recording.recording",
    "read_recordings": "recording.recording",
    "write_recording": "recording.recording",
    "RegressorKernel": "model.regressor.kernel",
    "build_kernel": "model.regressor.kernel",
    "Robot": "robot.robot",
    "load_robot": "robot.robot",
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
