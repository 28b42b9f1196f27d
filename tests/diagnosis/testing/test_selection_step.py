"""Candidates tried beside a model: what is judged, refined, left out, and on which folds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from scara_ident.diagnosis.candidates.candidates import Candidate
from scara_ident.diagnosis.fitting.at_estimate import at_estimate
from scara_ident.diagnosis.testing.selection_step import (
    best_of_each,
    folds_of,
    model_with,
    moments_of,
    observed_at_every_sample,
)
from scara_ident.diagnosis.testing.selection_step import observed as observed_with
from scara_ident.effects import Member
from scara_ident.effects.elasticity import JointElasticity
from scara_ident.effects.friction import Stribeck, friction_places
from scara_ident.effects.gear import TransmissionLoss
from scara_ident.effects.measurement import TimeDelay, shifted
from scara_ident.effects.position import Spring
from scara_ident.effects.presliding import Presliding
from scara_ident.effects.signals import ModelledEffect
from scara_ident.effects.tilt import BaseTilt
from scara_ident.estimation import wls
from scara_ident.estimation.information import weighted
from scara_ident.estimation.least_squares import value_and_weights
from scara_ident.estimation.observations import observe
from scara_ident.motion.prepared import prepare
from tests.diagnosis.made import (
    BANDS,
    Bump,
    exact_runs,
    observed,
    periodic_run,
    step_beside,
    virtual_runs,
    with_torque,
)

VELOCITY = 0.43
CHOSEN = (Candidate(Spring(), Member(0)), Candidate(TransmissionLoss(), Member(1, (0.1,))))


def spring_runs():
    return with_torque(exact_runs(), 1, lambda motion: 0.05 * motion.q[1])


def test_refinement_finds_a_nonlinear_parameter_between_scan_points():
    runs = with_torque(
        exact_runs(), 0, lambda motion: 0.08 * np.sign(motion.v[0]) * np.exp(-((motion.v[0] / VELOCITY) ** 2))
    )
    step = step_beside(runs)
    nearest = min(Stribeck().members(step.scene), key=lambda member: abs(np.log(member.nonlinear[0] / VELOCITY)))
    (leader,) = step.judge([Candidate(Stribeck(), replace(nearest, joint=0))])
    # The other joint's scan is all but the same; the next scan point is one of the own joint's.
    assert step.scene.speed[0] == pytest.approx(step.scene.speed[1], rel=1e-3)
    (fine,) = step.refine([leader])
    assert fine.examination.gain > 2.0 * leader.examination.gain
    assert fine.candidate.member.nonlinear[0] == pytest.approx(VELOCITY, rel=0.1)
    assert fine.candidate.member.joint == 0


def test_what_is_taken_out_of_the_data_is_taken_out_of_what_effects_in_the_model_do(monkeypatch: pytest.MonkeyPatch):
    """Beside a ripple of 24 % of a UR5's elbow torque that came 1 ms early seemed 0.26 early, and stayed in the data."""
    bumps = with_torque(exact_runs(), 0, lambda motion: 3.0 * np.exp(-(((motion.q[0] - 1.5) / 0.3) ** 2)))
    step = step_beside([shifted(run, -0.004) for run in bumps], [Candidate(Bump(), Member(0, (1.5,)))])
    value, weights = value_and_weights(observed_with(step))
    step = replace(step, scene=at_estimate(step.scene, step.chosen, value), weights=weights)
    everything, (one,) = Candidate(TimeDelay(), Member(None)), step.judge([Candidate(TimeDelay(), Member(0))])
    (whole,) = step.judge([everything])
    assert whole.accepted and whole.examination.value[0] == pytest.approx(0.004, rel=0.05)
    # As it is where it is judged by columns at hand from before the effect came in.
    (later,) = step.judge([everything], step_beside([shifted(run, -0.004) for run in bumps]).scene)
    assert later.examination.value[0] == whole.examination.value[0]
    monkeypatch.setattr(TimeDelay, "of_torque", lambda *_: None)
    (base,) = step.judge([everything])
    assert base.gain < 0.5 * whole.gain
    # Of one joint it is a column of the model, by the base model's torque.
    assert step.judge([one.candidate])[0].examination.value[0] == one.examination.value[0]


