"""The proof of speed: this package beside figaroh and the plain Pinocchio loop, and how its cost grows.

Each table is measured by itself and kept with the machine, its load and the date in `benchmarks/results/bench.json`;
`docs/benchmarks.md` is written from that. Ways that are compared run in turn, each in a process of its own.

    python benchmarks/bench.py [--full] [--only arrays recursion ...] [--figaroh PYTHON]
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import shlex
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from bench_growth import bandwidth, candidates, joints, recordings
from bench_page import PAGE, RESULTS, page
from bench_recursion import recursion
from fleet import measured_speed

ROOT = Path(__file__).resolve().parents[1]
PANDA = tuple(f"panda_joint{k}" for k in range(1, 8))
UR5 = tuple(f"{name}_joint" for name in ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3"))
# Of those that keep all rows: the most samples at which their arrays leave this machine's memory free.
MAX_ROWS = 4_000_000
# Samples at which it is found whether one or two BLAS threads suit them; above so many they are measured once.
PROBED = 20_000
ONCE_FROM = 100_000


@dataclass(frozen=True)
class Asked:
    """How thoroughly, and where figaroh is."""

    repeats: int
    figaroh: str
    arms: int
    folder: Path


def robots() -> dict[str, tuple[str, tuple[str, ...]]]:
    """Return URDF and joints of each arm."""
    from identification import ROBOTS

    return {
        "SCARA03": (str(ROOT / "urdf" / "scara03.urdf"), ("joint1", "joint2")),
        "UR5": (str(ROBOTS / "ur_description/urdf/ur5_robot.urdf"), UR5),
        "Panda": (str(ROBOTS / "panda_description/urdf/panda.urdf"), PANDA),
    }


def once(asked: Asked, way: str, arm: str, samples: int, blas: int) -> dict[str, Any]:
    """Run one way in a process of its own."""
    urdf, names = robots()[arm]
    python = asked.figaroh if way.startswith("figaroh") else sys.executable
    place = asked.folder / f"{way}.npy"
    command = [python, str(ROOT / "benchmarks" / "ways.py"), "--way", way, "--urdf", urdf, "--joints", *names]
    threads = {name: str(blas) for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")}
    done = subprocess.run(
        [*command, "--samples", str(samples), "--predicted", str(place)],
        env=os.environ | threads | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise SystemExit(f"{way}, {arm}, {samples} samples: {done.stderr.strip().splitlines()[-1:]}")
    return dict(json.loads(done.stdout.splitlines()[-1])) | {
        "predicted": np.load(place),
        "truth": np.load(place.with_suffix(".truth.npy")),
    }


def apart(one: dict[str, Any], other: dict[str, Any]) -> float:
    """Return the largest difference of predicted torques over the largest torque of its joint."""
    size = np.abs(one["truth"]).max(axis=0)
    return float(np.max(np.abs(one["predicted"] - other["predicted"]) / size))


def in_turn(asked: Asked, ways: dict[str, int], arm: str, samples: int) -> dict[str, list[dict[str, Any]]]:
    """Run ways one after the other within each repeat, each with its BLAS threads; those of all rows once if these are many."""
    runs: dict[str, list[dict[str, Any]]] = {way: [] for way in ways}
    for turn in range(asked.repeats):
        for way, blas in ways.items():
            if turn == 0 or samples <= ONCE_FROM or way.startswith("scara_ident"):
                runs[way].append(once(asked, way, arm, samples, blas))
    return runs


def medians(runs: list[dict[str, Any]]) -> dict[str, float]:
    return {key: median(run[key] for run in runs) for key in ("seconds", "cpu_seconds", "extra_mb")}


def arrays(asked: Asked) -> list[dict[str, Any]]:
    """Time and memory from arrays to parameters, three ways, three arms, three lengths."""
    found = []
    for arm, (_, names) in robots().items():
        # The BLAS threads with which each of the others is faster.
        slow = {
            way: min((1, 2), key=lambda blas: once(asked, way, arm, PROBED, blas)["seconds"])
            for way in ("loop", "figaroh")
        }
        for samples in (10_000, 100_000, 1_000_000):
            held = {way: blas for way, blas in slow.items() if samples * len(names) <= MAX_ROWS}
            if samples == 1_000_000:
                held.pop("figaroh", None)
            runs = in_turn(asked, {"scara_ident": 1} | held, arm, samples)

            row: dict[str, Any] = {"arm": arm, "joints": len(names), "samples": samples, "blas_threads": slow}
            row["ways"] = {way: medians(each) for way, each in runs.items()}
            row["apart"] = {way: apart(runs["scara_ident"][0], runs[way][0]) for way in held}
            found.append(row)
            told(row)
    return found


def consistent(asked: Asked) -> list[dict[str, Any]]:
    """Estimates that a real arm can have, from 10,000 samples."""
    found = []
    for arm, (_, names) in robots().items():
        ways = {"scara_ident_consistent": 1, "figaroh_consistent": 1}
        runs = in_turn(asked, ways, arm, 10_000)
        row: dict[str, Any] = {"arm": arm, "joints": len(names), "samples": 10_000}
        row["ways"] = {
            way: medians(each)
            | {
                "error": float(
                    np.sqrt(np.mean((each[0]["predicted"] - each[0]["truth"]) ** 2) / np.mean(each[0]["truth"] ** 2))
                )
            }
            for way, each in runs.items()
        }
        found.append(row)
        told(row)
    return found


def fleet(asked: Asked) -> dict[str, Any]:
    """Recordings a second, from files to the table, by number of workers."""
    return measured_speed(asked.folder, asked.arms, asked.repeats)


def told(row: dict[str, Any]) -> None:
    print(json.dumps(row), file=sys.stderr, flush=True)


TABLES: dict[str, Callable[[Asked], Any]] = {
    "arrays": arrays,
    "recursion": lambda asked: recursion(asked.repeats),
    "consistent": consistent,
    "joints": lambda asked: joints(asked.repeats),
    "recordings": lambda asked: recordings(asked.repeats),
    "candidates": lambda asked: candidates(asked.repeats),
    "bandwidth": lambda asked: bandwidth(asked.repeats),
    "fleet": fleet,
}


def machine() -> dict[str, Any]:
    """Return what the figures belong to."""
    names = Path("/proc/cpuinfo")
    lines = names.read_text(encoding="utf-8").splitlines() if names.is_file() else []
    models = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return {
        "processor": next(models, platform.processor() or platform.machine()),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "versions": {name: version(name) for name in ("numpy", "scipy", "pin", "dask")},
    }


def figaroh_version(python: str) -> str | None:
    """Return the version of figaroh of a Python; None where it has none."""
    code = "from importlib.metadata import version; print(version('figaroh'))"
    try:
        done = subprocess.run([python, "-c", code], capture_output=True, text=True, check=False)
    except OSError:
        return None
    return done.stdout.strip() or None


def measured(asked: Asked, names: list[str]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Measure tables, each with what it was measured on."""
    other = figaroh_version(asked.figaroh)
    for name in names:
        if other is None and name in ("arrays", "consistent"):
            raise SystemExit(
                f"{asked.figaroh}: no figaroh there; install it with: {asked.figaroh} -m pip install figaroh"
            )
        load, start = os.getloadavg()[0], time.perf_counter()
        rows = TABLES[name](asked)
        yield (
            name,
            {
                "date": datetime.now(UTC).date().isoformat(),
                "load_before": round(load, 1),
                "seconds": round(time.perf_counter() - start),
                "repeats": asked.repeats,
                "machine": machine() | ({"figaroh": other} if other else {}),
                "rows": rows,
            },
        )


