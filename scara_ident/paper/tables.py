"""The printed tables, as typed into ``tables.json``.

Rows and columns follow `TRAJECTORIES`. In Tables 2 to 4 a row is the trajectory whose torque is predicted and a
column the trajectory the parameters were estimated on.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

import numpy as np

from scara_ident.arrays import Array
from scara_ident.paper.model import PARAMETERS, REDUCED

Row = tuple[float, float, float, float, float]
Matrix = tuple[Row, Row, Row, Row, Row]

TRAJECTORIES: tuple[str, str, str, str, str] = ("CI", "L1", "L2", "OJK", "OJD")


@dataclass(frozen=True)
class Table1:
    """Characteristics of the trajectories; one entry per trajectory, one row per joint.

    Attributes
    ----------
    log_det, condition : tuple of float
        J_d and J_k.
    sigma : pair of tuple of float
        Standard deviation of the measured torque over six repetitions, N m.
    peak_velocity, peak_acceleration : pair of tuple of float
        rad/s, rad/s^2.
    """

    log_det: Row
    condition: Row
    sigma: tuple[Row, Row]
    peak_velocity: tuple[Row, Row]
    peak_acceleration: tuple[Row, Row]


@dataclass(frozen=True)
class ErrorTable:
    """Rms torque errors of every trajectory with the parameters of every trajectory.

    Attributes
    ----------
    unit : str
        "N m", or "1" where normalised.
    errors : pair of 5x5 tuples
        For each joint.
    row_average, column_average : pair of tuple of float
        The printed averages on the right and at the bottom.
    average : pair of float
        The printed average of all.
    """

    name: str
    unit: str
    errors: tuple[Matrix, Matrix]
    row_average: tuple[Row, Row]
    column_average: tuple[Row, Row]
    average: tuple[float, float]


def _typed() -> dict[str, Any]:
    text = (files("scara_ident.paper") / "tables.json").read_text(encoding="utf-8")
    return {name: _fixed(content) for name, content in json.loads(text).items()}


def _fixed(content: Any) -> Any:
    if isinstance(content, dict):
        return {name: _fixed(value) for name, value in content.items()}
    return tuple(map(_fixed, content)) if isinstance(content, list) else content


_TYPED = _typed()

DURATION: Row = _TYPED["duration"]
"""Duration of each trajectory, s."""

POSITION_RANGE_2: tuple[tuple[float, float], ...] = _TYPED["position range of joint 2"]
"""Range of joint 2 on each trajectory as the text gives it, rad."""

POSITION_LIMITS = ((-35.0, 215.0), (-125.0, 125.0))
"""Range of each joint, degrees."""

VELOCITY_LIMIT = 3.77
"""Largest speed of each joint, rad/s."""

TOOL_ACCELERATION_LIMIT = 9.0
"""Largest horizontal acceleration of the gripper, m/s^2."""

TABLE_1 = Table1(**_TYPED["Table 1"])
TABLE_2, TABLE_3, TABLE_4 = (ErrorTable(**_TYPED[name]) for name in ("Table 2", "Table 3", "Table 4"))

TORQUE_RMS: tuple[Row, Row] = _TYPED["torque rms"]
"""Rms of the measured torque of each joint and trajectory, N m: the first column of Tables 2 and 4."""

TABLE_5: tuple[Row, ...] = tuple(_TYPED["Table 5"][name] for name in REDUCED)
"""Estimates of the reduced model; rows in the order of `REDUCED`."""


def table5_parameters(trajectory: str) -> Array:
    """Return a column of Table 5 as the paper's parameter vector.

    Parameters
    ----------
    trajectory : str
        One of `TRAJECTORIES`: the one the parameters were estimated on.

    Returns
    -------
    ndarray, shape (15,)
        In the order of `PARAMETERS`; zero where the reduced model has none.

    Raises
    ------
    ValueError
        For another name.
    """
    if trajectory not in TRAJECTORIES:
        raise ValueError(f"no trajectory {trajectory!r} in Table 5; it has {', '.join(TRAJECTORIES)}")
    column = TRAJECTORIES.index(trajectory)
    values = {name: row[column] for name, row in zip(REDUCED, TABLE_5, strict=True)}
    return np.array([values.get(parameter.name, 0.0) for parameter in PARAMETERS])
