"""Which joints' torque scales are compared, and that the joint named for one depends on no unit of length."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scara_ident.diagnosis.diagnose import diagnose
from scara_ident.effects import Member, effects_named
from scara_ident.effects.measurement import TorqueGainMismatch
from scara_ident.effects.scale_groups import scale_groups
from scara_ident.model.model import build_model
from scara_ident.robot.robot import Robot
from tests.arms import ALONG, CYLINDRICAL, PLANAR_2R, UP, Link, in_unit, recorded_torque, recording, sines, ur5
from tests.effects.scenes import scene_of

SLIDES = tuple(Link("prismatic", axis=axis, mass=5.0) for axis in (ALONG, (0.0, 1.0, 0.0), UP))
TURN = Link(axis=UP, xyz=(0.3, 0.0, 0.0))


def per_joint(robot: Robot, unit: float) -> np.ndarray:
    """Return what a torque is multiplied by in another unit of length; a position that slides by the unit."""
    return np.where(robot.prismatic, unit, unit**2)[:, None]


@pytest.mark.parametrize("unit", [1e-3, 0.05, 1.0, 20.0])
@pytest.mark.parametrize(
    ("links", "groups"),
    [
        (PLANAR_2R, ((0, 1),)),
        (PLANAR_2R[:1], ((0,),)),
        (CYLINDRICAL, ((0, 2), (1,))),
        (SLIDES, ((0,), (1,), (2,))),
        ((SLIDES[2], TURN, TURN, TURN), ((0,), (1, 2, 3))),
        ((TURN, TURN, SLIDES[2], TURN), ((0, 1, 3), (2,))),
    ],
)
def test_joints_that_share_parameters_are_compared(links, groups, unit: float, tmp_path: Path):
    assert scale_groups(build_model(in_unit(links, unit, tmp_path)).rigid_body, (True,) * len(links)) == groups


def test_all_joints_of_an_arm_in_space_are_compared():
    term = build_model(ur5()).rigid_body
    assert scale_groups(term, (True,) * 6) == ((0, 1, 2, 3, 4, 5),)
    # One that rests says nothing of the others'.
    assert scale_groups(term, (False, True, True, False, False, False)) == ((0,), (1, 2), (3,), (4,), (5,))


def test_of_two_joints_that_share_parameters_the_second_is_tried(tmp_path: Path):
    effect = TorqueGainMismatch()
    scene = scene_of(in_unit(CYLINDRICAL, 1.0, tmp_path))
    assert [member.joint for member in effect.members(scene)] == [2]
    assert effect.estimated_beside(scene, Member(2)) == Member(0)
    assert "it is not known which" in effect.or_else(scene, Member(2), np.array([0.2]))
    assert effect.members(scene_of(in_unit(PLANAR_2R[:1], 1.0, tmp_path))) == ()
    # Behind a slide that is alone the ratio is to the scale of the first that turns.
    scene = scene_of(in_unit((SLIDES[2], TURN, TURN, TURN), 1.0, tmp_path))
    assert [member.joint for member in effect.members(scene)] == [1, 2, 3]
    assert effect.estimated_beside(scene, Member(3)) == Member(1) and effect.estimated_beside(scene, Member(1)) is None
    assert (
        effect.description(scene, Member(3))
        == "a torque scale that differs from the other joints', relative to that of j2"
    )
    assert (
        effect.description(scene, Member(1))
        == "a torque scale that differs from the other joints', relative to that of the joints not named"
    )
    assert effect.or_else(scene, Member(3), np.array([0.2])) == ""


@pytest.mark.slow
def test_the_joint_named_for_a_wrong_scale_depends_on_no_unit_of_length(tmp_path: Path):
    """In metres it was the column, 0.84 times the others, and in units of 20 m the ram, 1.20 times the first."""
    time, found = np.arange(3000) / 250.0, []
    friction = np.array([(9.0, 4.0, 0.0, 0.0, 1.0), (30.0, 20.0, 0.0, 0.0, 5.0), (8.0, 6.0, 0.0, 0.0, 2.0)])
    for unit in (1.0, 0.05, 20.0):
        (tmp_path / str(unit)).mkdir()
        robot = in_unit(CYLINDRICAL, unit, tmp_path / str(unit))
        scale, length = per_joint(robot, unit), np.where(robot.prismatic, unit, 1.0)[:, None]
        runs = []
        for k in range(2):
            rng = np.random.default_rng(k)
            q, v, a = (0.5 * length * each for each in sines(rng, time, 3, lowest=0.3))
            own = friction * scale
            own[:, 1] /= length[:, 0]
            u = recorded_torque(robot, q, v, a, own) * [[1.0], [1.0], [1.2]]
            noise = scale * [[0.3], [1.0], [0.2]] * rng.standard_normal(u.shape)
            runs.append(recording(robot, f"t{k}_1", time, q, u + noise))
        result = diagnose(robot, runs, bands=[8.0] * 3, catalogue=effects_named("torque_gain_mismatch"))
        (effect,) = result.effects
        found.append(effect.parameters["ratio"])
        assert effect.joint == "j3" and effect.description.endswith("it is not known which scale is wrong")
    for ratio in found:
        assert ratio.value == pytest.approx(1.2, abs=4.0 * ratio.std)
        assert (ratio.value, ratio.std) == (
            pytest.approx(found[0].value, rel=1e-6),
            pytest.approx(found[0].std, rel=1e-3),
        )
