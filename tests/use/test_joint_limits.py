"""What a motion reaches of limits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.errors import UsageError
from scara_ident.export.identified_model import IdentifiedModel
from scara_ident.use.energy import drive
from scara_ident.use.joint_limits import joint_limits, margins
from tests.arms import motion


def moved(known: IdentifiedModel):
    """A sine of joint 1 about 0.5 rad, joint 2 at rest."""
    time, w = np.arange(4001) / 1000.0, 2.0 * np.pi * 0.5
    q = np.stack([0.5 + 0.8 * np.sin(w * time), np.zeros_like(time)])
    v = np.stack([0.8 * w * np.cos(w * time), np.zeros_like(time)])
    return drive(known, motion(q, v, np.stack([-0.8 * w**2 * np.sin(w * time), np.zeros_like(time)])))


def test_each_limit_has_its_extreme_and_its_time(known: IdentifiedModel):
    limits = joint_limits(
        known.robot, velocities={"joint1": 2.0}, accelerations={"joint1": 10.0}, powers={"joint1": 1e4}
    )
    found = {each.name: each for each in margins(known.robot, limits, [moved(known)])}
    high, low = found["joint1.position.upper"], found["joint1.position.lower"]
    assert (high.reached, high.time) == (pytest.approx(1.3), pytest.approx(0.5, abs=2e-3))
    assert (low.reached, low.kept) == (pytest.approx(-0.3), True)
    assert low.margin == pytest.approx(known.robot.lower[0] * -1 - 0.3)
    speed = found["joint1.velocity"]
    assert (speed.bound, abs(speed.reached), speed.kept) == (2.0, pytest.approx(0.8 * np.pi), False)
    # Above 2 rad/s about every passage of the middle, of which there are five, two of them at the ends.
    assert len(speed.beyond) == 5
    assert speed.beyond[1] == (pytest.approx(1.0 - np.arccos(2.0 / (0.8 * np.pi)) / np.pi, abs=2e-3), pytest.approx(1.0 + np.arccos(2.0 / (0.8 * np.pi)) / np.pi, abs=2e-3))  # fmt: skip
    assert found["joint1.acceleration"].share == pytest.approx(0.8 * np.pi**2 / 10.0)
    assert found["joint1.power"].kept
    assert found["joint2.velocity"].reached == 0.0
    assert "joint2.power" not in found


def test_torque_and_power_are_those_of_the_drive(known: IdentifiedModel):
    own = moved(known)
    limits = joint_limits(known.robot, torques={"joint1": 1.0}, powers={"joint1": 50.0})
    found = {each.name: each for each in margins(known.robot, limits, [own])}
    assert abs(found["joint1.torque"].reached) == np.abs(own.torque[0]).max()
    # At the motor: torque there times its own speed.
    motor = own.torque[0] * own.motion.v[0] * known.robot.reduction[0]
    assert abs(found["joint1.power"].reached) == pytest.approx(np.abs(motor).max())


def test_an_endless_joint_has_no_share(known: IdentifiedModel):
    limits = joint_limits(known.robot)
    limits = replace(limits, lower=np.array([-np.inf, -1.0]), upper=np.array([1.0, 1.0]))
    found = {each.name: each for each in margins(known.robot, limits, [moved(known)])}
    assert "joint1.position.lower" not in found
    broken = found["joint1.position.upper"]
    assert (broken.share, broken.kept, broken.excess) == (None, False, np.inf)


@pytest.mark.filterwarnings("error")
def test_a_range_that_begins_at_zero_is_as_any_other(known: IdentifiedModel):
    limits = replace(joint_limits(known.robot), lower=np.array([0.0, -1.0]), upper=np.array([2.0, 1.0]))
    found = {each.name: each for each in margins(known.robot, limits, [moved(known)])}
    assert found["joint1.position.lower"].share == pytest.approx(1.3)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"torques": {"joint9": 1.0}}, "has no joint 'joint9'"),
        ({"powers": {"joint1": 0.0}}, "power limit of joint1: 0 allows no motion"),
        ({"ranges": {"joint1": (1.0, -1.0)}}, "is empty"),
    ],
)
def test_a_limit_that_makes_no_sense_is_one_line(known: IdentifiedModel, given, said: str):
    with pytest.raises(UsageError, match=said):
        joint_limits(known.robot, **given)
