"""The closed form of the regressor against Pinocchio, and its criteria."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from numpy.typing import NDArray

from scara_ident import paper
from scara_ident.robot.robot import load_robot
from tests.paper.made import NAMES, SEEDS, URDF, friction, inertial_grouping, random_states


def random_bodies(rng: np.random.Generator) -> NDArray[np.float64]:
    """Ten parameters of each of two bodies with nothing zero."""
    return np.concatenate([pin.Inertia.Random().toDynamicParameters() * rng.uniform(0.5, 2) for _ in range(2)])


def torque_scale(w: NDArray[np.float64], parameters: NDArray[np.float64]) -> float:
    return float(np.max(np.einsum("ipn,p->in", np.abs(w), np.abs(parameters))))


@settings(max_examples=30)
@given(seed=SEEDS)
def test_closed_form_torque_is_pinocchios_for_any_two_bodies(arm: pin.Model, seed: int) -> None:
    q, v, a = random_states(seed)
    pin.seed(seed % 2**31)
    rng = np.random.default_rng(seed)
    bodies = random_bodies(rng)
    rotors = rng.uniform(1e-5, 1e-2, 2)
    reduction = (float(rng.uniform(20, 150)), float(-rng.uniform(20, 150)))
    ratio = np.array(reduction)
    armature = ratio**2 * rotors
    data = arm.createData()
    expected = np.empty((2, q.shape[1]))
    for k in range(q.shape[1]):
        at_joint = pin.computeJointTorqueRegressor(arm, data, q[:, k], v[:, k], a[:, k]) @ bodies
        expected[:, k] = (at_joint + armature * a[:, k]) / ratio
    p_d = inertial_grouping() @ np.concatenate([bodies, armature])
    w = paper.regressor(q, v, a, reduction=reduction)[:, :5]
    found = np.einsum("ipn,p->in", w, p_d)
    assert np.max(np.abs(found - expected)) <= 1e-12 * torque_scale(w, p_d)


def test_closed_form_torque_of_the_embedded_arm_is_inverse_dynamics_with_armature(arm: pin.Model) -> None:
    q, v, a = random_states(3, 200)
    actuators = ElementTree.parse(URDF).getroot().findall("transmission/actuator")
    armature = 100.0**2 * np.array([float(x.findtext("rotorInertia", "")) for x in actuators])
    model = arm.copy()
    model.armature = armature
    data = model.createData()
    expected = np.stack([pin.rnea(model, data, *(x[:, k] for x in (q, v, a))) for k in range(200)], axis=1) / 100
    p_d = paper.table5_parameters("OJD")[:5]
    w = paper.regressor(q, v, a)[:, :5]
    found = np.einsum("ipn,p->in", w, p_d)
    assert np.max(np.abs(found - expected)) <= 1e-12 * torque_scale(w, p_d)


def test_the_loaded_robots_standard_parameters_group_to_table_5() -> None:
    found = inertial_grouping() @ load_robot().standard_parameters()
    np.testing.assert_allclose(found, paper.table5_parameters("OJD")[:5], rtol=1e-12, atol=1e-15)


def test_the_link_length_enters_as_in_a_model_with_that_length(arm: pin.Model) -> None:
    model = arm.copy()
    model.jointPlacements[2] = pin.SE3(np.eye(3), np.array([0.51, 0.0, 0.12]))
    q, v, a = random_states(5, 50)
    data = model.createData()
    pi = np.concatenate([model.inertias[i].toDynamicParameters() for i in (1, 2)])
    expected = np.stack([pin.rnea(model, data, *(x[:, k] for x in (q, v, a))) for k in range(50)], axis=1) / 100
    p_d = inertial_grouping(0.51) @ np.concatenate([pi, [0.0, 0.0]])
    w = paper.regressor(q, v, a, link_length=0.51)[:, :5]
    found = np.einsum("ipn,p->in", w, p_d)
    assert np.max(np.abs(found - expected)) <= 1e-12 * torque_scale(w, p_d)


def test_the_motion_determines_five_inertial_parameters_and_fifteen_in_all() -> None:
    w = paper.regressor(*random_states(1, 300))
    stacked = np.moveaxis(w, 1, 2).reshape(-1, 15)
    scaled = stacked / np.linalg.norm(stacked, axis=0)
    assert np.linalg.matrix_rank(scaled) == 15
    assert np.linalg.matrix_rank(scaled[:, :5]) == 5


@settings(max_examples=20)
@given(seed=SEEDS)
def test_friction_and_offset_act_on_their_own_joint_alone(seed: int) -> None:
    q, v, a = random_states(seed, 5)
    rng = np.random.default_rng(seed)
    parameters = np.concatenate([np.zeros(5), rng.normal(size=10)])
    found = np.einsum("ipn,p->in", paper.regressor(q, v, a), parameters)
    for joint in range(2):
        own = friction(v[joint], parameters[5 + 4 * joint : 9 + 4 * joint]) + parameters[13 + joint]
        np.testing.assert_allclose(found[joint], own, rtol=1e-12, atol=1e-12)


def test_friction_opposes_motion_alike_in_both_directions_and_rests_at_standstill() -> None:
    coefficients = np.array([0.2, 0.1, -0.02, 0.003])
    speed = np.array([0.5, 2.0])
    expected = 0.2 + 0.1 * speed - 0.02 * speed**2 + 0.003 * speed**3
    v = np.tile(np.concatenate([speed, -speed, [0.0]]), (2, 1))
    w = paper.regressor(np.zeros_like(v), v, np.zeros_like(v))
    for joint in range(2):
        found = coefficients @ w[joint, 5 + 4 * joint : 9 + 4 * joint]
        np.testing.assert_allclose(found, [*expected, *-expected, 0.0], rtol=1e-15)


def test_shapes_that_do_not_fit_are_refused() -> None:
    with pytest.raises(ValueError, match=r"\(2, N\)"):
        paper.regressor(np.zeros((3, 4)), np.zeros((3, 4)), np.zeros((3, 4)))
    with pytest.raises(ValueError, match=r"\(2, N\)"):
        paper.regressor(np.zeros((2, 4)), np.zeros((2, 5)), np.zeros((2, 4)))


def test_parameters_are_in_the_papers_order_with_units() -> None:
    inertial = [f"P_d{i}" for i in range(1, 6)]
    assert [*inertial, "a01", "a11", "a21", "a31", "a02", "a12", "a22", "a32", "p_o1", "p_o2"] == NAMES
    assert paper.PARAMETERS[0].meaning == "I1z + m2 l1^2 + Jm1/tau1^2"
    assert all(parameter.unit and parameter.meaning.isascii() for parameter in paper.PARAMETERS)


def test_the_reduced_model_lacks_P_d3_cubic_friction_and_offsets() -> None:
    assert set(NAMES) - set(paper.REDUCED) == {"P_d3", "a31", "a32", "p_o1", "p_o2"}
    assert [name for name in NAMES if name in paper.REDUCED] == list(paper.REDUCED)


def test_criteria_of_a_known_matrix() -> None:
    singular = np.array([4.0, 2.0, 0.5])
    rng = np.random.default_rng(0)
    u = np.linalg.qr(rng.normal(size=(40, 3)))[0]
    v = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    w = np.moveaxis((u * singular @ v.T).reshape(20, 2, 3), 0, 2)  # (2, 3, 20)
    log_det, condition = paper.criteria(w)
    assert log_det == pytest.approx(np.log(4.0 * 2.0 * 0.5) * 2, rel=1e-12)
    assert condition == pytest.approx(64.0, rel=1e-12)


def test_criteria_stay_accurate_where_the_product_matrix_would_not() -> None:
    """cond(H)^2 = 1e24 is beyond what double precision holds of H^T H."""
    singular = np.array([1e6, 1.0, 1e-6])
    rng = np.random.default_rng(0)
    u = np.linalg.qr(rng.normal(size=(40, 3)))[0]
    v = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    log_det, condition = paper.criteria(np.moveaxis((u * singular @ v.T).reshape(20, 2, 3), 0, 2))
    assert log_det == pytest.approx(0.0, abs=1e-3)
    assert condition == pytest.approx(1e24, rel=1e-2)


@pytest.mark.parametrize("count", [3, 50], ids=["fewer rows than columns", "joint at rest"])
def test_criteria_of_a_motion_that_tells_too_little(count: int) -> None:
    q, v, a = random_states(0, count)
    w = paper.regressor(q, np.zeros_like(v), a)
    assert paper.criteria(w) == (-np.inf, np.inf)


@pytest.mark.parametrize(
    ("trajectory", "log_det", "condition"),
    [(paper.OJK, "50.91", "2.66e+04"), (paper.OJD, "75.54", "1.52e+06")],
    ids=["OJK", "OJD"],
)
def test_the_indexes_of_the_printed_formulas(trajectory: paper.Trajectory, log_det: str, condition: str) -> None:
    """Figures found independently on 2500 equally spaced samples."""
    found = paper.criteria(paper.regressor(*trajectory.motion(trajectory.times())))
    assert f"{found[0]:.2f}" == log_det
    assert f"{found[1]:.2e}" == condition
