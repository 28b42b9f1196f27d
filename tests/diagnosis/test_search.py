"""The search: what comes in, what is refined, what is dropped again, and the delay that is corrected in the data."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.diagnosis.candidates import Candidate
from scara_ident.diagnosis.search import Beside, best_of_each, model_with, refine, search
from scara_ident.diagnosis.table import tabulate
from scara_ident.effects import Member
from scara_ident.effects.friction import AsymmetricFriction, Stribeck
from scara_ident.effects.measurement import TimeDelay, shifted
from scara_ident.effects.position import Spring
from tests.diagnosis.made import (
    BANDS,
    complete,
    exact_runs,
    fitted,
    residual_noise,
    scene_of,
    virtual_runs,
    with_torque,
)

MODEL = complete()
SMALL = (Spring(), Stribeck(), AsymmetricFriction(), TimeDelay())


def spring(motion, stiffness: float = 0.05):
    return stiffness * motion.q[1]


def asymmetry(motion, difference: float = 0.03):
    return difference * np.abs(motion.v[0])


def test_nothing_comes_in_where_nothing_is_missing():
    result = search(MODEL, exact_runs(), BANDS, catalogue=SMALL)
    assert (result.chosen, result.steps, result.delay) == ((), (), None)
    assert result.model is result.scene.model
    assert not any(decision.accepted for decision in result.decisions)
    assert result.tried == len(result.decisions)


def test_two_planted_effects_come_in_and_nothing_else():
    runs = with_torque(with_torque(exact_runs(), 1, spring), 0, asymmetry)
    result = search(MODEL, runs, BANDS, catalogue=SMALL)
    assert {item.label(result.scene) for item in result.chosen} == {"spring of joint2", "asymmetric_friction of joint1"}
    assert [step.decision.candidate for step in result.steps] == list(result.chosen)
    assert len(result.model.columns) == len(MODEL.columns) + 2
    clean = fitted(MODEL, exact_runs())
    assert np.max(np.abs(result.scene.value - clean.value)[:5] / clean.std[:5]) < 4.0


def test_the_error_falls_with_every_step_to_that_of_the_clean_recordings():
    runs = with_torque(with_torque(exact_runs(), 1, spring), 0, asymmetry)
    result = search(MODEL, runs, BANDS, catalogue=SMALL)
    errors = [residual_noise(step.estimate, step.evidence) for step in result.steps]
    start = residual_noise(result.start, result.start_evidence)
    # The sum over joints in equal weight falls; a joint that fits worse only because it weighs less may grow a little.
    sizes = [np.sum((error / errors[-1]) ** 2) for error in (start, *errors)]
    assert sizes[0] > 2.0 * sizes[1] > 2.0 * sizes[2]
    clean = search(MODEL, exact_runs(), BANDS, catalogue=SMALL)
    assert errors[1] == pytest.approx(residual_noise(clean.start, clean.start_evidence), rel=0.02)


def test_refinement_finds_a_nonlinear_parameter_between_scan_points():
    runs = with_torque(
        exact_runs(), 0, lambda motion: 0.08 * np.sign(motion.v[0]) * np.exp(-((motion.v[0] / 0.43) ** 2))
    )
    scene = scene_of(MODEL, runs)
    beside = Beside(scene, tuple(runs), BANDS, tabulate(MODEL, runs, BANDS), fitted(MODEL, runs).weights, 10)
    rough = beside.judge_new([Candidate(Stribeck(), member) for member in Stribeck().members(scene)])
    leader = max(rough, key=lambda item: item.examination.gain)
    (fine,) = refine(beside, [leader])
    assert fine.examination.gain >= leader.examination.gain
    assert fine.candidate.member.nonlinear[0] == pytest.approx(0.43, rel=0.1)
    assert fine.candidate.member.joint == 0


def test_a_delay_is_corrected_in_the_data():
    late = [shifted(run, -0.004) for run in exact_runs()]
    result = search(MODEL, late, BANDS, catalogue=SMALL)
    assert result.delay is not None
    assert result.delay[0] == pytest.approx(0.004, abs=2e-4)
    assert result.chosen == ()
    clean = fitted(MODEL, exact_runs())
    corrected = fitted(MODEL, result.recordings)
    assert np.max(np.abs(corrected.value - clean.value) / clean.std) < 1.0


def test_weights_of_the_fit_make_joints_equal():
    result = search(MODEL, virtual_runs(), BANDS, catalogue=(Spring(),))
    weighted = result.start.weights * residual_noise(result.start, result.start_evidence)
    assert weighted[0] == pytest.approx(weighted[1], rel=0.01)


def test_the_best_of_each_prefers_what_may_come_in():
    runs = with_torque(exact_runs(), 1, spring)
    scene = scene_of(MODEL, runs)
    beside = Beside(scene, tuple(runs), BANDS, tabulate(MODEL, runs, BANDS), fitted(MODEL, runs).weights, 10)
    decisions = beside.judge_new([Candidate(Stribeck(), Member(1, (x,))) for x in (0.1, 0.5)])
    decisions += beside.judge_new([Candidate(Spring(), Member(j)) for j in range(2)])
    best = best_of_each(decisions)
    assert set(best) == {"stribeck of joint2", "spring of joint1", "spring of joint2"}
    assert best["spring of joint2"].accepted
    assert not best["spring of joint1"].accepted
    assert best["stribeck of joint2"].gain == max(item.gain for item in decisions[:2])


def test_nothing_to_judge_gives_no_decision():
    runs = exact_runs()
    scene = scene_of(MODEL, runs)
    beside = Beside(scene, tuple(runs), BANDS, tabulate(MODEL, runs, BANDS), np.ones(2), 1)
    assert beside.judge_new([]) == []
    assert model_with(scene, []) is scene.model
