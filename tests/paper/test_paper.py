"""The founding paper: its closed form against Pinocchio, its figures, and the checks of its tables."""

from __future__ import annotations

import dataclasses
import json
import xml.etree.ElementTree as ElementTree
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from scara_ident import paper
from scara_ident.paper import parameter_checks, table_checks
from scara_ident.robot.robot import load_robot
from tests.shared import ROOT, shared_path

URDF = ROOT / "urdf" / "scara03.urdf"
SEEDS = st.integers(0, 2**32 - 1)
NAMES = [parameter.name for parameter in paper.PARAMETERS]


@pytest.fixture(scope="module")
def arm() -> pin.Model:
    model = pin.buildModelFromUrdf(str(URDF))
    return pin.buildReducedModel(model, [model.getJointId("joint3")], pin.neutral(model))


@pytest.fixture(scope="module")
def report() -> paper.PaperReport:
    return paper.check_paper()


def random_states(seed: int, count: int = 20) -> tuple[NDArray[np.float64], ...]:
    rng = np.random.default_rng(seed)
    return tuple(scale * rng.uniform(-1, 1, (2, count)) for scale in (np.pi, 3.77, 10.0))


def random_bodies(rng: np.random.Generator) -> NDArray[np.float64]:
    """Ten parameters of each of two bodies with nothing zero."""
    return np.concatenate([pin.Inertia.Random().toDynamicParameters() * rng.uniform(0.5, 2) for _ in range(2)])


def torque_scale(w: NDArray[np.float64], parameters: NDArray[np.float64]) -> float:
    return float(np.max(np.einsum("ipn,p->in", np.abs(w), np.abs(parameters))))


# ---- the regressor


@settings(deadline=None, max_examples=30)
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
    p_d = paper.inertial_grouping() @ np.concatenate([bodies, armature])
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
    found = paper.inertial_grouping() @ load_robot().standard_parameters()
    np.testing.assert_allclose(found, paper.table5_parameters("OJD")[:5], rtol=1e-12, atol=1e-15)


def test_the_link_length_enters_as_in_a_model_with_that_length(arm: pin.Model) -> None:
    model = arm.copy()
    model.jointPlacements[2] = pin.SE3(np.eye(3), np.array([0.51, 0.0, 0.12]))
    q, v, a = random_states(5, 50)
    data = model.createData()
    pi = np.concatenate([model.inertias[i].toDynamicParameters() for i in (1, 2)])
    expected = np.stack([pin.rnea(model, data, *(x[:, k] for x in (q, v, a))) for k in range(50)], axis=1) / 100
    p_d = paper.inertial_grouping(0.51) @ np.concatenate([pi, [0.0, 0.0]])
    w = paper.regressor(q, v, a, link_length=0.51)[:, :5]
    found = np.einsum("ipn,p->in", w, p_d)
    assert np.max(np.abs(found - expected)) <= 1e-12 * torque_scale(w, p_d)


def test_the_motion_determines_five_inertial_parameters_and_fifteen_in_all() -> None:
    w = paper.regressor(*random_states(1, 300))
    stacked = np.moveaxis(w, 1, 2).reshape(-1, 15)
    scaled = stacked / np.linalg.norm(stacked, axis=0)
    assert np.linalg.matrix_rank(scaled) == 15
    assert np.linalg.matrix_rank(scaled[:, :5]) == 5


@settings(deadline=None, max_examples=20)
@given(seed=SEEDS)
def test_friction_and_offset_act_on_their_own_joint_alone(seed: int) -> None:
    q, v, a = random_states(seed, 5)
    rng = np.random.default_rng(seed)
    parameters = np.concatenate([np.zeros(5), rng.normal(size=10)])
    found = np.einsum("ipn,p->in", paper.regressor(q, v, a), parameters)
    for joint in range(2):
        own = paper.friction(v[joint], parameters[5 + 4 * joint : 9 + 4 * joint]) + parameters[13 + joint]
        np.testing.assert_allclose(found[joint], own, rtol=1e-12, atol=1e-12)


