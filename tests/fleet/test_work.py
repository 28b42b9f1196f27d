"""Which files are worked on, and what work is left when something is held."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path

import pytest

from scara_ident.fleet.folder import RecordingFile
from scara_ident.fleet.store import Store
from scara_ident.fleet.work import LateEngine, Settings, Work
from scara_ident.progress import silent
from scara_ident.robot.robot import load_robot
from tests.shared import ROOT


def test_each_content_is_worked_on_once_and_what_is_not_there_is_a_fault(tmp_path: Path):
    files = []
    for arm, text in (("a", "one"), ("b", "one"), ("c", "two"), ("d", None)):
        if text is not None:
            (tmp_path / f"{arm}.csv").write_text(text)
        files.append(RecordingFile(arm, "2026-01-01", "x.csv", str(tmp_path / f"{arm}.csv")))
    work = Work(pickle.dumps(load_robot()), Settings(), Store(tmp_path / "cache"), silent, [])
    assert [file.arm for file in work.keyed(files)] == ["a", "c"]
    assert [(fault.arm, fault.passing) for fault in work.faults] == [("b", False), ("d", True)]


def test_an_engine_starts_for_work_only():
    with ExitStack() as stack:
        late = LateEngine(stack, Settings(scheduler="tcp://127.0.0.1:9"))
        late.run([])


@pytest.mark.slow
def test_a_later_run_has_the_keys_of_this_one(tmp_path: Path):
    # Where a robot were a set of words, each process would have another order of them.
    description = tmp_path / "robot.yaml"
    signals = ["position", "velocity", "effort", "temperature"]
    columns = "\n".join(f"  {signal}: {{column: '{{joint}}.{signal}s'}}" for signal in signals)
    urdf = ROOT / "urdf" / "scara03.urdf"
    description.write_text(
        f"urdf: {urdf}\neffort_side: joint\nrecording:\n  time: {{column: t}}\n{columns}\n", encoding="utf-8"
    )
    program = f"""
import pickle
from hashlib import sha256
from scara_ident.robot.robot import load_robot
print(sha256(pickle.dumps(load_robot({str(description)!r}))).hexdigest())
"""
    command = [sys.executable, "-c", program]
    found = [
        subprocess.run(
            command, env=os.environ | {"PYTHONHASHSEED": seed}, cwd=ROOT, capture_output=True, text=True, check=True
        ).stdout
        for seed in ("1", "2", "3")
    ]
    assert len(set(found)) == 1
    assert len(found[0]) == 65
