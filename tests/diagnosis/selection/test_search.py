"""The search: what comes in, what is refined, what is dropped again, and the delay that is corrected in the data."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.diagnosis.candidates.candidates import Candidate, CandidateColumns
from scara_ident.diagnosis.selection.search import (
    SearchTask,
    columns_at_hand,
    scene_of,
    search,
    search_again,
)
from scara_ident.effects import Coefficient, Member
from scara_ident.effects.friction import AsymmetricFriction, Stribeck
from scara_ident.effects.measurement import TimeDelay, shifted
from scara_ident.effects.position import Spring
from scara_ident.effects.recording_delays import DelayOfEachRecording
from scara_ident.estimation import wls
from scara_ident.estimation.run_offsets import rms_of
from tests.diagnosis.made import (
    BANDS,
    Bump,
    complete,
    exact_runs,
    fitted,
    observed,
    searched,
    step_beside,
    virtual_runs,
    with_torque,
)

MODEL = complete()
SMALL = (Spring(), Stribeck(), AsymmetricFriction(), TimeDelay())


def spring(motion, stiffness: float = 0.05):
    return stiffness * motion.q[1]


def asymmetry(motion, difference: float = 0.03):
    return difference * np.abs(motion.v[0])


def test_nothing_comes_in_where_nothing_is_missing():
    result = searched(exact_runs(), *SMALL)
    assert (result.chosen, result.steps, result.correction) == ((), (), None)
    assert result.model is result.scene.model
    assert not any(decision.accepted for decision in result.decisions)
    assert result.tried == len(result.decisions)


def test_each_recording_has_a_column_of_its_own_only_where_joints_show_that_they_differ():
    assert searched(exact_runs(), DelayOfEachRecording()).decisions == ()
    late = [shifted(run, -delay) for run, delay in zip(exact_runs(), (0.0, 4e-3, 0.0, 4e-3), strict=True)]
    assert len(searched(late, DelayOfEachRecording()).decisions) == 1


def test_two_planted_effects_come_in_and_nothing_else():
    runs = with_torque(with_torque(exact_runs(), 1, spring), 0, asymmetry)
    result = searched(runs, *SMALL)
    assert {item.label(result.scene) for item in result.chosen} == {"spring of joint2", "asymmetric_friction of joint1"}
    assert [step.decision.candidate for step in result.steps] == list(result.chosen)
    assert len(result.model.columns) == len(MODEL.columns) + 2
    clean = fitted(exact_runs())
    assert np.max(np.abs(result.scene.value - clean.value)[:5] / clean.std[:5]) < 4.0


def test_an_effect_is_left_out_afterwards():
    runs = with_torque(with_torque(exact_runs(), 1, spring), 0, asymmetry)
    left = searched(runs, *SMALL).without(["asymmetric_friction of joint1"])
    assert [item.label(left.scene) for item in left.chosen] == ["spring of joint2"]
    assert [step.decision.label for step in left.steps] == ["spring of joint2"]
    assert len(left.model.columns) == len(MODEL.columns) + 1


def test_the_error_falls_with_every_step_to_that_of_the_clean_recordings():
    runs = with_torque(with_torque(exact_runs(), 1, spring), 0, asymmetry)
    result = searched(runs, *SMALL)
    errors = [np.array(step.rms) for step in result.steps]
    start = np.array(rms_of(result.start.value, result.uncorrected))
    # The sum over joints in equal weight falls; a joint that fits worse only because it weighs less may grow a little.
    sizes = [np.sum((error / errors[-1]) ** 2) for error in (start, *errors)]
    assert sizes[0] > 2.0 * sizes[1] > 2.0 * sizes[2]
    clean = searched(exact_runs(), *SMALL)
    assert errors[1] == pytest.approx(rms_of(clean.start.value, clean.uncorrected), rel=0.02)


class BumpAndSlope(Bump):
    """Another shape of the same cause, which comes nearer between two places."""

    coefficients = (*Bump.coefficients, Coefficient("slope", "N m", "slope of a bump"))

    def signal_columns(self, signals, member):
        off = (signals.motion.q[0] - member.nonlinear[0]) / 0.45
        return [np.exp(-(off**2)), off * np.exp(-(off**2))]


def test_of_families_of_one_name_the_one_is_taken_that_is_better_once_refined():
    runs = with_torque(exact_runs(), 0, lambda motion: 0.2 * np.exp(-(((motion.q[0] - 1.15) / 0.3) ** 2)))
    step = step_beside(runs)
    first, second = (
        max(step.judge([Candidate(family, item) for item in family.members(step.scene)]), key=lambda item: item.gain)
        for family in (Bump(), BumpAndSlope())
    )
    assert first.gain < second.gain
    (chosen,) = searched(runs, Bump(), BumpAndSlope()).chosen
    assert chosen.effect == Bump()
    assert chosen.member.nonlinear[0] == pytest.approx(1.15, abs=0.01)


class FarBump(Bump):
    """One that is tried where it does not show."""

    def members(self, scene):
        return (Member(0, (3.3,)),)


def test_what_another_search_found_between_the_points_is_tried_where_it_was_found():
    runs = with_torque(exact_runs(), 0, lambda motion: 0.2 * np.exp(-(((motion.q[0] - 1.15) / 0.3) ** 2)))
    missed = searched(runs, FarBump())
    assert missed.chosen == ()
    found = Candidate(FarBump(), Member(0, (1.13,)))
    known = replace(missed, step=replace(missed.step, chosen=(found,)))
    task, columns = SearchTask(complete(), (FarBump(),)), CandidateColumns(observed(runs, BANDS))
    (chosen,) = search(task, columns, known=known).chosen
    assert chosen.member.nonlinear[0] == pytest.approx(1.15, abs=0.01)


def test_a_delay_is_corrected_in_the_data():
    late = [shifted(run, -0.004) for run in exact_runs()]
    result = searched(late, *SMALL)
    assert result.correction is not None
    assert result.correction.value[0] == pytest.approx(0.004, abs=2e-4)
    assert [item.effect.name for item in result.whole(result.step).chosen] == ["time_delay"]
    assert result.chosen == ()
    clean = fitted(exact_runs())
    mended = wls(result.step.observations)
    assert np.max(np.abs(mended.value - clean.value) / clean.std) < 1.0
    # The columns are those of the same motion; only the torque is another.
    whole = fitted([shifted(run, result.correction.value[0]) for run in late])
    assert np.max(np.abs(mended.value - whole.value) / clean.std) < 0.1
    for before, after in zip(result.uncorrected.data.stretches, result.data.stretches, strict=True):
        assert after.stretch.position is before.stretch.position


def test_weights_of_the_fit_make_joints_equal():
    result = searched(virtual_runs(), Spring())
    weighted = result.start.weights * rms_of(result.start.value, result.uncorrected)
    assert weighted[0] == pytest.approx(weighted[1], rel=0.01)


@pytest.mark.slow
def test_a_search_again_without_an_effect_is_one_that_never_had_it():
    runs = with_torque(with_torque(exact_runs(), 1, spring), 0, asymmetry)
    first = searched(runs, *SMALL)
    task = SearchTask(MODEL, SMALL)
    began = []
    for label in (label for label, _ in first.passed):
        again = search_again(task, first, [label])
        assert label not in {decision.label for decision in again.decisions}
        (other,) = (item.label(again.scene) for item in again.chosen)
        assert other != label
        # What came in before is not looked for again, and what is found has the size that it has alone.
        began.append([name for name, _ in again.passed])
        alone = searched(runs, *(item for item in SMALL if item.name not in label))
        (mine,), (its,) = again.chosen, alone.chosen
        assert mine == its
        assert again.scene.value == pytest.approx(alone.scene.value, rel=1e-9)
        assert again.steps[-1].rms == pytest.approx(alone.steps[-1].rms, rel=1e-9)
    assert [names[0] for names in began] == [first.passed[1][0], first.passed[0][0]]


def test_what_came_in_before_is_kept_as_it_was():
    runs = with_torque(with_torque(exact_runs(), 1, spring), 0, asymmetry)
    first = searched(runs, *SMALL)
    again = search_again(SearchTask(MODEL, SMALL), first, [first.passed[1][0]])
    assert again.passed[0] is first.passed[0]
    assert again.steps[0] is first.steps[0]


def test_a_search_on_columns_that_are_known_finds_the_same():
    runs = with_torque(exact_runs(), 1, spring)
    columns = CandidateColumns(observed(runs))
    first = search(SearchTask(MODEL, SMALL), columns)
    again = search(SearchTask(MODEL, SMALL), columns)
    assert again.chosen == first.chosen
    assert np.array_equal(again.scene.value, first.scene.value)


def test_the_scene_is_how_far_the_recordings_reach():
    runs = exact_runs()
    seen = observed(runs)
    scene = scene_of(MODEL, fitted(runs).value, seen)
    assert scene.duration == max(run.time[-1] - run.time[0] for run in runs)
    assert scene.start == {run.name: run.time[0] for run in runs}
    assert scene.travel == pytest.approx(np.max([np.ptp(run.position, axis=1) for run in runs], axis=0))
    assert scene.speed == pytest.approx(
        np.max([np.max(np.abs(p.motion.v), axis=1) for p in seen.data.stretches], axis=0)
    )
    assert (scene.rate, scene.band) == (pytest.approx(250.0), 11.0)
    assert scene_of(MODEL, scene.value, observed(runs, (None, None))).band == pytest.approx(0.45 * 250.0)
    for part in seen.data.stretches:
        for held, made in zip(columns_at_hand(seen)[part.motion], MODEL.joint_columns(part.motion), strict=True):
            assert np.array_equal(held, made)
