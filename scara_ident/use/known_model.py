"""A model with its parameters, from an identification at hand or from its file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from scara_ident.arrays import Array
from scara_ident.diagnosis.diagnose import Diagnosis
from scara_ident.errors import ScaraIdentError
from scara_ident.estimation.estimate import joint_errors
from scara_ident.export.result import read_content, read_identified
from scara_ident.identification.identify import Identification
from scara_ident.model.model import TorqueModel
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


def read_known_model(path: Path | str, robot: Path | None = None) -> KnownModel:
    """Read the model of an ``identification.json``, or of a ``diagnosis.json`` with the effects found.

    Parameters
    ----------
    path : path
    robot : path, optional
        A robot description to take instead of the one that the result was found with.

    Raises
    ------
    ScaraIdentError
        In one line: it cannot be read, is no such file, is of another robot, or leaves a parameter open.
    """
    found, content = read_identified(path, robot), read_content(Path(path))
    if found.undetermined.any():
        missing = found.model.names[int(np.argmax(found.undetermined))]
        raise ScaraIdentError(f"{path}: parameter {missing!r} has no value; record motion that determines it")
    bands, joints = content.get("band_hz") or {}, found.robot.joints
    return KnownModel(found.model, found.value, tuple(bands.get(joint) for joint in joints), _rms(content, joints))


def _rms(content: Mapping[str, Any], joints: Sequence[str]) -> Array:
    """Return the rms error over the recordings held out, else over those fitted, all counted alike; NaN where none is told."""
    whole = content.get("validation") or content.get("training")
    if whole:
        return np.array([whole["after_unfiltered"][joint] for joint in joints], dtype=float)
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
