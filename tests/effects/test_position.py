"""A spring on a joint: its columns against simulated arms of all kinds, and what an offset leaves of its rest position."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scara_ident.effects import Member, Scene, Signals
from scara_ident.effects.position import RopeWeight, Spring
from scara_ident.model.model import TorqueModel
from scara_ident.model.terms.friction import Offset
from scara_ident.robot.robot import Robot, load_robot
from scara_ident.simulation import effects as fx
from tests.arms import Link, write_urdf
from tests.effects.scenes import columns, moving, scene_of
from tests.effects.simulated import ARMS, arm_of, run, true_motion, true_scene
from tests.simulation.made import left_over, scara

STIFFNESS, REST = 0.07, 0.4


def without_offset(scene: Scene) -> Scene:
    kept = tuple(term for term in scene.model.terms if not isinstance(term, Offset))
    model = TorqueModel(scene.model.name, scene.robot, kept)
    return Scene(
        model, scene.value[: len(model.columns)], scene.duration, scene.rate, scene.band, scene.travel, scene.speed, {}
    )


@pytest.mark.parametrize("kind", ARMS)
def test_the_column_times_the_stiffness_is_what_the_simulated_arm_adds(kind: str, tmp_path: Path) -> None:
    arm = arm_of(kind, tmp_path)
    unit = float(arm.torque_scale[0])
    result = run(arm, fx.Spring(arm.robot.joints[0], STIFFNESS * unit, 0.0))
    wanted = columns(Spring(), true_scene(result), true_motion(result), Member(0))
    added = np.einsum("jpn,p->jn", wanted, [STIFFNESS * unit])
    left = left_over(arm, result.true)
    seen = np.isfinite(left) & np.all(result.true.velocity != 0.0, axis=0)
    assert np.count_nonzero(seen) > 0.9 * seen.size
    assert np.abs(added - left)[seen].max() < 1e-8 * unit
    assert np.abs(added).max() > 1e-3 * unit


def test_an_offset_in_the_model_leaves_the_rest_position_open() -> None:
    scene = scene_of(scara().robot)
    place = [column.name for column in scene.model.columns].index("p_o1")
    scene.value[place] = -STIFFNESS * REST
    assert len(Spring().columns(scene, Member(0))) == 1
    found = Spring().parameters(scene, Member(0), np.array([STIFFNESS]), np.array([[1e-6]]))
    assert found["rest_position"].value == pytest.approx(REST)
    assert found["rest_position"].std == np.inf
    assert found["stiffness"].std == pytest.approx(1e-3)
    assert "offset" in Spring().description(scene, Member(0))


def test_without_an_offset_the_rest_position_has_the_std_of_a_ratio() -> None:
    scene = without_offset(scene_of(scara().robot))
    assert len(Spring().columns(scene, Member(0))) == 2
    spread = np.array([[4e-6, 1e-6], [1e-6, 9e-6]])
    value = np.array([STIFFNESS, -STIFFNESS * REST])
    found = Spring().parameters(scene, Member(0), value, spread)["rest_position"]
    draws = np.random.default_rng(0).multivariate_normal(value, spread, 200_000)
    assert found.value == pytest.approx(REST)
    assert found.std == pytest.approx(np.std(-draws[:, 1] / draws[:, 0]), rel=0.03)


def test_a_spring_does_not_push_away() -> None:
    scene = scene_of(scara().robot)
    assert Spring().inadmissible(scene, Member(0), np.array([-1.0]), np.array([0.1])) is not None
    assert Spring().inadmissible(scene, Member(0), np.array([1.0]), np.array([0.1])) is None


def test_a_gear_transmits_a_spring_that_rests_where_the_offset_says() -> None:
    scene = scene_of(scara().robot)
    item = moving(scene.robot, 0.2)
    value, std = np.array([0.05]), np.eye(1)
    rest = Spring().parameters(scene, Member(1), value, std)["rest_position"].value
    found = Spring().torque_on_links(Signals(scene, item), Member(1), value)
    assert found[1] == pytest.approx(0.05 * (item.q[1] - rest))
    assert np.array_equal(found[0], np.zeros(item.samples))
    bare = without_offset(scene)
    both = Spring().torque_on_links(Signals(bare, item), Member(1), np.array([0.05, 0.1]))
    assert both[1] == pytest.approx(0.05 * item.q[1] + 0.1)


def lift(folder: Path, axis: tuple[float, float, float] = (0.0, 0.0, 1.0)) -> Robot:
    """A carriage on a column, an arm that turns on it, and a slide on that."""
    links = (
        Link(kind="prismatic", axis=axis, mass=20.0),
        Link(axis=(0.0, 0.0, 1.0), mass=8.0, com=(0.2, 0.0, 0.0)),
        Link(kind="prismatic", axis=(1.0, 0.0, 0.0), mass=3.0),
    )
    return load_robot(write_urdf(folder / "lift.urdf", links))


def test_only_what_goes_up_and_down_carries_a_rope(tmp_path: Path) -> None:
    assert [member.joint for member in RopeWeight().members(scene_of(lift(tmp_path)))] == [0]
    assert RopeWeight().members(scene_of(scara().robot)) == ()


@pytest.mark.parametrize("axis", [(0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (0.6, 0.0, 0.8)])
@pytest.mark.parametrize("reduction", [1.0, -25.0])
def test_a_rope_weighs_more_the_lower_its_joint_is(axis, reduction: float, tmp_path: Path) -> None:
    """By the virtual work of its weight, m g dh, on the side of the effort and either way round."""
    robot = lift(tmp_path, axis)
    robot = replace(robot, reduction=np.array([reduction, 1.0, 1.0]), effort_side="motor")
    scene, item = scene_of(robot), moving(robot, 0.5)
    column = columns(RopeWeight(), scene, item, Member(0))[0, 0]
    height = axis[2] * item.q[0]
    hanging = -np.sign(axis[2]) * item.q[0]
    assert column == pytest.approx(9.81 * axis[2] * hanging / reduction, rel=1e-3)
    assert np.all(np.diff(hanging)[np.abs(np.diff(height)) > 0] * np.diff(height)[np.abs(np.diff(height)) > 0] < 0.0)
    told = RopeWeight().parameters(scene, Member(0), np.array([4.0]), np.array([[0.04]]))["mass_per_length"]
    assert (told.value, told.std, told.unit) == (4.0, pytest.approx(0.2), "kg/m")


def test_of_rope_and_spring_one_at_the_most_is_possible(tmp_path: Path) -> None:
    """What pushes a lift away from where it would rest removed 94 % and was no effect: `undecided`."""
    scene, std = scene_of(lift(tmp_path)), np.array([0.1])
    # The first with the other's force is impossible.
    for one, other in ((Spring(), RopeWeight()), (RopeWeight(), Spring())):
        assert one.inadmissible(scene, Member(0), np.array([5.0]), std) is None
        assert other.inadmissible(scene, Member(0), np.array([-5.0]), std) is not None
    assert "0.51 kg/m" in Spring().or_else(scene, Member(0), np.array([5.0]))
    assert RopeWeight().or_else(scene, Member(0), np.array([5.0])) == ""
    assert Spring().or_else(scene, Member(2), np.array([5.0])) == ""
    assert "counterweight" in RopeWeight().description(scene, Member(0))


def test_a_gear_transmits_the_weight_of_a_rope(tmp_path: Path) -> None:
    scene, item = scene_of(lift(tmp_path)), moving(lift(tmp_path), 0.2)
    found = RopeWeight().torque_on_links(Signals(scene, item), Member(0), np.array([2.0]))
    assert found[0] == pytest.approx(-2.0 * 9.81 * item.q[0], rel=1e-3)
    assert not np.any(found[1:])
