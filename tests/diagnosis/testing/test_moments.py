"""Repetitions of a motion counted once: what copies say is what one of them says."""

from __future__ import annotations

from dataclasses import replace

import pytest
from numpy.testing import assert_allclose

from scara_ident.diagnosis.candidates.candidates import Candidate
from scara_ident.diagnosis.testing.moments import examine_moments
from scara_ident.effects import Member
from scara_ident.effects.position import Spring
from tests.diagnosis.made import exact_runs, periodic_run, step_beside

SPRING = Candidate(Spring(), Member(0))


def test_of_copies_of_recordings_as_much_is_determined_as_of_one_of_each():
    single = [exact_runs()[0], exact_runs()[2]]
    copies = [replace(item, name=item.name.replace("_1", f"_{k}")) for item in single for k in (1, 2, 3)]
    alone, both = step_beside(single), step_beside(copies)
    (one,), (many,) = alone.judge([SPRING]), both.judge([SPRING])
    once = examine_moments(both, SPRING)
    assert_allclose(once.value, one.examination.value, rtol=1e-6)
    assert once.p_value == pytest.approx(one.examination.p_value, rel=1e-4)
    assert once.freedom == pytest.approx(one.examination.freedom, rel=1e-6)
    # Blocks counted by themselves tell three times as much.
    assert many.examination.freedom > 2.0 * once.freedom


def test_where_no_motion_is_repeated_nothing_changes():
    step = step_beside([exact_runs()[0], exact_runs()[2]])
    (alone,) = step.judge([SPRING])
    assert examine_moments(step, SPRING).p_value == pytest.approx(alone.examination.p_value, rel=1e-6)


def test_of_the_periods_of_a_run_as_much_is_determined_as_of_fewer():
    three, five = (step_beside([periodic_run(count)]) for count in (3, 5))
    (alone,), (many,) = three.judge([SPRING]), five.judge([SPRING])
    once = [examine_moments(step, SPRING).freedom for step in (three, five)]
    assert many.examination.freedom > 1.4 * alone.examination.freedom
    assert once[1] == pytest.approx(once[0], rel=0.3)
    assert max(once) < 0.7 * alone.examination.freedom
