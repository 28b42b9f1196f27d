"""``scara-ident excite``: a small design, its files and what it refuses."""

from __future__ import annotations

import json
import re
from hashlib import sha256
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from scara_ident.files import write_json
from scara_ident.recording.recording import write_recording
from scara_ident.report.diagnosis import diagnosis_dict
from scara_ident.robot.robot import embedded_urdf
from tests.excitation.designs import hurry
from tests.inquiry.asked import PAIR, open_diagnosis, small_runs


@pytest.mark.slow
def test_a_small_design_keeps_its_limits_and_writes_its_files(command, tmp_path: Path):
    result = command(
        "excite", "--duration", "4", "--harmonics", "3", "--starts", "1", "--model", "basic", "--rate", "200",
        "--output", tmp_path,
    )  # fmt: skip
    assert result.status == 0
    content = json.loads((tmp_path / "excitation.json").read_text())
    assert content["duration"] == 4.0
    assert np.isfinite(content["log_det"])
    assert content["condition"] > 1.0
    assert content["limits"]
    table = pl.read_csv(tmp_path / "trajectory.csv")
    wanted = {f"joint{j}.{what}" for j in (1, 2) for what in ("position", "velocity", "acceleration")}
    assert set(table.columns) == {"time", *wanted}
    time = table["time"].to_numpy()
    assert np.allclose(np.diff(time), 1.0 / 200.0)
    for j in (1, 2):
        position, velocity = (table[f"joint{j}.{what}"].to_numpy() for what in ("position", "velocity"))
        moved = np.concatenate([[0.0], np.cumsum(0.5 * (velocity[1:] + velocity[:-1]) / 200.0)])
        assert np.allclose(position - position[0], moved, atol=2e-3)
        assert np.max(np.abs(velocity)) <= 3.77 * (1.0 + 1e-6)
    assert (tmp_path / "report.html").is_file()
    assert str(tmp_path / "trajectory.csv") in result.out


QUICK = ("--duration", "4", "--harmonics", "4", "--starts", "1", "--model", "basic")


