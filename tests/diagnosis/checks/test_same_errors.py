"""Two models that leave as much are the same, and one that leaves more is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scara_ident.diagnosis.candidates.candidates import Candidate
from scara_ident.diagnosis.checks.same_errors import same
from scara_ident.effects import Member
from scara_ident.effects.friction import AsymmetricFriction
from scara_ident.effects.position import Spring
from tests.diagnosis.made import Bent, exact_runs, step_beside, with_torque

SPRING = Candidate(Spring(), Member(0))


def test_what_chance_makes_is_no_difference_and_what_one_lacks_is():
    step = step_beside(with_torque(exact_runs(size=0.3), 0, lambda motion: 0.08 * (motion.q[0] - 1.57)))
    spring, bent, other = step.judge([SPRING, Candidate(Bent(), Member(0)), Candidate(AsymmetricFriction(), Member(0))])
    assert not np.array_equal(spring.examination.left, bent.examination.left)
    assert same((step, spring), (step, bent)) and same((step, bent), (step, spring))
    assert not same((step, spring), (step, other)) and not same((step, other), (step, spring))


def test_rounding_is_no_difference():
    """Of exact recordings two models of one span were another on one machine, by 1e-12 of what either removes in every block."""
    step = step_beside(with_torque(exact_runs(), 0, lambda motion: 0.08 * (motion.q[0] - 1.57)))
    (spring,) = step.judge([SPRING])
    left = spring.examination.left
    for share, alike in ((1e-12, True), (1e-6, False)):
        more = left + share * float(np.sum(step.model.squares)) / len(left)
        other = replace(spring, examination=replace(spring.examination, left=more))
        assert same((step, spring), (step, other)) is alike