def test_several_are_refined_as_each_alone():
    step = step_beside(exact_runs())
    leaders = step.judge(
        [Candidate(Stribeck(), Member(0, (0.1,))), CHOSEN[0], Candidate(Stribeck(), Member(1, (0.3,)))]
    )
    together = step.refine(leaders)
    alone = [step.refine([leader])[0] for leader in leaders]
    assert [item.candidate for item in together] == [item.candidate for item in alone]
    # Without nonlinear parameters there is nothing to refine.
    assert together[1] is leaders[1]


def test_the_best_of_each_prefers_what_may_come_in():
    step = step_beside(spring_runs())
    decisions = step.judge([Candidate(Stribeck(), Member(1, (x,))) for x in (0.1, 0.5)])
    decisions += step.judge([Candidate(Spring(), Member(j)) for j in range(2)])
    best = best_of_each(decisions)
    assert set(best) == {"stribeck of joint2", "spring of joint1", "spring of joint2"}
    assert best["spring of joint2"].accepted
    assert not best["spring of joint1"].accepted
    assert best["stribeck of joint2"].gain == max(item.gain for item in decisions[:2])
    poor = replace(best["spring of joint2"], gain=-1.0)
    assert best_of_each([replace(poor, accepted=False, gain=1.0), poor])[poor.label] is poor


def test_nothing_to_judge_gives_no_decision():
    step = step_beside(exact_runs())
    assert step.judge([]) == []
    assert step.refine([]) == []
    assert model_with(step.scene, []) is step.scene.model


def test_what_is_in_the_model_already_is_absorbed_and_without_it_is_not():
    step = step_beside(spring_runs(), CHOSEN)
    (beside,) = step.judge([CHOSEN[1]])
    assert not beside.accepted
    assert "absorbs" in beside.why
    rest = step.without(0)
    assert rest.chosen == CHOSEN[1:]
    assert step.without(1).chosen == CHOSEN[:1]
    (apart,) = step.without(1).judge([CHOSEN[1]])
    assert apart.examination.outside > 1e-4


def test_what_a_candidate_removes_is_the_difference_of_the_two_models():
    step = step_beside(spring_runs(), CHOSEN[:1])
    candidate = Candidate(Spring(), Member(1))
    (decision,) = step.judge([candidate])
    both = replace(step, chosen=(*step.chosen, candidate))
    before, after = (np.sum(item.model.squares) for item in (step, both))
    assert decision.examination.gain == pytest.approx(1.0 - after / before, rel=1e-9)
    assert_allclose(decision.examination.left, both.model.squares, rtol=1e-8)


def test_the_fitted_model_is_the_weighted_fit_of_the_model_with_effects_as_terms():
    step = step_beside(spring_runs(), CHOSEN)
    wide = observe(model_with(step.scene, CHOSEN), step.observations.data)
    assert step.model.parameters == wide.parameters
    whole = weighted(wide.by_joint, step.weights)
    assert np.sum(step.model.squares) == pytest.approx(whole.residual_sum(), rel=1e-9)
    for one, other in zip(step.model.joints, wide.joints, strict=True):
        assert_allclose(one.table, other.table, rtol=0, atol=1e-9)


def test_weights_of_the_fit_make_joints_equal():
    step = step_beside(exact_runs())
    power = [np.mean(residual**2) for residual in step.model.residual]
    assert power[0] == pytest.approx(power[1], rel=0.02)
    plain = [np.mean((residual / w) ** 2) for residual, w in zip(step.model.residual, step.weights, strict=True)]
    assert plain[0] > 3.0 * plain[1]


