from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from scara_ident.errors import UsageError
from scara_ident.estimation import ConsistentOptions, consistent, links, physical_consistency, wls
from scara_ident.estimation.consistent.prior import prior_rows
from scara_ident.estimation.consistent.problem import Problem
from scara_ident.estimation.consistent.solution import nearest_arm, noise_of, solve_consistent
from scara_ident.estimation.information import Information, merge
from scara_ident.model.base_parameters import pseudo_inertia
from scara_ident.model.model import build_model
from scara_ident.robot.robot import load_robot
from scara_ident.threads import one_blas_thread
from tests.arms import motion
from tests.estimation.consistent.arms import (
    base_of,
    heavier,
    moving,
    observed,
    panda,
    parameters,
    scara,
    smallest,
    smallest_eigenvalue_share,
    stroke,
    truth,
    ur5,
)

Array = NDArray[np.float64]
DISSIPATIVE = ConsistentOptions(friction="dissipative")


def test_the_prior_does_not_bias_determined_directions():
    """The problem itself, with a URDF wrong by a factor of five, against the truth, over repeated noise."""
    wrong = build_model(heavier(load_robot(), 5.0), "complete")
    value = truth(scara())
    item = moving(wrong.robot, count=600)
    w = wrong.regressor(item)
    u = np.einsum("jpn,p->jn", w, value)
    problem = Problem(wrong)
    rng = np.random.default_rng(0)
    biases, spread = [], []
    for _ in range(40):
        measured = u + 0.05 * np.sqrt(np.mean(u**2, axis=1, keepdims=True)) * rng.standard_normal(u.shape)
        empty = Information.empty(len(value))
        rows = merge(empty.absorb_columns(np.vstack([w[j], measured[j : j + 1]])) for j in range(2))
        noise = noise_of(rows, rows.solve())
        factor = rows.regressor_factor @ problem.unknowns.to_parameters / noise
        target = rows.projected_torque / noise
        point = problem.solve(factor, target, prior_rows(problem.unknowns, factor, target, 0.01))
        biases.append(problem.unknowns.parameters(point.x) - rows.solve().value)
        spread.append(np.sqrt(np.diag(rows.inverse())) * noise)
    std = np.mean(spread, axis=0)
    determined = std < 0.3 * np.abs(value)
    assert np.count_nonzero(determined) >= 6
    assert np.all(np.abs(np.mean(biases, axis=0))[determined] < 0.1 * std[determined])


def test_where_least_squares_is_possible_it_is_the_estimate_whatever_the_urdf_says():
    for factor in (1.0, 5.0, 0.1):
        model = build_model(heavier(load_robot(), factor), "complete")
        item = observed(model, moving(model.robot), truth(scara()), 0.05)
        plain, found = wls(item), consistent(item, options=DISSIPATIVE)
        assert found.was_possible
        assert found.active == ()
        np.testing.assert_allclose(found.value, plain.value, rtol=1e-6)
        np.testing.assert_allclose(found.std, plain.std, rtol=1e-6)
        np.testing.assert_allclose(base_of(found), found.value[:5], rtol=1e-9)
        assert smallest(found) > 0.0


def test_joints_are_weighted_by_their_residual_or_by_the_noise_given():
    model = scara()
    item = observed(model, moving(model.robot), truth(model), 0.05)
    found = consistent(item, options=DISSIPATIVE)
    np.testing.assert_allclose(found.weights, wls(item).weights, rtol=1e-12)
    given = replace(DISSIPATIVE, noise=np.array([0.02, 0.008]))
    plain = wls(item, np.array([0.02, 0.008]))
    np.testing.assert_allclose(consistent(item, options=given).value, plain.value, rtol=1e-6)
    with pytest.raises(UsageError, match="noise: expected 2 numbers"):
        consistent(item, options=ConsistentOptions(noise=np.ones(3)))


def test_what_torque_does_not_determine_is_nearest_to_nominal():
    model = scara()
    found = consistent(observed(model, moving(model.robot), truth(model), 0.0))
    # With the nominal arm's own torque the nominal arm comes back, in all 22 standard parameters.
    np.testing.assert_allclose(found.standard, model.robot.standard_parameters(), rtol=1e-4, atol=1e-5)


def test_a_joint_that_never_moves_keeps_its_nominal_body():
    model = scara()
    item = moving(model.robot)
    still = motion(item.q * [[1.0], [0.0]], item.v * [[1.0], [0.0]], item.a * [[1.0], [0.0]], rate=200.0)
    seen = observed(model, still, truth(model), 0.02)
    found = consistent(seen, options=DISSIPATIVE)
    assert np.any(found.undetermined)
    assert np.isinf(found.std[found.undetermined]).all()
    rotor = model.names.index("P_d5")
    nominal = truth(model)
    assert found.value[rotor] == pytest.approx(nominal[rotor], rel=1e-3)
    # What the first joint does tell, the sum of inertias at this angle, is least squares'.
    plain = wls(seen)
    states = still.q.T, still.v.T, still.a.T
    np.testing.assert_allclose(found.predict(*states)[:, 0], plain.predict(*states)[:, 0], atol=1e-6)
    assert smallest(found) > 0.0


def test_free_friction_is_left_alone():
    model = scara()
    item = observed(model, stroke(model.robot), truth(model), 0.05, seed=3)
    found = consistent(item, options=ConsistentOptions(friction="free"))
    assert not any("friction" in text for text in found.active)
    assert any("friction" in reason for reason in physical_consistency(found).reasons)


def test_a_velocity_limit_can_be_given():
    model = scara()
    item = observed(model, stroke(model.robot), truth(model), 0.05, seed=3)
    # Up to the speed that was seen plain least squares is possible.
    slow = ConsistentOptions(friction="dissipative", speed={"joint1": 0.6, "joint2": 0.6})
    found = consistent(item, options=slow)
    assert not any("friction" in text for text in found.active)


def test_priors_on_parameters_and_standard_parameters_count():
    model = scara()
    item = observed(model, stroke(model.robot), truth(model), 0.05)
    free = consistent(item)
    known = consistent(item, options=ConsistentOptions(priors={"P_d1": (16.0, 0.05), "m2": (8.0, 0.01)}))
    assert known.value[0] == pytest.approx(16.0, abs=0.2)
    assert abs(free.value[0] - 16.0) > abs(known.value[0] - 16.0)
    assert links(known)[1].mass == pytest.approx(8.0, abs=0.05)
    assert smallest(known) > 0.0
    with pytest.raises(UsageError, match="prior of 'P_d9'"):
        consistent(item, options=ConsistentOptions(priors={"P_d9": (1.0, 0.1)}))


@one_blas_thread()
@pytest.mark.parametrize("arm", [ur5, panda], ids=["ur5", "panda"])
def test_larger_arms_stay_possible_however_poor_the_data(arm):
    model = build_model(arm(), "basic")
    problem = Problem(model)
    value = parameters(model, model.robot.standard_parameters(), (2.0, 1.0))
    for seed in range(3):
        item = observed(model, stroke(model.robot, 0.3), value, 0.3, seed)
        rows = merge(item.by_joint)
        found = solve_consistent(problem, rows)
        x = nearest_arm(problem, rows, found.x)
        standard = problem.unknowns.standard(x)
        for body in standard[: 10 * model.robot.n].reshape(-1, 10):
            assert smallest_eigenvalue_share(body) >= -1e-9
            assert pseudo_inertia(body)[3, 3] > 0.0
        assert np.all(standard[10 * model.robot.n :] > 0.0)
