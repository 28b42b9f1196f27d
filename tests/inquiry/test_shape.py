"""The free curve over signals."""

from __future__ import annotations

import numpy as np

from scara_ident.effects import Member, Signals
from scara_ident.inquiry.shape import KNOTS, PAIR_KNOTS, shape_over
from scara_ident.robot.robot import load_robot
from tests.inquiry.asked import open_diagnosis


def test_hats_sum_to_one_and_follow_any_broken_line():
    robot, scene = load_robot(), open_diagnosis().search.scene
    motion = next(iter(scene.columns))
    signals = Signals(scene, motion)
    shape = shape_over(robot, ("position of joint2",), 0)
    hats = np.array(list(shape.signal_columns(signals, Member(0))))
    assert hats.shape == (KNOTS, motion.samples)
    knots = np.linspace(*shape.ranges[0], KNOTS)
    height = np.random.default_rng(0).normal(size=KNOTS)
    assert np.allclose(height @ hats, np.interp(motion.q[1], knots, height))
    pair = shape_over(robot, ("position of joint1", "velocity of joint2"), 0)
    both = np.array(list(pair.signal_columns(signals, Member(0))))
    assert both.shape == (PAIR_KNOTS**2, motion.samples) and np.allclose(both.sum(axis=0), 1.0)


def test_signals_that_no_motion_spreads_over_are_left_out():
    robot = load_robot()
    assert shape_over(robot, ("time",), 0) is None
    assert shape_over(robot, ("time", "motor angle"), 1).signals == (("motor angle", 1),)
