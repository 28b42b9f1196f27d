"""What is not needed is not loaded: each command as its own process, and the libraries that it leaves alone."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.shared import ROOT

HEAVY = {"matplotlib", "cvxpy", "clarabel", "polars", "mujoco", "numba", "trimesh", "yourdfpy", "h5py", "rosbags"}
PROGRAM = """
import sys
from scara_ident.cli.main import run
status = run(sys.argv[1:])
print()
print(status, *sorted({name.partition(".")[0] for name in sys.modules}))
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "more"),
    [
        (["--help"], {"numpy", "scipy", "pinocchio", "yaml"}),
        (["--version"], {"numpy", "scipy", "pinocchio", "yaml"}),
        (["identify", "--help"], {"numpy", "scipy", "pinocchio", "yaml"}),
        (["diagnose", "--help"], {"numpy", "scipy", "pinocchio", "yaml"}),
        (["base"], set()),
        (["base", "--robot", "ur5"], set()),
        (["paper"], {"pinocchio"}),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_a_command_loads_no_library_that_it_does_not_need(words: list[str], more: set[str], tmp_path: Path):
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, *words], cwd=tmp_path, capture_output=True, text=True, check=True,
        env={"PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    status, *loaded = done.stdout.splitlines()[-1].split()
    assert status == "0"
    assert {"typer", "scara_ident"} <= set(loaded)
    assert set(loaded) & (HEAVY | more) == set()
