"""Effects that stand for what is not in the catalogue are not believed."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from scara_ident.diagnosis.criteria import CRITERIA
from scara_ident.diagnosis.evidence.evidence import coloured_shares
from scara_ident.diagnosis.evidence.outcome import Outcome, Unexplained, outcome_of
from scara_ident.diagnosis.proxies import proxies
from scara_ident.diagnosis.selection.search import SearchTask
from scara_ident.diagnosis.testing.lack_of_fit import lack_of_fit
from scara_ident.diagnosis.testing.moments import examine_moments
from scara_ident.effects.friction import AsymmetricFriction, FrictionCoupling
from scara_ident.effects.measurement import TimeDelay, shifted
from scara_ident.effects.position import Spring
from scara_ident.estimation.run_offsets import rms_of
from scara_ident.estimation.run_variation import JointVariation, RunVariation
from tests.diagnosis.made import RATE, exact_runs, runs_that_repeat, searched, virtual_runs, with_torque
from tests.diagnosis.test_model_selection import MODEL, found, selected


def _always_off(outcome: Outcome, joint: int, size: float | None) -> JointVariation:
    """Runs whose torques on a joint are off the mean by this, of either sign."""
    assert size is not None
    rows = outcome.training.joints[joint]
    runs = len(outcome.training.each)
    bounds = np.append(rows.starts[np.searchsorted(outcome.training.owner, np.arange(runs))], rows.starts[-1])
    # A row stands for so many samples, and is as much longer.
    direction = np.full((1, rows.table.shape[1]), np.sqrt(np.sum(rows.counts) / rows.table.shape[1]))
    signs = np.where(np.arange(runs) % 2, -1.0, 1.0)
    return JointVariation(direction, np.ones(1), size * signs[:, None], 1.0, bounds, np.zeros((len(signs), 1)))


@pytest.mark.slow
def test_nothing_is_demoted_where_the_rest_is_noise() -> None:
    runs = virtual_runs("asymmetric_friction:joint1:viscous_difference=0.03")
    outcome = selected(runs, AsymmetricFriction(), FrictionCoupling(), bands=(11.0, 11.0), free=False)
    assert found(outcome) == {"asymmetric_friction of joint1"}
    assert outcome.unexplained is None
    assert outcome.demoted == ()
    # Had a little been left that repeats, an effect that removes most of what repeats would stay all the same.
    little = replace(outcome, repeating=frozenset({"joint1"}))
    assert proxies(little, CRITERIA) == []
    (proxy,) = proxies(little, replace(CRITERIA, min_of_repeatable=1.5))
    assert proxy.label == "asymmetric_friction of joint1"
    # What runs differ by does not repeat: an effect need not remove it.
    assert little.after.variation is None or not little.after.variation
    off = rms_of(outcome.search.start.value, outcome.search.uncorrected)
    differ = RunVariation(tuple(_always_off(outcome, joint, size) for joint, size in enumerate(off)))
    assert differ.mean_squares(outcome.training.joints) == pytest.approx(np.square(off))
    varied = replace(little, after=replace(little.after, variation=differ))
    assert proxies(varied, replace(CRITERIA, min_of_repeatable=1.5)) == []
    assert proxies(replace(outcome, repeating=frozenset({"joint2"})), replace(CRITERIA, min_of_repeatable=1.5)) == []
    # What is judged as left is what is kept.
    for joint, after in zip(lack_of_fit(outcome.residuals), outcome.fit_after, strict=True):
        assert joint == after
    assert_array_equal(outcome.training.model.names, outcome.search.model.names)


def test_an_effect_may_stand_for_what_repeats_at_all_frequencies_alike() -> None:
    """Encoders of 12 bits left 0.058 N m in every repetition, beside 0.026 of noise; a ripple that removed 7 % was believed."""
    runs = runs_that_repeat(0.1, lambda run: 0.015 * (run.position[0] - 1.57))
    once = searched(runs, Spring(), bands=(11.0, 11.0))
    assert found(SimpleNamespace(search=once)) == {"spring of joint1"}
    outcome = selected(runs, Spring(), bands=(11.0, 11.0), free=False)
    assert coloured_shares(outcome.residuals)[0] < CRITERIA.min_colour
    assert outcome.repeating == {"joint1"}
    assert found(outcome) == set()
    (demoted,) = outcome.demoted
    assert "of what repeats, and most of what repeats would stay unexplained" in demoted.why


def test_an_effect_need_not_remove_what_the_noise_of_positions_makes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Encoders of 15 bits left 0.17 N m in every repetition, as they had to; a friction that warms up was not believed for it."""
    runs = runs_that_repeat(0.1, lambda run: 0.015 * (run.position[0] - 1.57))
    outcome = selected(runs, Spring(), bands=(11.0, 11.0), free=False)
    believed = replace(outcome, search=searched(runs, Spring(), bands=(11.0, 11.0)))
    made = np.zeros(2)
    monkeypatch.setattr("scara_ident.diagnosis.proxies.noise_torque", lambda *_: made)
    (proxy,) = proxies(believed, CRITERIA)
    assert "most of what repeats would stay unexplained" in proxy.why
    made = np.array([1.1 * outcome.fit_after[0].missing, 0.0])
    assert proxies(believed, CRITERIA) == []
    # Repetitions of a motion prove no more than one of it does, for that noise repeats with them.
    (chosen,) = believed.search.chosen
    beside = believed.search.step.without(0)
    each, once = beside.judge([chosen])[0].examination.p_value, examine_moments(beside, chosen).p_value
    assert each < once
    tried = round(2.0 * CRITERIA.family_error / once)
    many = replace(believed.search, step=replace(believed.search.step, tried=tried))
    (proxy,) = proxies(replace(believed, search=many), CRITERIA)
    assert "with the repetitions of a motion counted once" in proxy.why


