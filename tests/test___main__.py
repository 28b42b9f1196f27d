"""The package run as a program."""

from __future__ import annotations

import subprocess
import sys

import pytest

import scara_ident
from tests.shared import PATIENCE


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "status"), [(["--version"], 0), (["base", "--robot", "nowhere.yaml"], 2), (["nothing"], 2)]
)
def test_it_is_the_command(words: list[str], status: int):
    done = subprocess.run(
        [sys.executable, "-m", "scara_ident", *words], capture_output=True, text=True, timeout=PATIENCE, check=False
    )
    assert done.returncode == status
    if status:
        assert done.stderr.startswith("scara-ident: ")
        assert done.stderr.count("\n") == 1
    else:
        assert done.stdout == f"scara-ident {scara_ident.__version__}\n"
