"""Friction beyond a polynomial: columns against simulated arms of all kinds, recovery from noisy recordings."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scara_ident.effects import Effect, Member
from scara_ident.effects.drift import OffsetDrift, WarmUp
from scara_ident.effects.friction import (
    AsymmetricFriction,
    FrictionCoupling,
    PositionDependentFriction,
    Stribeck,
    friction_of,
)
from scara_ident.model.model import build_model
from scara_ident.model.terms import Friction
from scara_ident.robot.robot import load_robot
from scara_ident.simulation import effects as fx
from scara_ident.simulation import simulate, virtual_arm
from tests.arms import Link, write_urdf
from tests.effects.scenes import columns, fit, moving, scene_of, wandering
from tests.effects.simulated import ARMS, arm_of, run, true_motion, true_scene
from tests.simulation.made import left_over


@pytest.mark.slow
@pytest.mark.parametrize("kind", ARMS)
@pytest.mark.parametrize("which", ["stribeck", "asymmetric", "coupling", "drift", "warm up", "position"])
def test_columns_times_true_parameters_are_what_the_simulated_arm_adds(kind: str, which: str, tmp_path: Path):
    arm = arm_of(kind, tmp_path)
    joint, other = arm.robot.joints[:2]
    a0, unit = arm.friction[0, 0], float(arm.torque_scale[0])
    cases: dict[str, tuple[fx.Effect, Effect, Member, list[float]]] = {
        "stribeck": (fx.Stribeck(joint, 0.5 * a0, 0.3), Stribeck(), Member(0, (0.3,)), [0.5 * a0]),
        "asymmetric": (fx.AsymmetricFriction(joint, 0.05 * unit), AsymmetricFriction(), Member(0), [0.05 * unit]),
        "coupling": (
            fx.FrictionCoupling(joint, 0.03 * unit, 0.02 * unit),
            FrictionCoupling(),
            Member(0, (), 1),
            [0.03 * unit, 0.02 * unit],
        ),
        "drift": (fx.OffsetDrift(joint, 0.03 * unit), OffsetDrift(), Member(0), [0.03 * unit]),
        "warm up": (fx.WarmUp(joint, 0.4, 1.5), WarmUp(), Member(0, (1.5,)), [0.4]),
        "position": (
            fx.PositionDependentFriction(joint, 0.3, 0.5),
            PositionDependentFriction(),
            Member(0),
            [0.3 * a0 * np.cos(0.5), 0.3 * a0 * np.sin(0.5)],
        ),
    }
    switch, effect, member, value = cases[which]
    result = run(arm, switch)
    scene = true_scene(result)
    if which == "drift":
        # It is in the recording, not in the arm.
        added = np.zeros_like(result.true.effort)
        added[0] = 0.03 * unit * result.recording.time
    else:
        added = left_over(arm, result.true)
    found = np.einsum("jkn,k->jn", columns(effect, scene, true_motion(result), member), np.array(value))
    # At the very start the arm is held or let go at rest, where the speed has no sign.
    seen = np.isfinite(added) & np.all(result.true.velocity != 0.0, axis=0)
    assert np.count_nonzero(seen) > 0.9 * seen.size
    assert np.abs(found - added)[seen].max() < 1e-8 * unit
    assert np.abs(found).max() > 1e-2 * unit
    covariance = 1e-6 * np.eye(len(value))
    told = effect.parameters(scene, member, np.array(value), covariance)
    for name, parameter in told.items():
        assert parameter.value == pytest.approx(getattr(result.effects[0], name)), name
        unit_of = type(switch).units[name].replace("N m", arm.robot.torque_unit(0))
        slides = which == "coupling" and arm.robot.prismatic[1]
        assert parameter.unit == (unit_of.replace("/rad", "/m") if slides else unit_of)
    assert effect.inadmissible(scene, member, np.array(value), np.full(len(value), 1e-6)) is None
    assert other in effect.description(scene, member) or which != "coupling"


def test_friction_of_a_sum_of_velocities_has_the_direction_of_the_drive():
    robot = load_robot()
    reversed_ = replace(robot, reduction=robot.reduction * np.array([1.0, -1.0]))
    for arm, sign in ((robot, 1.0), (reversed_, -1.0)):
        item = moving(arm, 1.0)
        for way, other in (("sum", 1.0), ("difference", -1.0)):
            w = sign * (item.v[1] + other * item.v[0])
            found = columns(FrictionCoupling(way), scene_of(arm), item, Member(1, (), 0))
            assert np.array_equal(found[1], [w, np.sign(w)])


def test_members_are_those_that_can_be_seen():
    scene = scene_of(load_robot())
    still = replace(scene, speed=np.array([2.0, 0.0]), travel=np.array([2.0, 0.0]))
    for effect in (Stribeck(), AsymmetricFriction(), WarmUp(), PositionDependentFriction()):
        assert {member.joint for member in effect.members(scene)} == {0, 1}
        assert {member.joint for member in effect.members(still)} == {0}
    assert FrictionCoupling("sum").members(scene) == (Member(0, (), 1), Member(1, (), 0))
    assert FrictionCoupling().members(still) == ()
    short = replace(scene, travel=np.array([2.0, 0.1]))
    assert [member.joint for member in PositionDependentFriction().members(short)] == [0]
    for effect in (Stribeck(), WarmUp()):
        (parameter,) = effect.nonlinear
        assert all(parameter.lower < member.nonlinear[0] < parameter.upper for member in effect.members(scene))


@pytest.mark.parametrize(
    ("effect", "member", "possible", "impossible"),
    [
        (Stribeck(), Member(0, (0.1,)), [[0.02]], [[-0.01], [0.5]]),
        (Stribeck(), Member(0, (1.5,)), [], [[0.01]]),
        (AsymmetricFriction(), Member(0), [[0.02], [-0.02]], [[0.9], [-0.9]]),
        (PositionDependentFriction(), Member(0), [[0.01, -0.015]], [[0.03, 0.0]]),
        (FrictionCoupling(), Member(0, (), 1), [[-0.1, 0.1]], []),
        (FrictionCoupling("sum"), Member(0, (), 1), [[0.1, 0.1], [-0.01, 0.1]], [[0.1, -0.1], [-0.1, 0.1]]),
        (WarmUp(), Member(0, (2.0,)), [[0.3]], [[-0.3], [5.0]]),
        (WarmUp(), Member(0, (100.0,)), [], [[0.3]]),
    ],
)
def test_what_no_arm_can_have_is_refused(effect, member, possible, impossible):
    scene = scene_of(load_robot())
    for value in possible:
        assert effect.inadmissible(scene, member, np.array(value), np.full(len(value), 1e-4)) is None
    for value in impossible:
        assert effect.inadmissible(scene, member, np.array(value), np.full(len(value), 1e-4))
        assert effect.inadmissible(scene, member, np.array(value), np.full(len(value), 10.0)) is None or (
            member.nonlinear and member.nonlinear[0] > 1.0
        )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("switch", "effect", "member"),
    [
        (fx.Stribeck("joint1", 0.12, 0.15), Stribeck(), Member(0, (0.15,))),
        (fx.AsymmetricFriction("joint1"), AsymmetricFriction(), Member(0)),
        (fx.WarmUp("joint1", 0.35, 3.0), WarmUp(), Member(0, (3.0,))),
        (fx.PositionDependentFriction("joint1", 0.25, 0.5), PositionDependentFriction(), Member(0)),
        (fx.FrictionCoupling("joint1"), FrictionCoupling(), Member(0, (), 1)),
        (fx.OffsetDrift("joint1"), OffsetDrift(), Member(0)),
    ],
)
def test_parameters_are_recovered_from_noisy_closed_loop_recordings(switch, effect, member):
    arm = virtual_arm()
    runs = [simulate(arm, wandering(arm, f"w{k}", k), effects=[switch], seed=k) for k in (1, 2)]
    data = [item.recording for item in runs]
    model = build_model(arm.robot, "complete")
    scene, value, covariance = fit(model, data, effect, member, band=25.0, rounds=3)
    for name, found in effect.parameters(scene, member, value, covariance).items():
        true = getattr(runs[0].effects[0], name)
        assert abs(found.value - true) < 4.0 * found.std + 0.01 * abs(true), name
        assert found.std < 0.2 * abs(true), name
    assert friction_of(scene, 0)[0] == pytest.approx(arm.friction[0, 0], rel=0.1)


@pytest.mark.parametrize(("viscous", "falls"), [(0.3, False), (0.1, True)])
def test_where_friction_as_a_whole_never_falls_that_is_said(viscous: float, falls: bool):
    """Friction that grows as the root of speed was told as Stribeck's on three arms, and nothing else."""
    scene = scene_of(load_robot())
    (term,) = (term for term in scene.model.terms if isinstance(term, Friction))
    value = np.zeros(len(scene.value))
    value[scene.model.place(term).start + len(term.powers) + 1] = viscous
    beside, member = replace(scene, value=value), Member(1, (0.2,))
    assert friction_of(beside, 1)[1] == viscous
    # It falls by at most 0.858 times its amplitude over its velocity: 0.215 N m s/rad.
    assert ("never falls" in Stribeck().or_else(beside, member, np.array([0.05]))) is not falls
    assert AsymmetricFriction().or_else(beside, Member(1), np.array([0.05])) == ""


