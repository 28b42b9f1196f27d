from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from scara_ident.errors import EstimationError, UsageError
from scara_ident.estimation import (
    ConsistentEstimate,
    ConsistentOptions,
    consistent,
    links,
    ols,
    physical_consistency,
    wls,
)
from scara_ident.estimation.bands import choose_bands
from scara_ident.estimation.consistent.bodies import smallest_eigenvalue_share
from scara_ident.estimation.consistent.options import Ellipsoid
from scara_ident.estimation.consistent.programme import Programme
from scara_ident.estimation.consistent.pull import prior_rows
from scara_ident.estimation.consistent.solution import fill, noise_of, solve_consistent
from scara_ident.estimation.information import Information, merge
from scara_ident.estimation.observations import Evidence, gather
from scara_ident.model.base_parameters import pseudo_inertia
from scara_ident.model.model import TorqueModel, build_model
from scara_ident.model.terms import Column
from scara_ident.motion.motion import Motion
from scara_ident.recording.recording import read_recording
from scara_ident.robot.robot import Robot, load_robot
from scara_ident.threads import one_blas_thread
from tests.arms import motion, sines
from tests.estimation.consistent.arms import heavier, panda, parameters, ur5
from tests.estimation.made import evidence
from tests.shared import shared_path

Array = NDArray[np.float64]


@cache
def scara(name: str = "complete") -> TorqueModel:
    return build_model(load_robot(), name)


def moving(robot: Robot, seed: int = 1, count: int = 2000, size: float = 0.6) -> Motion:
    rng = np.random.default_rng(seed)
    return motion(*sines(rng, np.arange(count) / 200.0, robot.n, size=size, lowest=0.3), rate=200.0)


def stroke(robot: Robot, speed: float = 0.65) -> Motion:
    """One slow stroke of every joint below a speed; each takes a little longer than the one before, up to 2.5 s."""
    time = np.linspace(0.0, 2.5, 1000)
    q, v, a = (np.zeros((robot.n, 1000)) for _ in range(3))
    for j in range(robot.n):
        duration = 2.5 * (1.0 - 0.3 * (robot.n - 1 - j) / robot.n)
        s, length = np.minimum(time / duration, 1.0), speed * duration / 1.875
        q[j] = length * (10 * s**3 - 15 * s**4 + 6 * s**5)
        v[j] = length * (30 * s**2 - 60 * s**3 + 30 * s**4) / duration
        a[j] = length * (60 * s - 180 * s**2 + 120 * s**3) / duration**2
    return motion(q, v, a, rate=400.0)


@one_blas_thread()
def observed(model: TorqueModel, item: Motion, value: Array, noise: float, seed: int = 0) -> Evidence:
    w = model.regressor(item).transpose(0, 2, 1)
    u = np.einsum("jnp,p->jn", w, value)
    sigma = noise * np.sqrt(np.mean(u**2, axis=1, keepdims=True))
    return evidence("made_1", w, u + sigma * np.random.default_rng(seed).standard_normal(u.shape), 200)


def truth(model: TorqueModel) -> Array:
    return parameters(model, model.robot.standard_parameters(), (0.08, 0.05))


def smallest(estimate: ConsistentEstimate) -> float:
    bodies = estimate.standard[: 10 * estimate.model.robot.n].reshape(-1, 10)
    return min(smallest_eigenvalue_share(body) for body in bodies)


def base_of(estimate: ConsistentEstimate) -> Array:
    term = estimate.model.rigid_body
    return (term.base.grouping @ estimate.standard)[term.kept]


def test_where_least_squares_is_possible_it_is_the_estimate_whatever_the_urdf_says():
    for factor in (1.0, 5.0, 0.1):
        model = build_model(heavier(load_robot(), factor), "complete")
        item = observed(model, moving(model.robot), truth(scara()), 0.05)
        plain, found = ols(model, [item]), consistent(model, [item])
        assert found.was_possible
        assert found.active == ()
        np.testing.assert_allclose(found.value, plain.value, rtol=1e-6)
        np.testing.assert_allclose(found.std, plain.std, rtol=1e-6)
        np.testing.assert_allclose(base_of(found), found.value[:5], rtol=1e-9)
        assert smallest(found) > 0.0


