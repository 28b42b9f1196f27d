"""The founding paper: its model in closed form, its trajectories, its printed tables, and what of it reproduces.

M. Indri, G. Calafiore, G. Legnani, F. Jatta, A. Visioli, "Optimized dynamic calibration of a SCARA robot",
IFAC World Congress 2002.
"""

from scara_ident.paper.checks import check_paper
from scara_ident.paper.model import (
    LINK_LENGTH,
    PARAMETERS,
    REDUCED,
    REDUCTION,
    Parameter,
    criteria,
    regressor,
)
from scara_ident.paper.report import Check, PaperReport, SectionCount
from scara_ident.paper.tables import (
    TABLE_1,
    TABLE_2,
    TABLE_3,
    TABLE_4,
    TABLE_5,
    TORQUE_RMS,
    TRAJECTORIES,
    ErrorTable,
    Table1,
    table5_parameters,
)
from scara_ident.paper.trajectories import OJD, OJK, Trajectory, tool_acceleration

__all__ = [
    "Check",
    "ErrorTable",
    "LINK_LENGTH",
    "OJD",
    "OJK",
    "PARAMETERS",
    "PaperReport",
    "Parameter",
    "REDUCED",
    "REDUCTION",
    "SectionCount",
    "TABLE_1",
    "TABLE_2",
    "TABLE_3",
    "TABLE_4",
    "TABLE_5",
    "TORQUE_RMS",
    "TRAJECTORIES",
    "Table1",
    "Trajectory",
    "check_paper",
    "criteria",
    "regressor",
    "table5_parameters",
    "tool_acceleration",
]