def test_the_other_law_falls_by_the_speed_itself_and_is_reported_as_such():
    scene, other = scene_of(load_robot()), Stribeck(1)
    item, member = moving(scene.robot), Member(1, (0.2,))
    v = item.v[1] * scene.robot.drive_sign[1]
    expected = np.sign(v) * np.exp(-np.abs(v) / 0.2)
    np.testing.assert_allclose(columns(other, scene, item, member)[1, 0], expected, atol=1e-12)
    assert Stribeck().other_laws() == (other,)
    assert other.other_laws() == (Stribeck(),)
    assert Stribeck().law() == {}
    assert other.law()["exponent"].value == 1.0
    assert other.description(scene, member).startswith(Stribeck().description(scene, member) + ", as exp(-|v|")


@pytest.mark.parametrize("speed", [1e-3, 2.0])
def test_speeds_at_which_friction_falls_are_shares_of_what_a_slide_reaches(tmp_path: Path, speed: float):
    robot = load_robot(write_urdf(tmp_path / "arm.urdf", [Link("prismatic")]))
    scene = replace(scene_of(robot), speed=np.array([speed]))
    tried = [member.nonlinear[0] for member in Stribeck().members(scene)]
    ((lower, upper),) = Stribeck().limits(scene, Member(0, (tried[0],)))
    assert lower < 0.1 * min(tried) and 2.0 * max(tried) < upper


def test_the_phase_of_a_slide_is_said_to_be_of_which_period(tmp_path: Path):
    robot = load_robot(write_urdf(tmp_path / "arm.urdf", [Link("prismatic"), Link()]))
    scene = replace(scene_of(robot), travel=np.array([0.6, 2.0]))
    assert "period of 1.2 m" in PositionDependentFriction().description(scene, Member(0))
    assert "period" not in PositionDependentFriction().description(scene, Member(1))
