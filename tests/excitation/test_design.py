"""Designed motions: how much they show, within which limits."""

import sys
from dataclasses import replace

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from scara_ident.errors import UsageError
from scara_ident.estimation.information import Information
from scara_ident.excitation import (
    Condition,
    ExcitationTrajectory,
    InfeasibleLimits,
    Limits,
    block_of,
    design_excitation,
    information_of,
    limits_of,
)
from scara_ident.model.model import build_model
from scara_ident.paper import OJD, criteria, regressor, table5_parameters, tool_acceleration
from scara_ident.robot.robot import Robot, load_robot
from tests.arms import PLANAR_2R, example_urdf, rnea, write_urdf
from tests.excitation.designs import COMPLETE, QUICK, SCARA, SHORT
from tests.excitation.made import rigid_model
from tests.test_threads import blas_threads


@pytest.fixture(scope="module")
def paper_length():
    return design_excitation(COMPLETE, limits=limits_of(SCARA, share=1.0), effort=QUICK)


def shares(trajectory: ExcitationTrajectory, limits: Limits, robot: Robot, times: int) -> dict[str, float]:
    """Shares of limits on a grid, without the code that the design uses."""
    q, v, a = trajectory.at(np.linspace(0.0, trajectory.duration, times))
    half = 0.5 * (limits.upper - limits.lower)
    torque = (rnea(robot, q, v, a) + (robot.reduction**2 * robot.rotor_inertia)[:, None] * a) * robot.row_scale[:, None]
    return {
        "position": float(np.max(np.abs(q - limits.centre[:, None]) / half[:, None])),
        "velocity": float(np.max(np.abs(v) / limits.velocity[:, None])),
        "torque": float(np.max(np.abs(torque) / limits.torque[:, None])),
    }


@pytest.mark.slow
def test_25_s_of_the_scara_reach_a_log_det_of_92_within_all_limits(paper_length):
    trajectory = paper_length.trajectories[0]
    log_det, condition = criteria(regressor(*trajectory.at(np.linspace(0.0, 25.0, 2500))))
    assert log_det == pytest.approx(paper_length.log_det, abs=1e-6)
    assert condition == pytest.approx(paper_length.condition, rel=1e-6)
    assert log_det >= 92.0
    # Ten times finer than the design's finest grid, and by other code.
    found = shares(trajectory, paper_length.limits, SCARA, 1001)
    assert max(found.values()) <= 1.0
    assert max(found.values()) > 0.99
    assert paper_length.verified > 10 * 48 * 40
    fine = trajectory.at(np.linspace(0.0, 25.0, 100_001))
    assert np.max(tool_acceleration(*fine)) <= 9.0
    assert np.max(np.abs(fine[1])) <= 3.77
    # Motors turn the arm of Table 5 against its friction.
    assert np.max(np.abs(np.einsum("ipN,p->iN", regressor(*fine), table5_parameters("OJD")))) <= 2.0


@pytest.mark.slow
def test_what_is_reported_as_reached_is_reached_between_samples_too(short):
    limits, trajectory = short.limits, short.trajectories[0]
    time = np.linspace(0.0, trajectory.duration, 200_001)
    q, v, a = trajectory.at(time)
    told = {each.name: each for each in short.reached}
    assert all(each.kept for each in short.reached)
    assert told["joint1.position.lower"].reached == pytest.approx(q[0].min(), abs=1e-5)
    assert told["joint2.position.upper"].reached == pytest.approx(q[1].max(), abs=1e-5)
    assert told["joint2.velocity"].reached == pytest.approx(np.abs(v[1]).max(), rel=1e-5)
    assert told["tool.acceleration"].reached == pytest.approx(tool_acceleration(q, v, a).max(), rel=1e-5)
    assert told["tool.acceleration"].reached >= tool_acceleration(q, v, a).max() * (1 - 1e-9)
    assert told["joint1.torque"].bound == limits.torque[0] == pytest.approx(1.6)


