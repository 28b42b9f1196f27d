"""Logs and URDFs as people have them are each read right, or refused with the remedy."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from scara_ident.errors import ScaraIdentError
from scara_ident.inspection.inspection import Inspection, inspect_file
from scara_ident.recording.recording import read_recording
from scara_ident.robot.robot import load_robot
from tests.inspection.odd_logs import LOGS, MADE, Log


def test_there_are_many():
    assert len(LOGS) >= 40
    assert len({log.name for log in LOGS}) == len(LOGS)


@pytest.mark.slow
@pytest.mark.parametrize("log", LOGS, ids=lambda log: log.name)
def test_a_log_is_read_right_or_refused_with_the_remedy(log: Log, tmp_path: Path):
    urdf, path = log.urdf(tmp_path), log.write(tmp_path)
    try:
        found = inspect_file(path, urdf=urdf, joints=log.pattern, folder=tmp_path)
    except ScaraIdentError as error:
        assert re.search(log.refused, str(error)), str(error)
        assert log.refused
        assert "\n" not in str(error)
        return
    said = "\n".join((*found.problems, found.refusal or ""))
    if log.refused:
        assert re.search(log.refused, said), said
        assert found.recording is None
        return
    assert not said.strip(), said
    read_like(log, found, tmp_path)


def read_like(log: Log, found: Inspection, folder: Path) -> None:
    """The recording is the one that was written, by the first description and by nothing else."""
    assert found.description is not None
    text = found.description.replace("# effort_side: joint", "effort_side: joint")
    (folder / "robot.yaml").write_text(text, encoding="utf-8")
    has_effort = "effort" in {column.quantity for column in found.columns if column.channel}
    recording = read_recording(found.path, load_robot(folder / "robot.yaml"), need_effort=has_effort)
    notes = "\n".join((*found.notes, *(finding.message for finding in recording.findings)))
    assert re.search(log.note, notes), notes
    assert recording.joints == log.joints
    made = log.made or MADE
    # Of rows that were sampled apart the ends are missing, and interpolated ones are as good as the cubic: of efforts
    # of 5 N m at 1 Hz its slopes err by h^2 / 6 of the third derivative, and it by a quarter of h times that.
    resampled = "interpolated onto" in notes
    exact = max(log.exact, 5.0 * (2 * np.pi * 1.3) ** 3 * 0.01**3 / 24 + 0.06 if resampled else 0.0)
    at = np.searchsorted(made["time"] - made["time"][0], recording.time - recording.time[0] - 2e-3)
    assert len(at) >= len(made["time"]) - (2 if resampled else 0)
    at += int(resampled)
    np.testing.assert_allclose(
        recording.time - recording.time[0], made["time"][at] - made["time"][at[0]], rtol=0, atol=log.clock
    )
    for k, joint in enumerate(recording.joints):
        moved = recording.position[k] - made[f"{joint}.position"][at]
        # An angle may be whole turns off where the file holds it within one.
        np.testing.assert_allclose(moved - 2 * np.pi * np.rint(moved[0] / (2 * np.pi)), 0.0, atol=min(exact, 1e-3))
        if recording.effort is not None:
            np.testing.assert_allclose(recording.effort[k], made[f"{joint}.effort"][at], rtol=0, atol=exact)
