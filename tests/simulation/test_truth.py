"""What is written of a simulated arm."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scara_ident.recording.recording import read_recordings
from scara_ident.robot.robot import load_robot
from scara_ident.simulation import (
    parse_effect,
    simulate,
    truth,
    virtual_arm,
    write_simulation,
)
from tests.arms import Link, write_urdf
from tests.simulation.made import swing


def test_written_recordings_are_read_back_and_the_truth_beside_is_not_one(tmp_path: Path) -> None:
    arm = virtual_arm()
    arm = replace(arm, robot=replace(arm.robot, effort_gain=np.array([2.0, 0.5])))
    effect = parse_effect("spring:joint2")
    runs = [simulate(arm, swing(arm.robot, 0.5), effects=[effect], repetition=k) for k in (1, 2)]
    paths = [write_simulation(run, tmp_path / "out") for run in runs]
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == [
        "swing_1.parquet", "swing_1.truth.json", "swing_2.parquet", "swing_2.truth.json",
    ]  # fmt: skip
    read = read_recordings([tmp_path / "out"], arm.robot)
    assert [item.path for item in read] == paths
    np.testing.assert_allclose(read[1].effort, runs[1].recording.effort, rtol=1e-12)
    np.testing.assert_array_equal(read[1].position, runs[1].recording.position)
    content = json.loads((tmp_path / "out" / "swing_2.truth.json").read_text())
    assert content["repetition"] == 2
    assert content["effects"] == [runs[1].effects[0].as_dict()]
    assert content["effects"][0]["parameters"]["stiffness"] > 0.0


def test_the_name_of_a_motion_leads_out_of_no_folder(tmp_path: Path) -> None:
    arm = virtual_arm()
    result = simulate(arm, replace(swing(arm.robot, 0.2), name="../../up"), repetition=3)
    assert write_simulation(result, tmp_path / "a" / "b") == tmp_path / "a" / "b" / "up_3.parquet"
    assert sorted(path.name for path in tmp_path.rglob("*.*")) == ["up_3.parquet", "up_3.truth.json"]


def test_truth_of_the_default_arm_is_the_papers_table_5() -> None:
    values = {row["name"]: row["value"] for row in truth(virtual_arm())["parameters"]}
    printed = {"P_d1": 16.165, "P_d2": 2.415, "P_d4": 0.758, "P_d5": 4.014, "a01": 0.21, "a11": 0.093, "a21": -0.016}
    printed |= {"a02": 0.088, "a12": 0.049, "a22": -0.007, "a31": 0.0, "a32": 0.0, "p_o1": 0.0, "P_d3": 0.0}
    assert {name: values[name] for name in printed} == pytest.approx(printed, abs=1e-9)


def test_truth_has_no_offset_of_an_axis_that_goes_up_and_down(tmp_path: Path) -> None:
    """Its model has none, as torque does not tell it from weight."""
    write_urdf(tmp_path / "arm.urdf", (Link(kind="prismatic", axis=(0, 0, 1)), Link(axis=(0, 1, 0))))
    arm = virtual_arm(load_robot(tmp_path / "arm.urdf"))
    told = truth(replace(arm, torque_offset=np.array([3.0, 0.2])))
    assert {item["name"]: item["value"] for item in told["parameters"] if item["name"].startswith("p_o")} == {
        "p_o2": 0.2
    }
    assert told["torque_offset"] == [3.0, 0.2]
