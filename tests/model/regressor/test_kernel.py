"""The batch regressor against Pinocchio, closed form, linearity and energy."""

from __future__ import annotations

from dataclasses import replace
from importlib.metadata import distribution
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scara_ident.errors import RegressorMismatch, RobotError
from scara_ident.model.regressor import kernel as regressor
from scara_ident.model.regressor.kernel import PARAMETERS, Array, RegressorKernel, build_kernel, pinocchio_regressor
from scara_ident.model.regressor.recursion import joint_geometry
from tests.model.regressor.made import (
    LINK,
    configuration,
    consistent_inertia,
    fill_inertias,
    random_chain,
    random_model,
    scara,
    states,
)

URDFS = {
    "ur5": "ur_description/urdf/ur5_robot.urdf",  # pi/2 written as 1.57079632679
    "ur10": "ur_description/urdf/ur10_robot.urdf",
    "panda": "panda_description/urdf/panda.urdf",  # branched at the hand, prismatic fingers
    "allegro": "allegro_hand_description/urdf/allegro_right_hand.urdf",  # four chains from one base
    "baxter": "baxter_description/urdf/baxter.urdf",  # two arms and prismatic grippers
    "kinova": "kinova_description/robots/kinova.urdf",  # continuous joints
    "finger": "finger_edu_description/robots/finger_edu.urdf",  # axis -x
}


def load(name: str) -> pin.Model:
    if name == "scara":
        return scara()
    robots = Path(str(distribution("example-robot-data").locate_file("cmeel.prefix/share/example-robot-data/robots")))
    return pin.buildModelFromUrdf(str(robots / URDFS[name]))


def assert_agrees(model: pin.Model, samples: int = 40) -> None:
    q, v, a = states(model, samples)
    expected = pinocchio_regressor(model, q, v, a)
    scale = np.abs(expected).max(axis=(0, 2))
    kinds = np.tile([0, 1, 1, 1, 2, 2, 2, 2, 2, 2], model.njoints - 1)
    scale = np.maximum(scale, [1e-3 * (scale[kinds == kind].max() or 1.0) for kind in kinds])
    difference = np.abs(build_kernel(model)(q, v, a) - expected).max(axis=(0, 2))
    assert np.all(difference <= 1e-10 * scale)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["scara", *URDFS])
def test_kernel_agrees_with_pinocchio_and_knows_its_structural_zeros(name: str) -> None:
    model = load(name)
    assert_agrees(model)
    expected = np.abs(pinocchio_regressor(model, *states(model, 40))).max(axis=2)
    np.testing.assert_array_equal(build_kernel(model).pattern, expected > 1e-12)


@pytest.mark.slow
@settings(max_examples=80)
@given(seed=st.integers(0, 2**32 - 1), bodies=st.integers(1, 6))
def test_kernel_agrees_with_pinocchio_on_random_trees(seed: int, bodies: int) -> None:
    assert_agrees(random_model(seed, bodies), samples=10)


@pytest.mark.slow
@pytest.mark.parametrize("joints", [12, 17, 23, 30, 40])
def test_kernel_agrees_with_pinocchio_on_long_chains(joints: int) -> None:
    assert_agrees(random_chain(joints, joints), samples=8)


@settings(max_examples=40)
@given(seed=st.integers(0, 2**32 - 1), bodies=st.integers(1, 6))
def test_regressor_times_parameters_is_inverse_dynamics(seed: int, bodies: int) -> None:
    model = random_model(seed, bodies)
    parameters = fill_inertias(model, seed)
    q, v, a = states(model, 6)
    torque = np.einsum("jpn,p->jn", build_kernel(model)(q, v, a), parameters)
    data = model.createData()
    for k in range(q.shape[1]):
        expected = pin.rnea(model, data, configuration(model, q[:, k]), v[:, k], a[:, k])
        np.testing.assert_allclose(torque[:, k], expected, rtol=0, atol=1e-11 * (1 + np.abs(expected).max()))


