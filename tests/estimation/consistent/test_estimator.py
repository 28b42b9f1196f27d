from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from scara_ident.errors import EstimationError
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
from scara_ident.estimation.consistent.estimator import _beyond_constraints, _half_along
from scara_ident.estimation.consistent.options import Ellipsoid
from scara_ident.estimation.information import Information, merge
from scara_ident.estimation.observations import observe
from scara_ident.model.model import build_model
from scara_ident.model.terms import Column
from scara_ident.motion.motion import Motion
from scara_ident.motion.prepared import prepare
from scara_ident.recording.recording import read_recording
from scara_ident.robot.robot import Robot, load_robot
from scara_ident.threads import one_blas_thread
from tests.arms import motion, sines, swing, write_urdf
from tests.estimation.consistent.arms import (
    WRIST,
    base_of,
    moving,
    observed,
    parameters,
    scara,
    smallest,
    stroke,
    truth,
    ur5,
)
from tests.shared import shared_path

Array = NDArray[np.float64]


@one_blas_thread()
def test_an_impossible_estimate_becomes_possible_at_little_cost():
    model = build_model(ur5(), "basic")
    value = parameters(model, model.robot.standard_parameters(), (3.0, 2.0))
    item = observed(model, moving(model.robot), value, 0.2)
    plain, found = ols(item), consistent(item)
    assert not physical_consistency(plain).possible
    checked = physical_consistency(found)
    assert checked.possible
    assert checked.margin > 0.0
    assert not found.was_possible
    assert any(text.startswith("inertia of") for text in found.active)
    assert smallest(found) >= -1e-9
    np.testing.assert_allclose(base_of(found), found.value[found.model.place(found.model.rigid_body)], atol=1e-9)
    # It explains the torque as well as the truth does, which is possible too.
    rows = merge(item.by_joint[j].scaled(float(found.weights[j])) for j in range(6))
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
    found = consistent(item)
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
    np.testing.assert_allclose(found.predict(test.q.T, test.v.T, test.a.T).T, torque, rtol=1e-9, atol=1e-12)
    assert [link.name for link in links(found)] == ["link1", "link2"]


def test_a_failed_solve_is_an_error_with_status_and_advice():
    model = scara()
    item = observed(model, stroke(model.robot), truth(model), 0.05)
    impossible = ConsistentOptions(total_mass=(5.0, 0.1), link_mass={"link1": (4.0, 0.1), "link2": (4.0, 0.1)})
    with pytest.raises(EstimationError, match=r"PrimalInfeasible.*contradict each other; widen"):
        consistent(item, options=impossible)
    with pytest.raises(EstimationError, match="no recording"):
        consistent(replace(item, owner=np.zeros(0, dtype=np.intp)))


def test_known_masses_and_centres_of_mass_hold():
    model = scara()
    item = observed(model, moving(model.robot), truth(model), 0.05)
    options = ConsistentOptions(
        friction="dissipative",
        total_mass=(25.0, 0.5),
        link_mass={"joint2": (9.0, 0.2)},
        com={"link1": Ellipsoid((0.3, 0.0, 0.05), (0.05, 0.05, 0.05))},
    )
    found = consistent(item, options=options)
    first, second = links(found)
    assert abs(first.mass + second.mass - 25.0) <= 0.5
    assert abs(second.mass - 9.0) <= 0.2
    assert np.linalg.norm((np.array(first.com) - (0.3, 0.0, 0.05)) / 0.05) <= 1.0
    # The masses are free to the torque, so nothing else had to give.
    assert found.was_possible
    np.testing.assert_allclose(found.value, wls(item).value, rtol=1e-6)
    inside = consistent(item, options=ConsistentOptions(com="visual"))
    assert all(abs(body.com[1]) <= 0.08 for body in links(inside))


def test_the_reduced_model_holds_its_missing_parameter_at_zero():
    model = scara("reduced")
    item = observed(model, stroke(model.robot), truth(model), 0.2)
    found = consistent(item)
    assert abs(found.standard[12]) < 1e-9
    np.testing.assert_allclose(base_of(found), found.value[:4], rtol=1e-8)


