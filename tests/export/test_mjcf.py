from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scara_ident.errors import ScaraIdentError
from scara_ident.export.friction import JointFriction
from scara_ident.export.mjcf import mjcf_text
from scara_ident.robot.robot import Robot, load_robot
from tests.export.arms import ARMS, Array, joint_torque, random_motion, random_standard

mujoco = pytest.importorskip("mujoco", reason="needs MuJoCo, from the extra 'test'")

SEEDS = st.integers(0, 2**31)


@pytest.fixture(scope="module", params=ARMS, ids=lambda make: make.__name__)
def robot(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Robot:
    make: Callable[[Path], Robot] = request.param
    return make(tmp_path_factory.mktemp(make.__name__))


def compiled(text: str) -> Any:
    """MuJoCo's model, without limits and dry friction, which it solves as soft constraints."""
    model = mujoco.MjModel.from_xml_string(text)
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    return model


def mujoco_torque(robot: Robot, model: Any, q: Array, v: Array, a: Array) -> Array:
    data, result = mujoco.MjData(model), np.zeros_like(q)
    joints = [model.joint(name) for name in robot.joints]
    for k in range(q.shape[1]):
        for i, joint in enumerate(joints):
            data.qpos[joint.qposadr[0]] = q[i, k]
            data.qvel[joint.dofadr[0]] = v[i, k]
            data.qacc[joint.dofadr[0]] = a[i, k]
        mujoco.mj_inverse(model, data)
        result[:, k] = [data.qfrc_inverse[joint.dofadr[0]] for joint in joints]
    return result


@pytest.mark.slow
@given(seed=SEEDS)
@settings(max_examples=25)
def test_mujoco_gets_the_identified_torque_and_damping(robot: Robot, seed: int) -> None:
    standard = random_standard(robot, seed)
    rng = np.random.default_rng(seed)
    friction = JointFriction(np.full(robot.n, 0.3), rng.uniform(0.01, 0.5, robot.n))
    model = compiled(mjcf_text(robot, standard, friction)[0])
    q, v, a = random_motion(robot, seed)
    damping = np.abs(robot.reduction) if robot.effort_side == "motor" else np.ones(robot.n)
    rigid = joint_torque(robot, standard, q, v, a)
    expected = rigid + (damping * friction.viscous)[:, None] * v
    found = mujoco_torque(robot, model, q, v, a)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * np.sqrt(np.mean(expected**2)))
    # On its own scale too: damping behind a high gear would hide the rest.
    model.dof_damping[:] = 0.0
    found = mujoco_torque(robot, model, q, v, a)
    np.testing.assert_allclose(found, rigid, rtol=0, atol=1e-9 * np.sqrt(np.mean(rigid**2)))


def test_the_arm_s_own_parameters_give_its_own_torque(robot: Robot) -> None:
    standard = robot.standard_parameters()
    if robot.name in ("carriage", "branched"):  # they have links without inertial
        with pytest.raises(ScaraIdentError, match="MuJoCo takes no moving link without mass"):
            mjcf_text(robot, standard)
        return
    text, notes = mjcf_text(robot, standard)
    assert notes == ()
    q, v, a = random_motion(robot, 2)
    expected = joint_torque(robot, standard, q, v, a)
    found = mujoco_torque(robot, compiled(text), q, v, a)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * np.sqrt(np.mean(expected**2)))


@given(seed=SEEDS)
@settings(max_examples=4)
def test_every_link_has_its_name_and_stands_where_it_stood(robot: Robot, seed: int) -> None:
    model = compiled(mjcf_text(robot, random_standard(robot, seed))[0])
    data, ours = mujoco.MjData(model), robot.model.createData()
    q = random_motion(robot, seed, samples=1)[0][:, 0]
    ordered = pin.neutral(robot.model)
    for name, value in zip(robot.joints, q, strict=True):
        joint = robot.model.joints[robot.model.getJointId(name)]
        ordered[joint.idx_q : joint.idx_q + joint.nq] = value if joint.nq == 1 else (np.cos(value), np.sin(value))
        data.qpos[model.joint(name).qposadr[0]] = value
    mujoco.mj_kinematics(model, data)
    pin.framesForwardKinematics(robot.model, ours, ordered)
    names = {model.body(k).name for k in range(model.nbody)}
    for k, frame in enumerate(robot.model.frames):
        if frame.type != pin.FrameType.BODY:
            continue
        assert frame.name in names
        body = data.body(frame.name)
        np.testing.assert_allclose(body.xpos, ours.oMf[k].translation, atol=1e-12)
        np.testing.assert_allclose(body.xmat.reshape(3, 3), ours.oMf[k].rotation, atol=1e-12)