def test_weighted_least_squares_is_the_estimate_where_it_is_possible_and_asked_for():
    model = scara()
    item = observed(model, moving(model.robot), truth(model), 0.05)
    found = consistent(model, [item], options=ConsistentOptions(weighting="noise"))
    np.testing.assert_allclose(found.value, wls(model, [item]).value, rtol=1e-6)
    given = ConsistentOptions(weighting="noise", noise=np.array([0.02, 0.008]))
    plain = wls(model, [item], np.array([0.02, 0.008]))
    np.testing.assert_allclose(consistent(model, [item], options=given).value, plain.value, rtol=1e-6)
    with pytest.raises(UsageError, match="noise: expected 2 numbers"):
        consistent(model, [item], options=ConsistentOptions(weighting="noise", noise=np.ones(3)))


@one_blas_thread()
def test_an_impossible_estimate_becomes_possible_at_little_cost():
    model = build_model(ur5(), "basic")
    value = parameters(model, model.robot.standard_parameters(), (3.0, 2.0))
    item = observed(model, moving(model.robot), value, 0.2)
    plain, found = ols(model, [item]), consistent(model, [item])
    assert not physical_consistency(plain).possible
    told = physical_consistency(found)
    assert told.possible
    assert told.margin > 0.0
    assert not found.was_possible
    assert any(text.startswith("inertia of") for text in found.active)
    assert smallest(found) >= -1e-9
    np.testing.assert_allclose(base_of(found), found.value[found.model.place(found.model.rigid_body)], atol=1e-9)
    # It explains the torque as well as the truth does, which is possible too.
    rows = merge(item.joint(j).scaled(float(found.weights[j])) for j in range(6))
    assert rows.residual_sum(found.value) <= rows.residual_sum(value)
    other = moving(model.robot, seed=9)
    w = model.regressor(other)
    exact = np.einsum("jpn,p->jn", w, value)

    def error(estimate: Array) -> float:
        return float(np.sqrt(np.mean((np.einsum("jpn,p->jn", w, estimate) - exact) ** 2)))

    assert error(found.value) < error(plain.value)


def test_the_arm_that_is_given_predicts_the_torque():
    model = scara()
    item = observed(model, stroke(model.robot), truth(model), 0.05)
    found = consistent(model, [item])
    arm = model.robot.model.copy()
    for body, k in zip(links(found), model.robot.order, strict=True):
        i = np.array(body.inertia)
        about = np.array([[i[0], i[1], i[2]], [i[1], i[3], i[4]], [i[2], i[4], i[5]]])
        arm.inertias[int(k) + 1] = pin.Inertia(body.mass, np.array(body.com), about)
    test = moving(model.robot, count=20)
    data = arm.createData()
    torque = np.array([pin.rnea(arm, data, test.q[:, k], test.v[:, k], test.a[:, k]) for k in range(20)]).T
    torque = (torque + found.standard[20:, None] * test.a) * model.robot.row_scale[:, None]
    rest = found.value.copy()
    rest[model.place(model.rigid_body)] = 0.0
    torque += np.einsum("jpn,p->jn", model.regressor(test), rest)
    np.testing.assert_allclose(found.predict(test), torque, rtol=1e-9, atol=1e-12)
    assert [link.name for link in links(found)] == ["link1", "link2"]


def test_what_torque_cannot_tell_is_nearest_to_nominal():
    model = scara()
    found = consistent(model, [observed(model, moving(model.robot), truth(model), 0.0)])
    # With the nominal arm's own torque the nominal arm comes back, in all 22 standard parameters.
    np.testing.assert_allclose(found.standard, model.robot.standard_parameters(), rtol=1e-4, atol=1e-5)


