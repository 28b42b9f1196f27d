"""Whether the wheel works where nothing else is: built, installed into an empty environment of each Python, and used.

    python benchmarks/wheels.py [--python PATH]... [--extra NAME]... [--lowest] [--keep FOLDER]

Without --python it takes every python3.11 to python3.14 that starts. Packages come from where pip is told to look. With --lowest
uv installs the oldest version of each dependency that pyproject.toml allows: what somebody has who installed them long ago.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from itertools import chain
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
VERSIONS = ("3.11", "3.12", "3.13", "3.14")
# What each extra brings, by the name it is imported by.
EXTRAS = {
    "ros": "rosbags",
    "hdf5": "h5py",
    "casadi": "casadi",
    "mujoco": "mujoco",
    "fleet": "dask, distributed, fsspec, s3fs",
}
USED = """
import pickle
from scara_ident import identify, load_robot, named_motion, simulate, virtual_arm
robot = load_robot()
run = simulate(virtual_arm(robot), named_motion("OJK", robot), rate=250.0)
result = identify(robot, [run.recording], method="consistent")
result.save("identification.json")
print(pickle.loads(pickle.dumps(result)), result.predict([0.1, 0.2], [0.5, -0.5], [1.0, 2.0]))
"""


def interpreters() -> list[str]:
    """Return the Pythons of VERSIONS that start."""
    found = []
    for version in VERSIONS:
        name = f"python{version}"
        path = shutil.which(name)
        if path is not None and subprocess.run([path, "-c", ""], capture_output=True, check=False).returncode == 0:
            found.append(path)
        else:
            print(f"{name}: not here", flush=True)
    return found


def run(words: list[str | Path], folder: Path) -> str:
    """Run a command in a folder; stop with what it says if it fails."""
    done = subprocess.run([str(word) for word in words], cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(
            f"{' '.join(map(str, words))}: exit status {done.returncode}\n{done.stdout[-2000:]}{done.stderr[-4000:]}"
        )
    return done.stdout.strip()


def install(own: Path, wanted: str, extras: list[str], folder: Path, *, lowest: bool) -> None:
    """Install a wheel and what it needs, the newest or the oldest that will do."""
    if lowest:
        run([own, "-m", "pip", "install", "--quiet", "uv"], folder)
        # Of a wheel only what is named beside it counts as direct.
        project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
        named = [
            *project["dependencies"],
            *chain.from_iterable(project["optional-dependencies"][name] for name in extras),
        ]
        words: list[str | Path] = ["uv", "pip", "install", "--quiet", "--python", own, "--resolution", "lowest-direct"]
        run([own, "-m", *words, wanted, *named], folder)
    else:
        run([own, "-m", "pip", "install", "--quiet", wanted], folder)


def check(python: str, wheel: Path, extras: list[str], folder: Path, *, lowest: bool) -> None:
    """Install the wheel with a Python into an environment of its own, and use it there."""
    began = time.monotonic()
    version = run([python, "-c", "import platform; print(platform.python_version())"], folder)
    place = folder / f"python-{version}"
    run([python, "-m", "venv", place], folder)
    own = place / "bin" / "python"
    wanted = f"{wheel}[{','.join(extras)}]" if extras else str(wheel)
    install(own, wanted, extras, folder, lowest=lowest)
    installed = time.monotonic() - began
    work = place / "work"
    work.mkdir()
    said = run([place / "bin" / "scara-ident", "--version"], work)
    if run([own, "-m", "scara_ident", "--version"], work) != said:
        sys.exit(f"{version}: the command and the module are of different versions")
    run([place / "bin" / "scara-ident", "simulate", "OJK", "--output", "logs"], work)
    run([place / "bin" / "scara-ident", "identify", "logs", "--output", "out"], work)
    if not (work / "out" / "report.html").is_file():
        sys.exit(f"{version}: identify wrote no report")
    for extra in extras:
        run([own, "-c", f"import {EXTRAS[extra]}"], work)
    result = run([own, "-c", USED], work)
    used = time.monotonic() - began - installed
    print(f"Python {version}: {said}; {result}; installed in {installed:.0f} s, used in {used:.0f} s", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--python", action="append", help="a Python to try; may be repeated")
    parser.add_argument("--extra", action="append", default=[], choices=sorted(EXTRAS), help="may be repeated")
    parser.add_argument("--lowest", action="store_true", help="the oldest versions that pyproject.toml allows")
    parser.add_argument("--keep", type=Path, help="where the environments are made, and stay")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = (given.keep or Path(temporary)).resolve()
        folder.mkdir(parents=True, exist_ok=True)
        run([sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", folder, ROOT], folder)
        (wheel,) = folder.glob("scara_ident-*.whl")
        for python in given.python or interpreters():
            check(python, wheel, given.extra, folder, lowest=given.lowest)


if __name__ == "__main__":
    main()
