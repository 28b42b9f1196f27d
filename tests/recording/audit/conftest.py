"""Fixtures of the tests beside."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scara_ident.recording.recording import Recording, read_recording
from scara_ident.robot.robot import Robot
from tests.made_recordings import save
from tests.recording.audit.made import Read


@pytest.fixture
def read(tmp_path: Path, robot: Robot) -> Read:
    def reader(made: dict[str, np.ndarray], other: Robot | None = None, **options: bool) -> Recording:
        return read_recording(save(tmp_path / "run_1.parquet", made), other or robot, **options)

    return reader
