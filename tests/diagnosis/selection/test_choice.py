"""What comes in next: which grid points are worth a fit, and what a fit shows."""

from __future__ import annotations

import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from scara_ident.diagnosis.candidates.candidates import Candidate, CandidateColumns
from scara_ident.diagnosis.criteria import CRITERIA
from scara_ident.diagnosis.fitting.correction import Correction
from scara_ident.diagnosis.fitting.nonlinear_fit import tune
from scara_ident.diagnosis.selection.choice import (
    _by_other_laws,
    _each_fitted,
    _left_again,
    _min_left,
    _plainer_first,
    _sure_once_refined,
    _worth_fitting,
    choose,
    fitted_beside,
)
from scara_ident.diagnosis.testing.selection_step import SelectionStep, moved_together
from scara_ident.effects import Interval, Member
from scara_ident.effects.elasticity import JointElasticity
from scara_ident.effects.friction import Stribeck
from scara_ident.effects.gear import TransmissionLoss
from scara_ident.effects.measurement import TimeDelay, shifted
from scara_ident.effects.payload import PayloadChange
from scara_ident.effects.payload_intervals import PayloadInIntervals
from scara_ident.effects.position import Spring
from scara_ident.simulation import parse_effect, simulate, virtual_arm
from tests.diagnosis.made import NOISE, exact_runs, multisine, step_beside, with_torque
from tests.effects.intervals import SECONDS, arms, runs, seen


def test_what_is_sure_only_beside_its_grid_point_is_refined_before_it_is_refused():
    def dip(motion):
        return 0.1 * np.sign(motion.v[0]) * np.exp(-((motion.v[0] / 0.43) ** 2))

    step = step_beside(with_torque(exact_runs(), 0, dip))
    members = [item for item in Stribeck().members(step.scene) if item.joint == 0]
    grid = max(step.judge([Candidate(Stribeck(), item) for item in members]), key=lambda item: item.gain)
    (fine,) = step.refine([grid])
    between = np.sqrt(grid.examination.p_value * fine.examination.p_value)
    strict = replace(step, tried=int(step.criteria.family_error / between))
    (refused,) = strict.judge([grid.candidate])
    assert refused.tentative and not refused.accepted
    (found,) = _sure_once_refined(strict, [refused], 0.0)
    assert found.accepted and found.candidate.member.nonlinear[0] == pytest.approx(0.43, rel=0.1)
    # Where something else removes much more it is not its turn.
    assert _sure_once_refined(strict, [refused], 2.0) == []


def point(label: str, gain: float, p_value: float):
    """Return a decision on a grid point of a family of one letter on a joint."""
    effect = SimpleNamespace(effect=SimpleNamespace(name=label[0]))
    examination = SimpleNamespace(p_value=p_value)
    return SimpleNamespace(candidate=effect, label=label, gain=gain, examination=examination, accepted=False)


def test_what_an_effect_may_stand_for_on_another_joint_is_fitted_beside_it():
    """An elastic second joint was believed where the first was, whose grid point chance might have brought."""

    other, first, faint = point("a1", 0.16, 3e-9), point("a2", 0.13, 0.13), point("a3", 0.05, 0.13)
    beside = point("b1", 0.15, 0.13)
    assert _worth_fitting([faint, first, beside, other], 0.1, 100, CRITERIA) == [other, first]
    # It may gain next to nothing there, and most once it is fitted.
    assert _worth_fitting([faint, beside, other], 0.1, 100, CRITERIA) == [other, faint]
    # Alone it is not worth a fit.
    assert _worth_fitting([first, beside], 0.1, 100, CRITERIA) == []
    # Unless it removes most: of an elastic first joint on moves with dwells chance might have brought 71 %.
    most = point("a2", 0.71, 0.13)
    assert _worth_fitting([first, beside, most], 0.1, 100, CRITERIA) == [most]


def test_a_resonance_that_one_grid_point_shows_large_and_another_sure_is_fitted():
    """At 20,000 N m/rad, with little damping, the point that removed most was unsure, and a sure one removed too little."""
    large, sure, other = point("a1", 0.091, 0.033), point("a1", 0.027, 1.4e-4), point("a2", 0.005, 0.13)
    assert _worth_fitting([sure, other, large], CRITERIA.min_gain, 116, CRITERIA) == [large, other]
    # Sure of the other joint alone, for which it may stand.
    sure = point("a2", 0.027, 1.4e-4)
    assert _worth_fitting([large, sure], CRITERIA.min_gain, 116, CRITERIA) == [large, sure]
    # A point that makes things worse is sure of nothing, and none may be large enough.
    assert _worth_fitting([large, point("a1", -0.1, 1e-9)], CRITERIA.min_gain, 116, CRITERIA) == []
    assert _worth_fitting([sure, other], CRITERIA.min_gain, 116, CRITERIA) == []


