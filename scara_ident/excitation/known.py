"""Results of an earlier identification or diagnosis, to predict torques with and to ask for."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from scara_ident.errors import ScaraIdentError
from scara_ident.files import path_fault, unreadable
from scara_ident.memory import read_text
from scara_ident.model.model import TorqueModel


def read_parameters(path: Path, model: TorqueModel) -> dict[str, float]:
    """Read the parameters of an ``identification.json``, or those of the model in a ``diagnosis.json``.

    Parameters
    ----------
    model : TorqueModel
        The model that the design is for.

    Returns
    -------
    dict of str to float
        Value by parameter; without those that the recordings did not determine.

    Raises
    ------
    ScaraIdentError
        If the file cannot be read, has no parameters, or is of another model or robot.
    """
    if (fault := path_fault(path)) is not None:
        raise ScaraIdentError(fault)
    try:
        content = json.loads(read_text(path))
        # Behind those of the model a diagnosis lists the effects' own.
        rows = content["parameters"][: len(model.names) if "verdict" in content else None]
        found = {str(row["name"]): float(row["value"]) for row in rows if not _undetermined(row)}
        if not np.isfinite(list(found.values())).all():
            raise ValueError("a value is not finite")
    except OSError as error:
        raise unreadable(path, error, "give an identification.json") from None
    except (ValueError, KeyError, TypeError, RecursionError):
        raise ScaraIdentError(
            f"{path}: no parameters in it; give the identification.json that identify wrote"
        ) from None
    for name in found:
        if name not in model.names:
            raise ScaraIdentError(
                f"{path}: parameter {name!r} is not of the model {model.name}, which has {', '.join(model.names)}; "
                "identify and excite with one --robot and --model"
            )
    return found


def read_diagnosis(path: Path) -> dict[str, Any]:
    """Read a ``diagnosis.json`` that a motion is to be designed for.

    Raises
    ------
    ScaraIdentError
        If the file cannot be read or is no diagnosis.
    """
    try:
        content = json.loads(read_text(path))
    except OSError as error:
        raise unreadable(path, error, "give a diagnosis.json") from None
    except ValueError:
        content = None
    if not isinstance(content, dict) or not {"verdict", "model", "next"} <= content.keys():
        raise ScaraIdentError(f"{path}: no diagnosis; give the diagnosis.json that diagnose wrote")
    return content


def _undetermined(row: dict[str, object]) -> bool:
    return row["value"] is None or bool(row.get("undetermined"))
