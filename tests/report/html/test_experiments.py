"""What is told to be recorded next."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.diagnosis import diagnose
from scara_ident.effects.position import Spring
from scara_ident.report.html.experiments import next_experiments
from scara_ident.robot.robot import load_robot
from tests.diagnosis.made import BANDS, exact_runs, with_torque

REPEAT = "To know the noise floor: record every trajectory at least twice."
HOLD_OUT = "give it with --validate."


@pytest.fixture(scope="module")
def lean():
    """A model that lacks nothing, on runs without repetition or validation."""
    return diagnose(load_robot(), exact_runs()[::2], bands=BANDS, catalogue=())


def test_what_the_recordings_lack_is_asked_for(lean):
    found = next_experiments(lean)
    assert REPEAT in found
    assert any(sentence.endswith(HOLD_OUT) for sentence in found)


def test_a_remainder_that_depends_on_a_signal_asks_for_that_signal_and_another_for_half_the_speed():
    runs = with_torque(exact_runs(), 1, lambda motion: 0.03 * np.sin(5.0 * motion.q[1]))
    found = diagnose(load_robot(), runs, bands=BANDS, catalogue=())
    first, *others = next_experiments(found)
    assert first.startswith("To learn what is left on joint2: move slowly over the whole range of position of joint2,")
    assert REPEAT not in others
    bare = replace(found, unexplained=replace(found.unexplained, signals=()))
    assert "at half the speed" in next_experiments(bare)[0]


def test_an_effect_that_was_found_asks_for_the_experiment_that_shows_it():
    runs = with_torque(exact_runs(3)[:4], 1, lambda motion: 0.05 * motion.q[1])
    found = diagnose(load_robot(), runs, bands=BANDS, catalogue=(Spring(),))
    assert f"To confirm spring of joint2: {Spring().experiment}." in next_experiments(found)
