"""Friction that gives energy within the speeds recorded, and how surely."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.estimation import wls
from scara_ident.estimation.pushing import pushes
from tests.diagnosis.made import exact_runs, observed, with_torque


def test_an_arm_pushes_nowhere():
    training = observed(list(exact_runs()))
    assert pushes(wls(training), training) == (None, None)


@pytest.mark.parametrize("joint", [0, 1])
def test_where_viscous_friction_is_turned_round_it_pushes_most_surely_where_it_is_determined_best(joint: int):
    """The law of the formulas less four times the speed, at the speed told: closed form."""
    training = observed(with_torque(exact_runs(), joint, lambda motion: -4.0 * motion.v[joint]))
    estimate = wls(training)
    found = pushes(estimate, training)
    push, other = found[joint], found[1 - joint]
    assert push is not None
    assert other is None
    clean = observed(list(exact_runs()))
    law = [wls(clean).value[clean.model.names.index(f"a{power}{joint + 1}")] for power in range(4)]
    expected = 4.0 * push.speed - sum(a * push.speed**power for power, a in enumerate(law))
    assert push.torque == pytest.approx(expected, abs=4.0 * push.std)
    assert push.stds > 50.0
    fastest = max(np.max(np.abs(part.motion.v[joint])) for part in training.data.stretches)
    assert 0.0 < push.speed <= fastest


def test_what_nothing_determines_is_not_said_to_push():
    training = observed(with_torque(exact_runs(), 0, lambda motion: -4.0 * motion.v[0]))
    estimate = wls(training)
    open_ = estimate.covariance.copy()
    open_[estimate.model.names.index("a31")] = np.inf
    unsure = replace(estimate, covariance=1e4**2 * estimate.covariance)
    assert pushes(replace(estimate, covariance=open_), training)[0] is None
    assert pushes(unsure, training)[0] is None