def test_friction_opposes_motion_alike_in_both_directions_and_rests_at_standstill() -> None:
    coefficients = [0.2, 0.1, -0.02, 0.003]
    speed = np.array([0.5, 2.0])
    expected = 0.2 + 0.1 * speed - 0.02 * speed**2 + 0.003 * speed**3
    np.testing.assert_allclose(paper.friction(speed, coefficients), expected, rtol=1e-15)
    np.testing.assert_allclose(paper.friction(-speed, coefficients), -expected, rtol=1e-15)
    assert paper.friction(0.0, coefficients) == 0.0


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
    assert [NAMES[column] for column in paper.REDUCED_COLUMNS] == list(paper.REDUCED)


# ---- the trajectories


@pytest.mark.parametrize("trajectory", [paper.OJK, paper.OJD], ids=lambda t: t.name)
def test_velocity_and_acceleration_are_derivatives_of_position(trajectory: paper.Trajectory) -> None:
    time = np.linspace(0.1, trajectory.duration - 0.1, 101)
    step = 1e-3
    weights = np.array([1.0, -8.0, 8.0, -1.0]) / (12.0 * step)
    nearby = [trajectory.motion(time + k * step) for k in (-2, -1, 1, 2)]
    _, v, a = trajectory.motion(time)
    # Five points: the error is step^4 / 30 times the fifth derivative, below 1e-9 here.
    for order, exact in ((0, v), (1, a)):
        numeric = sum(weight * near[order] for weight, near in zip(weights, nearby, strict=True))
        np.testing.assert_allclose(numeric, exact, rtol=0, atol=1e-9)


def test_motion_starts_at_the_printed_centre_with_the_printed_harmonics() -> None:
    q, v, a = paper.OJD.motion([0.0])
    np.testing.assert_allclose(q[:, 0], [1.57, 0.0])
    np.testing.assert_allclose(v[:, 0], [-2.18166 * 1.37509, 2.18166 * 1.17865], rtol=1e-15)
    np.testing.assert_array_equal(a[:, 0], 0.0)


@settings(deadline=None, max_examples=20)
@given(seed=SEEDS)
def test_tool_acceleration_is_pinocchios(arm: pin.Model, seed: int) -> None:
    q, v, a = random_states(seed, 4)
    model = arm.copy()
    tool = model.addFrame(
        pin.Frame("tool", 2, pin.SE3(np.eye(3), np.array([paper.LINK_LENGTH, 0.0, 0.0])), pin.FrameType.OP_FRAME)
    )
    data = model.createData()
    found = paper.tool_acceleration(q, v, a)
    for k in range(q.shape[1]):
        pin.forwardKinematics(model, data, q[:, k], v[:, k], a[:, k])
        expected = pin.getFrameClassicalAcceleration(model, data, tool, pin.LOCAL_WORLD_ALIGNED).linear
        np.testing.assert_allclose(found[k], np.linalg.norm(expected), rtol=1e-12)


# ---- the criteria


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


# ---- the tables as typed


def test_tables_are_typed_as_printed() -> None:
    printed = json.loads(shared_path("paper", "tables.json").read_text(encoding="utf-8"))
    assert tuple(printed["trajectories"]) == paper.TRAJECTORIES

    def row(values: dict[str, float]) -> tuple[float, ...]:
        return tuple(values[name] for name in paper.TRAJECTORIES)

    first = printed["table1"]
    assert paper.TABLE_1.log_det == row(first["J_d"])
    assert paper.TABLE_1.condition == row(first["J_k"])
    for key in ("sigma", "peak_velocity", "peak_acceleration"):
        assert getattr(paper.TABLE_1, key) == (row(first[f"{key}_1"]), row(first[f"{key}_2"]))
    for table, key in (
        (paper.TABLE_2, "table2_complete_model_rms_error"),
        (paper.TABLE_3, "table3_complete_model_normalised"),
        (paper.TABLE_4, "table4_reduced_model_rms_error"),
    ):
        for joint, number in enumerate("12"):
            cells = printed[key][number]
            assert table.errors[joint] == tuple(row(cells[name]) for name in paper.TRAJECTORIES)
            assert table.row_average[joint] == tuple(cells[name]["average"] for name in paper.TRAJECTORIES)
            if "torque_rms" in cells["CI"]:
                assert paper.TORQUE_RMS[joint] == tuple(cells[n]["torque_rms"] for n in paper.TRAJECTORIES)
    fifth = printed["table5_reduced_model_parameters"]
    assert tuple(fifth) == paper.REDUCED
    assert tuple(row(values) for values in fifth.values()) == paper.TABLE_5