@pytest.mark.slow
def test_the_std_of_repetitions_falls_against_ojd_as_the_log_det_promises(paper_length):
    """White noise on exact regressors, estimated by least squares, 400 times each."""
    trajectory = paper_length.trajectories[0]
    rng = np.random.default_rng(0)
    spreads, log_dets = [], []
    for moved in (OJD.motion(OJD.times()), trajectory.at(np.linspace(0.0, 25.0, 2500))):
        at = replace(trajectory.motion(2500), q=moved[0], v=moved[1], a=moved[2])
        h = COMPLETE.regressor(at).transpose(2, 0, 1).reshape(-1, 15)
        noise = 0.03 * rng.standard_normal((len(h), 400))
        estimates = np.linalg.lstsq(h, noise, rcond=None)[0]
        spreads.append(estimates.std(axis=1))
        log_dets.append(Information.empty(15).absorb(h, np.zeros(len(h))).log_det())
        covariance = np.cov(estimates)
        log_dets.append(-np.linalg.slogdet(covariance / 0.03**2)[1])
    assert log_dets[0] == pytest.approx(75.5, abs=0.1)
    promised = np.exp((log_dets[0] - log_dets[2]) / 30.0)
    seen = np.exp((log_dets[1] - log_dets[3]) / 30.0)
    assert promised < 0.6
    assert seen == pytest.approx(promised, rel=0.25)
    # Each parameter by itself, against the std that the design states.
    np.testing.assert_allclose(spreads[1], 0.03 * paper_length.std(), rtol=0.25)
    assert np.exp(np.mean(np.log(spreads[1] / spreads[0]))) < 0.6


@pytest.mark.slow
def test_a_design_has_one_blas_thread_on_which_the_last_digits_depend(monkeypatch: pytest.MonkeyPatch):
    seen: list[set[int]] = []
    monkeypatch.setattr(
        sys.modules[design_excitation.__module__], "reached", lambda *_: seen.append(blas_threads()) or ()
    )
    with threadpool_limits(limits=2, user_api="blas"):
        design_excitation(COMPLETE, **SHORT, effort=QUICK)
    assert seen == [{1}]


@pytest.mark.slow
def test_a_block_can_be_preferred_to_the_rest(short):
    wanted = block_of(COMPLETE, ["P_d2", "P_d3", "P_d4"])
    made = design_excitation(COMPLETE, **SHORT, criterion=wanted, effort=short.effort)
    costs = [
        wanted.cost(each.information.regressor_factor.T @ each.information.regressor_factor)[0]
        for each in (made, short)
    ]
    assert costs[0] < costs[1] - 0.5


@pytest.mark.slow
def test_the_condition_can_be_preferred_to_the_log_det(short):
    made = design_excitation(COMPLETE, **SHORT, criterion=Condition(), effort=short.effort)
    assert made.condition < 0.5 * short.condition
    assert made.log_det < short.log_det


@pytest.mark.slow
def test_a_design_fills_what_existing_recordings_lack():
    alone = design_excitation(COMPLETE, **SHORT, effort=QUICK)
    still = information_of(COMPLETE, alone.trajectories[0], 400)
    # Recordings in which friction was seen a thousand times better than bodies.
    factor = still.regressor_factor.copy()
    gram = factor.T @ factor
    friction = COMPLETE.place(COMPLETE.terms[1])
    gram[friction, friction] *= 1e6
    known = Information(np.pad(np.linalg.cholesky(gram).T, ((0, 1), (0, 1))), 400.0)
    bodies = block_of(COMPLETE, ["rigid_body"])
    made = {"alone": alone, "after": design_excitation(COMPLETE, **SHORT, prior=known, effort=QUICK)}
    together = {
        name: gram + each.information.regressor_factor.T @ each.information.regressor_factor
        for name, each in made.items()
    }
    assert bodies.cost(together["after"])[0] < bodies.cost(together["alone"])[0]
    assert made["after"].total.log_det() == pytest.approx(np.linalg.slogdet(together["after"])[1], abs=1e-6)
    assert np.linalg.slogdet(together["after"])[1] > np.linalg.slogdet(together["alone"])[1]


