"""Excitation: the motion from which the parameters of a model can be determined best, within the limits of the robot."""

from scara_ident.excitation.criteria import BlockLogDet, Condition, Criterion, LogDet, block_of
from scara_ident.excitation.curves import Basis, ExcitationTrajectory, make_basis
from scara_ident.excitation.design import Design, design_excitation, information_of
from scara_ident.excitation.limits import InfeasibleLimits, Limits, limits_of, nominal_parameters
from scara_ident.excitation.output import excitation_dict, write_joint_trajectory, write_trajectory
from scara_ident.excitation.promise import ExpectedAnswer, expected_answers
from scara_ident.excitation.search import Effort, Progress
from scara_ident.excitation.size import default_harmonics
from scara_ident.excitation.verification import Reached

__all__ = [
    "Basis",
    "BlockLogDet",
    "Condition",
    "Criterion",
    "Design",
    "Effort",
    "ExcitationTrajectory",
    "InfeasibleLimits",
    "Limits",
    "LogDet",
    "Progress",
    "Reached",
    "ExpectedAnswer",
    "block_of",
    "default_harmonics",
    "design_excitation",
    "excitation_dict",
    "information_of",
    "limits_of",
    "make_basis",
    "nominal_parameters",
    "expected_answers",
    "write_joint_trajectory",
    "write_trajectory",
]