def test_what_takes_the_place_of_an_effect_in_the_model_does_not_come_in(monkeypatch):
    """An elastic first joint was dropped again for the second, fitted with it so that it explained nothing any more."""
    held, spoilt = Candidate(Spring(), Member(1)), Candidate(Stribeck(), Member(0, (0.3,)))
    step = step_beside(with_torque(exact_runs(), 1, lambda motion: 0.05 * motion.q[1]), [held])
    (promised,) = replace(step, chosen=()).judge([held])
    monkeypatch.setattr(
        sys.modules[fitted_beside.__module__], "tune", lambda step, **_: replace(step, chosen=(spoilt, held))
    )
    ((own, decision),) = fitted_beside(step, [promised], 0.0, None)
    assert own.chosen == (spoilt,)
    assert decision.gain > 0.5
    assert (decision.accepted, decision.why) == (False, "takes the place of an effect in the model")


def test_a_coarse_fit_that_seems_to_take_the_place_of_another_is_finished_first(monkeypatch):
    """A second elastic joint of 2400 N m/rad was refused where a coarse fit ended on the way to it, and the first was 864 for 900."""
    asked = []

    def fitted(step, candidate, *, coarse=False):
        asked.append(coarse)
        return SimpleNamespace(scene=SimpleNamespace(together=(1,))), SimpleNamespace(
            accepted=not coarse, candidate=candidate
        )

    module = sys.modules[fitted_beside.__module__]
    monkeypatch.setattr(module, "fitted_with", fitted)
    monkeypatch.setattr(module, "_if_more", lambda step, decision: decision)
    for effect, coarse in ((JointElasticity(), [True, False]), (Stribeck(), [True])):
        item = SimpleNamespace(label="a1", candidate=Candidate(effect, Member(1, (9.0, 0.1))))
        ((_, decision),) = _each_fitted(None, [item], [item], None)
        assert decision.accepted == (len(coarse) > 1) and asked == coarse
        asked.clear()


def test_what_was_fitted_is_fitted_by_its_other_law_from_there_and_left_out_where_that_is_refused(monkeypatch):
    """A gear's loss without a gain of second order had one all the same, and a scale of the torque beside it."""
    asked, module = [], sys.modules[fitted_beside.__module__]

    def fitted(step, candidate, *, coarse=False):
        asked.append((step, candidate, coarse))
        return "refitted", SimpleNamespace(candidate=candidate, accepted=candidate.member.place == 1)

    monkeypatch.setattr(module, "fitted_with", fitted)
    monkeypatch.setattr(module, "_if_more", lambda step, decision: decision)
    candidates = [Candidate(effect, Member(j, (0.2,))) for effect, j in ((TransmissionLoss(), 1), (Spring(), 1))]
    candidates += [Candidate(TransmissionLoss(1), Member(0, (0.1,)))]
    found = _by_other_laws(None, [(str(k), SimpleNamespace(candidate=item)) for k, item in enumerate(candidates)])
    others = [replace(candidates[0], effect=TransmissionLoss(1)), replace(candidates[2], effect=TransmissionLoss())]
    assert asked == [("0", others[0], True), ("2", others[1], True)]
    assert [(own, item.candidate) for own, item in found] == [("refitted", others[0])]


def test_of_the_same_effects_the_fit_that_leaves_least_is_taken_whatever_the_last_gains_in_it():
    """Beside a first gear in a wrong minimum a second one gained all: 3433 for 15 500 N m/rad."""

    def fit(label: str, beside: str, left: float, gain: float) -> tuple:
        decision = SimpleNamespace(label=label, gain=gain, examination=SimpleNamespace(left=np.array([left, 1.0])))
        return SimpleNamespace(scene=None, chosen=[SimpleNamespace(label=lambda _: beside)]), decision

    wrong, right, other = fit("a2", "a1", 90.0, 0.9), fit("a1", "a2", 20.0, 0.3), fit("a3", "a1", 50.0, 0.8)
    assert _min_left([wrong, other, right]) == [right, other]


