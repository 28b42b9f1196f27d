"""``scara-ident base``."""

from __future__ import annotations

import json
from pathlib import Path

from tests.arms import Link, example_urdf, write_urdf


def test_it_prints_the_papers_parameters_and_writes_them(command, tmp_path: Path):
    result = command("base", "--output", tmp_path)
    assert result.status == 0
    for text in ("P_d1", "I1zz + 0.1089 m2 + 10000 Jm1", "10000 Jm2", "never appear in the torque: m1", "rank 5 of 5"):
        assert text in result.out
    content = json.loads((tmp_path / "base.json").read_text())
    assert content["count"] == 5
    assert [path.name for path in tmp_path.iterdir()] == ["base.json"]


def test_any_urdf_will_do(command):
    result = command("base", "--robot", example_urdf("double_pendulum.urdf"))
    assert result.status == 0
    assert "7 base parameters" in result.out


def test_an_angle_with_few_digits_is_said(command, tmp_path: Path):
    links = (
        Link(axis=(0, 1, 0)),
        Link(xyz=(0.3, 0, 0.1), rpy=(1.5708, 0, 0)),
        Link(xyz=(0, 0, 0.2), rpy=(1.5708, 0, 0)),
    )
    result = command("base", "--robot", write_urdf(tmp_path / "arm.urdf", links))
    assert result.status == 0
    assert "an angle in the URDF may have too few digits" in " ".join(result.out.split())


def test_base_parameters_that_no_motion_tells_apart_are_said(command):
    """A rank of 40 of 42 was printed as if it were right."""
    result = command("base", "--robot", "so101")
    assert result.status == 0
    said = " ".join(result.out.split())
    assert "check: rank 40 of 42" in said
    assert "2 of the base parameters are almost sums of others" in said


def test_a_robot_that_is_not_there_is_status_2_and_a_bad_one_1(command, tmp_path: Path):
    result = command("base", "--robot", tmp_path / "robot.yaml")
    assert result.status == 2
    assert f"{tmp_path / 'robot.yaml'}: no such robot description" in result.err
    (tmp_path / "robot.yaml").write_bytes(bytes(range(256)))
    assert command("base", "--robot", tmp_path / "robot.yaml").status == 1
    assert command("base", "--robot", tmp_path).status == 1
    # What a description names is no bad usage.
    (tmp_path / "robot.yaml").write_text("urdf: ur6\n")
    result = command("base", "--robot", tmp_path / "robot.yaml")
    assert result.status == 1 and "robot.yaml: urdf: ur6: no such file" in result.err


def test_words_it_does_not_know_are_bad_usage(command):
    assert command("base", "extra").status == 2
    assert command("base", "--robott", "x").status == 2