def test_where_something_stays_unexplained_repetitions_of_a_motion_count_once() -> None:
    runs = with_torque(exact_runs(1, 4), 0, lambda motion: 0.003 * motion.q[0])
    outcome = selected(runs, Spring(), bands=(11.0, 11.0), free=False)
    beside, candidates = outcome.search.step.without(0), outcome.search.chosen
    each, once = beside.judge(candidates)[0].examination.p_value, examine_moments(beside, candidates[0]).p_value
    assert each < 0.01 * once
    # So many tried that it is significant by all blocks only.
    tried = round(CRITERIA.family_error / np.sqrt(each * once))
    left = replace(outcome, unexplained=Unexplained("joint1", (), 0.01, 0.5), repeating=frozenset({"joint1"}))
    search = replace(outcome.search, step=replace(outcome.search.step, tried=tried))
    (proxy,) = proxies(replace(left, search=search), CRITERIA)
    assert "with the repetitions of a motion counted once" in proxy.why
    assert proxies(left, CRITERIA) == []
    assert proxies(replace(left, search=search, unexplained=None), CRITERIA) == []


class Waves(Spring):
    """A torque over the angle that is no spring's."""

    name = "waves"

    def signal_columns(self, signals, member):
        return [np.sin(3.0 * signals.motion.q[0])]


class Moved(Spring):
    """What moves links elsewhere than recorded, of which the first joint alone shows anything."""

    name = "moved"
    all_joints = True

    def signal_columns(self, signals, member):
        return [np.outer([1.0, 0.0], signals.motion.q[0])]

    def columns(self, scene, member):
        return super().columns(scene, member)[:1]


@pytest.mark.parametrize("left", [0.0, 0.05])
def test_what_moves_links_has_to_do_for_all_joints(left: float) -> None:
    """A force on the tool was a zero of joint 5 that was 15 degrees off, by what it removed there, and joints 1 to 4 stayed unexplained."""
    runs = with_torque(exact_runs(2, 3), 0, lambda motion: 0.015 * motion.q[0])
    runs = with_torque(runs, 1, lambda motion: left * np.sin(5.0 * motion.q[1]))
    outcome = selected(runs, Moved(), bands=(11.0, 11.0), free=False)
    assert (outcome.unexplained is not None) == (left > 0.0)
    assert found(outcome) == (set() if left else {"moved of joint1"})
    assert ("moved of joint1" in {item.label for item in outcome.demoted}) == (left > 0.0)


@pytest.mark.slow
def test_what_a_delay_removes_is_asked_beside_what_came_in_after_it() -> None:
    """A delay of 6 ms came in before a bent torque sensor of three times its size, and was taken for a part of that (UR5)."""
    runs = with_torque(exact_runs(2, 3), 0, lambda motion: 1.5 * np.sin(3.0 * motion.q[0]))
    late = [shifted(run, 0.006) for run in runs]
    once = searched(late, Waves(), TimeDelay(), bands=(11.0, 11.0))
    (delay,) = [item for item in once.steps if item.decision.candidate.corrects_data]
    (wave,) = [item for item in once.steps if item is not delay]
    before, after = rms_of(once.start.value, once.uncorrected), wave.rms
    # As though the delay had come in first, beside a torque that most of what repeats is.
    first = replace(delay, rms=tuple(np.sqrt(0.9 * b**2 + 0.1 * a**2) for b, a in zip(before, after, strict=True)))
    outcome = outcome_of(SearchTask(MODEL), replace(once, steps=(first, wave)))
    assert proxies(replace(outcome, repeating=frozenset({"joint1", "joint2"})), CRITERIA) == []


def test_a_delay_that_is_not_counted_is_not_taken_back_where_something_stays_unexplained() -> None:
    """Half a millisecond of held commands came back into the parameters of an arm with an elastic gear that was not found."""
    runs = with_torque(exact_runs(2, 3), 0, lambda motion: 0.05 * np.sin(3.0 * motion.q[0]))
    late = [shifted(run, 0.4 / RATE) for run in runs]
    outcome = outcome_of(SearchTask(MODEL), searched(late, TimeDelay(), bands=(11.0, 11.0)))
    correction = outcome.search.correction
    assert correction is not None and outcome.unexplained is not None
    assert proxies(outcome, CRITERIA) == []
    # Of more than a sample it would be an effect, and is asked what every one is.
    longer = replace(outcome.search, correction=replace(correction, value=4.0 * correction.value))
    (proxy,) = proxies(replace(outcome, search=longer), CRITERIA)
    assert (proxy.label, proxy.accepted) == ("time_delay", False)
