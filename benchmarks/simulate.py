"""Time the virtual arm: seconds of computing per run, first and later, on one core.

Run ``python benchmarks/simulate.py [--output FILE.json]``.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from importlib.metadata import distribution
from os import environ
from pathlib import Path

import numpy as np

from scara_ident.robot.robot import Robot, load_robot
from scara_ident.simulation import Effect, ReferenceMotion, parse_effect, sampled, simulate, virtual_arm

FIRST = """
import time
start = time.perf_counter()
from scara_ident.paper import OJD
from scara_ident.simulation import sampled, simulate, virtual_arm
arm = virtual_arm()
simulate(arm, sampled("OJD", arm.robot, OJD.motion, 25.0))
print(time.perf_counter() - start)
"""

EFFECTS = {
    "none": (),
    "elastic joints": ("joint_elasticity:joint1", "joint_elasticity:joint2"),
    "loss and presliding": ("transmission_loss:joint1", "transmission_loss:joint2", "presliding:joint1"),
}


def swing(robot: Robot, duration: float) -> ReferenceMotion:
    lower = np.where(np.isfinite(robot.lower), robot.lower, -np.pi)
    upper = np.where(np.isfinite(robot.upper), robot.upper, np.pi)
    middle = 0.5 * (lower + upper)[:, None]
    size = np.minimum(0.2 * (upper - lower), 0.6)[:, None]
    w = np.linspace(0.8, 1.5, robot.n)[:, None]
    return sampled(
        "swing",
        robot,
        lambda t: (middle - size * np.cos(w * t), size * w * np.sin(w * t), size * w**2 * np.cos(w * t)),
        duration,
    )


def example(name: str) -> Robot:
    found = [file for file in distribution("example-robot-data").files or [] if str(file).endswith(f"/{name}")]
    return load_robot(Path(str(found[0].locate())))


def first_runs() -> tuple[float, float]:
    """Return seconds of a new process with an empty cache of machine code and with a full one."""
    with tempfile.TemporaryDirectory() as folder:
        times = []
        for _ in range(2):
            done = subprocess.run(
                [sys.executable, "-c", FIRST],
                env={**environ, "NUMBA_CACHE_DIR": folder},
                capture_output=True,
                text=True,
                check=True,
            )
            times.append(float(done.stdout))
    return times[0], times[1]


def best_of(robot: Robot, motion: ReferenceMotion, effects: tuple[Effect, ...], runs: int = 3) -> tuple[float, int]:
    arm = virtual_arm(robot)
    times = []
    for _ in range(runs + 1):
        start = time.perf_counter()
        result = simulate(arm, motion, effects=effects)
        times.append(time.perf_counter() - start)
    return min(times[1:]), result.substeps


def main() -> None:
    from scara_ident.paper import OJD

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, help="write the table as JSON")
    options = parser.parse_args()
    cold, warm = first_runs()
    rows = []
    scara = load_robot()
    motion = sampled("OJD", scara, OJD.motion, 25.0)
    for name, texts in EFFECTS.items():
        seconds, substeps = best_of(scara, motion, tuple(parse_effect(text) for text in texts))
        rows.append({"arm": "scara03", "joints": 2, "effects": name, "simulated": 25.0, "seconds": seconds})
        rows[-1]["substeps"] = substeps
    for urdf in ("ur5_robot.urdf", "panda.urdf"):
        robot = example(urdf)
        seconds, substeps = best_of(robot, swing(robot, 25.0), ())
        rows.append({"arm": robot.name, "joints": robot.n, "effects": "none", "simulated": 25.0, "seconds": seconds})
        rows[-1]["substeps"] = substeps
    print(f"new process, 25 s of the SCARA03, imports included: {cold:.1f} s compiling, {warm:.2f} s with the cache")
    print(f"{'arm':10}{'joints':>7}{'effects':>22}{'steps/sample':>14}{'simulated s':>13}{'computing s':>13}")
    for row in rows:
        print(
            f"{row['arm']:10}{row['joints']:7}{row['effects']:>22}{row['substeps']:14}{row['simulated']:13.1f}"
            f"{row['seconds']:13.2f}"
        )
    if options.output:
        content = {"first_run_compiling": cold, "first_run_cached": warm, "runs": rows}
        options.output.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
