"""Checks along the two trajectories that the paper prints as formulas."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from scara_ident.paper.model import criteria, regressor
from scara_ident.paper.report import Check, equality, inequality, information
from scara_ident.paper.tables import (
    POSITION_LIMITS,
    POSITION_RANGE_2,
    TABLE_1,
    TABLE_4,
    TOOL_ACCELERATION_LIMIT,
    TORQUE_RMS,
    TRAJECTORIES,
    VELOCITY_LIMIT,
    table5_parameters,
)
from scara_ident.paper.trajectories import OJD, OJK, Trajectory, tool_acceleration

PRINTED_AS_FORMULA = (OJK, OJD)
JOINTS = ("joint1", "joint2")

LOG_DET_TOLERANCE = 0.02
CONDITION_TOLERANCE = 0.10
# The paper takes its peaks from measured motion, we from the formula: as for J_d, 2 %.
PEAK_TOLERANCE = 0.02
TORQUE_TOLERANCE = 0.05


def _motion(
    trajectory: Trajectory,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    return trajectory.motion(trajectory.times())


def _rms(torque: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(np.sqrt(np.mean(torque**2, axis=1)))


def _torque(w: NDArray[np.float64], parameters: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(np.einsum("ipn,p->in", w, parameters))


def table1() -> Iterator[Check]:
    """Check the indexes and peaks of Table 1 for OJK and OJD."""
    section = "Table 1"
    for trajectory in PRINTED_AS_FORMULA:
        column = TRAJECTORIES.index(trajectory.name)
        q, v, a = _motion(trajectory)
        log_det, condition = criteria(regressor(q, v, a))
        yield equality(
            section,
            "J_d",
            TABLE_1.log_det[column],
            log_det,
            LOG_DET_TOLERANCE,
            trajectory=trajectory.name,
            comment="ideal motion, R_v = identity, natural logarithm",
        )
        yield equality(
            section,
            "J_k",
            TABLE_1.condition[column],
            condition,
            CONDITION_TOLERANCE,
            trajectory=trajectory.name,
            comment="ideal motion, R_v = identity",
        )
        for quantity, unit, signal, printed in (
            ("peak velocity", "rad/s", v, TABLE_1.peak_velocity),
            ("peak acceleration", "rad/s^2", a, TABLE_1.peak_acceleration),
        ):
            for joint, name in enumerate(JOINTS):
                yield equality(
                    section,
                    quantity,
                    printed[joint][column],
                    float(np.max(np.abs(signal[joint]))),
                    PEAK_TOLERANCE,
                    trajectory=trajectory.name,
                    joint=name,
                    unit=unit,
                )


def limits() -> Iterator[Check]:
    """Check the printed motion against the limits that the text gives."""
    section = "Limits"
    for trajectory in PRINTED_AS_FORMULA:
        q, v, a = _motion(trajectory)
        about = {"trajectory": trajectory.name}
        acceleration = float(np.max(tool_acceleration(q, v, a)))
        yield inequality(
            section,
            "tool acceleration",
            "computed <= printed",
            acceleration <= TOOL_ACCELERATION_LIMIT,
            TOOL_ACCELERATION_LIMIT,
            acceleration,
            unit="m/s^2",
            **about,
        )
        for joint, name in enumerate(JOINTS):
            speed = float(np.max(np.abs(v[joint])))
            yield inequality(
                section,
                "velocity limit",
                "computed <= printed",
                speed <= VELOCITY_LIMIT,
                VELOCITY_LIMIT,
                speed,
                joint=name,
                unit="rad/s",
                **about,
            )
            low, high = (float(np.deg2rad(bound)) for bound in POSITION_LIMITS[joint])
            least, most = float(q[joint].min()), float(q[joint].max())
            yield inequality(
                section,
                "lower position limit",
                "computed >= printed",
                least >= low,
                low,
                least,
                joint=name,
                unit="rad",
                comment=_beyond(low - least),
                **about,
            )
            yield inequality(
                section,
                "upper position limit",
                "computed <= printed",
                most <= high,
                high,
                most,
                joint=name,
                unit="rad",
                comment=_beyond(most - high),
                **about,
            )
        column = TRAJECTORIES.index(trajectory.name)
        digit = 10.0 ** -_decimals(POSITION_RANGE_2[column])
        for quantity, printed, computed in zip(
            ("least position", "greatest position"),
            POSITION_RANGE_2[column],
            (float(q[1].min()), float(q[1].max())),
            strict=True,
        ):
            yield equality(
                section,
                quantity,
                printed,
                computed,
                0.5 * digit / abs(printed),
                joint="joint2",
                unit="rad",
                comment="tolerance: half of the last printed digit",
                **about,
            )


def _beyond(excess: float) -> str:
    if excess <= 0.0:
        return ""
    text = f"{excess:.2g} rad beyond the limit"
    # alpha_0 is printed with two decimals.
    return f"{text}, less than the rounding of alpha_0" if excess < 0.005 else text


def _decimals(values: tuple[float, ...]) -> int:
    return max(len(repr(value).partition(".")[2]) for value in values)


def torque_rms() -> Iterator[Check]:
    """Check the torque rms that each column of Table 5 predicts along the printed formulas.

    The OJD column, the paper's best, is judged; the others inform.
    """
    section = "Torque rms from Table 5"
    for trajectory in PRINTED_AS_FORMULA:
        row = TRAJECTORIES.index(trajectory.name)
        w = regressor(*_motion(trajectory))
        for source in reversed(TRAJECTORIES):
            computed = _rms(_torque(w, table5_parameters(source)))
            for joint, name in enumerate(JOINTS):
                quantity = f"torque rms, parameters of {source}"
                printed, value = TORQUE_RMS[joint][row], float(computed[joint])
                if source == OJD.name:
                    yield equality(
                        section,
                        quantity,
                        printed,
                        value,
                        TORQUE_TOLERANCE,
                        trajectory=trajectory.name,
                        joint=name,
                        unit="N m",
                    )
                else:
                    yield information(
                        section,
                        quantity,
                        printed,
                        value,
                        trajectory=trajectory.name,
                        joint=name,
                        unit="N m",
                    )


def prediction_errors() -> Iterator[Check]:
    """Check the errors of Table 4 against those that Table 5 implies along the printed formulas.

    Least squares leaves a residual orthogonal to the regressor. So on the trajectory that gave the estimate P,
    the error of other parameters P' is the root of own error^2 + rms(W (P' - P))^2. This is exact for both
    joints together with one weight, and close for each alone.
    """
    section = "Table 4 from Table 5"
    for trajectory in PRINTED_AS_FORMULA:
        row = TRAJECTORIES.index(trajectory.name)
        w = regressor(*_motion(trajectory))
        own = table5_parameters(trajectory.name)
        for source in TRAJECTORIES:
            if source == trajectory.name:
                continue
            column = TRAJECTORIES.index(source)
            change = _rms(_torque(w, table5_parameters(source) - own))
            for joint, name in enumerate(JOINTS):
                errors = TABLE_4.errors[joint][row]
                yield equality(
                    section,
                    f"error, parameters of {source}",
                    errors[column],
                    float(np.hypot(errors[row], change[joint])),
                    TORQUE_TOLERANCE,
                    trajectory=trajectory.name,
                    joint=name,
                    unit="N m",
                    comment="own error and the change of predicted torque, root of squares",
                )
