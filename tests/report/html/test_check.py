"""The report of a check."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from scara_ident.motion.motion import Motion
from scara_ident.report.html.check import check_figures, check_report
from scara_ident.use.check import check
from scara_ident.use.joint_limits import joint_limits
from tests.report.html.document import data_of, document
from tests.report.simulated import swinging
from tests.use.conftest import identified, known

__all__ = ["identified", "known"]


def test_a_broken_limit_is_shown_with_its_time(known, tmp_path: Path):
    motion: Motion = swinging(np.zeros((2, 1000)))
    found = check(known, [motion], joint_limits(known.robot, torques={"joint1": 0.3}))
    check_report(tmp_path / "report.html", found)
    page, data = document(tmp_path / "report.html"), data_of(tmp_path / "report.html")
    assert (page.wrong, page.open) == ([], [])
    assert sorted(data["figures"]) == sorted(page.figures) == ["energy-time", "signals"]
    panels = data["figures"]["signals"]["variants"]["0"]["panels"]
    assert [panel["label"].split(" [")[0] for panel in panels] == ["position", "velocity", "acc.", "torque", "power"]
    torque = panels[3]["layers"]
    assert [layer["y"] for layer in torque if layer["t"] == "h"] == [-0.3, 0.3]
    assert [layer["x"] for layer in torque if layer["t"] == "v"] == [found.limited_by.time]
    assert "It cannot be run: torque of joint1" in (tmp_path / "report.html").read_text()
    assert [len(row) for row in check_figures(found)] == [2, 2]