@pytest.mark.slow
def test_trajectories_of_given_lengths_move_alike_and_count_by_their_time():
    limits = limits_of(SCARA, accelerations={"joint1": 6.0}, jerks={"joint2": 60.0})
    made = design_excitation(
        COMPLETE, duration=(2.0, 4.0), harmonics=8, samples=400, limits=limits, effort=QUICK, name="run"
    )
    assert [(each.name, each.duration) for each in made.trajectories] == [("run-a", 2.0), ("run-b", 4.0)]
    assert made.samples == (200, 400)
    assert [each.basis.orders[-1] for each in made.trajectories] == [5, 8]
    told = {each.name: each for each in made.reached}
    for trajectory in made.trajectories:
        time = np.linspace(0.0, trajectory.duration, 20_001)
        assert np.max(np.abs(trajectory.at(time)[2][0])) <= told["joint1.acceleration"].reached <= 4.8
        jerk = trajectory.coefficients[1] @ trajectory.basis.rows(time, 3).T
        assert np.max(np.abs(jerk)) <= told["joint2.jerk"].reached <= 48.0
    parts = [information_of(COMPLETE, each, size) for each, size in zip(made.trajectories, made.samples, strict=True)]
    assert made.log_det == pytest.approx(
        np.linalg.slogdet(sum(p.regressor_factor.T @ p.regressor_factor for p in parts))[1], abs=1e-6
    )


@pytest.mark.slow
def test_trajectories_designed_together_share_the_work(short):
    two = design_excitation(COMPLETE, **SHORT, trajectories=2, effort=short.effort)
    assert [each.name for each in two.trajectories] == ["excitation-a", "excitation-b"]
    parts = [information_of(COMPLETE, each, 400) for each in two.trajectories]
    assert two.log_det == pytest.approx(
        np.linalg.slogdet(sum(p.regressor_factor.T @ p.regressor_factor for p in parts))[1], abs=1e-6
    )
    # Twice a trajectory designed alone gives 15 ln 2 more than once.
    assert two.log_det > short.log_det + 15.0 * np.log(2.0)


@pytest.mark.slow
def test_noise_of_the_torques_weights_the_rows(short):
    std = np.array([0.04, 0.012])
    made = design_excitation(COMPLETE, **SHORT, torque_std=std, effort=QUICK)
    h = COMPLETE.regressor(made.trajectories[0].motion(400)) / std[:, None, None]
    stacked = h.transpose(2, 0, 1).reshape(-1, 15)
    assert made.information.log_det() == pytest.approx(np.linalg.slogdet(stacked.T @ stacked)[1], abs=1e-6)
    # The paper's criteria count every row alike.
    alike = information_of(COMPLETE, made.trajectories[0], 400)
    assert (made.log_det, made.condition) == (pytest.approx(alike.log_det()), pytest.approx(alike.condition()))
    np.testing.assert_allclose(made.std(), np.sqrt(np.diag(np.linalg.inv(stacked.T @ stacked))), rtol=1e-6)


@pytest.mark.slow
def test_an_arm_of_six_joints_is_excited_within_its_limits():
    robot = load_robot(example_urdf("ur5_joint_limited_robot.urdf"))
    model = rigid_model(robot)
    limits = limits_of(robot, floor=0.05, clearance=None)
    made = design_excitation(
        model, duration=8.0, harmonics=4, samples=400, criterion=Condition(), limits=limits, effort=QUICK
    )
    assert np.sqrt(made.condition) < 100.0
    assert all(each.kept for each in made.reached)
    assert max(shares(made.trajectories[0], limits, robot, 2001).values()) <= 1.0


@pytest.mark.slow
def test_splines_do_as_harmonics_do():
    made = design_excitation(COMPLETE, **SHORT, family="spline", effort=QUICK)
    assert all(each.kept for each in made.reached)
    _, v, a = made.trajectories[0].at(np.array([0.0, 4.0]))
    assert np.max(np.abs(v)) < 1e-12 and np.max(np.abs(a)) < 1e-10


@pytest.mark.slow
def test_the_start_can_be_given():
    start = np.array([1.0, -0.5])
    made = design_excitation(COMPLETE, **SHORT, start=start, effort=QUICK)
    q, v, _ = made.trajectories[0].at(np.array([0.0, 4.0]))
    np.testing.assert_allclose(q, np.column_stack([start, start]), atol=1e-12)
    assert np.max(np.abs(v)) < 1e-12


def test_a_start_outside_the_limits_is_said():
    with pytest.raises(InfeasibleLimits, match=r"start: joint2 = 2\.5 lies outside its range -2\.18166\.\.2\.18166"):
        design_excitation(COMPLETE, limits=limits_of(SCARA, share=1.0), start=np.array([0.0, 2.5]))
    with pytest.raises(InfeasibleLimits, match="joint2 is at the end of its range"):
        design_excitation(COMPLETE, limits=limits_of(SCARA, share=1.0), start=np.array([0.0, 2.18]))
    with pytest.raises(UsageError, match="expected 2 positions"):
        design_excitation(COMPLETE, start=np.zeros(3))


