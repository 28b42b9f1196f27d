"""The last look: what stands beside all that was found stays, what does not is demoted with why."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.diagnosis.audit import uncertain, unsettled
from scara_ident.diagnosis.candidates import Candidate
from scara_ident.diagnosis.diagnose import diagnose
from scara_ident.effects import Member, Parameter
from scara_ident.effects.elasticity import JointElasticity
from scara_ident.effects.position import Spring
from scara_ident.robot.robot import load_robot
from tests.diagnosis.made import BANDS, exact_runs, searched, with_torque
from tests.estimation.test_run_variation import runs


def test_a_size_within_its_uncertainty_is_none():
    elastic = Candidate(JointElasticity(), Member(0, (10.0, 0.1)))
    surely = {"stiffness": Parameter(3e4, 1e3, "N m/rad"), "frequency": Parameter(10.0, 9.0, "Hz")}
    hardly = {"stiffness": Parameter(3e4, 1.4e4, "N m/rad"), "frequency": Parameter(10.0, 0.1, "Hz")}
    assert uncertain(elastic, surely, 2.5) is None
    # That its frequency is sure does not make it large.
    why = uncertain(elastic, hardly, 2.5)
    assert why is not None
    assert "stiffness" in why
    assert uncertain(elastic, {"stiffness": Parameter(3e4, np.inf, "N m/rad")}, 2.5) is not None


def test_a_spring_of_the_arm_stands():
    made = with_torque(exact_runs(), 1, lambda motion: 0.05 * motion.q[1])
    found = searched(made, Spring())
    assert [item.label(found.scene) for item in found.chosen] == ["spring of joint2"]
    assert unsettled(found, found.step.weights) == []


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
