"""``scara-ident diagnose``: what it writes and refuses."""

from __future__ import annotations

import json
from pathlib import Path

import polars as pl
import pytest

from scara_ident.recording.recording import write_recording
from scara_ident.report.html.blocks import number
from tests.diagnosis.made import held_out_run, virtual_runs
from tests.shared import shared_path

pytestmark = pytest.mark.slow

EFFECT = "spring:joint1"


def test_it_writes_what_the_contract_says(command, tmp_path: Path):
    train, out = tmp_path / "train", tmp_path / "out"
    train.mkdir()
    for run in virtual_runs(EFFECT):
        write_recording(run, train / f"{run.name}.parquet")
    test = tmp_path / "test_1.parquet"
    write_recording(held_out_run(EFFECT), test)
    result = command("diagnose", train, "--validate", test, "--output", out)
    assert result.status == 0
    content = json.loads((out / "diagnosis.json").read_text())
    assert {
        "verdict", "noise_floor", "effects", "training", "validation", "not_identifiable", "candidates", "unexplained",
    } <= set(content)  # fmt: skip
    assert content["verdict"] in ("complete", "explained", "unexplained")
    effect = content["effects"][0]
    assert (effect["effect"], effect["joint"]) == ("spring", "joint1")
    assert set(content["recordings"]["validation"]) == {"test_1"}
    assert set(content["recordings"]["training"]) == {"F1_1", "F1_2", "F2_1", "F2_2"}
    assert content["validation"]["after"]["joint1"] < content["validation"]["before"]["joint1"]
    pictures = {f"effect_{k + 1}.png" for k in range(len(content["effects"]))}
    assert {path.name for path in out.iterdir()} == {"diagnosis.json", "diagnosis.md", "report.html", *pictures}
    assert "Found spring on joint1" in result.out
    story = (out / "diagnosis.md").read_text()
    assert story.startswith("# Diagnosis of scara03")
    # What it costs, the same in both reports and in the JSON.
    worth = content["worth"]
    assert set(worth["tracking"]) == {"pid", "urdf", "identified", "effects"}
    own = worth["effects"][0]
    assert (own["effect"], own["joint"]) == ("spring", "joint1")
    assert worth["tracking"]["effects"]["joint1"] < min(
        own["fed_without_it"]["joint1"], worth["tracking"]["pid"]["joint1"]
    )
    page = (out / "report.html").read_text()
    assert 'id="worth"' in page
    for said in worth["summary"]:
        assert said in story
    for errors in (*worth["tracking"].values(), own["pid_without_it"], own["fed_without_it"]):
        assert number(errors["joint1"]) in page


def test_a_band_can_be_asked_for(command, folder: Path, tmp_path: Path):
    run = folder / "OJD_1.parquet"
    assert command("diagnose", run, "--band", "6", "--output", tmp_path / "out").status == 0
    content = json.loads((tmp_path / "out" / "diagnosis.json").read_text())
    assert content["band_hz"] == {"joint1": 6.0, "joint2": 6.0}
    assert command("diagnose", run, "--band", "0").status == 2


def test_what_cannot_be_read_or_used_is_said_in_a_line(command, folder: Path):
    run = folder / "OJD_1.parquet"
    assert command("diagnose", "nowhere.csv").status == 2
    assert command("diagnose").status == 2
    assert command("diagnose", run, "--model", "full").status == 2
    assert "held out" in command("diagnose", run, "--validate", run).err


def test_recordings_can_be_named_as_without_payload(command, folder: Path, tmp_path: Path):
    runs = sorted(folder.glob("*.parquet"))[:3]
    result = command("diagnose", *runs[1:], "--unloaded", runs[0], "--effects", "payload_change", "--json")
    assert result.status == 0
    # What is named as unloaded is trained on too, once.
    assert {run.stem for run in runs} == set(json.loads(result.out)["recordings"]["training"])


def test_a_joint_that_does_not_move_leaves_the_others_their_diagnosis_and_the_next_motion(
    command, folder: Path, tmp_path: Path
):
    logs = pl.read_parquet(folder / "OJD_1.parquet")
    still = logs.with_columns(pl.lit(0.3).alias("joint2.position")).select(
        "time", *(f"joint{j}.{what}" for j in (1, 2) for what in ("position", "effort"))
    )
    still.write_parquet(tmp_path / "still_1.parquet")
    out = tmp_path / "out"
    assert command("diagnose", tmp_path / "still_1.parquet", "--output", out).status == 0
    content = json.loads((out / "diagnosis.json").read_text())
    assert content["noise_density"]["joint1"] > 0.0 and content["noise_density"]["joint2"] is None
    words = ("--tell", out / "diagnosis.json", "--duration", "3", "--starts", "1", "--output", tmp_path / "next")
    assert command("excite", *words).status == 0
    tells = json.loads((tmp_path / "next" / "excitation.json").read_text())["tells"]
    assert any(item["sigma_after"] > item["sigma_before"] for item in tells)


def test_joints_that_hardly_move_leave_the_one_that_does_its_diagnosis(command, tmp_path: Path):
    arm = shared_path("data", "ur10e", "robot.yaml")
    run = shared_path("data", "ur10e", "jointwise_1.parquet")
    result = command("diagnose", run, "--robot", arm, "--output", tmp_path / "out")
    assert result.status == 0 and "DLASCL" not in result.out


def test_no_process_is_begun_for_pictures_where_there_is_nothing_to_draw(
    command, folder: Path, tmp_path: Path, monkeypatch
):
    from scara_ident.report import pictures

    monkeypatch.setattr(pictures, "diagnosis_pictures", None)
    run, out = folder / "OJD_1.parquet", tmp_path / "out"
    # No family is tried that the run, which has no effect, could be mistaken for.
    assert command("diagnose", run, "--effects", "spring", "--output", out).status == 0
    content = json.loads((out / "diagnosis.json").read_text())
    assert not content["effects"] and content["unexplained"] is None
    assert {path.name for path in out.iterdir()} == {"diagnosis.json", "diagnosis.md", "report.html"}
