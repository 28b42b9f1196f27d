"""Friction that turns late: the area of its column is what a step leaves for each second that it is late."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.effects import Member, Signals
from scara_ident.effects.filters.late_turn import LateTurn, lacking
from scara_ident.robot.robot import load_robot
from tests.effects.scenes import columns, moving, scene_of


def test_a_step_that_is_late_leaves_twice_its_delay_at_every_turn():
    scene = scene_of(load_robot(), rate=500.0)
    item = moving(scene.robot, 4.0, 500.0)
    sign = Signals(scene, item).sign
    own = columns(LateTurn(), scene, item, Member(1))
    assert np.all(own[0] == 0.0)
    turns = np.flatnonzero(np.diff(sign[1]))
    reach = round(0.5 * np.min(np.diff(turns)))
    for turn in turns[(turns > reach) & (turns < item.samples - reach)]:
        area = np.sum(own[1, 0, turn - reach : turn + reach]) / item.rate
        assert area == pytest.approx(-2.0 * np.sign(np.diff(sign[1])[turn]), rel=0.05)


def test_what_a_torque_lacks_is_its_rate_backwards():
    signals = Signals(scene_of(load_robot(), rate=500.0), moving(load_robot(), 4.0, 500.0))
    found = lacking(signals, np.sin(3.0 * signals.time)[None])[0, 400:-400]
    assert found == pytest.approx(-3.0 * np.cos(3.0 * signals.time[400:-400]), abs=1e-4)
