"""Commands of the package run from a checkout, as a user would run them, and the commands that commits are compared by."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

METHODS = ("ols", "wls", "rls", "consistent")
MODELS = ("complete", "basic")
START = "from scara_ident.cli import main; main()"


@dataclass(frozen=True)
class Run:
    """One command that ended: exit status, wall-clock seconds, peak memory in MB, and what it printed."""

    status: int
    seconds: float
    memory: float
    output: str
    errors: str


def run(checkout: Path, arguments: Sequence[str]) -> Run:
    """Run a command with the package of a checkout and the dependencies of this interpreter."""
    if not (checkout / "scara_ident").is_dir():
        # What is installed would be run in its place.
        raise SystemExit(f"{checkout}: no checkout: it holds no folder scara_ident; see git worktree add")
    environment = os.environ | {"PYTHONPATH": str(checkout.resolve())}
    # Modules that are compiled again in every run are no user's, and more than a tenth of a short command.
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    with tempfile.TemporaryFile("w+") as output, tempfile.TemporaryFile("w+") as errors:
        began = time.perf_counter()
        child = subprocess.Popen(
            [sys.executable, "-P", "-c", START, *arguments], stdout=output, stderr=errors, env=environment
        )
        # The usage of this child alone; `resource.getrusage` knows only the largest of all children.
        _, status, usage = os.wait4(child.pid, 0)
        seconds = time.perf_counter() - began
        child.returncode = os.waitstatus_to_exitcode(status)
        output.seek(0)
        errors.seek(0)
        return Run(child.returncode, seconds, usage.ru_maxrss / 1024.0, output.read(), errors.read())


def held_out(recordings: Sequence[Path]) -> list[str]:
    """Return the options that hold recordings out."""
    return [word for recording in recordings for word in ("--validate", str(recording))]


def measured(data: Path) -> dict[str, tuple[list[str], list[str]]]:
    """Return the arguments of `identify` and `diagnose` for each measured arm, as docs/measured.md has them."""
    ur10e = [data / "ur10e" / f"{name}.parquet" for name in ("ident_50s_12harm", "ident_50s_14harm_noload")]
    more = [data / "ur10e" / f"{name}.parquet" for name in ("ident_20s_8harm", "ident_20s_10harm")]
    tests = [
        data / "ur10e" / f"{name}.parquet" for name in ("ident_40s_12harm", "ident_30s_12harm", "val_ptp_10_points")
    ]
    sets = {
        "emps": [
            [data / "emps" / "identification.parquet"],
            [data / "emps" / "validation_pulses.parquet"],
        ],
        "double_pendulum_c1": _but(data / "double_pendulum_c1", ("C1_154548", "C1_143601")),
        "double_pendulum_a0": _but(data / "double_pendulum_a0", ("A0_0815_03", "A0_0815_11")),
    }
    words = {name: 2 * (_words(train, test, data / name / "robot.yaml"),) for name, (train, test) in sets.items()}
    robot = data / "ur10e" / "robot.yaml"
    words["ur10e"] = (_words(ur10e, tests[:1], robot), _words([*ur10e, *more], tests, robot))
    return words


def cases(folder: Path) -> dict[str, list[str]]:
    """Return the arguments of every folder that has recordings to fit and to hold out."""
    found = sorted(path for path in folder.iterdir() if (path / "train").is_dir())
    return {path.name: [str(path / "train"), *held_out([path / "test"]), *_description(path)] for path in found}


def _description(folder: Path) -> list[str]:
    """Return the option that names the robot, where the folder describes one."""
    path = folder / "robot.yaml"
    return ["--robot", str(path)] if path.exists() else []


def _but(folder: Path, names: Sequence[str]) -> list[list[Path]]:
    recordings = sorted(folder.glob("*.parquet"))
    return [[p for p in recordings if p.stem not in names], [p for p in recordings if p.stem in names]]


def _words(train: Sequence[Path], test: Sequence[Path], robot: Path) -> list[str]:
    return [*map(str, train), *held_out(test), "--robot", str(robot)]