@pytest.mark.slow
def test_start_limits_block_and_known_torques_are_heeded(command, tmp_path: Path):
    parameters = tmp_path / "identification.json"
    parameters.write_text(json.dumps({"parameters": [{"name": "a01", "value": 0.3}, {"name": "a02", "value": 0.1}]}))
    words = (
        *QUICK, "--for", "rigid_body", "--start", "1,-0.5", "--range", "joint1=0..2", "--velocity", "joint1=1.5",
        "--torque", "joint2=0.8", "--tool-acceleration", "6", "--tool-speed", "0.9", "--parameters", parameters,
        "--trajectories", "2", "--share", "1",
    )  # fmt: skip
    result = command("excite", *words, "--output", tmp_path / "a")
    assert result.status == 0
    content = json.loads((tmp_path / "a" / "excitation.json").read_text())
    assert content["criterion"] == {"name": "block_logdet", "parameters": ["P_d1", "P_d2", "P_d3", "P_d4", "P_d5"]}
    bounds = {name: limit["bound"] for name, limit in content["limits"].items()}
    assert bounds["joint1.position.upper"] == 2.0 and bounds["joint1.velocity"] == 1.5
    assert bounds["joint2.torque"] == 0.8 and bounds["tool.acceleration"] == 6.0 and bounds["tool.speed"] == 0.9
    assert all(limit["share"] <= 1.0 for limit in content["limits"].values())
    assert any("with the friction given" in note for note in content["notes"])
    for name in ("trajectory.csv", "trajectory-b.csv"):
        table = pl.read_csv(tmp_path / "a" / name)
        assert np.allclose(table[0, "joint1.position"], 1.0) and np.allclose(table[-1, "joint2.position"], -0.5)
    # Once more: the same seed gives the same files.
    assert command("excite", *words, "--output", tmp_path / "b").status == 0
    for name in ("trajectory.csv", "trajectory-b.yaml", "excitation.png"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


@pytest.mark.slow
def test_recordings_at_hand_count(command, steps, tmp_path: Path, folder: Path):
    alone = command("excite", *QUICK, "--json", "--output", tmp_path)
    filled = command("excite", *QUICK, "--json", "--known", folder / "OJD_1.parquet", "--output", tmp_path)
    assert {"reading what is known", "search 1", "drawing excitation.png", "drawing report.html"} <= set(steps)
    before, after = json.loads(alone.out), json.loads(filled.out)
    assert before["log_det_with_prior"] is None
    assert after["log_det_with_prior"] > max(after["log_det"], before["log_det"])
    assert after["trajectories"] != before["trajectories"]


def test_what_cannot_be_is_said_before_the_search(command, tmp_path: Path):
    for words, status, said in (
        (("--start", "0,2.5"), 1, "start: joint2 = 2.5 lies outside its range"),
        (("--start", "0"), 2, "expected 2 positions"),
        (("--duration", "2", "--harmonics", "4000"), 2, "use at most 150"),
        (("--harmonics", "50", "--rate", "5"), 2, "use fewer harmonics, or a higher rate"),
        (("--duration", "1", "--rate", "12"), 2, "reaches 5 Hz and needs at least 20 Hz"),
        (("--floor", "2"), 1, "lower the floor"),
        (("--torque", "joint1=0.1"), 1, "joint1: a torque of 0.08 N m does not overcome its friction"),
        (("--range", "joint9=0..1"), 2, "'joint9': the robot has no such joint"),
        (("--for", "P_d9"), 2, "parameter 'P_d9'"),
        (("--jerk", "joint1=0"), 2, "jerk limit of joint1"),
        (("--box", "1,2,3"), 2, "expected X,Y,Z,DX,DY,DZ"),
        (("--box", "1,0,0,.1,.1,.1"), 2, "has no collision shapes"),
        (("--asked-std", "5"), 2, "the noise of joint1, joint2 is not known; give --noise joint1=RMS"),
        (("--asked-std", "five"), 2, "expected a percentage such as 5"),
        (("--noise", "joint1=1"), 2, "--noise is for --asked-std"),
        (("--parameters", "none.json"), 2, "none.json: no such file"),
    ):
        outcome = command("excite", *words, "--output", tmp_path)
        assert (outcome.status, said in outcome.err) == (status, True), outcome.err
    assert list(tmp_path.iterdir()) == []


def test_bad_usage_is_status_2(command, tmp_path: Path):
    for words in (["--duration", "0"], ["--harmonics", "1"], ["--starts", "0"], ["--criterion", "magic"]):
        assert command("excite", *words, "--output", tmp_path).status == 2
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_a_motion_is_designed_for_what_a_diagnosis_left_open(command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    hurry(monkeypatch)
    for item in small_runs():
        (tmp_path / "logs").mkdir(exist_ok=True)
        write_recording(item, tmp_path / "logs" / f"{item.name}.parquet")
    write_json(tmp_path / "diagnosis.json", diagnosis_dict(open_diagnosis()))
    words = ("--known", tmp_path / "logs", "--duration", "5", "--harmonics", "5", "--starts", "1", "--output", tmp_path)
    result = command("excite", "--tell", tmp_path / "diagnosis.json", *words)
    assert result.status == 0
    content = json.loads((tmp_path / "excitation.json").read_text())
    first = content["tells"][0]
    assert first["question"] == PAIR and first["sigma_after"] > first["sigma_before"]
    assert all(limit["share"] <= 1.0 for limit in content["limits"].values())
    assert (tmp_path / "trajectory.csv").is_file() and (tmp_path / "report.html").is_file()


@pytest.mark.slow
def test_the_robot_is_that_of_the_diagnosis_where_none_is_given(
    command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """The embedded arm has the same name, and other limits."""
    hurry(monkeypatch)
    slow = tmp_path / "slow.urdf"
    slow.write_text(re.sub(r'velocity="[^"]+"', 'velocity="0.5"', embedded_urdf().read_text()))
    content = diagnosis_dict(open_diagnosis())
    content["rebuild"]["robot"] |= {"urdf": str(slow), "sha256": sha256(slow.read_bytes()).hexdigest()}
    write_json(tmp_path / "diagnosis.json", content)
    words = ("--tell", tmp_path / "diagnosis.json", "--duration", "3", "--starts", "1", "--output", tmp_path)
    assert command("excite", *words).status == 0
    limits = json.loads((tmp_path / "excitation.json").read_text())["limits"]
    assert limits["joint1.velocity"]["bound"] == pytest.approx(0.8 * 0.5)
    slow.unlink()
    assert "give --robot" in command("excite", *words).err


def test_a_file_that_is_no_diagnosis_is_said(command, tmp_path: Path):
    (tmp_path / "other.json").write_text("[]", encoding="utf-8")
    assert "no diagnosis" in command("excite", "--tell", tmp_path / "other.json").err
    assert "no such file" in command("excite", "--tell", tmp_path / "none.json").err
    for words, said in (
        (("--for", "friction"), "two goals"),
        (("--asked-std", "5"), "two goals"),
        (("--criterion", "cond"), "leave --criterion out"),
        (("--model", "complete"), "leave --model out"),
    ):
        outcome = command("excite", "--tell", tmp_path / "other.json", *words)
        assert (outcome.status, said in outcome.err) == (2, True), outcome.err
