"""Limits of joints: what a URDF states, and what it writes where there is none."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scara_ident import read_arrays
from scara_ident.errors import RobotError
from scara_ident.excitation import limits_of
from scara_ident.robot.robot import Robot, load_robot
from tests.arms import PLANAR_2R, Link, write_urdf

SLIDE = (Link(axis=(0, 0, 1)), Link(axis=(0, 1, 0), kind="prismatic"))


def arm(folder: Path, lower: str, upper: str, links: tuple[Link, ...] = PLANAR_2R) -> Robot:
    """Return an arm whose joints have the range of these words."""
    path = write_urdf(folder / "arm.urdf", links)
    text = path.read_text()
    assert 'lower="-3" upper="3"' in text
    path.write_text(text.replace('lower="-3" upper="3"', f'lower="{lower}" upper="{upper}"'))
    return load_robot(path)


@pytest.mark.parametrize("size", ["10000.0", "1e16", "3.4e38", "62.9"])
def test_a_range_of_many_turns_is_none(tmp_path: Path, size: str):
    """An arm with +-10000 rad was told that its joints do not move, having turned by 12 rad."""
    robot = arm(tmp_path, f"-{size}", size)
    assert np.all(robot.lower == -np.inf) and np.all(robot.upper == np.inf)
    time = np.arange(400) / 100
    turned = np.sin(np.outer(time, [1.0, 1.7]))
    noise = np.random.default_rng(0).normal(size=(2, 400, 2))
    found = read_arrays(time, turned + 1e-5 * noise[0], turned + 1e-2 * noise[1], robot).findings
    assert [finding.kind for finding in found] == []
    with pytest.raises(RobotError, match="has no position limits"):
        limits_of(robot)


@pytest.mark.parametrize(("lower", "upper"), [("-6.29", "6.29"), ("-62.8", "0.5"), ("0", "12")])
def test_a_range_of_some_turns_is_the_joints(tmp_path: Path, lower: str, upper: str):
    robot = arm(tmp_path, lower, upper)
    assert np.all(robot.lower == float(lower)) and np.all(robot.upper == float(upper))


def test_each_end_is_one_by_itself(tmp_path: Path):
    robot = arm(tmp_path, "-1", "1e6")
    assert np.all(robot.lower == -1) and np.all(robot.upper == np.inf)


def test_a_slide_may_be_longer_than_an_angle(tmp_path: Path):
    robot = arm(tmp_path, "-100", "100", SLIDE)
    assert robot.lower.tolist() == [-np.inf, -100.0] and robot.upper.tolist() == [np.inf, 100.0]
    assert np.all(arm(tmp_path, "-1e4", "1e4", SLIDE).upper == np.inf)
