"""Every reason to keep an effect out, in words."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.diagnosis.candidates.candidates import Candidate
from scara_ident.diagnosis.criteria import CRITERIA
from scara_ident.diagnosis.testing.acceptance import Decision, decide, displacement
from scara_ident.diagnosis.testing.candidate_tests import Examination
from scara_ident.effects import Member
from scara_ident.effects.elasticity import JointElasticity
from scara_ident.effects.friction import AsymmetricFriction
from scara_ident.effects.gear import TransmissionLoss
from scara_ident.effects.measurement import TimeDelay
from scara_ident.effects.position import Spring
from scara_ident.robot.robot import load_robot
from tests.effects.scenes import scene_of

SCENE = scene_of(load_robot())
SPRING = Candidate(Spring(), Member(0))
GOOD = Examination(
    value=np.array([0.05, 0.0]),
    tested=np.array([0.05, 0.0]),
    covariance=np.diag([1e-6, 1e-6]),
    p_value=1e-12,
    outside=0.5,
    gain=0.3,
    held_out=0.2,
    fold_gains=(0.2, 0.2, 0.2, None),
    model_value=SCENE.value,
    left=np.ones(4),
    products=np.eye(2),
    freedom=30.0,
)


def decided(candidate: Candidate, item: Examination, tried: int, gain: float = 0.4) -> Decision:
    return decide(candidate, item, gain, SCENE, tried, CRITERIA)


class Asks(Spring):
    """One that an arm can have beside a friction of at least 0.3 alone."""

    def inadmissible(self, scene, member, value, std):
        known = [item.value[0] for item in scene.beside if item.effect == AsymmetricFriction()]
        return None if known and min(known) >= 0.3 else "without friction"


def test_what_an_arm_can_have_is_asked_beside_the_effects_in_the_model_as_they_are_fitted_with_it():
    chosen = (Candidate(Spring(), Member(1)), Candidate(AsymmetricFriction(), Member(0)))
    item = Candidate(Asks(), Member(0))
    for friction, why in ((0.3, None), (0.2, "without friction")):
        of_spring = np.full(len(Spring().columns(SCENE, Member(1))), 0.25)
        found = replace(GOOD, model_value=np.array([*SCENE.value, *of_spring, friction]))
        decision = decide(item, found, 0.4, SCENE, 100, CRITERIA, chosen)
        assert decision.accepted is (why is None)
        assert why is None or decision.why == why
    assert decide(item, GOOD, 0.4, SCENE, 100, CRITERIA).why == "without friction"
    assert SCENE.beside == ()


def test_a_good_candidate_comes_in_and_its_gain_is_reported():
    decision = decided(SPRING, GOOD, 100)
    assert decision.accepted
    assert decision.gain == pytest.approx(0.4)
    assert "40.0%" in decision.why
    assert decision.label == "spring of joint1"


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"outside": 1e-9}, "absorbs"),
        ({"outside": 1e-4}, "lies outside the model"),
        ({"p_value": 2.0 * CRITERIA.family_error / 100}, "may be chance"),
        ({"value": np.array([-0.05, 0.0])}, "push away"),
        ({"fold_gains": (0.5, -0.1, 0.2, None)}, "helps in only 2 of 3"),
    ],
)
def test_each_failed_condition_is_said_in_words(change: dict, why: str):
    decision = decided(SPRING, replace(GOOD, **change), 100)
    assert not decision.accepted
    assert why in decision.why


def test_a_coefficient_within_two_deviations_of_what_is_possible_is_possible():
    loss = Candidate(TransmissionLoss(), Member(1, (0.05,)))
    for value, accepted in ((-0.019, True), (-0.021, False)):
        item = replace(GOOD, value=np.array([value]), covariance=np.array([[1e-4]]))
        decision = decided(loss, item, 10)
        assert decision.accepted is accepted
    assert "cannot give energy" in decision.why


def test_the_p_value_is_corrected_for_what_was_tried():
    item = replace(GOOD, p_value=0.01 * CRITERIA.family_error)
    assert decided(SPRING, item, 50).accepted
    assert not decided(SPRING, item, 200).accepted


def test_what_is_worth_a_look_may_be_chance_and_is_not_said_to_have_a_p_value_of_one():
    look = decided(SPRING, replace(GOOD, p_value=0.008), 200)
    assert look.tentative
    assert look.why == ("may be chance: p = 8.0e-03 by itself, but with 200 candidates tried 1.0e-05 is required")
    other = decided(SPRING, replace(GOOD, p_value=0.02), 20)
    assert not other.tentative
    assert other.why == "not significant: p = 4.0e-01 over the 20 candidates tried, 0.002 is required"


def test_a_joints_own_delay_of_less_than_a_sample_is_not_an_effect():
    delay = Candidate(TimeDelay(), Member(0))
    for value, accepted in ((0.5 / SCENE.rate, False), (4.0 / SCENE.rate, True)):
        item = replace(GOOD, value=np.array([value]), covariance=np.array([[1e-10]]))
        decision = decided(delay, item, 10)
        assert decision.accepted is accepted, decision.why


def test_a_mean_delay_is_taken_out_whichever_of_the_runs_it_helps_in():
    item = replace(GOOD, value=np.array([0.003]), covariance=np.array([[1e-8]]), fold_gains=(0.5, -0.1, 0.2))
    assert decided(Candidate(TimeDelay(), Member(None)), item, 100).accepted
    own = replace(item, value=np.array([4.0 / SCENE.rate]))
    assert "helps in only 2 of 3" in decided(Candidate(TimeDelay(), Member(0)), own, 100).why


@pytest.mark.parametrize(
    ("samples", "gain", "accepted"),
    [(1.5, 0.016, True), (0.5, 0.016, True), (1.5, -0.01, False), (0.5, -0.01, False), (0.001, 0.016, False)],
)
def test_a_mean_delay_that_is_sure_is_taken_out_however_little_it_removes(samples: float, gain: float, accepted: bool):
    """4.5 ms of a UR5 removed 1.6 % at p = 1e-29, and left in it made parameters 6 standard deviations wrong.

    So did 0.4 ms of a Panda whose commands were held for a millisecond, with 3.6 %. What is settled is not corrected.
    """
    value = np.array([samples / SCENE.rate])
    item = replace(GOOD, value=value, tested=value, covariance=np.array([[1e-14]]))
    decision = decided(Candidate(TimeDelay(), Member(None)), item, 100, gain)
    assert decision.accepted is accepted
    assert accepted or "below the detection limit" in decision.why


def test_less_than_a_sample_is_taken_out_where_the_parameters_are_off_by_more_than_they_are_unsure():
    count = len(SCENE.value)
    for square, inside, accepted in ((0.9, 0.5, False), (1.1, 0.5, True), (8.0, 0.1, False), (10.0, 0.1, True)):
        value = np.array([0.5 / SCENE.rate])
        item = replace(GOOD, value=value, tested=value, outside=1.0 - inside)
        item = replace(item, covariance=value[:, None] ** 2 / (square * count))
        decision = decided(Candidate(TimeDelay(), Member(None)), item, 100, 0.016)
        assert decision.accepted is accepted
        assert accepted or "below the detection limit: removes 1.6%" in decision.why
        # Of more than a sample, and of what removes as much as any effect has to, it is not asked.
        longer = replace(item, value=3.0 * value)
        assert decided(Candidate(TimeDelay(), Member(None)), longer, 100, 0.016).accepted
        assert decided(Candidate(TimeDelay(), Member(None)), item, 100, 0.06).accepted


def test_displacement_is_that_of_the_parameters_in_their_standard_deviations():
    rng = np.random.default_rng(3)
    model, own = rng.standard_normal((200, 5)), rng.standard_normal((200, 1))
    own += model[:, :1]
    torque = model @ np.arange(5.0) + 0.3 * own[:, 0] + 0.1 * rng.standard_normal(200)
    left = own - model @ np.linalg.lstsq(model, own)[0]
    products, variance = left.T @ left, 0.01
    value = np.linalg.solve(products, left.T @ torque)
    with_it = np.linalg.lstsq(np.hstack([model, own]), torque)[0][:5]
    off = np.linalg.lstsq(model, torque)[0] - with_it
    covariance, outside = variance * np.linalg.inv(products), float(products[0, 0] / np.sum(own**2))
    item = replace(GOOD, tested=value, covariance=covariance, outside=outside, model_value=with_it)
    assert displacement(item) == pytest.approx(off @ (model.T @ model) @ off / variance / 5)
    assert displacement(replace(item, covariance=np.full((1, 1), np.inf))) == 0.0
    assert displacement(replace(item, outside=0.0)) == 0.0


@pytest.mark.parametrize(("gain", "removes"), [(0.04, "4.0%"), (-0.5, "0.0%")])
def test_too_small_a_gain_is_below_the_detection_limit(gain: float, removes: str):
    assert decided(SPRING, GOOD, 100, gain).why.startswith(f"below the detection limit: removes {removes}")


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"min_outside": 0.6}, "lies outside the model"),
        ({"family_error": 1e-11}, "may be chance"),
        ({"min_gain": 0.5}, "below the detection limit: removes 40.0% of the squared residual, 50% is required"),
    ],
)
def test_the_numbers_are_those_of_the_criteria(change: dict, why: str):
    decision = decide(SPRING, GOOD, 0.4, SCENE, 100, replace(CRITERIA, **change))
    assert not decision.accepted
    assert why in decision.why


def test_votes_are_asked_as_the_criteria_say():
    item = replace(GOOD, fold_gains=(0.5, -0.1, 0.2, None))
    assert decide(SPRING, item, 0.4, SCENE, 100, replace(CRITERIA, min_votes=0.6)).accepted


def test_what_fits_with_an_impossible_sign_only_has_no_gain_and_no_significance():
    """An elastic gear with negative stiffness, which position noise resembles, stood there with p = 1e-50."""
    item = replace(GOOD, value=np.array([-1e-4]), covariance=np.array([[1e-12]]), p_value=1e-50)
    decision = decided(Candidate(JointElasticity(), Member(0, (30.0, 0.2))), item, 100)
    assert (decision.accepted, decision.gain, decision.examination.p_value) == (False, 0.0, 1.0)
    assert decision.why == "its compliance would be negative: the link would move ahead of its motor"
    # Two coefficients, of which one has an impossible sign, say more than that.
    assert decided(SPRING, replace(GOOD, value=np.array([-0.05, 0.0])), 100).gain == 0.4


def test_what_removes_most_of_what_is_left_is_no_small_error_of_the_model():
    """A spring on a joint that carries its weight lay 2e-4 outside the model and removed 68 % with p = 1e-42: it was not named."""
    faint = replace(GOOD, outside=2e-4)
    assert decided(SPRING, faint, 100, gain=CRITERIA.dominant).accepted
    below = decided(SPRING, faint, 100, gain=0.9 * CRITERIA.dominant)
    assert not below.accepted and below.tentative and "small errors" in below.why
    # Where only rounding is left of it, nothing that it removes says anything.
    assert not decided(SPRING, replace(GOOD, outside=1e-9), 100, gain=0.9).accepted
    # Nor what no arm has.
    assert not decided(SPRING, replace(faint, value=np.array([-0.05, 0.0])), 100, gain=0.9).tentative


@pytest.mark.parametrize(
    ("fold_gains", "gain", "accepted"),
    [
        ((0.5, -0.1, 0.2, None), 0.6, True),
        ((0.5, -0.1, 0.2, None), 0.4, False),
        ((0.5, -0.1, None, None), 0.6, False),
        ((0.5, -0.1, -0.2, 0.9), 0.6, False),
    ],
)
def test_one_of_few_trajectories_does_not_outvote_what_removes_most(
    fold_gains: tuple[float | None, ...], gain: float, accepted: bool
):
    assert decided(SPRING, replace(GOOD, fold_gains=fold_gains), 100, gain=gain).accepted is accepted


def test_what_goes_as_an_effect_that_no_arm_has_is_kept_with_its_gain():
    """A spring that pushes removed 94 % of what repeated, and the sentence said that filters may leave as much."""
    pushing = replace(GOOD, value=np.array([-0.05, 0.0]), tested=np.array([-0.05, 0.0]))
    assert decided(SPRING, pushing, 100, 0.94).as_no_arm == pytest.approx(0.94)
    assert decided(SPRING, GOOD, 100, 0.94).as_no_arm == 0.0
    for change in ({"p_value": 0.01}, {"outside": 1e-9}, {"fold_gains": (0.5, -0.1, -0.1, None)}):
        assert decided(SPRING, replace(pushing, **change), 100, 0.4).as_no_arm == 0.0
    # One coefficient alone has no gain and no significance, and is kept all the same.
    alone = replace(pushing, value=np.array([-0.5]), tested=np.array([-0.5]), covariance=np.array([[1e-6]]))
    loss = decided(Candidate(TransmissionLoss(), Member(0, (0.5,))), alone, 100, 0.94)
    assert (loss.gain, loss.as_no_arm) == (0.0, pytest.approx(0.94))