@settings(max_examples=20)
@given(seed=st.integers(0, 2**32 - 1), bodies=st.integers(1, 5))
def test_work_of_the_torques_is_the_gain_of_energy(seed: int, bodies: int) -> None:
    model = random_model(seed, bodies)
    parameters = fill_inertias(model, seed)
    generator = np.random.default_rng(seed)
    amplitude, phase = generator.uniform(0.2, 0.6, (2, bodies, 1))
    rate = np.arange(1, bodies + 1)[:, None] * 0.7

    def motion(t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        angle = rate * t + phase
        return amplitude * np.sin(angle), amplitude * rate * np.cos(angle), -amplitude * rate**2 * np.sin(angle)

    nodes, weights = np.polynomial.legendre.leggauss(60)
    q, v, a = motion(1.0 + nodes)
    torque = np.einsum("jpn,p->jn", build_kernel(model)(q, v, a), parameters)
    work = float(weights @ np.sum(torque * v, axis=0))
    data = model.createData()
    q, v, _ = motion(np.array([0.0, 2.0]))
    energy = [
        pin.computeKineticEnergy(model, data, configuration(model, q[:, k]), v[:, k])
        + pin.computePotentialEnergy(model, data, configuration(model, q[:, k]))
        for k in range(2)
    ]
    assert work == pytest.approx(energy[1] - energy[0], abs=1e-9 * (1 + np.abs(energy).max()))


def test_scara_has_the_closed_form_of_a_planar_arm() -> None:
    kernel = build_kernel(scara())
    (_, q2), (v1, v2), (a1, a2) = q, v, a = states(scara(), 30)
    c, s = np.cos(q2), np.sin(q2)
    expected = np.zeros((2, 20, 30))
    expected[0, 9] = a1
    expected[0, 10] = LINK**2 * a1
    expected[0, 11] = LINK * (c * (2 * a1 + a2) - s * (2 * v1 * v2 + v2**2))
    expected[0, 12] = -LINK * (s * (2 * a1 + a2) + c * (2 * v1 * v2 + v2**2))
    expected[0, 19] = expected[1, 19] = a1 + a2
    expected[1, 11] = LINK * (c * a1 + s * v1**2)
    expected[1, 12] = LINK * (c * v1**2 - s * a1)
    np.testing.assert_allclose(kernel(q, v, a), expected, atol=1e-13)
    np.testing.assert_array_equal(kernel.pattern, np.any(expected != 0, axis=2))


def test_acceleration_of_every_joint_counts_the_last_included() -> None:
    model = load("panda")
    parameters = fill_inertias(model, 3)
    kernel, q = build_kernel(model), states(model, 1)[0]
    rest = np.zeros((model.nv, 1))
    data = model.createData()
    mass_matrix = pin.crba(model, data, q[:, 0], pin.Convention.WORLD)
    mass_matrix = np.triu(mass_matrix) + np.triu(mass_matrix, 1).T
    for joint in range(model.nv):
        unit = np.eye(model.nv)[:, [joint]]
        column = np.einsum("jpn,p->j", kernel(q, rest, unit) - kernel(q, rest, rest), parameters)
        np.testing.assert_allclose(column, mass_matrix[:, joint], atol=1e-12 * np.abs(mass_matrix).max())
        assert column[joint] > 0


def test_each_block_of_ten_columns_belongs_to_its_own_body() -> None:
    model = load("baxter")
    kernel = build_kernel(model)
    q, v, a = states(model, 1)
    w = kernel(q, v, a)[:, :, 0]
    generator = np.random.default_rng(5)
    bodies = [consistent_inertia(generator) for _ in range(model.njoints - 1)]
    for body in range(1, model.njoints):
        for other in range(1, model.njoints):
            model.inertias[other] = bodies[other - 1] if other == body else pin.Inertia.Zero()
        expected = pin.rnea(model, model.createData(), q[:, 0], v[:, 0], a[:, 0])
        columns = slice(10 * (body - 1), 10 * body)
        torque = w[:, columns] @ bodies[body - 1].toDynamicParameters()
        np.testing.assert_allclose(torque, expected, atol=1e-11 * np.abs(expected).max())
        moved_by = {model.joints[j].idx_v for j in list(model.supports[body])[1:]}
        assert set(np.flatnonzero(kernel.pattern[:, columns].any(axis=1))) <= moved_by


@pytest.mark.parametrize("axis", ["0 0 1", "0.6 0.8 0"])
def test_a_continuous_joint_takes_the_angle_like_a_revolute_one(axis: str) -> None:
    def arm(kind: str) -> pin.Model:
        body = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
        links = "".join(f'<link name="l{k}">{body}</link>' for k in range(3))
        joints = "".join(
            f'<joint name="j{k}" type="{kind}"><parent link="l{k}"/><child link="l{k + 1}"/><axis xyz="{axis}"/>'
            f'<origin xyz="0.1 0.2 0.3" rpy="0.4 0 {k}"/><limit lower="-9" upper="9" effort="1" velocity="1"/></joint>'
            for k in range(2)
        )
        return pin.buildModelFromXML(f'<robot name="arm">{links}{joints}</robot>')

    continuous, revolute = arm("continuous"), arm("revolute")
    assert (continuous.nq, continuous.nv, revolute.nq) == (4, 2, 2)
    q, v, a = states(revolute, 20)
    expected = build_kernel(revolute)(q, v, a)
    np.testing.assert_allclose(build_kernel(continuous)(q, v, a), expected, atol=1e-13)
    np.testing.assert_allclose(pinocchio_regressor(continuous, q, v, a), expected, atol=1e-12)


def test_only_requested_columns_are_generated_in_their_order() -> None:
    model = load("ur5")
    q, v, a = states(model, 5)
    full = build_kernel(model)
    columns = [59, 3, 3, 20, 41]
    kernel = build_kernel(model, columns)
    np.testing.assert_array_equal(kernel.columns, columns)
    np.testing.assert_array_equal(kernel.pattern, full.pattern[:, columns])
    np.testing.assert_allclose(kernel(q, v, a), full(q, v, a)[:, columns], rtol=1e-13, atol=1e-13)
    assert kernel._program.operations < full._program.operations / 3
    assert build_kernel(model, [])(q, v, a).shape == (6, 0, 5)
    for bad in ([60], [-1]):
        with pytest.raises(ValueError, match=r"0 \.\. 59"):
            build_kernel(model, bad)


@pytest.mark.parametrize("samples", [0, 1, 4095, 4096, 4097, 8195])
def test_samples_are_independent_of_how_many_there_are(samples: int) -> None:
    model = scara()
    q, v, a = states(model, samples)
    result = build_kernel(model)(q, v, a)
    assert result.shape == (2, 20, samples)
    assert result.flags.c_contiguous
    for k in {0, samples // 2, samples - 1} if samples else ():
        np.testing.assert_allclose(
            result[:, :, k], pinocchio_regressor(model, q, v, a)[:, :, k], rtol=1e-12, atol=1e-12
        )


def test_a_used_output_is_overwritten_structural_zeros_included() -> None:
    model = load("panda")
    kernel = build_kernel(model)
    q, v, a = states(model, 5000)
    expected = kernel(q, v, a)
    out = np.full(expected.shape, np.nan)
    assert kernel(q, v, a, out=out) is out
    np.testing.assert_array_equal(out, expected)
    longer = np.full((*expected.shape[:2], 6000), np.nan)
    kernel(q, v, a, out=longer[:, :, :5000])
    np.testing.assert_array_equal(longer[:, :, :5000], expected)
    assert np.isnan(longer[:, :, 5000:]).all()


def test_states_may_come_transposed_and_as_lists() -> None:
    model = scara()
    q, v, a = states(model, 12)
    kernel = build_kernel(model)
    transposed = (np.ascontiguousarray(part.T).T for part in (q, v, a))
    np.testing.assert_array_equal(kernel(*transposed), kernel(q, v, a))
    np.testing.assert_array_equal(kernel(q.tolist(), v.tolist(), a.tolist()), kernel(q, v, a))


def test_wrong_shapes_are_refused() -> None:
    model = scara()
    kernel = build_kernel(model)
    q, v, a = states(model, 4)
    with pytest.raises(ValueError, match="v: expected"):
        kernel(q, v[:, :3], a)
    with pytest.raises(ValueError, match="q: expected"):
        kernel(q.T, v.T, a.T)
    with pytest.raises(ValueError, match="out: expected"):
        kernel(q, v, a, out=np.empty((2, 20, 5)))
    with pytest.raises(ValueError, match="out: expected"):
        kernel(q, v, a, out=np.empty((2, 20, 4), dtype=np.float32))
    with pytest.raises(ValueError, match="C order"):
        kernel(q, v, a, out=np.empty((2, 20, 4), order="F"))


@pytest.mark.parametrize("joint", [pin.JointModelSpherical(), pin.JointModelHX(0.1), pin.JointModelFreeFlyer()])
def test_other_joints_are_refused_by_name(joint: pin.JointModel) -> None:
    model = scara()
    model.addJoint(2, joint, pin.SE3.Identity(), "odd")
    with pytest.raises(RobotError, match=f"joint 'odd' is a {joint.shortname()}; supported are revolute"):
        build_kernel(model)


def test_a_model_without_joints_is_refused() -> None:
    with pytest.raises(RobotError, match="no joint"):
        build_kernel(pin.Model())


def test_a_kernel_of_another_geometry_is_refused_naming_row_and_parameter() -> None:
    model = scara()
    traced = joint_geometry(model)
    model.jointPlacements[2] = pin.SE3(np.eye(3), np.array([LINK * (1 + 1e-9), 0.0, 0.0]))
    kernel = regressor._emit_kernel(traced, model.gravity, None)
    with pytest.raises(RegressorMismatch, match=r"joint 'joint1' for m of body 'joint2' differs .* 2\.0e-09"):
        regressor._check(kernel, model)


def wrong_kernel(fault: str, model: pin.Model) -> RegressorKernel:
    gravity, joints = pin.Motion(model.gravity), joint_geometry(model)
    if fault == "parent":
        joints[8] = replace(joints[8], parent=8)
    if fault == "axis":
        joints[8] = replace(joints[8], axis=-joints[8].axis)
    if fault == "kind":
        joints[8] = replace(joints[8], prismatic=False)
    if fault == "gravity":
        gravity.linear = np.array([0.0, 0.0, 9.81])
    return regressor._emit_kernel(joints, gravity, None)


@pytest.mark.slow
@pytest.mark.parametrize("fault", ["parent", "axis", "kind", "gravity"])
def test_a_kernel_of_a_wrong_model_is_refused(fault: str) -> None:
    model = load("panda")
    regressor._check(wrong_kernel("none", model), model)
    with pytest.raises(RegressorMismatch, match="differs from Pinocchio's"):
        regressor._check(wrong_kernel(fault, model), model)


FAULTS = {
    "acceleration of the last joint is zero": lambda evaluate, q, v, a: evaluate(q, v, a * (np.arange(9) < 8)[:, None]),
    "body index off by one": lambda evaluate, q, v, a: np.roll(evaluate(q, v, a), 10, axis=1),
    "two parameters in the wrong order": lambda evaluate, q, v, a: evaluate(q, v, a)[:, swapped(14, 16)],
    "not a number": lambda evaluate, q, v, a: evaluate(q, v, a) + np.where(np.arange(90) == 13, np.nan, 0.0)[:, None],
}


def swapped(i: int, j: int) -> list[int]:
    order = list(range(90))
    order[i], order[j] = j, i
    return order


@pytest.mark.parametrize("fault", FAULTS)
def test_a_kernel_with_a_known_fault_is_refused(fault: str) -> None:
    model = load("panda")
    kernel = build_kernel(model)

    class Faulty(RegressorKernel):
        def __call__(self, q: Array, v: Array, a: Array, out: Array | None = None) -> Array:
            return FAULTS[fault](kernel, q, v, a)

    faulty = Faulty(kernel.nv, kernel.columns, kernel.pattern, kernel._program)
    with pytest.raises(RegressorMismatch, match="differs from Pinocchio's"):
        regressor._check(faulty, model)


def test_parameters_are_in_pinocchios_order() -> None:
    body = pin.Inertia(2.0, np.array([0.1, 0.2, 0.3]), np.diag([1.0, 2.0, 2.5]))
    about_origin = body.inertia + 2.0 * (0.14 * np.eye(3) - np.outer(body.lever, body.lever))
    named = dict(zip(PARAMETERS, body.toDynamicParameters(), strict=True))
    assert named["m"] == 2.0
    assert [named["mcx"], named["mcy"], named["mcz"]] == pytest.approx([0.2, 0.4, 0.6])
    for i, j, name in [(0, 0, "Ixx"), (0, 1, "Ixy"), (1, 1, "Iyy"), (0, 2, "Ixz"), (1, 2, "Iyz"), (2, 2, "Izz")]:
        assert named[name] == pytest.approx(about_origin[i, j])


def test_models_alike_have_one_kernel_and_others_their_own() -> None:
    """A robot that was loaded again had its kernel traced and checked anew."""
    model, (q, v, a) = load("ur5"), states(load("ur5"), 5)
    kernel = build_kernel(model, range(20))
    heavier = model.copy()
    heavier.inertias[1] = pin.Inertia.Random()
    assert build_kernel(heavier, range(20)) is kernel
    assert build_kernel(model, range(10, 30)) is not kernel
    tilted, longer = model.copy(), model.copy()
    tilted.gravity.linear = np.array([0.0, 1.0, -9.0])
    longer.jointPlacements[3] = pin.SE3(np.eye(3), np.array([0.1, 0.2, 0.3]))
    for other in (tilted, longer):
        expected = regressor.pinocchio_regressor(other, q, v, a)[:, :20]
        np.testing.assert_allclose(build_kernel(other, range(20))(q, v, a), expected, atol=1e-10)