def test_an_arm_with_continuous_joints_in_a_plane_is_estimated():
    robot = load_robot("double_pendulum")
    model = build_model(robot, "complete")
    found = consistent(observe(model, prepare([swing(robot, seconds=3.0, rate=100.0)]).at((None, None))))
    assert physical_consistency(found).possible


def test_beyond_a_bound_the_mean_square_of_the_tail_stays():
    """Of a million draws about a value so far beyond, those on the other side."""
    draws = np.random.default_rng(0).standard_normal(1_000_000)
    along, plain = np.diag([0.0, 0.5]), np.array([[4.0, 0.0], [0.0, np.inf]])
    for beyond in (0.0, 0.5, 1.5):
        inside = draws[draws > beyond] - beyond
        found = _beyond_constraints(along, plain, beyond**2)
        assert found[0, 0] == pytest.approx(4.0 * np.mean(inside**2), rel=0.02)
        assert found[1, 1] == 0.5
    assert 0.0 < _beyond_constraints(along, plain, 30.0**2)[0, 0] < 0.01


def test_friction_that_constraints_tie_is_no_surer_than_they_are_strong():
    """A cubic friction of -0.0006462 +- 6.7e-06, truth 0: a bound's edge, which quadratic and viscous friction were tied to."""
    model = scara()
    value = truth(model)
    bent = [k for k, name in enumerate(model.names) if name.startswith(("a2", "a3"))]
    value[bent] = 0.0
    off = []
    for seed in range(8):
        found = consistent(observed(model, moving(model.robot, size=0.3), value, 0.3, seed=seed))
        off += ((found.value - value) / found.std)[bent].tolist()
    assert np.sqrt(np.mean(np.square(off))) < 1.2
    assert np.max(np.abs(off)) < 4.0


def test_beside_noise_that_remembers_what_a_constraint_holds_is_no_surer():
    """In these draws a parameter lay up to 9.3 standard deviations off, none over 2.3 by the data alone: white noise was the measure."""
    model = scara("basic")
    value = truth(model)
    value[model.names.index("a02")] = 0.001
    for seed in (1, 4, 9, 14):
        item = observed(model, moving(model.robot, size=0.05), value, 0.3, seed, memory=0.98)
        found, alone = consistent(item), wls(item)
        assert not found.was_possible
        off, data = (np.max(np.abs(each.value - value) / each.std) for each in (found, alone))
        assert off < 1.25 * data


@pytest.mark.slow
def test_a_parameter_that_a_constraint_fixes_is_as_sure_as_the_constraint_is_strong():
    """Its standard deviation was 0, and what the arm really has beyond it whenever noise had pushed it to the constraint."""
    model = scara("basic")
    value = truth(model)
    value[model.names.index("a02")] = 0.0
    weak = observed(model, moving(model.robot, size=0.05), value, 0.3, seed=2)
    assert ols(weak).value[model.names.index("a02")] < 0.0
    found = consistent(weak)
    place = model.names.index("a02")
    assert "friction of joint2" in found.active
    assert found.value[place] == pytest.approx(0.0, abs=1e-6)
    assert 0.3 * wls(weak).std[place] < found.std[place] <= wls(weak).std[place]
    # Friction of half a standard deviation: half of the draws are at the constraint, or near it.
    value[place] = 0.5 * found.std[place]
    held = within = 0
    for seed in range(12):
        drawn = consistent(observed(model, moving(model.robot, size=0.05), value, 0.3, seed=seed))
        held += drawn.value[place] < 0.01 * value[place]
        within += abs(drawn.value[place] - value[place]) <= 2.0 * drawn.std[place]
    assert held >= 2
    assert within >= 11


