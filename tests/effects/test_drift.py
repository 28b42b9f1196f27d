"""Slow changes; against simulated arms they are tested with the frictions."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.effects import EffectTerm, Member, Signals
from scara_ident.effects.drift import OffsetDrift, WarmUp
from scara_ident.effects.following import slopes_by_differences
from scara_ident.effects.friction import friction_of, friction_torque
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


def test_a_part_of_the_friction_warms_up_alone():
    scene, item, member = scene_of(load_robot()), moving(load_robot(), 0.5), Member(1, (4.0,))
    whole, dry, drag = (columns(WarmUp(part), scene, item, member)[1, 0] for part in ("all", "coulomb", "viscous"))
    assert dry + drag == pytest.approx(whole)
    coulomb = friction_of(scene, 1)[0]
    assert np.abs(dry) == pytest.approx(coulomb * np.exp(-item.time / 4.0))
    assert [set(family.other_laws()) for family in (WarmUp(), WarmUp("coulomb"))] == [
        {WarmUp("coulomb"), WarmUp("viscous")},
        {WarmUp("all"), WarmUp("viscous")},
    ]
    assert WarmUp().law() == {}
    for part, power, word in (("coulomb", 0.0, "Coulomb friction alone"), ("viscous", 1.0, "grows with speed alone")):
        assert WarmUp(part).law()["speed_power"].value == power
        assert word in WarmUp(part).description(scene, member)
        assert "Coulomb" in WarmUp(part).columns(scene, member)[0].meaning or part == "viscous"


@pytest.mark.parametrize("part", ["all", "coulomb", "viscous"])
def test_what_is_unsure_of_a_part_of_the_friction_is_said_as_differences_say_it(part):
    scene, item, member = scene_of(load_robot()), moving(load_robot(), 0.5), Member(1, (4.0,))
    signals, value = Signals(scene, item), np.array([0.7])
    (said, by_differences) = (
        found[1]
        for found in (
            WarmUp(part).estimate_slopes(signals, member, value),
            slopes_by_differences(WarmUp(part), signals, member, value),
        )
    )
    dense = np.zeros((2, len(scene.value), item.samples))
    for own, (places, rows) in zip(dense, (said, by_differences), strict=True):
        own[places] = rows
    assert dense[0] == pytest.approx(dense[1], abs=1e-6 * np.abs(dense[1]).max())


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
