"""The command check."""

from __future__ import annotations

import json
from pathlib import Path

from scara_ident.cli.main import run
from tests.report.html.document import data_of, document
from tests.use.conftest import identified, result_file

__all__ = ["identified", "result_file"]


def test_a_motion_that_can_be_run(command, steps, folder: Path, result_file: Path, tmp_path: Path):
    done = command("check", folder / "OJD_2.parquet", result_file, "--output", tmp_path)
    assert done.status == 0
    assert "It can be run." in done.out
    assert steps == [
        "reading the model", "reading the motion", "checking every limit", "writing", "drawing check.png",
        "drawing report.html",
    ]  # fmt: skip
    content = json.loads((tmp_path / "check.json").read_text())
    assert content["runs"] is True
    assert content["limits"]["joint1.torque"]["bound"] == 2.0
    assert content["recorded_minus_foreseen"]["joint1"] < 0.05
    assert (tmp_path / "check.png").stat().st_size > 10_000
    page = document(tmp_path / "report.html")
    assert page.wrong == []
    assert sorted(data_of(tmp_path / "report.html")["figures"]) == sorted(page.figures)


def test_one_that_cannot_is_exit_status_1_with_its_results(capfd, folder: Path, result_file: Path, tmp_path: Path):
    words = ["check", folder / "OJD_2.parquet", result_file, "--torque", "joint2=0.2", "--output", tmp_path]
    assert run([str(word) for word in words]) == 1
    out, err = capfd.readouterr()
    assert "It cannot be run: torque of joint2 at " in out
    assert err.startswith(f"scara-ident: {folder / 'OJD_2.parquet'}: it cannot be run: torque of joint2 at ")
    assert err.count("\n") == 1
    assert "; along the same path it can be run at " in err
    assert not err.endswith(".\n")
    content = json.loads((tmp_path / "check.json").read_text())
    assert content["limited_by"]["kind"] == "torque"
    assert content["limited_by"]["margin"] < 0.0 < content["speed_share"] < 1.0


def test_json_alone(capfd, folder: Path, result_file: Path):
    assert run(["check", str(folder / "OJD_2.parquet"), str(result_file), "--json", "--power", "joint1=1"]) == 1
    assert json.loads(capfd.readouterr().out)["limited_by"]["kind"] == "power"


def test_what_is_wrong_is_one_line(command, folder: Path, result_file: Path):
    assert command("check", folder / "OJD_2.parquet", result_file, "--torque", "joint9=1").status == 2
    assert "joint9" in command("check", folder / "OJD_2.parquet", result_file, "--torque", "joint9=1").err
    missing = command("check", folder / "missing.csv", result_file)
    assert missing.status == 2 and "missing.csv: no such file" in missing.err
    done = command("check", folder / "OJD_2.parquet", folder / "OJD_1.parquet")
    assert done.status == 1
    assert "give an identification.json" in done.err or "not JSON" in done.err
