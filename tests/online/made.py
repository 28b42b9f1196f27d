"""A two-joint arm on sums of sines, sample by sample, whose parameters may change on the way."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np

from scara_ident.model.model import TorqueModel, build_model
from scara_ident.motion.motion import Motion
from scara_ident.paper import table5_parameters
from scara_ident.robot.robot import load_robot
from tests.arms import Array, sines

RATE = 500.0
NOISE = np.array([0.04, 0.012])


@cache
def model() -> TorqueModel:
    return build_model(load_robot(), "basic")


@cache
def truth() -> Array:
    paper = dict(zip(build_model(load_robot()).names, np.append(table5_parameters("OJD"), [0.0] * 15), strict=False))
    known = np.array([paper.get(name, 0.0) for name in model().names])
    for name, value in (("a01", 0.21), ("a11", 0.09), ("a02", 0.09), ("a12", 0.05), ("p_o1", 0.01), ("p_o2", -0.01)):
        known[model().names.index(name)] = value
    return known


def signals(seconds: float, seed: int = 0) -> list[Array]:
    """Position, velocity, acceleration, shape (n, N) each."""
    time = np.arange(round(seconds * RATE)) / RATE
    return sines(np.random.default_rng(seed), time, 2, lowest=0.3)


def columns(q: Array, v: Array, a: Array) -> tuple[Array, ...]:
    return model().joint_columns(Motion("m", "m", np.arange(float(q.shape[1])), q, v, a, None, RATE))


def torque(states: Sequence[Array], value: Array, scale: Sequence[float] = (1.0, 1.0), seed: int = 1) -> Array:
    rows = columns(*states)
    clean = np.array([value[own] @ each for own, each in zip(model().active, rows, strict=True)])
    noise = NOISE[:, None] * np.random.default_rng(seed).standard_normal(clean.shape)
    return np.asarray(np.array(scale)[:, None] * clean + noise)
