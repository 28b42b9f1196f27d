"""Motions by name."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scara_ident.errors import UsageError
from scara_ident.paper import OJD, OJK
from scara_ident.recording.files.parquet_csv import write_columns
from scara_ident.robot.robot import load_robot
from scara_ident.simulation import reconstruction
from scara_ident.simulation.named import named_motion
from tests.simulation.made import tree

SCARA = load_robot()


@pytest.mark.parametrize("formula", [OJK, OJD], ids=lambda formula: formula.name)
def test_the_papers_formulas_are_followed_to_their_end(formula):
    motion = named_motion(formula.name, SCARA)
    assert motion.duration == pytest.approx(formula.duration)
    for found, expected in zip((motion.position, motion.velocity, motion.acceleration), formula.motion(motion.time), strict=True):  # fmt: skip
        np.testing.assert_allclose(found, expected, atol=1e-12)


def test_working_trajectories_are_the_reconstructions():
    np.testing.assert_array_equal(named_motion("L2", SCARA).position, reconstruction("L2").position)


def test_a_file_goes_before_a_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    columns = {"time": np.array([0.0, 0.5, 1.0])}
    columns |= {
        f"{joint}.{kind}": np.zeros(3) for joint in SCARA.joints for kind in ("position", "velocity", "acceleration")
    }
    write_columns(tmp_path / "still.csv", columns)
    (tmp_path / "still.csv").rename(tmp_path / "mine.csv")
    monkeypatch.chdir(tmp_path)
    assert named_motion("mine.csv", SCARA).duration == 1.0


def test_what_is_neither_is_refused_with_the_names():
    with pytest.raises(UsageError, match=r"'OJX': no such file, and not one of OJK, OJD, CI, L1, L2$"):
        named_motion("OJX", SCARA)


def test_the_papers_motions_are_for_two_joints(tmp_path: Path):
    with pytest.raises(UsageError, match="for its two joints; test_arm has 4"):
        named_motion("OJD", tree(tmp_path))
    assert named_motion("OJD", replace(SCARA, name="other")).joints == SCARA.joints