def test_a_joint_that_never_moves_keeps_its_nominal_body():
    model = scara()
    item = moving(model.robot)
    still = motion(item.q * [[1.0], [0.0]], item.v * [[1.0], [0.0]], item.a * [[1.0], [0.0]], rate=200.0)
    seen = observed(model, still, truth(model), 0.02)
    found = consistent(model, [seen])
    assert np.any(found.undetermined)
    assert np.isinf(found.std[found.undetermined]).all()
    rotor = model.names.index("P_d5")
    nominal = truth(model)
    assert found.value[rotor] == pytest.approx(nominal[rotor], rel=1e-3)
    # What the first joint does tell, the sum of inertias at this angle, is least squares'.
    plain = ols(model, [seen])
    np.testing.assert_allclose(found.predict(still)[0], plain.predict(still)[0], atol=1e-6)
    assert smallest(found) > 0.0


def test_the_prior_does_not_pull_determined_directions():
    """The programme itself, with a URDF wrong by a factor of five, against the truth, over repeated noise."""
    wrong = build_model(heavier(load_robot(), 5.0), "complete")
    value = truth(scara())
    item = moving(wrong.robot, count=600)
    w = wrong.regressor(item)
    u = np.einsum("jpn,p->jn", w, value)
    programme = Programme(wrong)
    rng = np.random.default_rng(0)
    pulled, spread = [], []
    for _ in range(40):
        measured = u + 0.05 * np.sqrt(np.mean(u**2, axis=1, keepdims=True)) * rng.standard_normal(u.shape)
        empty = Information.empty(len(value))
        rows = merge(empty.absorb_columns(np.vstack([w[j], measured[j : j + 1]])) for j in range(2))
        noise = noise_of(rows, rows.solve())
        factor, target = rows.regressor_factor / noise, rows.projected_torque / noise
        prior = prior_rows(programme.unknowns, factor @ programme.unknowns.to_parameters, target, 0.01)
        point = programme.solve(factor, target, prior)
        pulled.append(point.parameters - rows.solve().value)
        spread.append(np.sqrt(np.diag(rows.inverse())) * noise)
    std = np.mean(spread, axis=0)
    determined = std < 0.3 * np.abs(value)
    assert np.count_nonzero(determined) >= 6
    assert np.all(np.abs(np.mean(pulled, axis=0))[determined] < 0.1 * std[determined])


def test_the_problem_is_a_parametrised_one_of_one_size_and_repeats():
    model = scara()
    programme = Programme(model)
    assert programme.problem.is_dcp(dpp=True)
    shapes = set()
    for seed, count in enumerate((50, 500, 5000)):
        item = observed(model, moving(model.robot, seed, count, size=0.05), truth(model), 0.3)
        rows = merge(item.joint(j) for j in range(2))
        again = solve_consistent(programme, rows)
        fresh = solve_consistent(Programme(model), rows)
        assert again.point is not None
        np.testing.assert_allclose(again.value, fresh.value, atol=1e-6 * np.abs(fresh.value).max())
        import cvxpy as cp

        shapes.add(programme.problem.get_problem_data(cp.CLARABEL)[0]["A"].shape)
    assert len(shapes) == 1


def test_a_failed_solve_is_an_error_with_status_and_advice():
    model = scara()
    item = observed(model, stroke(model.robot), truth(model), 0.05)
    impossible = ConsistentOptions(total_mass=(5.0, 0.1), link_mass={"link1": (4.0, 0.1), "link2": (4.0, 0.1)})
    with pytest.raises(EstimationError, match=r"PrimalInfeasible.*contradict each other; widen"):
        consistent(model, [item], options=impossible)
    with pytest.raises(EstimationError, match="no recording"):
        consistent(model, [])


