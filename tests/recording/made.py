"""Recordings as text, and what a refusal says."""

from __future__ import annotations

from pathlib import Path

import pytest

from scara_ident.errors import RecordingError
from scara_ident.recording.recording import (
    read_recording,
)
from scara_ident.robot.robot import Robot
from tests.made_recordings import columns


def refusal(path: Path, robot: Robot) -> str:
    with pytest.raises(RecordingError) as caught:
        read_recording(path, robot)
    message = str(caught.value)
    assert "\n" not in message
    assert path.name in message
    return message


def csv_lines(samples: int = 200) -> list[str]:
    made = columns(samples)
    return [",".join(made)] + [",".join(f"{v:.17g}" for v in row) for row in zip(*made.values(), strict=True)]


def write_text(path: Path, lines: list[str], end: str = "\n", encoding: str = "utf-8") -> Path:
    path.write_bytes((end.join(lines) + end).encode(encoding))
    return path
