"""Observations made of linear rows, without a robot's motion."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scara_ident.estimation.joint_rows import JointRows, joined
from scara_ident.estimation.observations import Observations
from scara_ident.estimation.sample_columns import SampleColumns
from scara_ident.model.model import TorqueModel, build_model
from scara_ident.motion.prepared import PreparedData, PreparedRecording, prepare
from scara_ident.robot.robot import load_robot
from tests.arms import Link, recording, write_urdf

Array = NDArray[np.float64]


def two_joint_model(folder: Path) -> TorqueModel:
    """Two joints about parallel vertical axes: inertial columns shared by both, friction and offset by joint."""
    links = (Link(), Link(xyz=(0.3, 0.0, 0.0)))
    return build_model(load_robot(write_urdf(folder / "arm.urdf", links)), "basic")


def linear(model: TorqueModel, name: str, w: Array, u: Array, length: int) -> Observations:
    """Rows of every joint, ``w`` of shape (n, N, p) and ``u`` of shape (n, N), in blocks of ``length`` samples."""
    starts = np.array([*range(0, u.shape[1], length), u.shape[1]])
    raw = tuple(w[j][:, own].T for j, own in enumerate(model.active))
    joints = tuple(
        JointRows(own, np.vstack([columns, torque]), starts, np.diff(starts).astype(float))
        for own, columns, torque in zip(model.active, raw, u, strict=True)
    )
    data = PreparedData((_prepared(model, name, u),), (None,) * len(u))
    return Observations(model, data, joints, np.zeros(len(starts) - 1, dtype=np.intp), ((raw,),))


def _prepared(model: TorqueModel, name: str, u: Array) -> PreparedRecording:
    """A recording of nothing but torque, of which every sample is used."""
    time = np.arange(u.shape[1]) / 1000.0
    (made,) = prepare([recording(model.robot, name, time, np.zeros_like(u), u)]).recordings
    for part in made.stretches:
        vars(part).update(trim=0, rest=np.zeros(u.shape, dtype=bool), used=np.ones(u.shape, dtype=bool))
    return made


def together(items: Sequence[Observations]) -> Observations:
    """Return the observations of several recordings as those of one set of data."""
    data = PreparedData(tuple(one for item in items for one in item.data.recordings), items[0].data.bands)
    joints, _ = joined([item.joints for item in items], items[0].model.active)
    firsts = np.cumsum([0, *(len(item.data.recordings) for item in items)])
    owner = np.concatenate([item.owner + first for item, first in zip(items, firsts[:-1], strict=True)])
    raw = SampleColumns(items[0].model, data.recordings, tuple(raw for item in items for raw in item.raw))
    return Observations(items[0].model, data, joints, owner, raw)


def rows(rng: np.random.Generator, model: TorqueModel, count: int) -> Array:
    """Slow sines where the model has entries, and ones under the offsets; shape (n, N, p)."""
    time = np.arange(count)
    w = np.zeros((model.robot.n, count, len(model.columns)))
    for j, k in zip(*np.nonzero(model.pattern), strict=True):
        if model.columns[k].name.startswith("p_o"):
            w[j, :, k] = 1.0
        else:
            w[j, :, k] = np.sin(2 * np.pi * time * rng.uniform(0.001, 0.02) + rng.uniform(0, 6))
    return w