def test_trajectories_are_typed_as_printed() -> None:
    printed = json.loads(shared_path("paper", "tables.json").read_text(encoding="utf-8"))["formula7"]
    for trajectory in (paper.OJK, paper.OJD):
        figures = printed[trajectory.name]
        assert trajectory.duration == figures["duration"]
        assert list(trajectory.offset) == figures["offset"]
        assert [list(x) for x in trajectory.amplitude] == figures["amplitude"]
        assert [list(x) for x in trajectory.omega] == figures["omega"]


def test_a_column_of_table_5_becomes_a_parameter_vector() -> None:
    found = dict(zip(NAMES, paper.table5_parameters("L2"), strict=True))
    assert found["P_d4"] == -3.554
    assert found["a22"] == -0.034
    assert all(found[name] == 0.0 for name in set(NAMES) - set(paper.REDUCED))
    with pytest.raises(ValueError, match="L3"):
        paper.table5_parameters("L3")


# ---- what reproduces


def rows(report: paper.PaperReport, section: str, **fields: str) -> list[paper.Check]:
    found = [c for c in report.section(section) if all(getattr(c, k) == v for k, v in fields.items())]
    assert found
    return found


def test_indexes_and_speeds_agree_and_only_one_acceleration_does(report: paper.PaperReport) -> None:
    table1 = report.section("Table 1")
    assert {c.tolerance for c in table1 if c.quantity == "J_d"} == {0.02}
    assert {c.tolerance for c in table1 if c.quantity == "J_k"} == {0.10}
    assert all(c.agrees for c in table1 if c.quantity != "peak acceleration")
    agreeing = [(c.trajectory, c.joint) for c in table1 if c.quantity == "peak acceleration" and c.agrees]
    assert agreeing == [("OJD", "joint2")]


def test_peaks_are_those_of_the_printed_formulas(report: paper.PaperReport) -> None:
    """Figures found independently."""
    found = {(c.quantity, c.trajectory, c.joint): round(c.computed, 2) for c in report.section("Table 1")}
    for trajectory, speeds, accelerations in (
        ("OJK", (1.27, 1.29), (4.31, 1.73)),
        ("OJD", (3.00, 2.57), (4.13, 3.03)),
    ):
        for joint in (1, 2):
            assert found["peak velocity", trajectory, f"joint{joint}"] == speeds[joint - 1]
            assert found["peak acceleration", trajectory, f"joint{joint}"] == accelerations[joint - 1]


def test_OJD_asks_for_more_tool_acceleration_than_allowed(report: paper.PaperReport) -> None:
    found = {c.trajectory: c for c in rows(report, "Limits", quantity="tool acceleration")}
    assert found["OJD"].agrees is False
    assert round(found["OJD"].computed, 1) == 13.2
    assert found["OJK"].agrees is True


def test_OJD_as_printed_leaves_the_range_of_joint_1_by_less_than_a_milliradian(
    report: paper.PaperReport,
) -> None:
    (row,) = rows(report, "Limits", quantity="lower position limit", trajectory="OJD", joint="joint1")
    assert row.agrees is False
    assert row.computed == pytest.approx(1.57 - 2.18166, abs=1e-5)
    assert row.printed is not None
    assert 0.0 < row.printed - row.computed < 1e-3


