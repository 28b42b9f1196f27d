"""The last look: what stands beside all that was found stays, what does not is demoted with why."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.diagnosis import audit
from scara_ident.diagnosis.audit import outdone, uncertain, unsettled
from scara_ident.diagnosis.candidate_tests import Examination
from scara_ident.diagnosis.candidates import Candidate
from scara_ident.diagnosis.criteria import CRITERIA
from scara_ident.diagnosis.diagnose import diagnose
from scara_ident.diagnosis.effect_parameters import Coefficients
from scara_ident.effects import Member
from scara_ident.effects.friction import AsymmetricFriction
from scara_ident.effects.position import Spring
from scara_ident.robot.robot import load_robot
from tests.diagnosis.made import BANDS, exact_runs, searched, with_torque
from tests.estimation.test_run_variation import runs


def examined(freedom: float, size: int) -> Examination:
    """An examination of which only these are asked."""
    nothing = np.zeros(size)
    return Examination(
        nothing, nothing, np.eye(size), 0.0, 1.0, 0.5, 0.5, (), 1.0, nothing, nothing, np.eye(size), freedom
    )  # fmt: skip


@pytest.mark.parametrize(
    ("value", "covariance", "freedom", "stands"),
    [
        ([3.2], [[1.0]], 200.0, True),
        ([-2.8], [[1.0]], 200.0, False),
        # Few blocks know a standard deviation badly.
        ([3.2], [[1.0]], 5.0, False),
        ([3.2], [[np.inf]], 200.0, False),
        # Together beyond doubt, though neither alone; and no more sure for a second that says nothing.
        ([2.6, 2.6], np.eye(2), 500.0, True),
        ([3.0, 3.0], [[1.0, 0.95], [0.95, 1.0]], 500.0, False),
        ([0.5, -0.5], [[1.0, 0.99], [0.99, 1.0]], 500.0, True),
    ],
)
def test_coefficients_are_asked_together(value: list, covariance: list, freedom: float, stands: bool):
    own = Coefficients(np.array(value), np.array(covariance))
    why = uncertain(own, examined(freedom, len(value)), slice(None), 3.0)
    assert (why is None) is stands
    assert stands or "within its uncertainty" in why


def test_only_what_is_essential_is_asked():
    # First moments that differ beyond doubt from run to run make no body without a mass.
    own = Coefficients(np.array([2.0, 9.0]), np.eye(2))
    for essential, stands in ((slice(None), True), (slice(0, 1), False), (slice(1, 2), True)):
        assert (uncertain(own, examined(100.0, 2), essential, 3.0) is None) is stands


def test_a_spring_of_the_arm_stands(monkeypatch: pytest.MonkeyPatch):
    made = with_torque(exact_runs(), 1, lambda motion: 0.05 * motion.q[1])
    found = searched(made, Spring())
    assert [item.label(found.scene) for item in found.chosen] == ["spring of joint2"]
    assert unsettled(found, found.step.weights) == []
    # Nor does anything do as well; but beside the spring itself, were it not believed, what stands for it falls.
    (spring,) = (item.decision for item in found.steps)
    assert outdone(found, found.step.weights, ()) == []
    (other,) = found.step.without(0).judge([Candidate(AsymmetricFriction(), Member(1))])
    assert other.examination.held_out < CRITERIA.least_share * spring.examination.held_out
    assert outdone(found, found.step.weights, (other,)) == []
    proxy = replace(found, step=replace(found.step, chosen=(other.candidate,)))
    (fallen,) = outdone(proxy, found.step.weights, (other.refused(""), spring.refused("")))
    assert (fallen.label, fallen.accepted, fallen.tentative) == (other.label, False, True)
    assert fallen.why == "spring of joint2, which is not believed, does as well in its place"
    # What turns within a step of the encoder is no rival: nothing real was refused.
    monkeypatch.setattr(audit, "within_a_step", lambda step, candidate: "less than a step")
    assert outdone(proxy, found.step.weights, (spring.refused(""),)) == []


def test_without_effects_there_is_nothing_to_look_at():
    found = searched(exact_runs(), Spring())
    assert not found.chosen
    assert unsettled(found, found.step.weights) == []


@pytest.mark.slow
def test_where_the_best_is_refused_the_next_best_is_tried():
    # Delays by run come first and are refused; the spring is there all the same.
    made = with_torque(runs(np.random.default_rng(8), (0.0, 0.0, 0.0, 0.004)), 1, lambda motion: 0.01 * motion.q[1])
    result = diagnose(load_robot(), made, bands=BANDS)
    assert [(item.effect, item.joint) for item in result.effects] == [("spring", "joint2")]
