"""The recursion over bodies: the geometry it reads, which entries it finds, and the equivalence principle."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scara_ident.model.regressor.recursion import JointGeometry, joint_geometry, trace_regressor
from scara_ident.model.regressor.tracing import compile_program
from tests.model.regressor.made import configuration, fill_inertias, random_model, scara, states

SEEDS = st.integers(0, 2**32 - 1)


def regressor(model: pin.Model, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
    """Evaluate what is traced, shape (nv, 10 bodies, samples)."""
    width = 10 * (model.njoints - 1)
    trace, entries = trace_regressor(joint_geometry(model), model.gravity, range(width))
    program = compile_program(trace, [(row * width + column, entry) for (row, column), entry in entries.items()])
    result = np.zeros((model.nv * width, q.shape[1]))
    program.evaluate(np.concatenate([q, v, a]), result, np.empty((program.buffers, q.shape[1])))
    return result.reshape(model.nv, width, -1)


def moved(joint: JointGeometry, q: float) -> pin.SE3:
    """Placement of a joint's frame in its parent's."""
    zero = pin.SE3(joint.rotation, joint.offset)
    if joint.prismatic:
        return zero * pin.SE3(np.eye(3), q * joint.axis)
    return zero * pin.SE3(pin.exp3(q * joint.axis), np.zeros(3))


@settings(max_examples=40)
@given(seed=SEEDS, bodies=st.integers(1, 6))
def test_joints_stand_where_pinocchio_has_them(seed: int, bodies: int) -> None:
    model = random_model(seed, bodies)
    q = states(model, 1)[0][:, 0]
    data = model.createData()
    pin.forwardKinematics(model, data, configuration(model, q))
    placed = [pin.SE3.Identity()]
    for index, joint in enumerate(joint_geometry(model), 1):
        placed.append(placed[joint.parent] * moved(joint, q[joint.velocity_index]))
        np.testing.assert_allclose(placed[index].homogeneous, data.oMi[index].homogeneous, atol=1e-12)


@settings(max_examples=20)
@given(seed=SEEDS, bodies=st.integers(1, 5))
def test_a_lift_under_the_arm_cannot_be_distinguished_from_gravity(seed: int, bodies: int) -> None:
    """An arm that a slide without gravity pushes up at g feels what it feels at rest under gravity."""
    gravity = 9.81
    lifted, standing = pin.Model(), pin.Model()
    for model in (lifted, standing):
        model.gravity.linear = np.zeros(3)
        model.addJoint(0, pin.JointModelPZ(), pin.SE3.Identity(), "lift")
    arm = random_model(seed, bodies)
    for index in range(1, arm.njoints):
        for model in (lifted, standing):
            parent = int(arm.parents[index]) + 1
            model.addJoint(parent, arm.joints[index], arm.jointPlacements[index], arm.names[index])
    standing.gravity.linear = np.array([0.0, 0.0, -gravity])
    q, v, a = states(lifted, 4)
    v[0] = a[0] = 0.0
    expected = regressor(standing, q, v, a)
    a[0] = gravity
    np.testing.assert_allclose(regressor(lifted, q, v, a), expected, rtol=0, atol=1e-11 * (1 + np.abs(expected).max()))


@settings(max_examples=20)
@given(seed=SEEDS, bodies=st.integers(1, 5))
def test_at_rest_it_is_the_slope_of_the_potential_energy(seed: int, bodies: int) -> None:
    model = random_model(seed, bodies)
    parameters = fill_inertias(model, seed)
    q = states(model, 1)[0]
    rest = np.zeros_like(q)
    torque = np.einsum("jpn,p->j", regressor(model, q, rest, rest), parameters)
    data = model.createData()

    def energy(angles: np.ndarray) -> float:
        return float(pin.computePotentialEnergy(model, data, configuration(model, angles)))

    step = 1e-3
    for joint in range(model.nv):
        unit = np.eye(model.nv)[joint]
        # Five points: the error is step^4 / 30 times the fifth derivative.
        near = [energy(q[:, 0] + k * step * unit) for k in (-2, -1, 1, 2)]
        slope = np.dot([1.0, -8.0, 8.0, -1.0], near) / (12.0 * step)
        assert torque[joint] == pytest.approx(slope, abs=1e-8 * (1 + np.abs(torque).max()))


def test_quarter_turns_are_exact_and_rounded_ones_are_left_alone() -> None:
    def turned(angle: float) -> np.ndarray:
        model = pin.Model()
        placement = pin.SE3(pin.rpy.rpyToMatrix(angle, 0.0, 0.0), np.array([0.4, 1e-17, 0.0]))
        model.addJoint(0, pin.JointModelRZ(), placement, "j")
        (joint,) = joint_geometry(model)
        assert joint.offset[1] == 0.0
        return joint.rotation

    np.testing.assert_array_equal(turned(np.pi / 2), [[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    assert turned(1.57079632679)[1, 1] == pytest.approx(4.9e-12, rel=0.01)


def test_only_the_columns_asked_for_are_traced_and_zeros_are_none() -> None:
    model = scara()
    joints = joint_geometry(model)
    everything = set(trace_regressor(joints, model.gravity, range(20))[1])
    assert everything == {(0, k) for k in (9, 10, 11, 12, 19)} | {(1, k) for k in (11, 12, 19)}
    assert set(trace_regressor(joints, model.gravity, [11, 3])[1]) == {(0, 11), (1, 11)}