def test_the_OJD_column_predicts_the_printed_torque_within_5_percent(report: paper.PaperReport) -> None:
    section = "Torque rms from Table 5"
    judged = rows(report, section, quantity="torque rms, parameters of OJD")
    assert len(judged) == 4
    assert all(c.agrees and c.tolerance == 0.05 for c in judged)
    found = {(c.trajectory, c.joint): c.computed for c in judged}
    for key, value in {
        ("OJK", "joint1"): 0.5145,
        ("OJK", "joint2"): 0.1293,
        ("OJD", "joint1"): 0.5982,
        ("OJD", "joint2"): 0.1697,
    }.items():
        assert found[key] == pytest.approx(value, abs=2e-4)
    others = [c for c in report.section(section) if c not in judged]
    assert len(others) == 16
    assert all(c.agrees is None for c in others)


def test_table_5_implies_the_prediction_errors_of_table_4(report: paper.PaperReport) -> None:
    section = report.section("Table 4 from Table 5")
    assert len(section) == 16
    assert all(c.agrees for c in section)


@pytest.mark.parametrize("table", ["Table 2", "Table 3", "Table 4"])
def test_printed_averages_include_the_diagonal(report: paper.PaperReport, table: str) -> None:
    first, *averages = report.section(f"Averages of {table}")
    assert first.quantity.endswith("diagonal included")
    assert first.computed == 20.0
    assert "reproduces 0 of 20" in first.comment or "reproduces 1 of 20" in first.comment
    assert len(averages) == 22
    assert all(c.agrees for c in averages)


def test_table_3_is_table_2_normalised(report: paper.PaperReport) -> None:
    section = report.section("Table 3 from Table 2")
    assert len(section) == 10
    assert all(c.agrees for c in section)


def test_residuals_exceed_the_repeatability_of_the_torque_but_for_L2(report: paper.PaperReport) -> None:
    section = report.section("Own errors and noise")
    assert {(c.trajectory, bool(c.agrees)) for c in section} == {
        *((name, False) for name in ("CI", "L1", "OJK", "OJD")),
        ("L2", True),
    }


def test_no_arm_has_the_parameters_of_CI_and_L2(report: paper.PaperReport) -> None:
    impossible = {
        c.trajectory
        for c in report.section("Table 5, inertia")
        if c.quantity.startswith("an arm exists") and not c.agrees
    }
    assert impossible == {"CI", "L2"}


@pytest.mark.parametrize("trajectory", paper.TRAJECTORIES)
def test_the_arm_that_is_said_to_exist_can_be_built(trajectory: str, report: paper.PaperReport) -> None:
    """Independent of the bound: look for a mass of link 2 with which both bodies are possible."""
    d1, d2, _, d4, d5 = paper.table5_parameters(trajectory)[:5]
    masses = np.geomspace(1e-2, 1e3, 20001)
    link2 = d4 - d2**2 / masses >= 0.0
    link1 = d1 - masses * paper.LINK_LENGTH**2 >= 0.0
    possible = bool(np.any(link1 & link2)) and d5 >= 0.0
    (row,) = [
        c
        for c in report.section("Table 5, inertia")
        if c.quantity.startswith("an arm exists") and c.trajectory == trajectory
    ]
    assert row.agrees == possible


def test_friction_is_never_negative_where_it_was_measured_and_four_times_beyond(
    report: paper.PaperReport,
) -> None:
    section = report.section("Table 5, friction")
    assert all(c.agrees for c in section if "estimated from" in c.quantity)
    driving = {(c.trajectory, c.joint) for c in section if "can reach" in c.quantity and not c.agrees}
    assert driving == {("CI", "joint1"), ("L2", "joint1"), ("L2", "joint2"), ("OJK", "joint1")}


