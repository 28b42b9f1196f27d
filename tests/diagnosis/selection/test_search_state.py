"""Where a search stands: what comes in, what gives way, and that the state before is what it was."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import bilinear, lfilter

from scara_ident.diagnosis.candidates.candidates import Candidate, CandidateColumns
from scara_ident.diagnosis.criteria import CRITERIA
from scara_ident.diagnosis.selection.search import scene_of
from scara_ident.diagnosis.selection.search_state import SearchState
from scara_ident.diagnosis.testing.selection_step import SelectionStep
from scara_ident.diagnosis.testing.selection_step import observed as with_effects
from scara_ident.effects import Member
from scara_ident.effects.elasticity import JointElasticity
from scara_ident.effects.filters.torque_filter import TorqueFilter
from scara_ident.effects.friction import AsymmetricFriction
from scara_ident.effects.measurement import TimeDelay, shifted
from scara_ident.effects.position import Spring
from scara_ident.estimation import wls
from scara_ident.estimation.run_offsets import rms_of
from tests.diagnosis.made import complete, exact_runs, observed, with_torque

MODEL = complete()


def begun(runs, *families) -> SearchState:
    observations = observed(runs)
    start = wls(observations)
    scene = scene_of(MODEL, start.value, observations)
    pool = tuple(Candidate(family, member) for family in families for member in family.members(scene))
    columns = CandidateColumns(observations)
    step = SelectionStep(scene, columns, (), start.weights, len(pool), CRITERIA, start.offsets)
    return SearchState(step, start.value, pool, pool)


def labels(state: SearchState, candidates) -> list[str]:
    return [item.label(state.step.scene) for item in candidates]


def let_in(state: SearchState, label: str) -> SearchState:
    (decision,) = [item for item in state.step.judge(state.candidates) if item.label == label]
    return state.with_effect(decision)


def sprung(runs, stiffness: float = 0.05):
    return with_torque(runs, 1, lambda motion: stiffness * motion.q[1])


def test_an_effect_that_comes_in_is_in_the_model_and_no_candidate_any_more():
    state = begun(sprung(exact_runs()), Spring(), AsymmetricFriction())
    after = let_in(state, "spring of joint2")
    assert after.labels == {"spring of joint2"}
    assert set(labels(state, state.candidates)) - set(labels(after, after.candidates)) == {"spring of joint2"}
    assert (after.pool, after.step.tried, after.correction) == (state.pool, state.step.tried, None)
    (step,) = after.steps
    rows = with_effects(after.step)
    assert (step.chosen, step.rms) == (after.step.chosen, rms_of(after.value, rows, after.step.offsets))
    assert after.value[-1] == pytest.approx(0.05, rel=0.05)
    # The state before is what it was.
    assert (state.step.chosen, state.steps) == ((), ())


def test_what_gives_way_may_come_in_again():
    runs = with_torque(sprung(exact_runs()), 0, lambda motion: 0.03 * np.abs(motion.v[0]))
    state = let_in(
        let_in(begun(runs, Spring(), AsymmetricFriction()), "spring of joint2"), "asymmetric_friction of joint1"
    )
    left = state.giving_way(0)
    assert left.labels == {"asymmetric_friction of joint1"}
    assert [step.decision.label for step in left.steps] == ["asymmetric_friction of joint1"]
    assert "spring of joint2" in labels(left, left.candidates)
    assert left.exchanges == 1


def test_more_candidates_count_as_tried_and_some_labels_are_not_to_be():
    state = begun(exact_runs(), Spring())
    other = Candidate(AsymmetricFriction(), AsymmetricFriction().members(state.step.scene)[0])
    more = state.with_more([other])
    assert (more.pool[-1], more.candidates[-1], more.step.tried) == (other, other, state.step.tried + 1)
    assert labels(state, more.only({"spring of joint1"}).candidates) == [
        "spring of joint2",
        "asymmetric_friction of joint1",
    ]


def test_a_delay_is_taken_out_of_the_data_and_its_sizes_add_up():
    state = begun([shifted(run, -0.004) for run in exact_runs()], TimeDelay())
    after = let_in(state, "time_delay")
    assert after.step.chosen == ()
    assert after.correction is not None
    assert after.correction.value[0] == pytest.approx(0.004, abs=2e-4)
    assert state.correction is None
    # What was left in the data is no more than a thousandth of it, and nothing of what was taken out is counted twice.
    again = after.corrected(after.correction.candidate)
    assert again.correction is not None
    assert again.correction.value[0] == pytest.approx(after.correction.value[0], rel=1e-3)
    half = begun([shifted(run, -0.002) for run in exact_runs()], TimeDelay())
    first = let_in(half, "time_delay").correction
    assert first is not None
    whole = replace(state, correction=first).corrected(first.candidate).correction
    assert whole is not None
    assert whole.value[0] == pytest.approx(first.value[0] + after.correction.value[0], rel=1e-2)


def test_a_delay_of_all_joints_takes_the_place_of_those_of_single_ones_which_may_come_in_again():
    runs = [shifted(run, -0.004) for run in sprung(exact_runs())]
    state = begun(runs, TimeDelay(), Spring())
    whole = next(item for item in state.step.judge(state.candidates) if item.label == "time_delay")
    for label in ("time_delay of joint1", "spring of joint2", "time_delay of joint2"):
        state = let_in(state, label)
    after = state.with_effect(whole)
    assert after.labels == {"spring of joint2"}
    assert [step.decision.label for step in after.steps] == ["spring of joint2", "time_delay"]
    assert {"time_delay of joint1", "time_delay of joint2"} <= set(labels(after, after.candidates))
    assert after.correction.value[0] == pytest.approx(0.004, abs=2e-4)
    # Nothing was exchanged: that many may be is another question.
    assert after.exchanges == 0
    # What is left of a correction was found beside what joints differ by, and takes the place of none.
    again = let_in(after, "time_delay of joint1").with_effect(whole)
    assert again.labels == {"spring of joint2", "time_delay of joint1"}


def filtered(runs, time_constant: float = 0.008):
    return [
        replace(
            run, effort=lfilter(*bilinear([1.0], [time_constant, 1.0], 1.0 / (run.time[1] - run.time[0])), run.effort)
        )
        for run in runs
    ]


def test_what_a_correction_leaves_is_tried_then_and_follows_it():
    effect = TorqueFilter()
    state = replace(begun(filtered(exact_runs()), TimeDelay()), after_correction=frozenset([effect.name]))
    late = let_in(state, "time_delay")
    assert late.correction is not None
    (rest,) = [item for item in late.candidates if item.effect.name == effect.name]
    assert rest == late.step.rest == late.pool[-1]
    assert rest.effect == TorqueFilter(float(late.correction.value[0]))
    assert late.step.tried == state.step.tried + 1
    there = let_in(late, effect.name)
    assert (there.step.chosen, there.step.rest) == ((rest,), None)
    # What is left of the delay beside it moves it.
    again = there.corrected(late.correction.candidate)
    assert again.correction is not None
    assert again.correction.value[0] == pytest.approx(0.008, abs=1e-4)
    (moved,) = again.step.chosen
    assert moved.effect == TorqueFilter(float(again.correction.value[0])) != rest.effect
    assert again.step.rest is None
    assert again.pool == (*state.pool, moved)
    # Of a search without such an effect it stays what may be left.
    other = let_in(begun(filtered(exact_runs()), TimeDelay()), "time_delay")
    assert other.step.rest == rest
    assert other.pool == state.pool


def test_what_is_gone_back_to_holds_no_fit_and_not_the_columns_before_a_correction():
    """Of a delay the columns before it were held twice, 70 MB of them."""
    state = begun([shifted(run, -0.004) for run in exact_runs()], TimeDelay(), Spring())
    decisions = {item.label: item for item in state.step.judge(state.candidates)}
    assert "model" in vars(state.step)
    kept = state.to_go_back_to(decisions["spring of joint2"])
    assert "model" not in vars(kept.step)
    assert kept.step.columns is state.step.columns
    other = state.to_go_back_to(decisions["time_delay"])
    assert other.step.columns is not state.step.columns
    assert other.step.observations is state.step.observations


def test_at_another_estimate_members_that_act_together_are_as_they_were_fitted_there():
    runs = exact_runs()
    state = begun(runs, Spring())
    first, second = (Candidate(JointElasticity(), Member(j, (9.0, 0.2))) for j in (0, 1))
    state = replace(state, step=replace(state.step, chosen=(second, Candidate(Spring(), Member(0)), first)))
    moved = replace(state.step, chosen=(first.at((7.0, 0.1)),)).scene
    assert state.at(moved).step.chosen == (second, state.step.chosen[1], first.at((7.0, 0.1)))
    assert state.at(state.step.scene) is state
