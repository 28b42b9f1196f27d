"""``scara-ident compare``: what it writes and refuses."""

from __future__ import annotations

import json
from pathlib import Path


def test_it_writes_every_trajectory_against_every_trajectory(command, folder: Path, tmp_path: Path):
    result = command("compare", folder, "--model", "basic", "--output", tmp_path)
    assert result.status == 0
    content = json.loads((tmp_path / "comparison.json").read_text())
    names = ["CI", "OJD"]
    assert sorted(content["trajectories"]) == names
    for key in ("errors", "predicted_by_covariance", "normalised"):
        assert sorted(content[key]) == names
        assert all(sorted(row) == names for row in content[key].values())
    assert content["characteristics"]["OJD"]["recordings"] == ["OJD_1", "OJD_2"]
    assert content["characteristics"]["CI"]["sigma"] is None
    assert content["model"] == "basic"
    assert (tmp_path / "report.html").stat().st_size > 1000
    for text in ("J_d", "J_k", "OJD", "CI", content["summary"][0].split(" (")[0][:30]):
        assert text in result.out


def test_json_on_the_output_is_the_same(command, folder: Path, tmp_path: Path):
    result = command("compare", folder, "--model", "basic", "--json", "--output", tmp_path)
    assert result.status == 0
    assert json.loads(result.out) == json.loads((tmp_path / "comparison.json").read_text())


def test_one_trajectory_is_refused_in_a_line(command, folder: Path, tmp_path: Path):
    result = command("compare", folder / "OJD_1.parquet", folder / "OJD_2.parquet", "--output", tmp_path / "out")
    assert result.status == 1
    assert "at least two trajectories" in result.err
    assert not (tmp_path / "out").exists()