@pytest.mark.parametrize("runs", [2, 4])
def test_observations_with_effects_are_those_of_the_model_that_has_them(runs: int):
    step = step_beside(exact_runs()[:runs], CHOSEN)
    wide = observe(model_with(step.scene, CHOSEN), step.observations.data)
    found = observed_at_every_sample(step)
    assert found.model.names == wide.model.names
    assert_allclose(wls(found).value, wls(wide).value, rtol=1e-9)
    assert_allclose(wls(observed_with(step)).value, wls(wide).value, rtol=1e-9)
    value = wls(wide).value
    assert_allclose(found.unfiltered_rms(value), wide.unfiltered_rms(value), rtol=1e-9)
    for one, other in zip(found.predicted(value), wide.predicted(value), strict=True):
        assert_allclose(one, other, rtol=0, atol=1e-12)


def test_candidates_at_hand_are_at_the_first_scene_but_for_loads_that_are_others_now():
    step = step_beside(exact_runs(), [Candidate(Spring(), Member(1))])
    held = ModelledEffect(Spring(), Member(1), (0.5,))
    later = replace(step, scene=replace(step.scene, value=1.1 * step.scene.value, link_torques=(held,)))
    candidates = [Candidate(TransmissionLoss(), Member(j, (0.1,))) for j in (0, 1)] + [
        Candidate(BaseTilt(), Member(None))
    ]
    found = later.rows_at_hand(step.scene, candidates)
    first, now = (later.rows(scene, candidates) for scene in (step.scene, later.scene))
    # The spring loads the second joint alone.
    assert [own is one for own, one in zip(found, first, strict=True)] == [True, False, True]
    assert found[1] is now[1]
    assert all(own is one for own, one in zip(step.rows_at_hand(step.scene, candidates), first, strict=True))
    (told,) = later.judge(candidates[1:2], step.scene)
    assert_array_equal(told.examination.value, later.judge(candidates[1:2])[0].examination.value)


