"""How long `diagnose` takes, and how much memory, of an arm in space with several elastic gears.

A virtual arm of six joints stands on a tilted base, and the gears of some of its joints are elastic. It is recorded a few times
in wandering motions of its own, of which the last is held out. Each run is a process of its own, so that its largest memory is
that of the diagnosis.

    python benchmarks/elastic_arm.py --seconds 15
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import resource
import time
from pathlib import Path

import numpy as np
from virtual_motions import random_motion

from scara_ident import diagnose, parse_effect, simulate, virtual_arm
from scara_ident.robot.robot import load_robot

RUNS, RATE = 5, 1000.0
# Stiffness of the elastic gears, N m/rad, from the shoulder on: soft enough that all of them are found.
STIFFNESS = {"shoulder_lift_joint": 9000.0, "elbow_joint": 5000.0, "wrist_1_joint": 900.0}
TILT = "base_tilt:tilt_x=0.02,tilt_y=-0.015"


def main() -> None:
    """Print and write what was found, and what it took."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=15.0, help="duration of each recording")
    parser.add_argument("--elastic", type=int, default=3, help="number of elastic gears")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--repeats", type=int, default=1)
    parser.add_argument("--output", type=Path)
    given = parser.parse_args()
    rows = []
    for _ in range(given.repeats):
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            row = pool.apply(found_of, (given.seed, given.seconds, given.elastic))
        rows.append(row)
        print(
            f"{row['verdict']}: {'; '.join(row['found'])}: {row['seconds']:.1f} s, {row['cpu']:.1f} s of CPU, {row['megabytes']:.0f} MB",
            flush=True,
        )
    if given.output:
        given.output.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")


def found_of(seed: int, seconds: float, elastic: int) -> dict[str, object]:
    """Record an arm, diagnose it, and return what was found and what that took."""
    robot = load_robot("ur5")
    arm = virtual_arm(robot)
    gears = list(STIFFNESS.items())[:elastic]
    effects = [
        parse_effect(text) for text in (TILT, *(f"joint_elasticity:{joint}:stiffness={k}" for joint, k in gears))
    ]
    runs = []
    for k in range(RUNS):
        motion = random_motion(f"t{k}", arm, "fourier", seconds, np.random.default_rng([seed, 10 + k]))
        runs.append(simulate(arm, motion, effects=effects, seed=1000 * seed + k, rate=RATE).recording)
    began, cpu = time.perf_counter(), time.process_time()
    result = diagnose(robot, runs[:-1], validation=runs[-1:])
    return {
        "verdict": result.verdict,
        "found": [item.label for item in result.effects],
        "seconds": time.perf_counter() - began,
        "cpu": time.process_time() - cpu,
        "megabytes": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0,
    }


if __name__ == "__main__":
    main()
