"""A joint with another zero: columns against the torque there, slopes against differences, members, recovery."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.diagnosis import diagnose
from scara_ident.effects import EffectTerm, Member, Signals
from scara_ident.effects.aliases import aliases
from scara_ident.effects.joint_zero import JointZero, moved_motion
from scara_ident.export.traced_model import trace_model
from scara_ident.model.model import TorqueModel
from scara_ident.model.regressor.tracing import compile_program
from scara_ident.recording.recording import Recording
from scara_ident.robot.description import RobotDescription
from scara_ident.robot.robot import Robot, build_robot, load_robot
from scara_ident.simulation import VirtualArm, parse_effect, sampled, simulate, virtual_arm
from tests.arms import Array, example_urdf, ur5
from tests.effects.scenes import columns, dense, moving, scene_of


def arm_of(*joints: str) -> Robot:
    """A UR5 whose other joints are locked."""
    urdf = example_urdf("ur5_robot.urdf")
    return build_robot(RobotDescription(urdf=urdf, effort_side="joint", joints=dict.fromkeys(joints)), urdf)


UPPER_ARM = ("shoulder_lift_joint", "elbow_joint")


@pytest.mark.parametrize("offset", [1e-4, -0.3, 1.5707963, 3.0])
def test_the_torque_is_that_at_the_true_position_whatever_the_offset(offset: float):
    scene, item = scene_of(ur5()), moving(ur5(), 0.3)
    there = moved_motion(item, 2, offset)
    expected = np.einsum("jpn,p->jn", scene.model.regressor(there), scene.value)
    expected -= np.einsum("jpn,p->jn", scene.model.regressor(item), scene.value)
    found = offset * columns(JointZero(), scene, item, Member(2, (offset,)))[:, 0]
    # The difference of a small offset keeps fewer digits.
    assert np.abs(found - expected).max() < 1e-9 * np.abs(scene.value).max()


def test_no_offset_is_the_derivative():
    scene, item = scene_of(ur5()), moving(ur5(), 0.3)
    step = 1e-4
    near = columns(JointZero(), scene, item, Member(3, (step,))) + columns(
        JointZero(), scene, item, Member(3, (-step,))
    )
    found = columns(JointZero(), scene, item, Member(3, (0.0,)))
    # A mean of differences errs by the square of the step.
    assert np.abs(found - 0.5 * near).max() < 1e-6 * np.abs(found).max()


@pytest.mark.parametrize("offset", [0.0, 0.2, -1.2])
def test_slopes_are_the_differences_of_the_torque(offset: float):
    robot = arm_of(*UPPER_ARM, "wrist_1_joint")
    scene, item = scene_of(robot), moving(robot, 0.3)
    effect, member = JointZero(), Member(1, (offset,))

    def torque(value: Array, at: float = offset) -> Array:
        return offset * columns(effect, replace(scene, value=value), item, Member(1, (at,)))[:, 0]

    bodies = len(scene.model.rigid_body.columns)
    found = dense(effect.slopes(Signals(scene, item), member), bodies + 2)
    tie = effect.tie(scene, member)
    assert tie.value == offset
    assert tie.slopes.tolist() == [*[0.0] * (bodies + 1), 1.0]
    expected = [(torque(scene.value + d) - torque(scene.value - d)) / 2.0 for d in np.eye(len(scene.value))[:bodies]]
    expected += [0.0 * expected[0], (torque(scene.value, offset + 1e-4) - torque(scene.value, offset - 1e-4)) / 2e-4]
    # Linear in the bodies; by the offset a difference errs by the square of its step.
    assert np.abs(found - np.moveaxis(expected, 0, 1)).max() < 1e-5


@pytest.mark.slow
@pytest.mark.parametrize(
    ("robot", "told"), [("ur5", [1, 2, 3, 4]), ("panda", [1, 2, 3, 4, 5]), (None, []), ("kinova", [1, 2, 3, 4])]
)
def test_members_are_the_joints_whose_zero_no_parameters_take_up(robot: str | None, told: list[int]):
    scene = scene_of(load_robot() if robot is None else load_robot(robot), name="basic")
    assert [member.joint for member in JointZero().members(scene)] == told
    (absorbed,) = (alias for alias in aliases(scene.model) if alias.effect == JointZero.name)
    told_names = {scene.robot.joints[member.place] for member in JointZero().members(scene)}
    assert told_names.isdisjoint(absorbed.joints)
    assert told_names | set(absorbed.joints) == set(scene.robot.joints)


@pytest.mark.parametrize("offset", [0.0, 0.4])
def test_it_is_in_the_code_of_an_export_whatever_the_offset(offset: float):
    robot = ur5()
    scene, item = scene_of(robot, name="basic"), moving(robot, 0.02)
    term = EffectTerm(JointZero(), Member(2, (offset,)), scene)
    model = TorqueModel("basic", robot, (*scene.model.terms, term))
    value = np.append(scene.value, offset or 0.1)
    recorded = trace_model(model, value)
    program = compile_program(recorded.trace, list(enumerate(recorded.torque)))
    found = np.zeros((robot.n, item.samples))
    program.evaluate(np.concatenate([item.q, item.v, item.a]), found, np.zeros((program.buffers, item.samples)))
    expected = np.einsum("jkn,k->jn", model.regressor(item), value)
    # The derivative at no offset is one by differences.
    assert np.abs(found - expected).max() < 1e-9 * np.abs(expected).max()


def test_the_line_that_mends_it_is_named():
    scene = scene_of(ur5())
    said = JointZero().or_else(scene, Member(2, (0.1,)), np.array([0.1]))
    assert "+0.1 rad (+5.73 deg)" in said
    assert "offset: {elbow_joint: ...}" in said


def runs(arm: VirtualArm, effect: str | None, middle: float = 0.5) -> list[Recording]:
    """Three motions about poses over most of a turn."""
    made = []
    for k in range(3):
        rng = np.random.default_rng(k)
        size, phase = rng.uniform(0.4, 0.8, (2, arm.robot.n, 4))
        centre = rng.uniform(-middle, middle, (arm.robot.n, 1))

        def path(
            t: Array, size: Array = size, phase: Array = phase, centre: Array = centre
        ) -> tuple[Array, Array, Array]:
            q, v, a = centre + 0.0 * t, 0.0 * centre * t, 0.0 * centre * t
            for i in range(4):
                w, x = 0.9 * (i + 1), size[:, i, None] / (1.0 + i)
                angle = w * t + 8.0 * phase[:, i, None]
                q, v, a = q + x * np.sin(angle), v + x * w * np.cos(angle), a - x * w * w * np.sin(angle)
            return q, v, a

        effects = [] if effect is None else [parse_effect(effect)]
        made.append(
            simulate(arm, sampled(f"t{k}", arm.robot, path, 12.0), effects=effects, rate=250.0, seed=k).recording
        )
    return made


@pytest.mark.slow
@pytest.mark.parametrize("offset", [0.15, -0.6])
def test_a_wrong_zero_is_found_and_reported(offset: float):
    arm = virtual_arm(arm_of(*UPPER_ARM))
    found = diagnose(arm.robot, runs(arm, f"joint_zero:shoulder_lift_joint:offset={offset}"), model="basic")
    assert [item.label for item in found.effects] == ["joint_zero of shoulder_lift_joint"]
    told = found.effects[0].parameters["offset"]
    assert abs(told.value - offset) < 3.0 * told.std
    assert told.std < 0.01
    assert "recording, position: offset: {shoulder_lift_joint" in found.effects[0].description


@pytest.mark.slow
def test_none_is_found_where_there_is_none_or_parameters_take_it_up():
    arm = virtual_arm(arm_of(*UPPER_ARM))
    assert not diagnose(arm.robot, runs(arm, None), model="basic").effects
    taken_up = diagnose(arm.robot, runs(arm, "joint_zero:elbow_joint:offset=0.2"), model="basic")
    assert not taken_up.effects
    assert "elbow_joint" in next(item for item in taken_up.aliases if item.effect == JointZero.name).joints
