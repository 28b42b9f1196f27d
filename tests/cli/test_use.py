"""`scara-ident use`."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from scara_ident.files import plain
from scara_ident.report.identification import identification_dict
from scara_ident.robot.robot import load_robot
from tests.report.simulated import made, run
from tests.simulation.made import swing

SPRING = {"stiffness": {"value": 0.4, "std": 0.01}, "rest_position": {"value": 0.1, "std": None}}


def test_the_command_writes_the_table_and_the_report(command, tmp_path: Path) -> None:
    found = identification_dict(made([run("OJD_1", 1), run("OJD_2", 2)], bands=[15.0, 15.0]))
    content = found | {"effects": [{"effect": "spring", "joint": "joint1", "parameters": SPRING}]}
    (tmp_path / "diagnosis.json").write_text(json.dumps(plain(content)), encoding="utf-8")
    motion = swing(load_robot(), 0.5)
    columns = {"time": motion.time}
    for kind in ("position", "velocity", "acceleration"):
        columns |= {f"{joint}.{kind}": row for joint, row in zip(motion.joints, getattr(motion, kind), strict=True)}
    path = tmp_path / "short.csv"
    np.savetxt(path, np.array(list(columns.values())).T, delimiter=",", header=",".join(columns), comments="")
    answer = command("use", tmp_path / "diagnosis.json", "--trajectory", path, "--output", tmp_path / "out")
    assert answer.status == 0, answer.err
    told = json.loads((tmp_path / "out" / "use.json").read_text())
    # A row a joint, which fits a line whatever the number of joints.
    row = next(line.split() for line in answer.out.splitlines() if line.startswith("joint2"))
    assert row == ["joint2", *(f"{errors['joint2']:.3g}" for errors in told["tracking"].values()), "rad"]
    assert set(told["tracking"]) == {"pid", "urdf", "identified", "effects"}
    page = (tmp_path / "out" / "report.html").read_text()
    assert "Feed-forward" in page
    assert "with the effects found" in page
