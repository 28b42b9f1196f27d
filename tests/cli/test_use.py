"""`scara-ident use`."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from scara_ident.robot.robot import load_robot
from tests.simulation.made import swing
from tests.use.made import content


def test_the_command_writes_the_table_and_the_report(command, tmp_path: Path) -> None:
    (tmp_path / "diagnosis.json").write_text(json.dumps(content()), encoding="utf-8")
    motion = swing(load_robot(), 0.5)
    columns = {"time": motion.time}
    for kind in ("position", "velocity", "acceleration"):
        columns |= {f"{joint}.{kind}": row for joint, row in zip(motion.joints, getattr(motion, kind), strict=True)}
    path = tmp_path / "short.csv"
    np.savetxt(path, np.array(list(columns.values())).T, delimiter=",", header=",".join(columns), comments="")
    answer = command("use", tmp_path / "diagnosis.json", "--trajectory", path, "--output", tmp_path / "out")
    assert answer.status == 0, answer.err
    told = json.loads((tmp_path / "out" / "use.json").read_text())
    assert set(told["tracking"]) == {"pid", "urdf", "identified", "effects"}
    page = (tmp_path / "out" / "report.html").read_text()
    assert "Feed-forward" in page
    assert "with the effects found" in page