def test_known_masses_and_centres_of_mass_hold():
    model = scara()
    item = observed(model, moving(model.robot), truth(model), 0.05)
    options = ConsistentOptions(
        total_mass=(25.0, 0.5),
        link_mass={"joint2": (9.0, 0.2)},
        com={"link1": Ellipsoid((0.3, 0.0, 0.05), (0.05, 0.05, 0.05))},
    )
    found = consistent(model, [item], options=options)
    first, second = links(found)
    assert abs(first.mass + second.mass - 25.0) <= 0.5
    assert abs(second.mass - 9.0) <= 0.2
    assert np.linalg.norm((np.array(first.com) - (0.3, 0.0, 0.05)) / 0.05) <= 1.0
    # The masses are free to the torque, so nothing else had to give.
    assert found.was_possible
    np.testing.assert_allclose(found.value, ols(model, [item]).value, rtol=1e-6)
    inside = consistent(model, [item], options=ConsistentOptions(com="visual"))
    assert all(abs(body.com[1]) <= 0.08 for body in links(inside))


def test_priors_on_parameters_and_standard_parameters_count():
    model = scara()
    item = observed(model, stroke(model.robot), truth(model), 0.05)
    free = consistent(model, [item])
    told = consistent(model, [item], options=ConsistentOptions(priors={"P_d1": (16.0, 0.05), "m2": (8.0, 0.01)}))
    assert told.value[0] == pytest.approx(16.0, abs=0.2)
    assert abs(free.value[0] - 16.0) > abs(told.value[0] - 16.0)
    assert links(told)[1].mass == pytest.approx(8.0, abs=0.05)
    assert smallest(told) > 0.0
    with pytest.raises(UsageError, match="prior of 'P_d9'"):
        consistent(model, [item], options=ConsistentOptions(priors={"P_d9": (1.0, 0.1)}))


def test_the_reduced_model_holds_its_missing_parameter_at_zero():
    model = scara("reduced")
    item = observed(model, stroke(model.robot), truth(model), 0.2)
    found = consistent(model, [item])
    assert abs(found.standard[12]) < 1e-9
    np.testing.assert_allclose(base_of(found), found.value[:4], rtol=1e-8)


def test_a_parameter_that_a_constraint_fixes_has_no_spread_of_its_own():
    model = scara("basic")
    value = truth(model)
    value[model.names.index("a02")] = 0.0
    weak = observed(model, moving(model.robot, size=0.05), value, 0.3, seed=2)
    assert ols(model, [weak]).value[model.names.index("a02")] < 0.0
    found = consistent(model, [weak])
    place = model.names.index("a02")
    assert "friction of joint2" in found.active
    assert found.value[place] == pytest.approx(0.0, abs=1e-6)
    assert found.std[place] < 1e-6


def test_a_slow_stroke_predicts_fast_motion():
    model = scara()
    value = truth(model)
    fast = motion(*sines(np.random.default_rng(5), np.arange(4000) / 200.0, 2, size=0.75, lowest=0.25), rate=200.0)
    assert 2.5 < np.max(np.abs(fast.v[0])) < model.robot.velocity_limit[0]
    w = model.regressor(fast)[0]

    def error(estimate: Array) -> float:
        return float(np.sqrt(np.mean(((estimate - value) @ w) ** 2)))

    lubricated = ConsistentOptions(friction="lubricated")
    plain, braking, shaped = [], [], []
    for seed in range(5):
        item = observed(model, stroke(model.robot), value, 0.3, seed)
        plain.append(error(ols(model, [item]).value))
        braking.append(error(consistent(model, [item]).value))
        shaped.append(error(consistent(model, [item], options=lubricated).value))
    # The torque itself is 0.2 N m.
    assert np.median(plain) > 0.8
    assert np.median(braking) < 0.5 * np.median(plain)
    assert np.max(shaped) < 0.12


@dataclass(frozen=True, eq=False)
class Spring:
    """A further term that declares no more than that its parameter cannot be negative."""

    robot: Robot
    name: str = "spring"

    @property
    def columns(self) -> tuple[Column, ...]:
        return (Column("stiffness", self.robot.joints[0], "N m/rad", "spring", nonnegative=True),)

    @property
    def pattern(self) -> NDArray[np.bool_]:
        return np.array([[True], [False]])

    def regressor(self, item: Motion) -> Array:
        return np.stack([item.q[:1], 0.0 * item.q[:1]])


