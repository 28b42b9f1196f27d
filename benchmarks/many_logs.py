"""Time and peak memory of `identify` and `diagnose` on a folder of many logs.

Random motions of a virtual arm with a torque ripple on one joint are recorded, and both commands run on more and more of them,
each in a process of its own.

    python benchmarks/many_logs.py --robot ur5 --joint elbow_joint --logs 5 10 60 --output benchmarks/results/many_logs.json
"""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path

import numpy as np
from checkouts import run
from virtual_motions import KINDS, random_motion

from scara_ident import load_robot, parse_effect, simulate, virtual_arm, write_recording

CHECKOUT = Path(__file__).resolve().parents[1]


def main() -> None:
    """Print and write what was measured."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robot", default="ur5")
    parser.add_argument("--joint", default="elbow_joint", help="joint with a ripple of 1 N m")
    parser.add_argument("--logs", type=int, nargs="+", default=[5, 10, 60])
    parser.add_argument("--seconds", type=float, default=60.0, help="length of each log")
    parser.add_argument("--rate", type=float, default=1000.0)
    parser.add_argument("--checkout", type=Path, default=CHECKOUT, help="whose package runs")
    parser.add_argument("--output", type=Path)
    given = parser.parse_args()
    rows = []
    print(f"{'command':10}{'logs':>6}{'samples':>10}{'s':>8}{'MB':>8}")
    with tempfile.TemporaryDirectory() as place:
        logs = recorded(given.robot, given.joint, max(given.logs), given.seconds, given.rate, Path(place))
        for count in given.logs:
            for command in ("identify", "diagnose"):
                words = [command, *map(str, logs[:count]), "--robot", given.robot]
                took = run(given.checkout, words)
                if took.status:
                    raise SystemExit(f"{' '.join(words)}: status {took.status}: {took.errors.strip()}")
                samples = round(count * given.seconds * given.rate)
                row = {
                    "command": command,
                    "logs": count,
                    "samples": samples,
                    "seconds": took.seconds,
                    "memory_mb": took.memory,
                }
                rows.append(row)
                print(f"{command:10}{count:6}{samples:10}{took.seconds:8.1f}{took.memory:8.0f}", flush=True)
    if given.output:
        given.output.parent.mkdir(parents=True, exist_ok=True)
        given.output.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")


def recorded(name: str, joint: str, count: int, seconds: float, rate: float, place: Path) -> list[Path]:
    """Write so many logs, and return their paths."""
    arm, made = virtual_arm(load_robot(name)), []
    effects = [parse_effect(f"torque_ripple:{joint}:amplitude=1.0")]
    for k in range(count):
        motion = random_motion(f"log{k}", arm, KINDS[k % len(KINDS)], seconds, np.random.default_rng([7, k]))
        made.append(place / f"log{k}_1.parquet")
        write_recording(simulate(arm, motion, effects=effects, seed=100 + k, rate=rate).recording, made[-1])
    return made


if __name__ == "__main__":
    main()
