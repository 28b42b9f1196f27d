"""Motions that an arm is to follow."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scara_ident.errors import RecordingError
from scara_ident.recording.files.parquet_csv import write_columns
from scara_ident.simulation import (
    ReferenceMotion,
    read_trajectory,
)
from tests.simulation.made import scara, swing


def test_a_trajectory_file_is_followed(tmp_path: Path) -> None:
    arm = scara()
    motion = swing(arm.robot, 0.4)
    columns = {"time": motion.time}
    for kind in ("position", "velocity", "acceleration"):
        for joint, row in zip(motion.joints, getattr(motion, kind), strict=True):
            columns[f"{joint}.{kind}"] = row
    write_columns(tmp_path / "swing.csv", columns)
    read = read_trajectory(tmp_path / "swing.csv", arm.robot)
    np.testing.assert_allclose(read.position, motion.position, atol=1e-15)
    assert read.name == "swing"
    del columns["joint2.velocity"]
    write_columns(tmp_path / "part.csv", columns)
    with pytest.raises(RecordingError, match=r"part.csv: no column 'joint2.velocity'"):
        read_trajectory(tmp_path / "part.csv", arm.robot)


def test_a_coarse_motion_is_interpolated_by_quintics() -> None:
    motion = swing(scara().robot, 2.0)
    coarse = ReferenceMotion(
        "c", motion.joints, motion.time[::20],
        motion.position[:, ::20], motion.velocity[:, ::20], motion.acceleration[:, ::20],
    )  # fmt: skip
    fine = coarse.at(motion.time)
    np.testing.assert_allclose(fine.position, motion.position, atol=1e-9)
    np.testing.assert_allclose(fine.velocity, motion.velocity, atol=1e-7)
    np.testing.assert_allclose(fine.acceleration, motion.acceleration, atol=1e-4)


def test_a_held_motion_stands_before_and_after() -> None:
    motion = swing(scara().robot, 0.5).held(0.1, 0.2)
    assert motion.duration == pytest.approx(0.8)
    assert np.all(np.diff(motion.time) > 0)
    assert np.all(motion.velocity[:, :100] == 0.0)
    assert np.all(motion.position[:, -200:] == motion.position[:, -1:])


def test_a_motion_with_a_gap_in_its_values_is_refused() -> None:
    motion = swing(scara().robot, 0.5)
    broken = motion.velocity.copy()
    broken[1, 3] = np.nan
    with pytest.raises(RecordingError, match="velocity has a value that is not finite"):
        replace(motion, velocity=broken)


@pytest.mark.parametrize("place", [0, 2, -1])
@pytest.mark.parametrize("value", [np.inf, -np.inf, np.nan])
@pytest.mark.filterwarnings("error")
def test_a_time_that_is_none_is_refused_in_one_line(tmp_path: Path, place: int, value: float) -> None:
    arm = scara()
    motion = swing(arm.robot, 0.4)
    time = motion.time.copy()
    time[place] = value
    columns = {"time": time}
    for kind in ("position", "velocity", "acceleration"):
        columns |= {f"{joint}.{kind}": row for joint, row in zip(motion.joints, getattr(motion, kind), strict=True)}
    write_columns(tmp_path / "swing.csv", columns)
    with pytest.raises(RecordingError, match=r"swing\.csv: .*time must have at least two samples and grow strictly"):
        read_trajectory(tmp_path / "swing.csv", arm.robot)
