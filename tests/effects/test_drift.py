"""Slow changes; against simulated arms they are tested with the frictions."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.effects import EffectTerm, Member, Signals
from scara_ident.effects.drift import OffsetDrift, WarmUp
from scara_ident.effects.friction import friction_torque
from scara_ident.robot.robot import load_robot
from tests.effects.scenes import columns, moving, scene_of


def test_an_offset_is_no_drift_where_the_model_has_none():
    scene = scene_of(load_robot(), name="reduced")
    drift, member = OffsetDrift(), Member(0)
    assert len(EffectTerm(drift, member, scene).columns) == 2
    assert "offset" in (drift.inadmissible(scene, member, np.array([0.0, 0.1]), np.array([0.01, 0.01])) or "")
    assert drift.inadmissible(scene, member, np.array([0.1, 0.1]), np.array([0.01, 0.01])) is None
    assert len(EffectTerm(drift, member, scene_of(load_robot())).columns) == 1


def test_time_counts_from_the_start_of_each_recording():
    scene, item = scene_of(load_robot(), start={"m": -2.0}), moving(load_robot(), 0.5)
    assert columns(OffsetDrift(), scene, item, Member(1))[1, 0] == pytest.approx(item.time + 2.0)
    friction = friction_torque(Signals(scene, item), 1)
    warm = columns(WarmUp(), scene, item, Member(1, (4.0,)))[1, 0]
    assert warm == pytest.approx(friction * np.exp(-(item.time + 2.0) / 4.0))


def test_a_drift_stays_within_the_torque_limit():
    scene, std = scene_of(load_robot()), np.array([1e-3])
    most = float(scene.robot.torque_limit[0]) / scene.duration
    assert OffsetDrift().inadmissible(scene, Member(0), np.array([0.9 * most]), std) is None
    assert "limit" in OffsetDrift().inadmissible(scene, Member(0), np.array([-1.1 * most - 0.002]), std)


def test_warming_up_is_tried_where_there_is_friction():
    assert WarmUp().members(scene_of(load_robot()))
    model = scene_of(load_robot()).model
    frictionless = [term for term in model.terms if term.name != "friction"]
    scene = scene_of(load_robot())
    bare = type(model)(model.name, model.robot, tuple(frictionless))
    assert WarmUp().members(type(scene)(bare, scene.value, 10.0, 1e3, 15.0, scene.travel, scene.speed, {})) == ()


def test_no_gear_warms_up_in_a_second():
    """A share of 3.3 with 0.6 s was once believed of a measured arm."""
    scene, std = scene_of(load_robot()), np.array([0.01])
    warm = WarmUp()
    for share, seconds, possible in ((3.3, 0.6, False), (0.3, 0.6, False), (0.3, 8.0, True), (2.5, 8.0, True)):
        why = warm.inadmissible(scene, Member(0, (seconds,)), np.array([share]), std)
        assert (why is None) is possible
    # What is within its own error of no friction at all is not too fast.
    assert warm.inadmissible(scene, Member(0, (0.6,)), np.array([0.3]), np.array([0.2])) is None