def test_limits_that_cannot_hold_the_arm_are_said(tmp_path):
    robot = load_robot(write_urdf(tmp_path / "arm.urdf", PLANAR_2R))
    model = build_model(robot, "basic")
    hanging = design_excitation(model, duration=4.0, harmonics=5, limits=limits_of(robot), effort=QUICK)
    assert all(each.kept for each in hanging.reached)
    low = limits_of(robot, ranges={"j1": (-0.5, 0.5), "j2": (-0.5, 0.5)}, torques={"j1": 3.0}, share=1.0)
    with pytest.raises(InfeasibleLimits, match=r"j1 needs .* of 3 N m to hold the arm; allow j1 more torque"):
        design_excitation(model, limits=low)
    with pytest.raises(InfeasibleLimits, match=r"height is .* where the floor is at 2 m"):
        design_excitation(COMPLETE, limits=limits_of(SCARA, floor=2.0))


@pytest.mark.slow
def test_friction_counts_in_the_torque_also_where_a_joint_turns_back():
    limits = limits_of(SCARA, torques={"joint1": 1.0}, share=1.0)
    known = {"a01": 0.3, "a11": 0.05, "a21": -0.01, "a02": 0.1}
    made = design_excitation(COMPLETE, **SHORT, limits=limits, known=known, effort=QUICK)
    torque = np.abs(made.motion(rate=20_000.0).torque[0])
    told = {each.name: each for each in made.reached}["joint1.torque"]
    assert torque.max() <= told.reached <= 1.0
    assert told.active and torque.max() > 0.9
    with pytest.raises(InfeasibleLimits, match=r"joint1: a torque of 1 N m does not overcome its friction of 1\.5 N m"):
        design_excitation(COMPLETE, limits=limits, known={"a01": -1.5})


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"trajectories": 0}, "trajectories 0"),
        ({"duration": (5.0, 6.0, 7.0), "trajectories": 2}, "3 durations for 2 trajectories"),
        ({"duration": (300.0, 1.0)}, "harmonic 5: 8 samples cannot resolve"),
        ({"duration": 0.0}, "duration 0 s"),
        ({"duration": (5.0, np.nan)}, "duration nan s"),
        ({"trajectories": 27}, "trajectories 27: expected at least 1 and at most 26"),
        ({"duration": 2.0, "harmonics": 4000}, "harmonics 4000: more than a search .* use at most 150"),
        ({"harmonics": 151}, "harmonics 151"),
        ({"harmonics": 80, "trajectories": 2}, "use at most 75, or fewer trajectories"),
        ({"harmonics": (1, 2, 700)}, "harmonic 700: 2500 samples cannot resolve so fast a motion; use at most 625"),
        ({"samples": 1}, "samples 1"),
        ({"duration": -3.0}, "duration -3"),
        ({"torque_std": np.array([1.0, 0.0])}, "torque noise: expected 2 positive"),
        ({"prior": Information.empty(3)}, "about 3 parameters, the model complete has 15"),
        ({"known": {"a99": 1.0}}, "parameter 'a99'"),
    ],
)
def test_arguments_that_do_not_fit_are_said(given, said):
    with pytest.raises(UsageError, match=said):
        design_excitation(COMPLETE, **given)


@pytest.mark.slow
def test_a_multisine_has_the_chosen_harmonics_alone():
    made = design_excitation(COMPLETE, duration=4.0, samples=400, harmonics=(1, 2, 3, 5, 7), effort=QUICK)
    (trajectory,) = made.trajectories
    assert trajectory.basis.orders == (1, 2, 3, 5, 7)
    # Over one period without its end, so that a harmonic falls on one line of the spectrum.
    q = trajectory.at(np.linspace(0.0, 4.0, 65)[:-1])[0]
    lines = np.abs(np.fft.rfft(q, axis=1))
    others = np.setdiff1d(np.arange(33), (0, 1, 2, 3, 5, 7))
    assert np.max(lines[:, others]) < 1e-10 * np.max(lines)


def test_ojd_breaks_the_limits_that_the_design_keeps():
    assert criteria(regressor(*OJD.motion(OJD.times())))[0] == pytest.approx(75.5, abs=0.1)
    assert np.max(tool_acceleration(*OJD.motion(OJD.times()))) > 13.0
