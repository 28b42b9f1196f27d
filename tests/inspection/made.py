"""Files to inspect, and the way back from the description to the recording."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from scara_ident.inspection.inspection import Inspection, inspect_file
from scara_ident.recording.recording import read_recording
from scara_ident.robot.robot import embedded_urdf, load_robot
from tests.made_recordings import save
from tests.recording.files.formats import recorded

MADE = recorded(600)


def inspected(path: Path, folder: Path, urdf: Path | None = None) -> Inspection:
    return inspect_file(path, urdf=urdf or embedded_urdf(), folder=folder)


def read_back(found: Inspection, folder: Path, side: str = "motor") -> object:
    """Write the description, state the side that it asks for, and read the recording with it."""
    assert found.description is not None
    text = found.description.replace(f"# effort_side: {side}", f"effort_side: {side}")
    (folder / "robot.yaml").write_text(text, encoding="utf-8")
    return read_recording(found.path, load_robot(folder / "robot.yaml"))


def assert_same(found, tmp_path, *, signals=("position", "effort", "velocity")) -> None:
    wanted = read_recording(save(tmp_path / "contract.parquet", MADE), load_robot())
    np.testing.assert_allclose(found.time - found.time[0], wanted.time, rtol=0, atol=5e-7)
    for signal in signals:
        np.testing.assert_allclose(getattr(found, signal), getattr(wanted, signal), rtol=1e-9, atol=1e-9)
