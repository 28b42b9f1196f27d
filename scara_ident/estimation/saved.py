"""An estimate as plain values in a result file, and back."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from scara_ident.arrays import Array
from scara_ident.errors import UsageError
from scara_ident.estimation.consistent.estimator import ConsistentEstimate
from scara_ident.estimation.consistent.shape import ShapeChoice
from scara_ident.estimation.estimate import Estimate
from scara_ident.estimation.information import Information
from scara_ident.memory import read_text
from scara_ident.model.model import TorqueModel, build_model
from scara_ident.robot.robot import Robot

GIVE = "give the identification.json or diagnosis.json"


def estimate_dict(estimate: Estimate) -> dict[str, Any]:
    """Return all of an estimate but how runs differ, which its covariance holds; the robot and the model by name."""
    model = estimate.model
    found: dict[str, Any] = {
        "robot": model.robot.name,
        "joints": list(model.robot.joints),
        "model": model.name,
        "names": list(model.names),
        "method": estimate.method,
        "value": estimate.value,
        "covariance": estimate.covariance,
        "undetermined": estimate.undetermined,
        "information": {"factor": estimate.information.factor, "rows": estimate.information.rows},
        "weights": estimate.weights,
        "std_kind": estimate.std_kind,
        "noise_bias": estimate.noise_bias,
    }
    if isinstance(estimate, ConsistentEstimate):
        found["consistent"] = {
            "standard": estimate.standard,
            "active": list(estimate.active),
            "was_possible": estimate.was_possible,
            "shapes": [dict(vars(choice)) for choice in estimate.shapes],
            "notes": list(estimate.notes),
        }
    return found


def read_estimate(path: Path, robot: Robot) -> Estimate | None:
    """Return the estimate that a file holds as `estimate_dict` has it, bit by bit; None where it holds a model in another way.

    Raises
    ------
    UsageError
        If the file cannot be read, holds no estimate, or is of another robot or model.
    """
    try:
        content = json.loads(read_text(path))
        if "estimate" not in content and "rebuild" in content:
            return None
        held = content["estimate"]
        name, joints, names = held["model"], tuple(held["joints"]), tuple(held["names"])
    except OSError as error:
        raise UsageError(f"{path}: cannot be read: {error.strerror or error}; {GIVE}") from None
    except (ValueError, KeyError, TypeError, RecursionError):
        raise UsageError(f"{path}: no estimate in it; {GIVE} that identify or diagnose wrote") from None
    model = build_model(robot, name)
    if joints != robot.joints or names != model.names:
        raise UsageError(
            f"{path}: is of {held.get('robot')} with the joints {', '.join(joints)}, and its {name} model has other "
            f"parameters than that of {robot.name}; give the robot that it was identified with"
        )
    try:
        return _estimate(held, model)
    except (ValueError, KeyError, TypeError) as error:
        raise UsageError(f"{path}: its estimate is incomplete ({error}); save it again") from None


def _estimate(held: dict[str, Any], model: TorqueModel) -> Estimate:
    p = len(model.names)
    covariance = np.zeros((p, p))
    for k, row in enumerate(held["covariance"]):
        # JSON knows no infinity; on the diagonal it stands for what the data leave open.
        covariance[k] = [x if x is not None else np.inf if j == k else np.nan for j, x in enumerate(row)]
    factor = _array(held["information"]["factor"]).reshape(-1, p + 1)
    parts: dict[str, Any] = {
        "model": model,
        "method": str(held["method"]),
        "value": _array(held["value"]).reshape(p),
        "covariance": covariance,
        "undetermined": np.array(held["undetermined"], dtype=bool).reshape(p),
        "information": Information(factor, float(held["information"]["rows"])),
        "weights": _array(held["weights"]).reshape(model.robot.n),
        "std_kind": str(held["std_kind"]),
        "noise_bias": None if held["noise_bias"] is None else _array(held["noise_bias"]).reshape(p),
    }
    more = held.get("consistent")
    if more is None:
        return Estimate(**parts)
    return ConsistentEstimate(
        **parts,
        standard=_array(more["standard"]),
        active=tuple(more["active"]),
        was_possible=bool(more["was_possible"]),
        shapes=tuple(ShapeChoice(**choice) for choice in more["shapes"]),
        notes=tuple(more["notes"]),
    )


def _array(values: Any) -> Array:
    return np.array(values, dtype=float)