def test_trajectories_are_the_folds():
    seen = observed(exact_runs())
    assert_array_equal(np.unique(seen.owner), range(4))
    assert np.all(np.diff(seen.owner) >= 0)
    assert_array_equal(folds_of(seen.data, seen.owner, np.arange(len(seen.owner)), 4), seen.owner // 2)


def test_parts_of_the_only_trajectory_are_its_folds():
    seen = observed(exact_runs()[:1])
    fold = folds_of(seen.data, seen.owner, np.arange(len(seen.owner)), 4)
    assert_array_equal(np.unique(fold), range(4))
    assert np.all(np.diff(fold) >= 0)
    assert np.ptp(np.bincount(fold)) <= 1
    # Fewer blocks than parts leave parts empty, not folds out of range.
    assert folds_of(seen.data, seen.owner[:2], np.arange(2), 4).max() < 4


def test_repetitions_of_the_only_trajectory_are_parted_alike():
    # Else what one shows is held out by showing it again, and an effect that stands for the motion itself is believed.
    seen = observed(exact_runs()[:2])
    fold = folds_of(seen.data, seen.owner, np.arange(len(seen.owner)), 4)
    first, second = fold[seen.owner == 0], fold[seen.owner == 1]
    assert_array_equal(np.unique(first), range(4))
    assert_array_equal(first, second)


def test_periods_of_the_only_recording_are_parted_alike():
    """A false effect of a UR5 was shown to every period by the other three (one file, 23 s of a motion of 5.8 s)."""
    seen = observed([periodic_run()])
    moments = moments_of(seen.data)
    assert len(moments) == len(seen.owner)
    assert len(np.unique(moments)) < 0.4 * len(moments)
    fold = folds_of(seen.data, seen.owner, np.arange(len(seen.owner)), 4)
    assert_array_equal(np.unique(fold), range(4))
    for moment in np.unique(moments):
        assert len(np.unique(fold[moments == moment])) == 1
    # Without periods each block is a moment of its own.
    seen = observed(exact_runs()[:2])
    assert_array_equal(moments_of(seen.data), np.tile(np.arange(len(seen.owner) // 2), 2))


def test_blocks_without_any_row_are_left_out():
    first, second = exact_runs()[:2]
    position = first.position.copy()
    position[:, 1000:1600] = position[:, 1000:1001]
    position[:, 1600:] += position[:, 1000:1001] - position[:, 1600:1601]
    seen = observe(observed([second]).model, prepare([replace(first, position=position), second], BANDS))
    rows = sum(np.diff(joint.starts) for joint in seen.joints)
    assert np.any(rows == 0)
    step = step_beside([replace(first, position=position), second])
    assert len(step.model.owner) == np.count_nonzero(rows)
    assert all(len(joint.starts) == np.count_nonzero(rows) + 1 for joint in step.model.joints)
    assert [joint.table.shape for joint in step.model.joints] == [joint.table.shape for joint in seen.joints]
    assert_allclose(np.sum(step.model.squares), weighted(seen.by_joint, step.weights).residual_sum(), rtol=1e-9)


def test_a_step_that_is_left_forgets_its_twin_with_more_noise():
    step = step_beside(exact_runs()[:2])
    twin = step.noisier
    assert step.noisier is twin
    step.lean()
    assert step.noisier is not twin
    assert_array_equal(step.noisier.model.root, twin.model.root)


def test_the_scene_of_a_step_has_the_members_that_act_together_and_no_others():
    family = JointElasticity()
    first, second = (Candidate(family, Member(j, (9.0, 0.2))) for j in (0, 1))
    spring = Candidate(Spring(), Member(0))
    step = step_beside(exact_runs(), [second, spring, first])
    assert step.scene.together == ((family, first.member), (family, second.member))
    left = step.without(0)
    assert left.scene.together == ((family, first.member),)
    # Beside it the other is what it changes, with which both are what they are together.
    apart = left.columns.rows(left.scene, [first, second])
    both = step.columns.rows(step.scene, [first, second])
    stiffness = [1.0 / family.tie(step.scene, item.member).value for item in (first, second)]
    for joint in range(2):
        whole = sum(rows[joint] / k for rows, k in zip(both, stiffness, strict=True))
        assert_allclose(sum(rows[joint] / k for rows, k in zip(apart, stiffness, strict=True)), whole, atol=1e-9)
    assert left.without(1).scene.together == ()


def test_candidates_at_hand_that_act_together_with_effects_in_the_model_are_those_beside_them():
    family = JointElasticity()
    other = Candidate(family, Member(1, (9.0, 0.2)))
    alone = step_beside(exact_runs(), [])
    step = replace(alone, chosen=(Candidate(family, Member(0, (9.0, 0.2))),))
    (beside,), (first,) = step.rows_at_hand(alone.scene, [other]), alone.rows_at_hand(alone.scene, [other])
    assert np.abs(beside[0] - first[0]).max() > 0.01 * np.abs(first[0]).max()
    assert_array_equal(beside[0], step.rows(step.scene, [other])[0][0])


def test_what_an_arm_can_have_is_judged_beside_the_effects_in_the_model():
    """Dry friction that builds up over a distance was refused as too much, beside friction at low speed that does so too."""
    runs = virtual_runs("presliding:joint2:presliding_distance=0.01", "stribeck:joint2:amplitude=0.176:velocity=0.3")
    chosen = (Candidate(Stribeck(), Member(1, (0.3,))), Candidate(Presliding(), Member(1, (0.01,))))
    beside = step_beside(runs, chosen).without(1)
    (decision,) = beside.judge(chosen[1:])
    assert decision.accepted, decision.why
    found, scene = decision.examination, beside.scene
    coulomb = found.model_value[friction_places(scene, 1)[0]]
    # By more than chance.
    assert found.value[0] - 2.0 * np.sqrt(found.covariance[0, 0]) > 1.5 * coulomb
    assert found.value[0] < 1.5 * (coulomb + found.model_value[len(scene.value)])
    # What it is judged beside is known to the judgement alone.
    assert scene.beside == ()
