"""Recordings are read while what works on them is loaded."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from scara_ident.cli import reading
from scara_ident.cli.reading import read_beside
from scara_ident.robot.robot import load_robot
from tests.shared import ROOT


def test_nothing_is_read_where_nothing_is_named() -> None:
    with read_beside(load_robot(), [], []) as wanted:
        assert wanted() == [((), []), ((), [])]


@pytest.mark.slow
def test_what_both_processes_need_is_loaded_once_before_there_are_two() -> None:
    program = f"""
import sys
from scara_ident.cli.reading import read_beside
from scara_ident.recording import apart
from scara_ident.robot.robot import load_robot

beside, before = apart.usable_beside, []
apart.usable_beside = lambda *given: before.extend(sys.modules) or beside(*given)
with read_beside(load_robot(), []):
    print(all(name in before for name in {reading.BEFORE!r}))
"""
    done = subprocess.run([sys.executable, "-c", program], cwd=Path(ROOT), capture_output=True, text=True, check=True)
    assert done.stdout == "True\n"


@pytest.mark.slow
def test_what_is_loaded_meanwhile_is_loaded_when_recordings_are_waited_for() -> None:
    program = f"""
import sys
from scara_ident.cli.reading import read_beside
from scara_ident.robot.robot import load_robot

with read_beside(load_robot(), []):
    print(all(name in sys.modules for name in {(*reading.BEFORE, *reading.LATER)!r}))
"""
    done = subprocess.run([sys.executable, "-c", program], cwd=Path(ROOT), capture_output=True, text=True, check=True)
    assert done.stdout == "True\n"
