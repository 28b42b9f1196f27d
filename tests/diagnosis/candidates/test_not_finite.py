"""Effects whose columns are not finite: a note or an error in one line, and a fit that goes back from where there are none."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from scara_ident import load_robot
from scara_ident.diagnosis import diagnose
from scara_ident.diagnosis.candidates.candidates import Candidate, CandidateColumns
from scara_ident.diagnosis.candidates.not_finite import without_not_finite
from scara_ident.diagnosis.selection.search import SearchTask, scene_of, search
from scara_ident.diagnosis.testing.selection_step import NOT_FINITE
from scara_ident.effects import CATALOGUE, Coefficient, Effect, Member, NonlinearParameter
from scara_ident.effects.position import Spring
from scara_ident.errors import ScaraIdentError
from scara_ident.estimation import wls
from tests.diagnosis.made import BANDS, complete, exact_runs, observed, step_beside, with_torque
from tests.plugins.arm_lab.arm_lab.cogging import Cogging


@dataclass(frozen=True)
class Broken(Effect):
    """A spring that is not finite on recordings of some names."""

    name = "broken"
    summary = "broken"
    coefficients = (Coefficient("stiffness", "N m/rad", "stiffness"),)
    on: str = ""
    by: float = np.nan

    def signal_columns(self, signals, member):
        turn = signals.motion.q[member.place]
        return [turn * self.by if signals.motion.name.startswith(self.on) else turn]


@dataclass(frozen=True)
class Ended(Cogging):
    """A wave whose arithmetic ends at so many periods."""

    name = "ended"
    nonlinear = (NonlinearParameter("periods", "1/turn", 3.0, 12.0),)
    end: float = 6.5

    def signal_columns(self, signals, member):
        return [column / float(member.nonlinear[0] < self.end) for column in super().signal_columns(signals, member)]


def waving(periods: float):
    """Runs with a wave over the second joint's position."""
    return with_torque(exact_runs(), 1, lambda motion: 0.03 * np.sin(periods * motion.q[1]))


def tried(runs, *catalogue: Effect, asked_for: bool = False):
    return search(SearchTask(complete(), catalogue, asked_for=asked_for), CandidateColumns(observed(runs)))


@pytest.mark.slow
@pytest.mark.parametrize("by", [np.nan, np.inf, 1e200])
def test_an_effect_that_nobody_asked_for_is_left_out_with_a_line(by: float):
    found = tried(waving(6.0), Broken(by=by), Broken("A_2", by), Cogging())
    assert [item.effect.name for item in found.chosen] == ["cogging"]
    assert {item.candidate.effect.name for item in found.decisions} == {"cogging"}
    # Both are of one name.
    (note,) = found.notes
    assert note == (
        "broken of joint1, joint2 cannot be tried: its columns are not finite on any recording; correct the effect"
    )
    found = tried(waving(6.0), Broken("A_2", by), Cogging())
    assert found.notes == (
        "broken of joint1, joint2 cannot be tried: its columns are not finite on A_2; correct the effect or leave out A_2",
    )


def test_one_that_was_asked_for_is_an_error_of_a_line():
    said = (
        "effect broken of joint1, joint2 cannot be tried: its columns are not finite on B_1, B_2; correct the effect, leave out "
        "B_1, B_2 or leave this effect out"
    )
    with pytest.raises(ScaraIdentError) as raised:
        diagnose(load_robot(), exact_runs(), bands=BANDS, catalogue=(Spring(), Broken("B")))
    assert (str(raised.value), raised.value.exit_status) == (said, 1)


@pytest.mark.slow
def test_beside_all_that_is_built_in_it_is_a_note_of_the_result():
    found = diagnose(load_robot(), exact_runs(), bands=BANDS, catalogue=(*CATALOGUE, Broken("B")))
    assert [note.partition(":")[0] for note in found.notes] == ["broken of joint1, joint2 cannot be tried"]


def test_of_an_effect_with_some_values_the_others_are_tried():
    found = tried(waving(6.0), Ended(), asked_for=True)
    (chosen,) = found.chosen
    assert chosen.member.nonlinear[0] == pytest.approx(6.0, abs=0.02)
    assert found.notes[0].startswith("ended of joint1, joint2 cannot be tried with some values of its parameters: ")


@pytest.mark.slow
@pytest.mark.parametrize(("end", "best"), [(6.2001, 6.2), (6.05, 6.05)])
def test_a_fit_goes_back_from_values_without_columns(end: float, best: float):
    """It goes past the best on its way there, and stays at the edge where the best is beyond it; both ended in numpy's error."""
    found = tried(waving(6.2), Ended(end))
    (chosen,) = found.chosen
    assert best - 0.02 < chosen.member.nonlinear[0] < end


def test_no_decision_says_that_the_model_absorbs_what_has_no_columns():
    step = step_beside(waving(6.0))
    decisions = step.judge([Candidate(Broken(), Member(0)), Candidate(Cogging(), Member(1, (6.0,)))])
    assert [(item.accepted, item.tentative) for item in decisions] == [(False, False), (True, False)]
    assert decisions[0].why == NOT_FINITE
    assert "absorbs" not in decisions[1].why


def test_all_candidates_are_kept_where_all_are_finite():
    seen = observed(exact_runs())
    scene = scene_of(seen.model, wls(seen).value, seen)
    candidates = [Candidate(Spring(), Member(j)) for j in (0, 1)]
    columns = CandidateColumns(seen)
    columns.rows(scene, candidates)
    assert without_not_finite(scene, columns, candidates, asked_for=True) == (tuple(candidates), ())
