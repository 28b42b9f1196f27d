"""Evidence made of linear rows, without a robot's motion."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scara_ident.estimation.information import Information
from scara_ident.estimation.observations import Evidence
from scara_ident.model.model import TorqueModel, build_model
from scara_ident.robot.robot import load_robot
from tests.arms import Link, write_urdf

Array = NDArray[np.float64]


def two_joint_model(folder: Path) -> TorqueModel:
    """Two joints about parallel vertical axes: inertial columns shared by both, friction and offset by joint."""
    links = (Link(), Link(xyz=(0.3, 0.0, 0.0)))
    return build_model(load_robot(write_urdf(folder / "arm.urdf", links)), "basic")


def evidence(name: str, w: Array, u: Array, length: int) -> Evidence:
    """Rows of every joint, ``w`` of shape (n, N, p) and ``u`` of shape (n, N), in blocks of ``length`` samples."""
    n, count, p = w.shape
    bounds = [*range(0, count, length), count]
    empty = Information.empty(p)
    blocks = tuple(
        tuple(empty.absorb(w[j, a:b], u[j, a:b]) for j in range(n)) for a, b in zip(bounds, bounds[1:], strict=False)
    )
    unfiltered = tuple(empty.absorb(w[j], u[j]) for j in range(n))
    return Evidence(name, name.rpartition("_")[0], count, blocks, unfiltered, (1,) * n, 0.0, (0.0,) * n)


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