def main() -> None:
    """Measure, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--full", action="store_true", help="seven repeats for three, and the fleet of 200 arms for 20")
    parser.add_argument("--repeats", type=int, help="in place of these")
    parser.add_argument("--folder", type=Path, help="where the fleet's recordings are kept")
    parser.add_argument("--only", nargs="+", choices=list(TABLES), default=list(TABLES))
    parser.add_argument("--figaroh", default="build/figaroh/bin/python", help="a Python that has figaroh")
    parser.add_argument("--results", type=Path, default=RESULTS)
    options = parser.parse_args()
    held = json.loads(options.results.read_text(encoding="utf-8")) if options.results.is_file() else {}
    with tempfile.TemporaryDirectory() as folder:
        repeats = options.repeats or (7 if options.full else 3)
        place = options.folder or Path(folder)
        place.mkdir(parents=True, exist_ok=True)
        asked = Asked(repeats, options.figaroh, 200 if options.full else 20, place)
        for name, table in measured(asked, options.only):
            asking = ["--full"] * options.full + (["--repeats", str(options.repeats)] if options.repeats else [])
            command = shlex.join(["python", "benchmarks/bench.py", *asking, "--only", name])
            held[name] = table | {"command": command}
            options.results.write_text(json.dumps(held, indent=1) + "\n", encoding="utf-8")
    PAGE.write_text(page(held), encoding="utf-8")
    print(f"written to {PAGE}")


if __name__ == "__main__":
    main()