def test_joints_carry_range_armature_friction_and_damping(tmp_path: Path) -> None:
    from tests.export.arms import branched

    robot = branched(tmp_path)
    standard = random_standard(robot, 0)
    friction = JointFriction(np.array([0.1, np.nan, 0.3]), np.array([0.4, 0.5, -0.6]))
    text, notes = mjcf_text(robot, standard, friction)
    model = mujoco.MjModel.from_xml_string(text)
    wrist, shoulder, branch = (model.joint(name) for name in ("wrist", "shoulder", "branch"))
    assert [int(joint.type[0]) for joint in (wrist, shoulder, branch)] == [
        mujoco.mjtJoint.mjJNT_HINGE,
        mujoco.mjtJoint.mjJNT_HINGE,
        mujoco.mjtJoint.mjJNT_SLIDE,
    ]
    assert [bool(joint.limited[0]) for joint in (wrist, shoulder, branch)] == [True, False, True]
    np.testing.assert_array_equal(branch.range, [-0.2, 0.3])
    armature = [model.dof_armature[joint.dofadr[0]] for joint in (wrist, shoulder, branch)]
    np.testing.assert_array_equal(armature, standard[30:])
    loss = [model.dof_frictionloss[joint.dofadr[0]] for joint in (wrist, shoulder, branch)]
    np.testing.assert_allclose(loss, [50 * 0.1, 0.0, 400 * 0.3], rtol=1e-15)
    damping = np.array([model.dof_damping[joint.dofadr[0]] for joint in (wrist, shoulder, branch)])
    np.testing.assert_allclose(damping.ravel(), [50 * 0.4, 80 * 0.5, 0.0], rtol=1e-15)
    np.testing.assert_array_equal(model.opt.gravity, [1.0, -2.0, -9.0])
    assert any("shoulder: Coulomb friction is not known" in note for note in notes)
    assert any("branch: viscous friction is -0.6" in note for note in notes)


def test_what_is_drawn_has_no_mass_and_no_contact(robot: Robot) -> None:
    standard = random_standard(robot, 1)
    model = mujoco.MjModel.from_xml_string(mjcf_text(robot, standard)[0])
    assert np.sum(model.body_mass) == pytest.approx(np.sum(standard[: 10 * robot.n : 10]), rel=1e-14)
    assert not np.any(model.geom_contype) and not np.any(model.geom_conaffinity)


def test_a_free_arm_keeps_its_energy_in_simulation() -> None:
    """MuJoCo's own integration of the exported double pendulum, without friction."""
    from tests.export.arms import double_pendulum

    robot = double_pendulum(Path())
    model = compiled(mjcf_text(robot, robot.standard_parameters())[0])
    model.opt.integrator = int(mujoco.mjtIntegrator.mjINT_RK4)
    model.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
    data = mujoco.MjData(model)
    data.qpos[:] = 2.0, -0.5
    mujoco.mj_forward(model, data)
    start, kinetic = float(np.sum(data.energy)), 0.0
    for _ in range(500):
        mujoco.mj_step(model, data)
        kinetic = max(kinetic, float(data.energy[1]))
    mujoco.mj_forward(model, data)
    assert kinetic > 0.1
    assert float(np.sum(data.energy)) == pytest.approx(start, abs=1e-7 * kinetic)


@pytest.mark.parametrize("kind", ["point", "rod", "plate", "just outside"])
@given(seed=SEEDS)
@settings(max_examples=8)
def test_a_body_on_the_edge_of_the_possible_is_taken_and_reported(kind: str, seed: int) -> None:
    robot = load_robot()
    rng = np.random.default_rng(seed)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    widths = {"point": (0, 0, 0), "rod": (0.02, 0, 0), "plate": (0.02, 0.01, 0), "just outside": (0.02, 0.01, -1e-10)}
    covariance = (turn * np.array(widths[kind])) @ turn.T
    body = pin.Inertia(1.5, rng.normal(0.0, 0.1, 3), np.trace(covariance) * np.eye(3) - covariance)
    standard = robot.standard_parameters()
    standard[10:20] = body.toDynamicParameters()
    text, notes = mjcf_text(robot, standard)
    assert len(notes) == 1 and notes[0].startswith("link2: a point, rod or plate was made thicker by")
    q, v, a = random_motion(robot, seed)
    expected = joint_torque(robot, standard, q, v, a)
    found = mujoco_torque(robot, compiled(text), q, v, a)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-8 * np.sqrt(np.mean(expected**2)))


def test_a_link_without_mass_is_refused_by_name(tmp_path: Path) -> None:
    from tests.export.arms import carriage

    robot = carriage(tmp_path)
    with pytest.raises(ScaraIdentError, match=r"^cart: MuJoCo takes no moving link without mass"):
        mjcf_text(robot, robot.standard_parameters())


def test_an_arm_that_cannot_exist_is_refused_by_name() -> None:
    robot = load_robot()
    standard = robot.standard_parameters()
    standard[10] = -1.0
    with pytest.raises(ScaraIdentError, match=re.escape("link2: its mass is -1 kg")):
        mjcf_text(robot, standard)