def test_a_further_term_keeps_the_signs_that_it_declares():
    plain = scara("basic")
    model = replace(plain, name="with spring", terms=(*plain.terms, Spring(plain.robot)))
    for stiffness in (0.05, -0.05):
        value = np.append(truth(plain), stiffness)
        item = observed(model, moving(model.robot), value, 0.02)
        found = consistent(model, [item])
        assert found.was_possible == (stiffness > 0.0)
        assert found.value[-1] == pytest.approx(max(stiffness, 0.0), abs=3.0 * ols(model, [item]).std[-1] + 1e-6)
        assert ("stiffness" in found.active) == (stiffness < 0.0)
    assert "stiffness = spring = -0.0" in physical_consistency(ols(model, [item])).reasons[0]


def test_free_friction_is_left_alone():
    model = scara()
    item = observed(model, stroke(model.robot), truth(model), 0.05, seed=3)
    found = consistent(model, [item], options=ConsistentOptions(friction="free"))
    assert not any("friction" in text for text in found.active)
    assert any("friction" in reason for reason in physical_consistency(found).reasons)


def test_a_velocity_limit_can_be_given():
    model = scara()
    item = observed(model, stroke(model.robot), truth(model), 0.05, seed=3)
    # Up to the speed that was seen plain least squares is possible.
    slow = ConsistentOptions(speed={"joint1": 0.6, "joint2": 0.6})
    found = consistent(model, [item], options=slow)
    assert not any("friction" in text for text in found.active)


@one_blas_thread()
@pytest.mark.parametrize("arm", [ur5, panda], ids=["ur5", "panda"])
def test_larger_arms_stay_possible_however_poor_the_data(arm):
    model = build_model(arm(), "basic")
    programme = Programme(model)
    value = parameters(model, model.robot.standard_parameters(), (2.0, 1.0))
    for seed in range(3):
        item = observed(model, stroke(model.robot, 0.3), value, 0.3, seed)
        rows = merge(item.joint(j) for j in range(model.robot.n))
        found = solve_consistent(programme, rows)
        x = fill(programme, rows, found.x)
        standard = programme.unknowns.standard(x)
        for body in standard[: 10 * model.robot.n].reshape(-1, 10):
            assert smallest_eigenvalue_share(body) >= -1e-9
            assert pseudo_inertia(body)[3, 3] > 0.0
        assert np.all(standard[10 * model.robot.n :] > 0.0)


def test_slow_stroke_of_the_cases_predicts_the_paper_trajectory():
    model = scara()
    recordings = [
        shared_path("cases", "nothing_missing", *p) for p in (("test", "L2_1.parquet"), ("train", "OJD_1.parquet"))
    ]
    slow, fast = (read_recording(path, model.robot) for path in recordings)
    bands = choose_bands(model, [slow]).bands
    seen, held_out = gather(model, slow, bands), gather(model, fast, bands)

    def error(estimate) -> float:
        found = estimate.errors(held_out)[0]
        assert found is not None
        return found.rms

    assert error(consistent(model, [seen])) < min(0.5, error(ols(model, [seen])))
    assert error(consistent(model, [seen], options=ConsistentOptions(friction="lubricated"))) < 0.12


@one_blas_thread()
def test_ur10e_measured_is_possible_and_predicts_as_well():
    robot = load_robot(shared_path("data", "ur10e", "robot.yaml"))
    model = build_model(robot, "basic")
    names = ("ident_50s_12harm", "ident_50s_14harm_noload", "ident_40s_12harm")
    recordings = [read_recording(shared_path("data", "ur10e", f"{name}.parquet"), robot) for name in names]
    *training, held_out = (gather(model, recording, (6.0,) * 6) for recording in recordings)
    plain, found = ols(model, training), consistent(model, training)
    assert not found.was_possible
    assert physical_consistency(found).possible
    assert smallest(found) >= -1e-9
    for before, after in zip(plain.errors(held_out), found.errors(held_out), strict=True):
        assert after.rms <= 1.05 * before.rms
