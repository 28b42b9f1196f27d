"""``scara-ident excite``: a small design, its files and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import polars as pl


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


def test_bad_usage_is_status_2(command, tmp_path: Path):
    for words in (["--duration", "0"], ["--harmonics", "1"], ["--starts", "0"], ["--criterion", "magic"]):
        assert command("excite", *words, "--output", tmp_path).status == 2
    assert list(tmp_path.iterdir()) == []