@pytest.mark.slow
def test_a_slow_stroke_predicts_fast_motion():
    model = scara()
    value = truth(model)
    fast = motion(*sines(np.random.default_rng(5), np.arange(4000) / 200.0, 2, size=0.75, lowest=0.25), rate=200.0)
    assert 2.5 < np.max(np.abs(fast.v[0])) < model.robot.velocity_limit[0]
    w = model.regressor(fast)[0]

    def error(estimate: Array) -> float:
        return float(np.sqrt(np.mean(((estimate - value) @ w) ** 2)))

    dissipative = ConsistentOptions(friction="dissipative")
    plain, braking, shaped = [], [], []
    for seed in range(5):
        item = observed(model, stroke(model.robot), value, 0.3, seed)
        plain.append(error(ols(item).value))
        braking.append(error(consistent(item, options=dissipative).value))
        shaped.append(error(consistent(item).value))
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
        found = consistent(item)
        assert found.was_possible == (stiffness > 0.0)
        assert found.value[-1] == pytest.approx(max(stiffness, 0.0), abs=3.0 * ols(item).std[-1] + 1e-6)
        assert ("stiffness" in found.active) == (stiffness < 0.0)
    assert "stiffness = spring = -0.0" in physical_consistency(ols(item)).reasons[0]


def test_slow_stroke_of_the_cases_predicts_the_paper_trajectory():
    model = scara()
    recordings = [
        shared_path("cases", "nothing_missing", *p) for p in (("test", "L2_1.parquet"), ("train", "OJD_1.parquet"))
    ]
    slow, fast = (prepare([read_recording(path, model.robot)]) for path in recordings)
    bands = choose_bands(model, slow).bands
    seen, held_out = observe(model, slow.at(bands)), observe(model, fast.at(bands))

    def error(estimate) -> float:
        found = estimate.errors(held_out)[0]
        assert found is not None
        return found.rms

    dissipative = ConsistentOptions(friction="dissipative")
    assert error(consistent(seen, options=dissipative)) < min(0.5, error(wls(seen)))
    found = consistent(seen)
    assert error(found) < 0.12
    # A slow stroke contradicts no shape, so that the strictest is taken.
    assert [choice.shape for choice in found.shapes] == ["lubricated", "lubricated"]


@pytest.mark.slow
@one_blas_thread()
def test_ur10e_measured_is_possible_and_predicts_as_well():
    robot = load_robot(shared_path("data", "ur10e", "robot.yaml"))
    model = build_model(robot, "basic")
    names = ("ident_50s_12harm", "ident_50s_14harm_noload", "ident_40s_12harm")
    recordings = [read_recording(shared_path("data", "ur10e", f"{name}.parquet"), robot) for name in names]
    training = observe(model, prepare(recordings[:2], (6.0,) * 6))
    held_out = observe(model, prepare(recordings[2:], (6.0,) * 6))
    plain, found = ols(training), consistent(training)
    assert not found.was_possible
    assert physical_consistency(found).possible
    assert smallest(found) >= -1e-9
    for before, after in zip(plain.errors(held_out), found.errors(held_out), strict=True):
        assert after.rms <= 1.05 * before.rms


def test_the_solvers_last_digits_are_no_direction_to_move_in():
    rng = np.random.default_rng(0)
    rows = rng.standard_normal((50, 5))
    information = Information.empty(5).absorb(rows, rng.standard_normal(50))
    allowed = rng.standard_normal((5, 3))
    rounding = np.column_stack([allowed, 1e-8 * rng.standard_normal(5)])
    exact = allowed @ np.linalg.inv(allowed.T @ rows.T @ rows @ allowed) @ allowed.T
    along = _half_along(information, rounding, np.ones(5))
    np.testing.assert_allclose(along @ along.T, exact, atol=1e-7)


def test_what_both_leave_open_stays_open():
    """Of recordings in which five joints rest, what no row tells has no finite variance with or without constraints."""
    plain, along = np.diag([2.0, np.inf]), np.diag([1.0, np.inf])
    found = _beyond_constraints(along, plain, 0.0)
    assert found[0, 0] == pytest.approx(2.0) and found[1, 1] == np.inf


def test_what_constraints_leave_open_stays_open():
    """One stretch of time told nothing of how far another would differ, along the constraints that held: infinity less infinity."""
    plain, along = np.diag([2.0, 3.0]), np.diag([np.inf, 0.0])
    found = _beyond_constraints(along, plain, 0.0)
    assert found[0, 0] == np.inf and found[1, 1] == pytest.approx(3.0)


