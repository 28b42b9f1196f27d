"""How cost grows: with joints, recordings and candidates; and the bandwidth of the memory as the limit."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from identification import ARMS, ROBOTS, recordings_of, robot_of
from ways import high_water
from ways import robot_of as with_joints

from scara_ident import Motion, build_model, identify, load_robot
from scara_ident.diagnosis.candidates.candidates import CandidateColumns
from scara_ident.diagnosis.selection.search import scene_of
from scara_ident.estimation.from_motion import information_of
from scara_ident.fleet.visit import watched

Array = np.ndarray
SAMPLES = 100_000
PANDA = str(ROBOTS / "panda_description/urdf/panda.urdf")


def timed(repeats: int, function: Callable[[], Any]) -> float:
    """Return the median of seconds, after a first call."""
    function()
    found = []
    for _ in range(repeats):
        start = time.perf_counter()
        function()
        found.append(time.perf_counter() - start)
    return median(found)


def random_motion(n: int, samples: int) -> Motion:
    q, v, a, torque = np.random.default_rng(0).uniform(-2.0, 2.0, (4, n, samples))
    return Motion("random", "random", np.arange(samples) / 1000.0, q, v, a, torque, 1000.0)


def joints(repeats: int) -> list[dict[str, Any]]:
    """Measure arrays to factors on the Panda with its first joints free and the others locked."""
    found = []
    for n in range(2, 8):
        model = build_model(with_joints(PANDA, [f"panda_joint{k}" for k in range(1, n + 1)]), "basic")
        motion = random_motion(n, SAMPLES)
        seconds = timed(repeats, lambda model=model, motion=motion: information_of(model, motion))
        found.append({"joints": n, "parameters": len(model.columns), "microseconds": 1e6 * seconds / SAMPLES})
    return found


def recordings(repeats: int) -> list[dict[str, Any]]:
    """Measure `identify` on more and more recordings of 25 s at 1 kHz."""
    robot = load_robot()
    arm = ARMS["SCARA03"]
    each = recordings_of(robot, arm)
    identify(robot, each[:1])
    before, _ = high_water()
    found = []
    for count in (1, 2, 4, 8):
        some = each[:count]
        Path("/proc/self/clear_refs").write_text("5", encoding="utf-8")
        seconds = timed(repeats, lambda some=some: identify(robot, some))
        found.append({"recordings": count, "seconds": seconds, "extra_mb": high_water()[1] - before})
    return found


def candidates(repeats: int) -> list[dict[str, Any]]:
    """Measure the columns of more and more candidate effects on one recording of 25 s at 1 kHz."""
    robot = load_robot()
    result = identify(robot, recordings_of(robot, ARMS["SCARA03"])[:1])
    scene = scene_of(result.model, result.estimate.value, result.training)
    every = watched(scene)
    found = []
    for count in (2, 4, 8, 16):
        some = every[:count]
        # Anew each time: what is shared between candidates is made once and kept.
        seconds = timed(repeats, lambda some=some: CandidateColumns(result.training).rows(scene, some))
        found.append({"candidates": len(some), "milliseconds": 1e3 * seconds})
    return found


def bandwidth(repeats: int) -> list[dict[str, Any]]:
    """Measure how fast memory is filled, and what share of that speed the regressor is written at."""
    small, large = np.empty(4096 * 40), np.empty(32_000_000)
    rates = {
        name: size * 8 / timed(4 * repeats, lambda array=array: array.fill(1.0)) / 1e9
        for name, array, size in (("cache", small, small.size), ("memory", large, large.size))
    }
    found = []
    for name, arm in ARMS.items():
        model = build_model(robot_of(arm), "basic")
        motion = random_motion(model.robot.n, 4096)
        rows = [np.empty((len(own), 4096)) for own in model.active]
        seconds = timed(20 * repeats, lambda model=model, motion=motion, rows=rows: model.joint_columns(motion, rows))
        count = sum(map(len, model.active))
        written = 8 * count * 4096 / seconds / 1e9
        found.append(
            {
                "arm": name,
                "entries": count,
                "fill_cache": rates["cache"],
                "fill_memory": rates["memory"],
                "regressor": written,
                "microseconds": 1e6 * seconds / 4096,
                "floor": 8e-3 * count / rates["cache"],
            }
        )
    return found
