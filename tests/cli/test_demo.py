"""The demo: the whole story on the embedded arm, with no input."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow


def test_the_demo_writes_every_result_and_finds_what_it_hid(command, tmp_path: Path):
    answer = command("demo", "--output", tmp_path / "demo")
    assert answer.status == 0
    written = {str(path.relative_to(tmp_path / "demo")) for path in tmp_path.rglob("*") if path.is_file()}
    assert written >= {
        "base/base.json", "paper/paper.json",
        "excite/trajectory.csv", "excite/excitation.json", "excite/report.html",
        "train/trajectory_1.parquet", "train/OJD_2.parquet", "test/L1_1.parquet",
        "identify/identification.json", "identify/report.html", "identify/scara03_identified.urdf",
        "compare/comparison.json", "compare/report.html", "diagnose/diagnosis.json", "diagnose/report.html",
        "ask/recordings/CI_2.parquet", "ask/diagnosis.json", "ask/report.html",
        "ask/next/trajectory.csv", "ask/next/excitation.json",
        "use/use.json", "use/report.html", "export/scara03.h", "export/export.json",
        "arms/arm2/2026-03-08/OJD_1.parquet", "fleet/fleet.parquet", "fleet/report.html",
    }  # fmt: skip
    diagnosis = json.loads((tmp_path / "demo" / "diagnose" / "diagnosis.json").read_text())
    (effect,) = diagnosis["effects"]
    assert (diagnosis["verdict"], effect["effect"], effect["joint"]) == ("explained", "transmission_loss", "joint2")
    # From one motion alone the arm is asked for what tells it.
    told, *_ = json.loads((tmp_path / "demo" / "ask" / "next" / "excitation.json").read_text())["tells"]
    assert told["question"].startswith("transmission_loss of joint2")
    assert told["sigma_after"] > 3.0 * told["sigma_before"]
    # It tells the truth in the end, and what to look at.
    story = answer.out.splitlines()
    (truth,) = [line for line in story if line.startswith("The arm really had")]
    assert "transmission_loss:joint2:loss_coefficient=0.2" in truth
    assert story[-1] == f"Open {tmp_path / 'demo' / 'diagnose' / 'report.html'}"
    # One arm of the fleet changed, in the joint and by the effect that it was given.
    place = story.index("3 arms of scara03: 1 changed, 2 unchanged")
    changed = "arm2  Gear loss that grows with the transmitted torque on joint2: loss"
    assert any(line.startswith(changed) for line in story[place:])
    assert max(map(len, (line for line in story if "/" not in line))) <= 80
