"""The printed tables, as typed.

Rows and columns follow `TRAJECTORIES`. In Tables 2 to 4 a row is the trajectory whose torque is predicted and a
column the trajectory the parameters were estimated on.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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
    name : str
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


DURATION: Row = (5.25, 4.5, 2.5, 20.0, 25.0)
"""Duration of each trajectory, s."""

POSITION_RANGE_2: tuple[tuple[float, float], ...] = (
    (0.70, 2.06),
    (0.78, 2.02),
    (0.86, 2.02),
    (-2.1, 2.1),
    (-2.18, 2.18),
)
"""Range of joint 2 on each trajectory as the text gives it, rad."""

POSITION_LIMITS = ((-35.0, 215.0), (-125.0, 125.0))
"""Range of each joint, degrees."""

VELOCITY_LIMIT = 3.77
"""Largest speed of each joint, rad/s."""

TOOL_ACCELERATION_LIMIT = 9.0
"""Largest horizontal acceleration of the gripper, m/s^2."""

TABLE_1 = Table1(
    log_det=(55.51, 58.08, 39.99, 51.69, 75.83),
    condition=(7350000.0, 4090000.0, 70200000.0, 24500.0, 1490000.0),
    sigma=((0.036, 0.037, 0.061, 0.035, 0.04), (0.012, 0.012, 0.031, 0.012, 0.012)),
    peak_velocity=((1.47, 1.87, 0.87, 1.29, 3.04), (1.95, 2.03, 1.72, 1.29, 2.58)),
    peak_acceleration=((6.55, 6.55, 3.91, 5.34, 3.16), (10.11, 10.02, 6.99, 4.12, 3.03)),
)

TABLE_2 = ErrorTable(
    name="Table 2",
    unit="N m",
    errors=(
        (
            (0.055, 0.066, 0.19, 0.065, 0.06),
            (0.1, 0.079, 0.796, 0.148, 0.083),
            (0.073, 0.066, 0.047, 0.063, 0.062),
            (0.111, 0.062, 0.26, 0.057, 0.064),
            (0.167, 0.077, 5.376, 1.298, 0.048),
        ),
        (
            (0.023, 0.03, 0.096, 0.041, 0.031),
            (0.061, 0.04, 0.084, 0.054, 0.043),
            (0.04, 0.031, 0.029, 0.035, 0.031),
            (0.048, 0.029, 0.126, 0.021, 0.022),
            (0.082, 0.03, 0.153, 0.115, 0.018),
        ),
    ),
    row_average=(
        (0.087, 0.241, 0.062, 0.111, 1.393),
        (0.044, 0.056, 0.033, 0.049, 0.08),
    ),
    column_average=(
        (0.101, 0.07, 1.334, 0.326, 0.063),
        (0.051, 0.032, 0.097, 0.053, 0.029),
    ),
    average=(0.379, 0.052),
)

TABLE_3 = ErrorTable(
    name="Table 3",
    unit="1",
    errors=(
        (
            (1.0, 1.21, 3.472, 1.192, 1.096),
            (1.264, 1.0, 10.017, 1.86, 1.043),
            (1.567, 1.422, 1.0, 1.35, 1.334),
            (1.937, 1.086, 4.535, 1.0, 1.109),
            (3.487, 1.61, 112.106, 27.066, 1.0),
        ),
        (
            (1.0, 1.289, 4.185, 1.793, 1.367),
            (1.534, 1.0, 2.117, 1.365, 1.084),
            (1.406, 1.085, 1.0, 1.214, 1.081),
            (2.262, 1.344, 5.903, 1.0, 1.033),
            (4.561, 1.64, 8.445, 6.348, 1.0),
        ),
    ),
    row_average=(
        (1.594, 3.037, 1.335, 1.933, 29.054),
        (1.927, 1.42, 1.157, 2.308, 4.399),
    ),
    column_average=(
        (1.851, 1.266, 26.226, 6.494, 1.116),
        (2.153, 1.272, 4.33, 2.344, 1.113),
    ),
    average=(7.39, 2.242),
)

TABLE_4 = ErrorTable(
    name="Table 4",
    unit="N m",
    errors=(
        (
            (0.055, 0.06, 0.235, 0.061, 0.061),
            (0.1, 0.082, 0.257, 0.106, 0.084),
            (0.072, 0.063, 0.049, 0.063, 0.066),
            (0.11, 0.069, 0.249, 0.065, 0.068),
            (0.334, 0.054, 1.107, 0.229, 0.051),
        ),
        (
            (0.025, 0.031, 0.089, 0.035, 0.033),
            (0.058, 0.04, 0.085, 0.047, 0.045),
            (0.039, 0.033, 0.03, 0.033, 0.033),
            (0.057, 0.03, 0.123, 0.023, 0.024),
            (0.068, 0.025, 0.148, 0.022, 0.019),
        ),
    ),
    row_average=(
        (0.094, 0.126, 0.063, 0.112, 0.355),
        (0.043, 0.055, 0.034, 0.052, 0.057),
    ),
    column_average=(
        (0.134, 0.066, 0.379, 0.105, 0.066),
        (0.049, 0.032, 0.095, 0.032, 0.031),
    ),
    average=(0.15, 0.048),
)

TORQUE_RMS: tuple[Row, Row] = (
    (0.535, 0.512, 0.36, 0.531, 0.602),
    (0.223, 0.23, 0.199, 0.135, 0.173),
)
"""Rms of the measured torque of each joint and trajectory, N m: the first column of Tables 2 and 4."""

TABLE_5: tuple[Row, ...] = (
    (16.307, 16.442, 12.308, 16.594, 16.165),  # P_d1
    (-0.547, 1.855, 1.352, 2.404, 2.415),  # P_d2
    (-0.592, 0.443, -3.554, 0.749, 0.758),  # P_d4
    (4.963, 4.443, 6.44, 3.947, 4.014),  # P_d5
    (0.185, 0.195, 0.144, 0.175, 0.21),  # a01
    (0.304, 0.12, 0.427, 0.181, 0.093),  # a11
    (-0.148, -0.024, -0.328, -0.085, -0.016),  # a21
    (0.084, 0.107, 0.077, 0.073, 0.088),  # a02
    (0.021, 0.039, 0.097, 0.089, 0.049),  # a12
    (0.002, -0.007, -0.034, -0.023, -0.007),  # a22
)
"""Estimates of the reduced model; rows in the order of `REDUCED`."""


def table5_parameters(trajectory: str) -> NDArray[np.float64]:
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
