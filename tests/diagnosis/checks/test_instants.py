"""Instants are no surer than the recordings agree on them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.diagnosis.candidates.candidates import Candidate
from scara_ident.diagnosis.checks.instants import with_instants_of_each
from scara_ident.diagnosis.checks.other_laws import parameters_of_laws
from scara_ident.diagnosis.fitting.effect_parameters import physical_parameters
from scara_ident.diagnosis.fitting.nonlinear_fit import tune
from scara_ident.diagnosis.testing.selection_step import SelectionStep
from scara_ident.effects import Coefficient, Effect, Member, NonlinearParameter
from scara_ident.recording.recording import Recording
from tests.diagnosis.made import NOISE, exact_runs, step_beside

WEIGHTS = 1.0 / np.array(NOISE)
STEP = 0.05


class Jump(Effect):
    """A torque on the first joint from an instant on."""

    name = "jump"
    summary = "jump"
    coefficients = (Coefficient("height", "N m", "height of a jump"),)
    nonlinear = (NonlinearParameter("time", "s", 0.0, np.inf, False, jumps=True),)

    def members(self, scene):
        return (Member(0, (5.0,)),)

    def signal_columns(self, signals, member):
        return [np.clip((signals.time - member.nonlinear[0]) * signals.motion.rate + 0.5, 0.0, 1.0)]


def runs_from(*instants: float) -> list[Recording]:
    """Runs whose first joint has a further torque from an instant of each on."""
    made = []
    for run, instant in zip(exact_runs(), instants, strict=False):
        effort = run.effort.copy()
        effort[0] += STEP * (run.time - run.time[0] > instant)
        made.append(replace(run, effort=effort))
    return made


def fitted(*instants: float) -> SelectionStep:
    """The model with a jump, its instant fitted, of runs that each have one at an instant of their own."""
    return tune(step_beside(runs_from(*instants), [Candidate(Jump(), Member(0, (instants[0],)))], WEIGHTS))


def test_an_instant_on_which_all_recordings_agree_stays_about_as_sure():
    step = fitted(5.0, 5.0, 5.0, 5.0)
    (own,), (told,) = physical_parameters(step).effects, parameters_of_laws(step).effects
    # Times are tried whole standard deviations apart.
    assert own["time"].std <= told["time"].std <= 3.0 * own["time"].std
    assert told["height"] == own["height"]
    assert told["time"].value == own["time"].value == pytest.approx(5.0, abs=3.0 * own["time"].std)


def test_an_instant_on_which_they_do_not_is_as_unsure_as_they_differ():
    """By the slope of its column it was told to a few hundredths of a second, seconds off in two of the runs."""
    step = fitted(5.0, 5.0, 8.0, 8.0)
    (own,), (told,) = physical_parameters(step).effects, parameters_of_laws(step).effects
    assert own["time"].std < 0.2
    assert told["time"].std > 0.7


def test_one_recording_does_not_say_how_recordings_differ():
    step = fitted(5.0)
    (own,) = physical_parameters(step).effects
    assert with_instants_of_each(step, 0, own) == own
