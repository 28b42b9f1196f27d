"""Checks along the two trajectories that the paper prints as formulas."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from scara_ident.arrays import Array
from scara_ident.paper.model import criteria, regressor
from scara_ident.paper.report import JOINTS, Check, Subject, equality, inequality, information
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

LOG_DET_TOLERANCE = 0.02
CONDITION_TOLERANCE = 0.10
# The paper takes its peaks from measured motion, we from the formula: as for J_d, 2 %.
PEAK_TOLERANCE = 0.02
TORQUE_TOLERANCE = 0.05


def _motion(trajectory: Trajectory) -> tuple[Array, Array, Array]:
    return trajectory.motion(trajectory.times())


def _rms(torque: Array) -> Array:
    return np.asarray(np.sqrt(np.mean(torque**2, axis=1)))


def _torque(w: Array, parameters: Array) -> Array:
    return np.asarray(np.einsum("ipn,p->in", w, parameters))


def table1() -> Iterator[Check]:
    """Check the indexes and peaks of Table 1 for OJK and OJD."""
    section = "Table 1"
    for trajectory in PRINTED_AS_FORMULA:
        column = TRAJECTORIES.index(trajectory.name)
        q, v, a = _motion(trajectory)
        log_det, condition = criteria(regressor(q, v, a))
        words = "ideal motion, R_v = identity"
        subject = Subject(section, "J_d", trajectory.name)
        yield equality(subject, TABLE_1.log_det[column], log_det, LOG_DET_TOLERANCE, f"{words}, natural logarithm")
        subject = Subject(section, "J_k", trajectory.name)
        yield equality(subject, TABLE_1.condition[column], condition, CONDITION_TOLERANCE, words)
        for quantity, unit, signal, printed in (
            ("peak velocity", "rad/s", v, TABLE_1.peak_velocity),
            ("peak acceleration", "rad/s^2", a, TABLE_1.peak_acceleration),
        ):
            for joint, name in enumerate(JOINTS):
                subject = Subject(section, quantity, trajectory.name, name, unit)
                peak = float(np.max(np.abs(signal[joint])))
                yield equality(subject, printed[joint][column], peak, PEAK_TOLERANCE)


def limits() -> Iterator[Check]:
    """Check the printed motion against the limits that the text gives."""
    section = "Limits"
    for trajectory in PRINTED_AS_FORMULA:
        q, v, a = _motion(trajectory)
        most = float(np.max(tool_acceleration(q, v, a)))
        subject = Subject(section, "tool acceleration", trajectory.name, unit="m/s^2")
        yield _at_most(subject, TOOL_ACCELERATION_LIMIT, most)
        for joint, name in enumerate(JOINTS):
            subject = Subject(section, "velocity limit", trajectory.name, name, "rad/s")
            yield _at_most(subject, VELOCITY_LIMIT, float(np.max(np.abs(v[joint]))))
            low, high = (float(np.deg2rad(bound)) for bound in POSITION_LIMITS[joint])
            least, most = float(q[joint].min()), float(q[joint].max())
            subject = Subject(section, "lower position limit", trajectory.name, name, "rad")
            yield inequality(subject, "computed >= printed", least >= low, low, least, _beyond(low - least))
            subject = Subject(section, "upper position limit", trajectory.name, name, "rad")
            yield _at_most(subject, high, most, _beyond(most - high))
        column = TRAJECTORIES.index(trajectory.name)
        digit = 10.0 ** -_decimals(POSITION_RANGE_2[column])
        for quantity, printed, computed in zip(
            ("least position", "greatest position"),
            POSITION_RANGE_2[column],
            (float(q[1].min()), float(q[1].max())),
            strict=True,
        ):
            subject = Subject(section, quantity, trajectory.name, "joint2", "rad")
            tolerance = 0.5 * digit / abs(printed)
            yield equality(subject, printed, computed, tolerance, "tolerance: half of the last printed digit")


def _at_most(subject: Subject, limit: float, reached: float, comment: str = "") -> Check:
    return inequality(subject, "computed <= printed", reached <= limit, limit, reached, comment)


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
                subject = Subject(section, f"torque rms, parameters of {source}", trajectory.name, name, "N m")
                printed, value = TORQUE_RMS[joint][row], float(computed[joint])
                if source == OJD.name:
                    yield equality(subject, printed, value, TORQUE_TOLERANCE)
                else:
                    yield information(subject, printed, value)


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
                implied = float(np.hypot(errors[row], change[joint]))
                words = "own error and the change of predicted torque, root of squares"
                subject = Subject(section, f"error, parameters of {source}", trajectory.name, name, "N m")
                yield equality(subject, errors[column], implied, TORQUE_TOLERANCE, words)