@settings(deadline=None, max_examples=60)
@given(
    coefficients=st.tuples(*[st.floats(-1, 1)] * 4),
    top=st.floats(0.1, 5.0),
)
def test_least_friction_is_that_of_a_fine_grid(coefficients: tuple[float, float, float, float], top: float) -> None:
    speeds = np.linspace(0.0, top, 20001)[1:]
    torque = paper.friction(speeds, coefficients)
    least, zero = parameter_checks.least_friction(np.array(coefficients), top)
    # Between grid points the torque moves by less than this.
    spacing = (1.0 + 2.0 * top + 3.0 * top**2) * top / 20000
    on_grid = min(torque.min(), coefficients[0])
    assert on_grid - spacing <= least <= on_grid + 1e-12
    assert (zero is None) == (least >= 0.0)
    if zero is not None:
        assert torque[speeds < zero].min(initial=0.0) >= -1e-12
        # The crossing is a root to rounding, of terms of up to this size.
        size = float(np.abs(coefficients) @ zero ** np.arange(4))
        assert paper.friction(zero, coefficients) <= 8.0 * np.finfo(float).eps * size


def test_friction_that_only_grazes_zero_does_not_drive() -> None:
    grazing = np.array([1.0, -2.0, 1.0, 0.0])  # (1 - v)^2
    assert parameter_checks.least_friction(grazing, 3.0) == (0.0, None)
    through = np.array([1.0, -1.0, 0.0, 0.0])
    least, zero = parameter_checks.least_friction(through, 3.0)
    assert least == -2.0
    assert zero == pytest.approx(1.0, rel=1e-14)


# ---- the checks can fail


def test_a_wrong_average_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    average = ((*paper.TABLE_2.row_average[0][:4], 1.390), paper.TABLE_2.row_average[1])
    monkeypatch.setattr(table_checks, "TABLE_2", dataclasses.replace(paper.TABLE_2, row_average=average))
    differing = [c for c in table_checks.averages() if c.agrees is False]
    assert [(c.quantity, c.trajectory) for c in differing if c.trajectory] == [("row average", "OJD")]


def with_cell(table: paper.ErrorTable, joint: int, row: int, column: int, value: float) -> paper.ErrorTable:
    errors: Any = np.array(table.errors)
    errors[joint, row, column] = value
    return dataclasses.replace(table, errors=errors.tolist())


def test_a_wrong_cell_of_table_3_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(table_checks, "TABLE_3", with_cell(paper.TABLE_3, 1, 0, 2, 4.485))
    (row,) = [c for c in table_checks.normalisation() if c.agrees is False]
    assert (row.trajectory, row.joint, row.quantity) == ("CI", "joint2", "worst cell, parameters of L2")


def test_an_own_error_that_is_not_the_least_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(table_checks, "TABLE_4", with_cell(paper.TABLE_4, 0, 4, 4, 0.056))
    differing = [c for c in table_checks.own_errors() if c.agrees is False]
    assert [(c.trajectory, c.joint) for c in differing] == [("OJD", "joint1")]


def test_a_reduced_model_that_fits_better_than_the_complete_one_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(table_checks, "TABLE_4", with_cell(paper.TABLE_4, 0, 1, 1, 0.070))
    differing = [c for c in table_checks.own_errors() if c.agrees is False]
    assert [(c.trajectory, c.joint) for c in differing] == [("L1", "both")]


# ---- the report


def test_the_report_goes_through_json_unchanged(report: paper.PaperReport) -> None:
    plain = report.to_dict()
    assert json.loads(json.dumps(plain, allow_nan=False)) == plain
    assert len(plain["checks"]) == len(report.checks)


def test_counts_add_up_to_the_rows(report: paper.PaperReport) -> None:
    counts = report.counts()
    assert [count.section for count in counts] == list(report.sections)
    assert sum(c.agree + c.differ + c.information for c in counts) == len(report.checks)
    assert sum(c.differ for c in counts) == len(report.differing())


def test_the_report_is_the_same_each_time(report: paper.PaperReport) -> None:
    assert paper.check_paper() == report
