from __future__ import annotations

from types import SimpleNamespace

import clarabel
import numpy as np
import pytest

from scara_ident.errors import EstimationError, UsageError
from scara_ident.estimation.consistent import feasibility, problem
from scara_ident.estimation.consistent.feasibility import check_consistency
from scara_ident.estimation.consistent.options import ConsistentOptions, Ellipsoid
from scara_ident.estimation.consistent.problem import Problem, build_unknowns
from scara_ident.estimation.information import Information
from scara_ident.model.model import build_model
from scara_ident.robot.robot import load_robot
from tests.estimation.consistent.arms import parameters, with_last_body, wrist_model
from tests.estimation.consistent.test_bodies import point_mass, thin_rod


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    return wrist_model(tmp_path_factory.mktemp("wrist"))


def test_the_nominal_arm_can_exist(model):
    found = check_consistency(model, parameters(model, with_last_body(model.robot, point_mass(1.0, (0.1, 0.05, 0.02)))))
    assert found.possible
    assert found.reasons == ()
    assert found.margin >= -1e-7


def test_a_thin_rod_can_exist(model):
    assert check_consistency(model, parameters(model, with_last_body(model.robot, thin_rod(1.5, 0.4)))).possible


def test_a_wrong_signed_product_of_inertia_is_refused_by_name(model):
    body = point_mass(2.0, (0.1, -0.2, 0.3))
    body[5] *= -1.0
    found = check_consistency(model, parameters(model, with_last_body(model.robot, body)))
    assert not found.possible
    assert found.margin < -1e-3
    assert any("I3xy = " in reason and "no bodies with mass" in reason for reason in found.reasons)
    # Each of the parameters named is needed for the contradiction, so its true value is not contradicted.
    body[5] *= -1.0
    assert check_consistency(model, parameters(model, with_last_body(model.robot, body))).possible


def test_a_negative_inertia_is_refused_in_words():
    model = build_model(load_robot(), "complete")
    value = parameters(model, model.robot.standard_parameters(), (0.1, 0.1))
    value[model.names.index("P_d4")] = -0.59
    found = check_consistency(model, value)
    assert not found.possible
    assert found.reasons[0] == "P_d4 = I2z = -0.59 kg m^2 cannot be negative"


def test_base_parameters_that_contradict_each_other_are_named_and_no_others():
    model = build_model(load_robot(), "complete")
    value = parameters(model, model.robot.standard_parameters(), (0.1, 0.1))
    # I2z >= (m2 s2x)^2 / m2 and m2 l1^2 < P_d1 bound each other: 2.415^2 0.33^2 / 16.165 = 0.039.
    value[model.names.index("P_d4")] = 0.03
    found = check_consistency(model, value)
    (reason,) = found.reasons
    assert all(name in reason for name in ("P_d1", "P_d2", "P_d4"))
    assert "P_d3" not in reason
    assert "P_d5" not in reason
    value[model.names.index("P_d4")] = 0.041
    assert check_consistency(model, value).possible


def test_friction_that_pushes_or_is_too_much_for_the_motor_is_reported_with_its_speeds():
    model = build_model(load_robot(), "complete")
    value = parameters(model, model.robot.standard_parameters(), (0.1, 0.1))
    # 0.27 - 1.2 v + v^2 is negative between 0.3 and 0.9.
    for name, number in {"a01": 0.27, "a11": -1.2, "a21": 1.0, "a31": -0.1, "a12": 0.6}.items():
        value[model.names.index(name)] = number
    found = check_consistency(model, value)
    assert not found.possible
    pushing, too_much = sorted(found.reasons)[1], sorted(found.reasons)[0]
    assert pushing.startswith("friction of joint1 pushes between 0.29") or "exceeds" in pushing
    assert any(reason.startswith("friction of joint2 exceeds the motor's limit of 2 N m above 3.17") for reason in
               found.reasons), too_much  # fmt: skip


def test_the_number_of_parameters_is_checked(model):
    with pytest.raises(UsageError, match="finite parameters of the model basic"):
        check_consistency(model, np.zeros(3))
    with pytest.raises(UsageError, match="finite"):
        check_consistency(model, np.full(len(model.columns), np.nan))


def test_limits_on_masses_and_centres_of_mass_count(model):
    value = parameters(model, with_last_body(model.robot, point_mass(1.0, (0.1, 0.05, 0.02))))
    inside = ConsistentOptions(
        link_mass={"l3": (1.0, 0.1)}, com={"l3": Ellipsoid((0.1, 0.05, 0.0), (0.05, 0.05, 0.05))}
    )
    assert check_consistency(model, value, unknowns=build_unknowns(model, inside)).possible
    # The first moments are told by gravity: a link of twice the mass has its centre of mass at half the distance.
    outside = ConsistentOptions(
        link_mass={"l3": (2.0, 0.1)}, com={"l3": Ellipsoid((0.1, 0.05, 0.0), (0.02, 0.02, 0.05))}
    )
    assert not check_consistency(model, value, unknowns=build_unknowns(model, outside)).possible


