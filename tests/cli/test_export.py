"""``scara-ident export``: from a result file alone, without the recordings."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from scara_ident.files import write_json
from scara_ident.report.identification import identification_dict
from tests.report.simulated import made, run


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("found") / "identification.json"
    write_json(path, identification_dict(made([run("OJD_1", 1), run("OJD_2", 2)], [run("CI_1", 3, start=4.0)])))
    return path


def test_the_file_and_what_it_costs(command, steps, result: Path, tmp_path: Path):
    done = command("export", result, "--to", "mjcf", "--output", tmp_path)
    assert steps == ["reading the model", "writing mjcf", "predicting with what was written"]
    assert done.status == 0
    content = json.loads((tmp_path / "export.json").read_text())
    assert {path.name for path in tmp_path.iterdir()} == {*content["files"], "export.json"}
    assert content["files"] == ["scara03_identified.xml", "scara03_mujoco.py"]
    errors = content["errors"]
    assert list(errors) == ["model", "exported", "with_code"]
    known = json.loads(result.read_text())["errors"]["validation"]["CI_1"]
    for joint in ("joint1", "joint2"):
        assert errors["model"][joint] == pytest.approx(known[joint]["rms"], rel=1e-9)
        assert errors["with_code"][joint] == pytest.approx(errors["model"][joint], rel=1e-6)
    assert content["missing"]["exported"][0]["what"] == "a21, a31, a22, a32"
    assert "exported: without a21, a31, a22, a32" in done.out
    assert max(len(line) for line in done.out.splitlines() if not line.startswith("written: ")) <= 80


def test_json_and_a_form_that_says_all(command, result: Path, tmp_path: Path):
    done = command("export", result, "--to", "c", "--output", tmp_path, "--json")
    assert json.loads(done.out) == json.loads((tmp_path / "export.json").read_text())
    assert json.loads(done.out)["missing"] == {"exported": []}
    assert "scara03_torque(" in (tmp_path / "scara03.h").read_text()


def test_wrong_uses_are_said_in_a_line(command, result: Path, tmp_path: Path):
    assert command("export", result).status == 2
    assert command("export", result, "--to", "fortran").status == 2
    missing = command("export", tmp_path / "none.json", "--to", "c")
    assert (missing.status, "no such file" in missing.err) == (2, True)
    assert "its parameters are not those of" in command("export", result, "--to", "c", "--robot", "ur5").err