@pytest.mark.parametrize(("last", "plain"), [(4.0, True), (6.3, False)])
def test_what_all_runs_take_up_at_one_time_is_no_list_of_intervals(last: float, plain: bool, tmp_path):
    """Their ends, told by all rows, do a little better on those held out than one instant (gallery: 6 intervals for one)."""
    robots, starts = arms(tmp_path), (4.0, 4.0, last)
    scene, observations = seen(robots[0], runs(robots, {f"m{k}_1": ((t, SECONDS),) for k, t in enumerate(starts)}))
    step = SelectionStep(scene, CandidateColumns(observations), (), np.full(2, 20.0), 10, CRITERIA)
    intervals = tuple(Interval(k, t, SECONDS) for k, t in enumerate(starts))
    asked = [(PayloadInIntervals(), Member(None, intervals=intervals)), (PayloadChange(), Member(None, (4.0,)))]
    within, once, spring = step.judge([*(Candidate(*item) for item in asked), Candidate(Spring(), Member(0))])
    order = [(step, spring), (step, within), (step, once)]
    assert _plainer_first(order) == ([order[0], order[2], order[1]] if plain else order)
    assert _plainer_first([(step, once), (step, within)]) == [(step, once), (step, within)]


@pytest.mark.parametrize("alike", [True, False])
def test_a_law_is_that_of_the_name_unless_it_is_reported(alike: bool, monkeypatch):
    """Of a gallery's gear with an efficiency the loss was by the law without, which left next to nothing less."""
    monkeypatch.setattr(sys.modules[choose.__module__], "same", lambda own, other: alike)
    laws = [(TransmissionLoss(1), "a1"), (TransmissionLoss(), "a2"), (Spring(), "b1"), (TransmissionLoss(), "a1")]
    order = [(None, SimpleNamespace(candidate=Candidate(law, Member(0)), label=label)) for law, label in laws]
    assert _plainer_first(order) == ([order[3], *order[:3]] if alike else order)
    assert _plainer_first(order[::-1]) == order[::-1]


@pytest.mark.parametrize(("left", "there"), [(0.02, True), (0.96, False)])
def test_little_of_a_delay_is_left_once_it_is_taken_out(left: float, there: bool, monkeypatch):
    """On a UR5 of 13 bits as much was left of 7 ms that no joint was late by; of true ones 0 to 8 % are."""
    step = step_beside([shifted(run, 0.006) for run in exact_runs()])
    (decision,) = step.judge([Candidate(TimeDelay(), Member(None))])
    assert decision.accepted and _left_again(step, decision) is None
    whole = Correction(decision.candidate, (1.0 + left) * decision.examination.value, ())
    monkeypatch.setattr(sys.modules[fitted_beside.__module__], "taken_out", lambda step, _: (step.columns, whole))
    said = _left_again(step, decision)
    assert (said is None) == there
    assert there or "removed from the data until nothing of it is left" in said
    # Of what stays in the model nothing is taken out.
    (spring,) = step.judge([Candidate(Spring(), Member(1))])
    assert _left_again(step, spring) is None


def test_what_noise_of_positions_hides_of_a_delay_may_be_left_once_it_is_taken_out():
    """Of 4 ms a UR5 of 18 bits seemed to have 2.3, and 3.9 until nothing was left: half of the column was noise."""
    rng, size = np.random.default_rng(5), 7e-5
    late = [shifted(run, -0.008) for run in exact_runs()]
    step = step_beside(
        [replace(run, position=run.position + size * rng.standard_normal(run.position.shape)) for run in late]
    )
    (decision,) = step.judge([Candidate(TimeDelay(), Member(None))])
    assert decision.accepted and _left_again(step, decision) is None
    assert decision.examination.value[0] < 0.5 * 0.008
    # Without noise in the column as much is left of nothing that is there.
    clean = replace(step)
    clean.__dict__["noisier"] = step
    assert "removed from the data until nothing of it is left" in (_left_again(clean, decision) or "")


@pytest.mark.slow
def test_a_gear_that_took_up_what_two_do_gives_way_to_both():
    arm, family = replace(virtual_arm(), torque_noise=np.array(NOISE)), JointElasticity()
    effects = [parse_effect(f"joint_elasticity:{j}:stiffness={k}") for j, k in (("joint1", 6000), ("joint2", 1500))]
    runs = [simulate(arm, multisine(f"F{k}", k, 9.0), effects=effects, seed=k, rate=500.0).recording for k in (1, 2, 3)]
    step = tune(step_beside(runs, [Candidate(family, Member(0, (6.0, 0.1)))], bands=(15.0, 15.0)))
    (alone,) = step.chosen
    # Below that of the gear that is there, 7.2 Hz.
    assert alone.member.nonlinear[0] < 6.5
    decisions = step.judge([Candidate(family, member) for member in family.members(step.scene) if member.joint == 1])
    winner, _, scene = choose(step, decisions, None)
    assert winner is not None and winner.candidate.member.joint == 1
    both = tune(replace(step, scene=scene, chosen=(*moved_together(step.chosen, scene), winner.candidate)))
    found = [1.0 / family.tie(both.scene, item.member).value for item in both.chosen]
    assert found == pytest.approx([6000.0, 1500.0], rel=0.05)
