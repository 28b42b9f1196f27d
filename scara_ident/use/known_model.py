"""A model with its parameters, from an identification at hand or from its file."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from scara_ident.arrays import Array
from scara_ident.diagnosis.diagnose import Diagnosis
from scara_ident.errors import ScaraIdentError
from scara_ident.estimation.estimate import joint_errors
from scara_ident.identification.identify import Identification
from scara_ident.model import MODELS
from scara_ident.model.model import TorqueModel, build_model
from scara_ident.model.terms import Friction
from scara_ident.motion.motion import Motion
from scara_ident.robot.robot import Robot


@dataclass(frozen=True, eq=False)
class KnownModel:
    """A torque model with the values of its parameters.

    Attributes
    ----------
    model : TorqueModel
    value : ndarray, shape (p,)
    bands : tuple of float or None, one per joint
        Low-pass that the estimate used, Hz.
    rms : ndarray, shape (n,)
        Rms error of the predicted torque, unfiltered, on recordings that were held out, else on those fitted; NaN where not
        known.
    """

    model: TorqueModel
    value: Array
    bands: tuple[float | None, ...]
    rms: Array

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self.model.robot

    def torque_parts(self, motion: Motion) -> dict[str, Array]:
        """Return the torque along a motion by what it comes from, recorded side, shape (n, N) each; their sum is the torque.

        The rigid bodies with the rotors, friction by power of speed, and every other term by its name.
        """
        found: dict[str, Array] = {}
        columns = self.model.joint_columns(motion)
        labels = [label for term in self.model.terms for label in _labels(term)]
        for joint, (own, rows) in enumerate(zip(self.model.active, columns, strict=True)):
            for column, row in zip(own, rows, strict=True):
                part = found.setdefault(labels[column], np.zeros((self.robot.n, motion.samples)))
                part[joint] += self.value[column] * row
        return found

    def torque(self, motion: Motion) -> Array:
        """Return the torque along a motion, recorded side, shape (n, N)."""
        columns = self.model.joint_columns(motion)
        return np.array([self.value[own] @ rows for own, rows in zip(self.model.active, columns, strict=True)])


def known_model(found: Identification | Diagnosis) -> KnownModel:
    """Return the model of an identification, or of a diagnosis with the effects found."""
    if isinstance(found, Diagnosis):
        estimate, fitted, held_out, bands = (
            found.after,
            found.training_after,
            found.validation_after,
            found.search.bands,
        )
    else:
        estimate, fitted, held_out, bands = found.estimate, found.training, found.validation, found.bands
    errors = joint_errors(estimate.value, held_out if held_out.data.recordings else fitted)
    rms = np.array([np.nan if error is None else error.rms_unfiltered for error in errors])
    return KnownModel(estimate.model, estimate.value, tuple(bands), rms)


def read_known_model(path: Path | str, robot: Robot) -> KnownModel:
    """Read the model of an ``identification.json``.

    Parameters
    ----------
    path : path
    robot : Robot
        The one that was identified.

    Raises
    ------
    ScaraIdentError
        In one line: it cannot be read, is no such file, or is of another robot or model.
    """
    content = _read(Path(path))
    if content.get("effects"):
        raise ScaraIdentError(
            f"{path}: has effects, which are not read from a file; give the identification.json of the same recordings"
        )
    try:
        name, rows = str(content["model"]), {str(row["name"]): row["value"] for row in content["parameters"]}
    except (KeyError, TypeError):
        raise ScaraIdentError(f"{path}: no model in it; give the identification.json that identify wrote") from None
    if name not in MODELS.names():
        raise ScaraIdentError(f"{path}: model {name!r} is not known here; install the package that adds it")
    model = build_model(robot, name)
    if set(rows) != set(model.names):
        unlike = sorted(set(rows) ^ set(model.names))
        raise ScaraIdentError(
            f"{path}: parameter {unlike[0]!r} is not of both the file and the model {name} of {robot.name}; give the "
            "--robot that was identified"
        )
    value = np.array([rows[each] for each in model.names], dtype=float)
    if not np.all(np.isfinite(value)):
        missing = [each for each, x in zip(model.names, value, strict=True) if not np.isfinite(x)]
        raise ScaraIdentError(f"{path}: parameter {missing[0]!r} has no value; record motion that determines it")
    bands = content.get("band_hz") or {}
    return KnownModel(model, value, tuple(bands.get(joint) for joint in robot.joints), _rms(content, robot.joints))


def _read(path: Path) -> Mapping[str, Any]:
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ScaraIdentError(
            f"{path}: cannot be read: {error.strerror or error}; give an identification.json"
        ) from None
    except ValueError:
        raise ScaraIdentError(f"{path}: not JSON; give the identification.json that identify wrote") from None
    if not isinstance(content, dict):
        raise ScaraIdentError(f"{path}: no model in it; give the identification.json that identify wrote")
    return content


def _rms(content: Mapping[str, Any], joints: Sequence[str]) -> Array:
    """Return the rms error over the recordings held out, else over those fitted, all counted alike; NaN where none is told."""
    errors = content.get("errors") or {}
    runs = [run for run in (errors.get("validation") or errors.get("training") or {}).values() if run]
    found = np.full(len(joints), np.nan)
    for j, joint in enumerate(joints):
        told = [float(run[joint]["rms_unfiltered"]) for run in runs if run.get(joint)]
        if told:
            found[j] = float(np.sqrt(np.mean(np.square(told))))
    return found


def _labels(term: Any) -> list[str]:
    """Name what each column of a term is part of."""
    if isinstance(term, Friction):
        return [f"{column.meaning.partition(' of ')[0]}" for column in term.columns]
    return [term.name.replace("_", " ")] * len(term.columns)
