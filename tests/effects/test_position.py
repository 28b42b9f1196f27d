"""A spring on a joint: its columns against simulated arms of all kinds, and what an offset leaves of its rest position."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scara_ident.effects import Member, Scene, Signals
from scara_ident.effects.position import Spring
from scara_ident.model.model import TorqueModel
from scara_ident.model.terms.friction import Offset
from scara_ident.simulation import effects as fx
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