@one_blas_thread()
def test_without_limits_an_arm_is_found_whatever_the_size_of_its_torques(tmp_path: Path):
    """The solver's numbers were told in 1 N m and 1 rad/s, beside which the friction of a small drive is nothing."""

    def found(scale: float, folder: str) -> ConsistentEstimate:
        links = [replace(link, mass=scale * link.mass, inertia=tuple(scale * np.array(link.inertia))) for link in WRIST]
        urdf = write_urdf(tmp_path / f"{folder}.urdf", links)
        text = urdf.read_text().replace('<limit lower="-3" upper="3" effort="50" velocity="4"/>', "")
        urdf.write_text(text.replace('type="revolute"', 'type="continuous"'))
        model = build_model(load_robot(urdf))
        value = parameters(model, model.robot.standard_parameters(), (2e-3 * scale, 1e-3 * scale))
        return consistent(observed(model, moving(model.robot, seed=3, size=1.5), value, 2e-3, seed=3))

    usual = found(1.0, "usual")
    assert any(text.startswith("friction of") for text in usual.active)
    for scale, folder in ((1e-6, "tiny"), (1e-3, "small"), (1e3, "large")):
        other = found(scale, folder)
        assert other.active == usual.active
        assert np.all(np.abs(other.value / scale - usual.value) < 1e-2 * np.sqrt(np.diag(usual.covariance)))


@one_blas_thread()
def test_how_sure_parameters_are_does_not_depend_on_the_units_of_length_and_mass(tmp_path: Path):
    """In mm, with torques of millions, constraints took all of the variance, and an offset's was that of its neighbours."""

    def found(length: float, mass: float, folder: str) -> ConsistentEstimate:
        unit = mass * length**2
        links = [
            replace(
                link,
                mass=mass * link.mass,
                xyz=tuple(length * np.array(link.xyz)),
                com=tuple(length * np.array(link.com)),
                inertia=tuple(unit * np.array(link.inertia)),
            )
            for link in WRIST
        ]
        urdf = write_urdf(tmp_path / f"{folder}.urdf", links)
        urdf.write_text(urdf.read_text().replace('effort="50"', f'effort="{50.0 * unit!r}"'))
        described = tmp_path / f"{folder}.yaml"
        joints = ", ".join(f"j{k}: {{rotor_inertia: {0.01 * unit!r}}}" for k in (1, 2, 3))
        described.write_text(
            f"urdf: {urdf.name}\neffort_side: joint\njoints: {{{joints}}}\ngravity: [0, 0, {-9.81 * length!r}]\n"
        )
        model = build_model(load_robot(described))
        value = parameters(model, model.robot.standard_parameters(), (0.2 * unit, 0.1 * unit))
        value[[k for k, name in enumerate(model.names) if name.startswith("p_o")]] = 2.0 * unit
        return consistent(observed(model, moving(model.robot, seed=3), value, 0.3, seed=3))

    usual = found(1.0, 1.0, "usual")
    assert any(text.startswith("friction of") for text in usual.active)
    for length, mass, folder in ((1e3, 1.0, "mm"), (1e3, 1e3, "mm_g"), (1e-3, 1.0, "km")):
        other = found(length, mass, folder)
        expected = usual.value / np.sqrt(np.diag(usual.covariance))
        np.testing.assert_allclose(other.value / np.sqrt(np.diag(other.covariance)), expected, rtol=0.02, atol=1e-3)


@one_blas_thread()
def test_an_arm_is_found_where_friction_is_next_to_nothing_beside_the_motors_limits(tmp_path: Path):
    """Of 2 h of recordings whose friction pushed by many standard deviations none was, in shares of limits of 50 N m."""
    model = build_model(load_robot(write_urdf(tmp_path / "wrist.urdf", WRIST)))
    value = parameters(model, model.robot.standard_parameters(), (2e-3, -1e-3))
    for k, name in enumerate(model.names):
        value[k] += {"a2": -4e-4, "a3": 2e-4}.get(name[:2], 0.0)
    found = consistent(observed(model, moving(model.robot, size=1.5), value, 1e-3, seed=1))
    assert any(text.startswith("friction of") for text in found.active)
    assert physical_consistency(found).possible
