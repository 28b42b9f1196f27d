"""A comparison as JSON and as sentences."""

from __future__ import annotations

from typing import Any

import numpy as np

from scara_ident.arrays import Array
from scara_ident.estimation.urdf_scale import scale_sentence
from scara_ident.identification.compare import Comparison, TrajectorySummary
from scara_ident.manners import listed
from scara_ident.model.urdf_values import urdf_values


def comparison_dict(comparison: Comparison) -> dict[str, Any]:
    """Return the content of ``comparison.json``."""
    robot = comparison.model.robot
    names = [summary.name for summary in comparison.trajectories]
    own = np.array([comparison.errors[i, i] for i in range(len(names))])
    nominal = urdf_values(comparison.model)
    return {
        "robot": robot.name,
        "model": comparison.model.name,
        "method": comparison.method,
        "trajectories": names,
        "joints": list(robot.joints),
        "units": {
            joint: {
                "torque": robot.torque_unit(j),
                "velocity": f"{robot.position_unit(j)}/s",
                "acceleration": f"{robot.position_unit(j)}/s^2",
            }
            for j, joint in enumerate(robot.joints)
        },
        "band_hz": robot.by_joint(comparison.bands),
        "characteristics": {
            summary.name: {
                "recordings": list(summary.recordings),
                "log_det": summary.log_det,
                "condition": summary.condition,
                "sigma": None if summary.sigma is None else robot.by_joint(summary.sigma),
                "peak_velocity": robot.by_joint(summary.peak_velocity),
                "peak_acceleration": robot.by_joint(summary.peak_acceleration),
            }
            for summary in comparison.trajectories
        },
        "torque_rms": {summary.name: robot.by_joint(summary.torque_rms) for summary in comparison.trajectories},
        "errors": _cells(comparison, comparison.errors),
        "predicted_by_covariance": _cells(comparison, comparison.expected),
        "normalised": _cells(comparison, comparison.errors / own[:, None]),
        "average_of_predicted": {
            name: robot.by_joint(_mean_known(comparison.errors[i])) for i, name in enumerate(names)
        },
        "average_of_estimated": {
            name: robot.by_joint(_mean_known(comparison.errors[:, k])) for k, name in enumerate(names)
        },
        "parameters": {
            summary.name: {
                column.name: {
                    "value": summary.estimate.value[k],
                    "urdf": nominal[k],
                    "std": summary.estimate.std[k],
                    "unit": column.unit,
                }
                for k, column in enumerate(comparison.model.columns)
            }
            for summary in comparison.trajectories
        },
        "friction": _friction(comparison),
        "summary": list(comparison_sentences(comparison)),
        "notes": list(comparison.notes),
    }


def _cells(comparison: Comparison, values: Any) -> dict[str, dict[str, dict[str, float]]]:
    names = [summary.name for summary in comparison.trajectories]
    robot = comparison.model.robot
    return {
        predicted: {estimated: robot.by_joint(values[i, k]) for k, estimated in enumerate(names)}
        for i, predicted in enumerate(names)
    }


def _mean_known(errors: Array) -> Array:
    """Return the mean error of each joint, (n,), over the trajectories in which it moves; NaN where it moves in none."""
    known = np.isfinite(errors)
    total = np.where(known, errors, 0.0).sum(axis=0)
    mean: Array = np.full(errors.shape[1], np.nan)
    np.divide(total, known.sum(axis=0), out=mean, where=known.any(axis=0))
    return mean


def _friction(comparison: Comparison) -> dict[str, Any]:
    """Friction curves of every joint from every trajectory, to the fastest speed of all (Fig. 4 of the paper)."""
    robot = comparison.model.robot
    found: dict[str, Any] = {}
    names = comparison.model.names
    for j, joint in enumerate(robot.joints):
        fastest = max(summary.peak_velocity[j] for summary in comparison.trajectories)
        speed = np.linspace(0.0, fastest, 60)
        curves = {}
        for summary in comparison.trajectories:
            curve = np.zeros_like(speed)
            for power in range(4):
                if f"a{power}{j + 1}" in names:
                    curve += summary.estimate.value[names.index(f"a{power}{j + 1}")] * speed**power
            curves[summary.name] = curve
        found[joint] = {
            "speed": speed,
            "torque": curves,
            "fastest": {summary.name: summary.peak_velocity[j] for summary in comparison.trajectories},
        }
    return found


def comparison_sentences(comparison: Comparison) -> tuple[str, ...]:
    """Return the result in words: which trajectory's parameters serve best, and where bias is at work."""
    names = [summary.name for summary in comparison.trajectories]
    own = np.array([comparison.errors[i, i] for i in range(len(names))])
    # Ratios to each trajectory's own error, so that joints of different torque count the same.
    ratio = np.nanmean(comparison.errors / own[:, None], axis=(0, 2))
    # A parameter left open may fit by luck what it is tried on, so such a fit is neither best nor explained.
    open_ = np.any(np.isinf(comparison.expected), axis=(0, 2))
    found = []
    if np.count_nonzero(~open_) > 1:
        best = int(np.argmin(np.where(open_, np.inf, ratio)))
        worst = int(np.argmax(np.where(open_, -np.inf, ratio)))
        whose = "Of the ranked trajectories, parameters" if np.any(open_) else "Parameters"
        found.append(
            f"{whose} from {names[best]} predict all trajectories best ({ratio[best]:.2f} times each one's own error), "
            f"those from {names[worst]} worst ({ratio[worst]:.3g} times)."
        )
    beyond = comparison.errors / comparison.expected
    i, k, j = np.unravel_index(int(np.nanargmax(np.where(np.isfinite(beyond), beyond, -1.0))), beyond.shape)
    if beyond[i, k, j] > 2.0:
        found.append(
            f"The error of the parameters from {names[k]} on {names[i]}, {comparison.model.robot.joints[j]}, is bias "
            f"and not noise: it is {beyond[i, k, j]:.3g} times the error that the parameters' covariance predicts."
        )
    elif np.any(np.isfinite(comparison.expected)):
        which = "other error" if np.any(open_) else "error"
        found.append(f"No {which} exceeds twice the error that noise in the parameters explains.")
    found += [_left_open(summary) for summary, still in zip(comparison.trajectories, open_, strict=True) if still]
    equal = all(np.ptp(summary.estimate.weights) == 0.0 for summary in comparison.trajectories)
    weights = "every row of every joint counts the same" if equal else "each joint is weighted by its residual"
    found.append(f"Estimated by {comparison.method}: {weights}.")
    found.append(scale_sentence(None, comparison.model.robot))
    return tuple(found)


def _left_open(summary: TrajectorySummary) -> str:
    """Say which parameters a trajectory leaves without a standard deviation, and what follows."""
    estimate = summary.estimate
    missing = [name for name, std in zip(estimate.model.names, estimate.std, strict=True) if not np.isfinite(std)]
    return (
        f"Parameters from {summary.name} are not ranked: no standard deviation is known for {listed(missing, 3)}, so the error "
        f"that noise explains is not known; the table has a dash there."
    )
