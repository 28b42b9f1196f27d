"""Memory and time of `identify` on one long file, by its length: each in a process of its own.

Run ``python benchmarks/streaming.py [--samples 1e6 3e6 1e7] [--robot NAME] [--whole]``. The recording is an arm that repeats a
motion of 20 s at 1 kHz, with noise that does not repeat. ``--whole`` reads the same files at once, for comparison.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from scara_ident.identification.identify import identify
from scara_ident.model.model import build_model
from scara_ident.motion.motion import Motion
from scara_ident.recording import long_file
from scara_ident.recording.recording import read_recording
from scara_ident.robot.robot import load_robot

RATE, PERIOD, HARMONICS = 1000.0, 20.0, 20
POSITION_NOISE, TORQUE_NOISE = 2e-6, 0.02
# Samples of a group of rows, and periods that are written together.
GROUP, TOGETHER = 250_000, 50


def write_long(path: Path, samples: int, name: str | None, seed: int = 0) -> None:
    """Write a recording of so many samples without holding it."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    robot = load_robot(name)
    model = build_model(robot)
    random = np.random.default_rng(seed)
    count = round(RATE * PERIOD)
    clock = np.arange(count) / RATE
    wave = 2.0 * np.pi / PERIOD * np.arange(1, HARMONICS + 1)[:, None, None]
    phase, size = random.uniform(0.0, 2.0 * np.pi, (2, HARMONICS, robot.n, 1))
    size = 0.06 * size / np.arange(1, HARMONICS + 1)[:, None, None] ** 0.5
    angle = wave * clock + phase
    motion = Motion(
        "long", "long", clock, np.sum(size * np.sin(angle), 0), np.sum(size * wave * np.cos(angle), 0),
        -np.sum(size * wave**2 * np.sin(angle), 0), None, RATE,
    )  # fmt: skip
    value = random.uniform(0.5, 1.5, len(model.columns))
    clean = np.array([value[own] @ rows for own, rows in zip(model.active, model.joint_columns(motion), strict=True)])
    sigma = TORQUE_NOISE * np.std(clean, axis=1)
    names = ["time", *(f"{joint}.{signal}" for joint in robot.joints for signal in ("position", "effort"))]
    schema = pa.schema([(column, pa.float64()) for column in names])
    with pq.ParquetWriter(path, schema) as writer:
        for start in range(0, samples, TOGETHER * count):
            rows = min(TOGETHER * count, samples - start)
            columns = {"time": np.arange(start, start + rows) / RATE}
            for j, joint in enumerate(robot.joints):
                place = np.arange(rows) % count
                columns[f"{joint}.position"] = motion.q[j][place] + POSITION_NOISE * random.standard_normal(rows)
                effort = clean[j][place] + sigma[j] * random.standard_normal(rows)
                columns[f"{joint}.effort"] = effort / robot.effort_gain[j]
            writer.write_table(pa.table(columns, schema=schema), row_group_size=GROUP)


def peak_memory() -> float:
    """Return the most memory that this process has had, MB; what getrusage says holds the parent's, too."""
    line = next(line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmHWM"))
    return float(line.split()[1]) / 1e3


def measure(path: Path, name: str | None, *, whole: bool) -> None:
    """Identify from one file, and print what it took as JSON."""
    if whole:
        long_file.LONGEST_WHOLE = sys.maxsize
    robot = load_robot(name)
    before = peak_memory()
    start = time.perf_counter(), time.process_time()
    result = identify(robot, [read_recording(path, robot)])
    spent = time.perf_counter() - start[0], time.process_time() - start[1]
    found = {"samples": result.training.samples, "seconds": spent[0], "cpu": spent[1], "before": before}
    found["peak"] = peak_memory()
    print(json.dumps(found | {"value": result.estimate.value.tolist(), "std": result.estimate.std.tolist()}))


def run(path: Path, name: str | None, *, whole: bool) -> dict[str, float]:
    """Measure in a process of its own."""
    given = [sys.executable, __file__, "--file", str(path), *(["--robot", name] if name else [])]
    done = subprocess.run([*given, *(["--whole"] if whole else [])], capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(done.stderr[-2000:])
    return json.loads(done.stdout)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--samples", type=float, nargs="+", default=[1e6, 3e6, 1e7])
    parser.add_argument("--robot")
    parser.add_argument("--whole", action="store_true")
    parser.add_argument("--file", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.file is not None:
        measure(options.file, options.robot, whole=options.whole)
        return
    print(f"{platform.machine()}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
    print(f"{'samples':>10} {'file MB':>8} {'s':>7} {'CPU s':>7} {'peak MB':>8} {'above start MB':>15}")
    with tempfile.TemporaryDirectory() as folder:
        for samples in map(int, options.samples):
            path = Path(folder, "long_1.parquet")
            write_long(path, samples, options.robot)
            found = run(path, options.robot, whole=options.whole)
            size, peak = path.stat().st_size / 1e6, found["peak"]
            above = found["peak"] - found["before"]
            print(
                f"{samples:10d} {size:8.0f} {found['seconds']:7.1f} {found['cpu']:7.1f} {peak:8.0f} {above:15.0f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
