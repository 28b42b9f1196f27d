"""Rows without a clock are read by the rate that the robot description states."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from scara_ident.errors import RecordingError
from scara_ident.recording.even_rows import with_even_clock
from scara_ident.recording.recording import read_recording
from scara_ident.recording.tables import read_frame
from scara_ident.robot.robot import Robot
from scara_ident.robot.signal_map import contract_channels
from tests.made_recordings import columns, save


def at_rate(robot: Robot, rate: float) -> Robot:
    return replace(robot, channels=replace(contract_channels(robot.joints), rate=rate))


def test_a_file_without_a_clock_is_the_same_as_one_with_even_stamps(tmp_path: Path, robot: Robot):
    made = columns(500)
    rate = 1.0 / float(made["time"][1] - made["time"][0])
    stamped = read_recording(save(tmp_path / "a.parquet", made), robot)
    del made["time"]
    found = read_recording(save(tmp_path / "b.parquet", made), at_rate(robot, rate))
    # To rounding of the stamps.
    np.testing.assert_allclose(found.time, stamped.time - stamped.time[0], rtol=0.0, atol=1e-9)
    np.testing.assert_array_equal(found.position, stamped.position)
    np.testing.assert_array_equal(found.effort, stamped.effort)
    assert [finding.kind for finding in found.findings] == ["stated_rate"]
    framed = read_frame(pl.DataFrame(made), at_rate(robot, rate))
    np.testing.assert_array_equal(framed.time, found.time)


def test_a_clock_that_is_there_beside_a_rate_is_said_to_be_unused(tmp_path: Path, robot: Robot):
    found = read_recording(save(tmp_path / "a.parquet", columns(500)), at_rate(robot, 50.0))
    assert found.time[1] == 0.02
    assert "its column 'time' is not used" in found.findings[0].message


def test_rows_with_stamps_by_their_format_need_not_be_even(robot: Robot):
    channels = at_rate(robot, 50.0).channels
    assert channels is not None
    with pytest.raises(RecordingError, match="its rows have stamps and need not be even"):
        with_even_clock(Path("bag"), ["time"], lambda names: {}, channels, shared_clock=True)
