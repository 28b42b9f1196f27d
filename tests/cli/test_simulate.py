"""``scara-ident simulate``: recordings, what was behind them, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from scara_ident.robot.robot import load_robot
from tests.diagnosis.made import multisine


@pytest.fixture
def trajectory(tmp_path: Path) -> Path:
    motion = multisine("short", 3, 3.0)
    columns = {"time": motion.time}
    for j, joint in enumerate(load_robot().joints):
        for what in ("position", "velocity", "acceleration"):
            columns[f"{joint}.{what}"] = getattr(motion, what)[j]
    pl.DataFrame(columns).write_csv(tmp_path / "short.csv")
    return tmp_path / "short.csv"


def test_every_run_is_recorded_with_its_truth(command, trajectory: Path, tmp_path: Path):
    out = tmp_path / "out"
    words = ("simulate", trajectory, "--effect", "spring:joint1:stiffness=0.07", "--repetitions", "2", "--seed", "4")
    result = command(*words, "--output", out)
    assert result.status == 0
    assert {path.name for path in out.iterdir()} == {
        f"short_{k}.{ending}" for k in (1, 2) for ending in ("parquet", "truth.json")
    }
    one, two = (pl.read_parquet(out / f"short_{k}.parquet") for k in (1, 2))
    assert {"time", "joint1.position", "joint1.effort", "joint2.position", "joint2.effort"} <= set(one.columns)
    assert not np.array_equal(one["joint1.effort"], two["joint1.effort"])
    truth = json.loads((out / "short_1.truth.json").read_text())
    assert (truth["seed"], truth["repetition"]) == (4, 1)
    assert "0.07" in json.dumps(truth["effects"])
    assert str(out / "short_2.parquet") in result.out
    again = tmp_path / "again"
    assert command(*words, "--output", again).status == 0
    assert pl.read_parquet(again / "short_1.parquet").equals(one)


def test_bad_usage_is_status_2_and_writes_nothing(command, trajectory: Path, tmp_path: Path):
    out = tmp_path / "out"
    for words in (
        ["nowhere.csv"],
        [trajectory, "--effect", "magic"],
        [trajectory, "--effect", "spring:joint9"],
        [trajectory, "--link-encoder", "joint9"],
        [trajectory, "--seed", "-1"],
    ):
        result = command("simulate", *words, "--output", out)
        assert result.status == 2
        assert not out.exists()


def test_a_push_is_in_the_recording_named_and_a_second_encoder_in_all(command, trajectory: Path, tmp_path: Path):
    words = ("simulate", trajectory, "--repetitions", "2", "--link-encoder", "joint2")
    push = "push:force=9,from=0.1,duration=0.2,recording=short_2"
    for name, more in (("plain", ()), ("pushed", ("--effect", push))):
        assert command(*words, *more, "--output", tmp_path / name).status == 0
    plain, pushed = (
        [pl.read_parquet(tmp_path / name / f"short_{k}.parquet") for k in (1, 2)] for name in ("plain", "pushed")
    )
    assert pushed[0].equals(plain[0])
    assert not pushed[1].equals(plain[1])
    assert [name for name in plain[0].columns if "link" in name] == ["joint2.link_position"]
    told = [json.loads((tmp_path / "pushed" / f"short_{k}.truth.json").read_text())["effects"] for k in (1, 2)]
    assert told[0] == []
    assert (told[1][0]["effect"], told[1][0]["parameters"]["from"]) == ("push", 0.1)


def test_motions_that_would_replace_each_other_are_refused(command, trajectory: Path, tmp_path: Path):
    other = tmp_path / "b" / trajectory.name
    other.parent.mkdir()
    other.write_bytes(trajectory.read_bytes())
    out = tmp_path / "out"
    for first, second in ((trajectory, other), ("OJK", "OJK")):
        result = command("simulate", first, second, "--output", out)
        assert result.status == 2 and not out.exists()
        assert f"{first}, {second}" in result.err and "--repetitions" in result.err
