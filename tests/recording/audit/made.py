"""What the tests of the audit ask of a recording and of a refusal."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from scara_ident.errors import RecordingError
from scara_ident.recording.recording import Recording
from scara_ident.robot.robot import Robot

Read = Callable[..., Recording]


def refusal(read: Read, made: dict[str, np.ndarray], other: Robot | None = None) -> str:
    with pytest.raises(RecordingError) as caught:
        read(made, other)
    message = str(caught.value)
    assert "\n" not in message
    assert "run_1.parquet" in message
    return message


def kinds(recording: Recording) -> list[str]:
    return [finding.kind for finding in recording.findings]


def only(recording: Recording, kind: str):
    assert kinds(recording) == [kind]
    finding = recording.findings[0]
    assert "\n" not in finding.message
    return finding