def impossible(model) -> np.ndarray:
    """Parameters of an arm whose last body would need a density below zero, and little friction."""
    body = point_mass(2.0, (0.1, -0.2, 0.3))
    body[5] *= -1.0
    return parameters(model, with_last_body(model.robot, body))


def rows_about(model, value: np.ndarray) -> Information:
    rng = np.random.default_rng(0)
    rows = rng.standard_normal((200, len(value)))
    return Information.empty(len(value)).absorb(rows, rows @ value + 0.1 * rng.standard_normal(200))


def test_the_distance_is_that_of_the_nearest_possible_arm_in_standard_deviations(model):
    value = impossible(model)
    found = check_consistency(model, value, information=rows_about(model, value))
    nearer = 0.5 * (value + parameters(model, with_last_body(model.robot, point_mass(2.0, (0.1, -0.2, 0.3)))))
    half = check_consistency(model, nearer, information=rows_about(model, nearer))
    assert found.distance_std > half.distance_std > 1.0


def test_a_finished_estimate_is_kept_when_the_nearest_arm_is_not_found(model, monkeypatch):
    def fails(*_):
        raise EstimationError("not solved")

    monkeypatch.setattr(Problem, "solve", fails)
    value = impossible(model)
    found = check_consistency(model, value, information=rows_about(model, value))
    assert found.possible is False
    assert found.distance_std is None


@pytest.mark.parametrize("limit", [{"max_iter": 1}, {"tol_gap_abs": 0.0, "tol_gap_rel": 0.0, "tol_feas": 0.0}])
def test_a_solver_that_stops_short_of_the_nearest_arm_loses_no_estimate(model, monkeypatch, limit):
    """Clarabel itself, out of iterations or of digits: what it leaves is not accepted, and no error."""
    for settings in ("_SETTINGS", "_CAREFUL"):
        monkeypatch.setattr(problem, settings, {**getattr(problem, settings), **limit})
    for bound in ("ACCEPTED_GAP", "ACCEPTED_RELATIVE_GAP", "ACCEPTED_RESIDUAL"):
        monkeypatch.setattr(problem, bound, 0.0)
    value = impossible(model)
    rows = rows_about(model, value)
    with pytest.raises(EstimationError, match="was not solved"):
        u = Problem(model).unknowns
        Problem(model).solve(rows.regressor_factor @ u.to_parameters, rows.projected_torque, 1e-2 * np.eye(u.size))
    found = check_consistency(model, value, information=rows)
    assert found.possible is False
    assert found.distance_std is None


@pytest.mark.parametrize("stops", ["AlmostSolved", "InsufficientProgress"])
def test_what_the_solver_leaves_open_is_undecided_and_not_an_error(model, monkeypatch, stops):
    """A solver that stops early: its arm lacks a little, and its multipliers prove nothing."""
    solver = clarabel.DefaultSolver

    class Early:
        def __init__(self, *problem):
            self.found = solver(*problem).solve()

        def solve(self):
            move = np.array(self.found.x)
            move[-1] -= 1e-3
            return SimpleNamespace(
                status=stops, x=10.0 * move, z=self.found.z, obj_val=1.0, obj_val_dual=0.9, r_prim=1e-3, r_dual=1e-3
            )

    monkeypatch.setattr(clarabel, "DefaultSolver", Early)
    value = impossible(model)
    found = check_consistency(model, value)
    assert found.possible is None
    assert found.margin < -1e-3
    (reason,) = found.reasons
    assert reason.startswith("whether bodies with these base parameters exist is undecided")
    # Friction that pushes is impossible whatever the bodies are.
    value[model.names.index("a01")] = -1.0
    found = check_consistency(model, value)
    assert found.possible is False
    assert all("undecided" not in reason for reason in found.reasons)


def test_a_bound_below_zero_decides_though_the_solver_stops_short(model, monkeypatch):
    """The multipliers of a solution to few digits still prove that there is no arm."""
    value = impossible(model)
    exact = check_consistency(model, value)
    monkeypatch.setattr(feasibility, "TOLERANCE", 1e-13)
    found = check_consistency(model, value)
    assert found.possible is False
    assert found.margin == pytest.approx(exact.margin, rel=1e-5)


def test_a_panic_of_the_solver_is_no_error(model, monkeypatch):
    """Asked for all digits, Clarabel 0.11 goes on until a number is not finite and panics."""
    monkeypatch.setattr(feasibility, "TOLERANCE", 0.0)
    assert not check_consistency(model, impossible(model)).possible
