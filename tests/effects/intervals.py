"""Runs of an arm in which something acts in intervals."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin

from scara_ident.diagnosis.selection.search import scene_of
from scara_ident.effects import Scene
from scara_ident.estimation.least_squares import wls
from scara_ident.estimation.observations import Observations, observe
from scara_ident.model.model import build_model
from scara_ident.motion.prepared import prepare
from scara_ident.recording.recording import Recording
from scara_ident.robot.robot import Robot, load_robot
from tests.arms import PLANAR_2R, Link, noisy, swing, write_urdf

MASS, ARM = 0.5, 0.3
BANDS = (8.0, 8.0)
RATE, SECONDS, NOISE = 200.0, 10.0, 0.05
# By how much offsets of runs differ, N m.
OFFSET = 0.2
# Cycles of a pick and place, and what is taken up midway in two runs.
CYCLES = {
    "m0_1": ((1.0, 3.2), (4.5, 7.0)),
    "m1_1": ((2.0, 4.1), (6.0, 8.3)),
    "m2_1": ((0.8, 2.5), (3.6, 5.2), (7.0, 9.0)),
}
MIDWAY = {"m0_1": ((4.0, SECONDS),), "m2_1": ((6.3, SECONDS),)}
ONE = {"m2_1": ((3.0, 6.5),)}
SINGLE = {"m2_1": ((4.0, SECONDS),)}

# Where the tool is, so that a force on it is known.
TOOL = Link(kind="fixed", xyz=(ARM, 0.0, 0.0), mass=1e-3, com=(0.0, 0.0, 0.0), inertia=(1e-6, 1e-6, 1e-6))

Spells = Mapping[str, tuple[tuple[float, float], ...]]


def arms(path: Path) -> tuple[Robot, Robot]:
    """Return the arm without and with a body on its last link."""
    links = (*PLANAR_2R, TOOL)
    bare, loaded = (load_robot(write_urdf(path / "arm.urdf", links)) for _ in range(2))
    body = pin.Inertia(MASS, np.array([ARM, 0.0, 0.0]), 0.002 * np.eye(3))
    loaded.model.inertias[2] = loaded.model.inertias[2] + body
    return bare, loaded


def run(
    robots: tuple[Robot, Robot],
    seed: int,
    spells: Spells,
    kind: str = "payload",
    *,
    seconds: float = SECONDS,
    offset: float = OFFSET,
) -> Recording:
    """Return a run in which something changes in its intervals; its offsets are its own."""
    bare, loaded = (swing(robot, f"m{seed}_1", seed, seconds, RATE) for robot in robots)
    assert bare.effort is not None and loaded.effort is not None
    rng = np.random.default_rng(seed)
    angle = np.cumsum(bare.position, axis=0)
    # About y a positive angle takes what lies along x down.
    along = -np.array([0.4 * np.sin(angle[0]) + ARM * np.sin(angle[1]), ARM * np.sin(angle[1])])
    up = -np.array([0.4 * np.cos(angle[0]) + ARM * np.cos(angle[1]), ARM * np.cos(angle[1])])
    change = {
        "payload": loaded.effort - bare.effort,
        "offset": np.outer([0.8, -0.5], np.ones_like(bare.time)),
        "friction": 0.5 * np.sign(np.gradient(bare.position, bare.time, axis=1)),
        "scale": 0.1 * bare.effort,
        "contact": -5.0 * along - 2.0 * up,
        "weight": 9.81 * MASS * up,
        "nothing": np.zeros_like(bare.effort),
    }[kind]
    acts = np.zeros(len(bare.time), dtype=bool)
    for start, stop in spells.get(bare.name, ()):
        acts |= (bare.time >= start) & (bare.time < stop)
    own = offset * rng.standard_normal((2, 1))
    return noisy(replace(bare, effort=bare.effort + acts * change + own), rng, NOISE)


def runs(
    robots: tuple[Robot, Robot], spells: Spells, kind: str = "payload", count: int = 3, offset: float = OFFSET
) -> list[Recording]:
    return [run(robots, seed, spells, kind, offset=offset) for seed in range(count)]


def seen(robot: Robot, recordings: list[Recording]) -> tuple[Scene, Observations]:
    """Return the scene of the base model's estimate, and the observations."""
    observations = observe(build_model(robot, "basic"), prepare(recordings, BANDS))
    return scene_of(observations.model, wls(observations).value, observations), observations
