"""What a residual is shown to be: noise, with the power to have found otherwise, or nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from scara_ident.diagnosis.criteria import CRITERIA
from scara_ident.diagnosis.diagnose import diagnose
from scara_ident.diagnosis.evidence.evidence import (
    Evidence,
    _of_joint,
    coloured_shares,
    evidence,
    held_out_evidence,
    min_found,
    unsure_of_others,
)
from scara_ident.diagnosis.testing.lack_of_fit import LackOfFit
from scara_ident.diagnosis.testing.selection_step import best_of_each
from scara_ident.estimation import wls
from scara_ident.estimation.noise_bias import noise_torque
from scara_ident.estimation.residuals import Residuals
from scara_ident.motion.prepared import prepare
from scara_ident.robot.robot import load_robot
from tests.diagnosis.made import BANDS, exact_runs, observed, step_beside, virtual_runs, with_torque


def left_of(noise: np.ndarray) -> np.ndarray:
    """Coloured shares of a residual that is this noise on both joints of every run."""
    data = prepare(exact_runs(), BANDS)
    predicted = tuple(part.torque - noise[:, : part.samples] for part in data.stretches)
    return coloured_shares(Residuals(data, predicted))


def test_what_the_noise_of_positions_makes_is_no_colour_and_what_it_does_not_make_is():
    """An arm with nothing missing was `undecided` for 26 % that encoders of 18 bits made."""
    rng = np.random.default_rng(4)
    data = prepare(exact_runs(), BANDS)
    samples = max(part.samples for part in data.stretches)
    white, own, again = rng.standard_normal((3, len(data.stretches), 2, samples))
    frequency = np.fft.rfftfreq(samples, 1.0 / data.stretches[0].rate) / BANDS[0]
    # As an acceleration has it.
    shape = np.where(frequency < 1.0, 10.0 * frequency**2, 0.0)
    rough, once_more = (np.fft.irfft(shape * np.fft.rfft(noise), samples) for noise in (own, again))

    def left(noise: np.ndarray, made: np.ndarray | None) -> np.ndarray:
        predicted = tuple(part.torque - row[:, : part.samples] for part, row in zip(data.stretches, noise, strict=True))
        return coloured_shares(Residuals(data, predicted), made)

    assert np.min(left(white + rough, None)) > 0.4
    assert np.max(left(white + rough, once_more)) < 0.2
    slow = np.cumsum(rng.standard_normal(white.shape), axis=2) / 20.0
    assert np.min(left(white + rough + slow, once_more)) > 0.4
    # Of a noise that is not there nothing is taken off.
    assert np.min(left(white + rough, 10.0 * once_more)) > 0.4


def test_white_noise_stands_out_nowhere_and_slow_noise_does():
    rng = np.random.default_rng(1)
    white = rng.standard_normal((2, 5000))
    white[1] = lfilter([1.0], [1.0, -0.99], white[1])
    share = left_of(white)
    assert share[0] < 0.15
    assert share[1] > 0.5


def test_units_of_torque_change_nothing():
    white = np.random.default_rng(2).standard_normal((2, 5000))
    assert left_of(1e6 * white) == pytest.approx(left_of(1e-6 * white), rel=1e-9)


@pytest.mark.parametrize("samples", [150, 200])
def test_a_run_of_one_block_shows_nothing(samples: int):
    """A carriage pushed once for half a second was `complete`: of one block the scatter of all effects was rounding."""
    run = exact_runs()[0]
    assert run.effort is not None
    short = replace(run, time=run.time[:samples], position=run.position[:, :samples], effort=run.effort[:, :samples])
    found = diagnose(load_robot(), [short], bands=BANDS, model="basic")
    assert [item.limit for item in found.evidence] == [1.0, 1.0]
    assert found.verdict == "undecided"


@pytest.fixture(scope="module")
def nothing_missing():
    return diagnose(load_robot(), virtual_runs(), bands=BANDS)


@pytest.mark.slow
def test_complete_is_earned_by_repetition(nothing_missing):
    assert nothing_missing.verdict == "complete"
    assert [item.by for item in nothing_missing.evidence] == ["repetition"] * 2
    assert all(item.limit < CRITERIA.min_power for item in nothing_missing.evidence)


@pytest.mark.slow
def test_an_effect_comes_in_from_its_detection_limit_on(nothing_missing):
    search = nothing_missing.search
    decision = best_of_each(search.decisions)["spring of joint2"]
    ((name, limit),) = min_found(search, decision).items()
    assert (name, limit.unit) == ("stiffness", "N m/rad")
    accepted = []
    for share in (0.0, 0.6, 1.4):
        runs = with_torque(virtual_runs(), 1, lambda motion, size=share * limit.value: size * motion.q[1])
        step = replace(step_beside(runs), tried=search.tried)
        accepted.append(step.judge([decision.candidate])[0].accepted)
    assert accepted == [False, False, True]
    # Of several coefficients no one size is the least.
    assert min_found(search, best_of_each(search.decisions)["friction_coupling of joint2 by joint1"]) == {}
    assert all(item.limit >= CRITERIA.min_gain for item in nothing_missing.evidence)


@pytest.mark.slow
def test_one_short_run_cannot_tell():
    first = virtual_runs()[0]
    assert first.effort is not None
    short = replace(
        first, time=first.time[:500], position=first.position[:, :500], effort=first.effort[:, :500], velocity=None
    )
    result = diagnose(load_robot(), [short], bands=BANDS)
    assert result.verdict == "undecided"
    assert not result.effects
    # `no effect would have been significant` was said beside effects that had been found.
    assert any(
        "no missing effect" in item.why and "would have been significant" in item.why for item in result.evidence
    )


def test_what_a_right_model_lacks_on_others_is_what_its_parameters_make_there():
    first, second = (observed(exact_runs()[k : k + 1]) for k in (0, 2))
    after = wls(first)
    expected = []
    for rows in second.joints:
        columns, covariance = rows.table[:-1], after.covariance[np.ix_(rows.columns, rows.columns)]
        expected.append(np.einsum("kn,kl,ln->", columns, covariance, columns) / np.sum(rows.counts))
    square = unsure_of_others(after, second) ** 2 - noise_torque(second, after.value) ** 2
    assert square == pytest.approx(np.array(expected), rel=1e-6)


def test_what_does_not_hold_on_other_recordings_is_not_shown():
    shown = (Evidence("joint1", True, "whiteness", "", 0.1), Evidence("joint2", True, "whiteness", "", 0.1))
    sure = np.zeros(2)
    found = held_out_evidence(shown, (1.0, 1.0), (1.4, 1.6), sure, sure)
    assert [item.shown for item in found] == [True, False]
    assert "1.6 times" in found[1].why
    assert held_out_evidence(shown, (1.0, 1.0), (None, None), sure, sure) == shown
    # What parameters that are not sure make there speaks against no model, and is said.
    found = held_out_evidence(shown, (1.0, 1.0), (1.4, 6.0), np.array([0.0, 6.0]), sure)
    assert all(item.shown for item in found)
    assert "6 times" in found[1].why and found[1].why.endswith("which the uncertainty of the parameters there explains")
    # Nor what runs differ by: two standard deviations of one draw.
    for apart, holds in ((3.0, True), (2.5, False)):
        found = held_out_evidence(shown, (1.0, 1.0), (1.4, 6.0), sure, np.array([0.0, apart]))
        assert [item.shown for item in found] == [True, holds]
    assert "6 times" in found[1].why


@pytest.mark.slow
@pytest.mark.parametrize(("missing", "shown"), [(0.009, False), (0.005, True)])
def test_what_surely_repeats_is_no_noise_however_small_beside_it(nothing_missing, missing, shown):
    # A delay of 12 ms that no candidate could take up left as much, beside noise that is larger.
    fit = [LackOfFit(joint, 0.0103, missing, missing * 1.1, 1.3e-14, ()) for joint in ("joint1", "joint2")]
    residuals = nothing_missing.training_after.residuals(nothing_missing.after.value)
    found = evidence(nothing_missing.search, residuals, fit, (0.0057, 0.0057), (0.0, 0.0))
    assert [item.shown for item in found] == [shown, shown]
    said = "0.009 N m repeats from run to run (p = 1.3e-14), 0.0103 N m does not; this is more than filters"
    assert found[0].why.startswith(said) != shown
    # Twenty times the noise was "too little to tell what it is".
    assert found[0].why.endswith("and no effect that was tried explains it") != shown
    # Then the model lacks something, whatever it is.
    assert [item.lacks for item in found] == [not shown, not shown]


@pytest.mark.parametrize(("of_positions", "shown"), [(0.0, False), (0.4, True)])
def test_what_is_white_and_repeats_above_the_noise_is_no_noise(nothing_missing, of_positions, shown):
    """A ripple five times the noise, at many speeds and beside 2 % of the torque, was white enough to be complete."""
    fit = [LackOfFit(joint, 0.07, 0.376, 0.4, 5e-22, ()) for joint in ("joint1", "joint2")]
    residuals = nothing_missing.training_after.residuals(nothing_missing.after.value)
    found = evidence(nothing_missing.search, residuals, fit, (0.48, 0.48), (of_positions,) * 2)
    assert [(item.shown, item.by) for item in found] == 2 * [(shown, "whiteness" if shown else "repetition")]
    said = (
        "0.376 N m repeats from run to run (p = 5.0e-22), 0.07 N m does not; this is not noise, even if it is white, "
        "but filters and encoders may cause as much, so this alone does not say that the model lacks something"
    )
    assert (found[0].why == said) != shown
    assert not any(item.lacks for item in found)


def test_the_noise_of_positions_speaks_of_the_joints_alone_that_it_colours(nothing_missing):
    """What it is on one joint must not take from another, whose residual is white, that it was shown to be noise."""
    left = nothing_missing.training_after.residuals(nothing_missing.after.value)
    data, rng = left.data, np.random.default_rng(6)
    made = []
    for part in data.stretches:
        frequency = np.fft.rfftfreq(part.samples, 1.0 / part.rate) / BANDS[0]
        shape = np.where(frequency < 1.0, frequency**2, 0.0)
        made.append(np.fft.irfft(shape * np.fft.rfft(rng.standard_normal((2, part.samples))), part.samples))
    predicted = [part.torque - rng.standard_normal(part.torque.shape) for part in data.stretches]
    for own, noise in zip(predicted, made, strict=True):
        # As much again, the other way round in time: of the same power.
        own[0] -= 10.0 * noise[0, ::-1]
    residuals = Residuals(data, tuple(predicted))
    told = [np.array([10.0, 1.0])[:, None] * noise for noise in made]
    without, within = (
        evidence(nothing_missing.search, residuals, (), (0.0, 0.0), (0.0, 0.0), made=known)
        for known in (None, lambda: told)
    )
    assert [item.shown for item in without] == [False, True]
    assert [item.shown for item in within] == [True, True]
    assert "the noise of the positions" in within[0].why and within[1] == without[1]


@pytest.mark.parametrize(
    ("p_value", "missing", "shown"), [(0.0138, 0.0227, False), (0.0138, 0.0100, True), (0.2, 0.0227, True)]
)
def test_what_is_far_above_the_noise_is_doubted_where_it_is_hardly_shown_to_repeat(p_value, missing, shown):
    """A gear of ten times the stiffness was `explained` beside 5.5 times the noise, with p = 1.4 % of few periods."""
    fit = LackOfFit("joint1", 0.00413, missing, 2.0 * missing, p_value, ())
    told = _of_joint("joint1", "N m", fit, 0.05, "white noise", 0.05, (0.03, 0.0, CRITERIA.far_above_noise), CRITERIA)
    assert told.shown == shown and told.by == ("whiteness" if shown else "repetition")


@pytest.mark.parametrize(("limit", "said"), [(0.984, True), (0.997, False), (1.0, False)])
def test_a_limit_that_is_all_but_the_whole_residual_is_not_found_as_its_share(limit, said):
    """`no missing effect that makes less than 100% of the squared residual` says nothing."""
    found = _of_joint("joint1", "N m", None, 0.05, "white noise", limit, (0.0, 0.0, CRITERIA.far_above_noise), CRITERIA)
    assert ("that makes less than 98% of the squared residual" in found.why) is said
    assert found.why.startswith("no missing effect would have been significant") is not said
