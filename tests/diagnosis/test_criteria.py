"""Numbers behind decisions: each says its unit and why, and is obeyed where it is given."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

from scara_ident.diagnosis import diagnose
from scara_ident.diagnosis.criteria import CRITERIA, SelectionCriteria
from scara_ident.effects.position import Spring
from scara_ident.robot.robot import load_robot
from tests.diagnosis.made import BANDS, exact_runs, with_torque


def test_every_number_has_a_unit_and_a_reason():
    documented = CRITERIA.documented()
    assert [row[0] for row in documented] == [item.name for item in fields(SelectionCriteria)]
    for name, value, unit, reason, _ in documented:
        assert value == getattr(CRITERIA, name)
        assert unit, name
        assert len(reason.split()) >= 2, name
        assert np.all(np.asarray(value) > 0.0), name


def test_what_they_stand_behind_keeps_its_order():
    assert CRITERIA.absorbed < CRITERIA.least_outside
    assert CRITERIA.least_gain < CRITERIA.remainder
    assert all(share < 1.0 < CRITERIA.wider for share in CRITERIA.narrower)


@pytest.mark.parametrize(
    ("change", "verdict", "found"),
    [
        ({}, "explained", ["spring"]),
        # With a bar that nothing clears the remainder stays.
        ({"least_gain": 1.01}, "unexplained", []),
        ({"most_effects": 0}, "unexplained", []),
        # Where so much may be left over, nothing is.
        ({"least_gain": 1.01, "remainder": 1.01, "remainder_to_noise": 1e3}, "complete", []),
    ],
)
def test_a_diagnosis_obeys_the_criteria_that_it_is_given(change: dict, verdict: str, found: list[str]):
    runs = with_torque(exact_runs(), 1, lambda motion: 0.05 * motion.q[1])
    criteria = replace(CRITERIA, **change)
    result = diagnose(load_robot(), "complete", runs, bands=BANDS, catalogue=(Spring(),), criteria=criteria)
    assert (result.verdict, [effect.effect for effect in result.effects]) == (verdict, found)
