"""``scara-ident identify``: what it prints, writes and refuses."""

from __future__ import annotations

import json
from pathlib import Path

import polars as pl
import pytest

from scara_ident.report import pictures


def refuse(constant: str) -> None:
    raise AssertionError(f"{constant} is not JSON")


@pytest.mark.slow
def test_it_writes_what_the_contract_says(command, folder: Path, tmp_path: Path):
    out = tmp_path / "new" / "out"
    result = command(
        "identify",
        folder / "OJD_1.parquet",
        folder / "OJD_2.parquet",
        "--validate",
        folder / "CI_1.csv",
        "--output",
        out,
    )
    assert result.status == 0
    content = json.loads((out / "identification.json").read_text(), parse_constant=refuse)
    assert (content["robot"], content["model"], content["method"], content["samples"]) == (
        "scara03",
        "complete",
        "wls",
        6000,
    )
    assert set(content["errors"]["training"]) == {"OJD_1", "OJD_2"}
    assert set(content["errors"]["validation"]) == {"CI_1"}
    value = {row["name"]: row["value"] for row in content["parameters"]}
    assert value["P_d1"] == pytest.approx(16.165, rel=0.01)
    assert value["P_d5"] == pytest.approx(4.014, rel=0.01)
    assert str(out / "identification.json") in result.out
    assert not [path for path in out.iterdir() if path.name.startswith(".")]


def test_it_says_parameters_errors_and_the_result_in_words(command, folder: Path):
    result = command("identify", folder / "OJD_1.parquet", "--validate", folder / "CI_1.csv")
    assert result.status == 0
    for text in (
        "P_d1",
        "kg m^2",
        "I1z + m2 l1^2 + Jm1/tau1^2",
        "OJD_1",
        "held out",
        "J_d",
        "The largest held-out error is on CI_1",
    ):
        assert text in result.out
    assert max(len(line) for line in result.out.splitlines()) <= 80


@pytest.mark.slow
@pytest.mark.parametrize("model", ["reduced", "basic"])
@pytest.mark.parametrize("method", ["wls", "rls"])
def test_models_and_methods_are_chosen_by_name(command, folder: Path, tmp_path: Path, model: str, method: str):
    result = command(
        "identify", folder / "OJD_1.parquet", "--model", model, "--method", method, "--band", "15", "--output", tmp_path
    )
    assert result.status == 0
    content = json.loads((tmp_path / "identification.json").read_text())
    assert (content["model"], content["method"]) == (model, method)
    assert len(content["parameters"]) == {"reduced": 10, "basic": 11}[model]
    assert content["band_hz"] == {"joint1": 15.0, "joint2": 15.0}


@pytest.mark.slow
def test_a_folder_and_a_glob_stand_for_their_recordings(command, folder: Path, tmp_path: Path):
    names = []
    for word in (folder, f"{folder}/*_?.*"):
        assert command("identify", word, "--band", "15", "--output", tmp_path).status == 0
        names.append(sorted(json.loads((tmp_path / "identification.json").read_text())["errors"]["training"]))
    assert names == [["CI_1", "OJD_1", "OJD_2"]] * 2


@pytest.mark.slow
def test_names_in_brackets_are_printed_as_they_are(command, folder: Path, tmp_path: Path):
    path = tmp_path / "run[bold]x_1.parquet"
    path.write_bytes((folder / "OJD_1.parquet").read_bytes())
    result = command("identify", path, "--band", "15", "--output", tmp_path / "[red]out")
    assert result.status == 0
    assert "run[bold]x_1" in result.out
    assert "[red]out" in result.out


def test_the_band_none_can_use_is_bad_usage(command, folder: Path):
    for band in ("0", "-3", "nan", "inf", "wide"):
        assert command("identify", folder / "OJD_1.parquet", f"--band={band}").status == 2


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["identify"], "recording"),
        (["identify", "nowhere.csv"], "nowhere.csv: no such file"),
        (["identify", "nowhere*.csv"], "no file matches"),
        (["identify", "{run}", "--model", "full"], "full"),
        (["identify", "{run}", "--method", "magic"], "magic"),
        (["identify", "{run}", "--colour"], "--colour"),
        (["identify", "{run}", "--validate", "{run}"], "held out"),
    ],
)
def test_bad_usage_is_status_2(command, folder: Path, words: list[str], said: str):
    result = command(*(word.replace("{run}", str(folder / "OJD_1.parquet")) for word in words))
    assert result.status == 2
    assert said in result.err.lower()


def test_what_the_data_cannot_give_is_status_1(command, folder: Path, tmp_path: Path):
    table = pl.read_parquet(folder / "OJD_1.parquet")
    dumb, still = tmp_path / "dumb_1.csv", tmp_path / "still_1.csv"
    table.drop("joint2.effort").write_csv(dumb)
    table.with_columns(pl.lit(0.3).alias("joint1.position"), pl.lit(0.3).alias("joint2.position")).write_csv(still)
    empty = tmp_path / "empty"
    empty.mkdir()
    for path, said in ((dumb, "joint2.effort"), (still, "still_1"), (empty, "no .parquet or .csv")):
        result = command("identify", path)
        assert result.status == 1
        assert said in result.err


def test_a_bad_robot_is_status_1_with_file_and_key(command, folder: Path, tmp_path: Path):
    path = tmp_path / "robot.yaml"
    path.write_text("urdf: arm.urdf\njoints: {joint1: {reductoin: 100}}\n")
    result = command("identify", folder / "OJD_1.parquet", "--robot", path)
    assert result.status == 1
    assert f"{path}: joints.joint1.reductoin: unknown key" in result.err


def test_nothing_is_half_written_where_nothing_can_be(command, folder: Path, tmp_path: Path):
    blocked = tmp_path / "out"
    blocked.write_text("a file where the folder should be")
    result = command("identify", folder / "OJD_1.parquet", "--band", "15", "--output", blocked)
    assert result.status == 1
    assert str(blocked) in result.err
    assert blocked.read_text() == "a file where the folder should be"
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_an_earlier_result_survives_a_run_that_fails(command, folder: Path, tmp_path: Path, monkeypatch):
    (tmp_path / "identification.json").write_text("earlier")
    (tmp_path / "torque.png").write_text("earlier")

    def full(path: Path, *rest: object) -> None:
        path.write_bytes(b"half")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(pictures, "torque_picture", full)
    result = command("identify", folder / "OJD_1.parquet", "--band", "15", "--output", tmp_path)
    assert result.status == 1
    assert "No space left" in result.err
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {
        "identification.json": "earlier",
        "torque.png": "earlier",
    }
