"""What the noise of positions does to parameters: measured by adding it once more, and said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.estimation import sample_columns, wls
from scara_ident.estimation.information import weighted
from scara_ident.estimation.noise_bias import (
    NEGLIGIBLE,
    OF_LAG,
    bias_sentence,
    largest_noise_torque,
    noise_bias,
    noise_shares,
    noise_torque,
    noisy,
)
from scara_ident.estimation.observations import informations
from scara_ident.motion.low_pass import differentiate
from scara_ident.motion.position_noise import STEPLESS, noisier
from scara_ident.motion.prepared import prepare
from tests.diagnosis.made import exact_runs, observed

# A band in which two differentiations magnify an encoder's steps.
WIDE = (15.0, 15.0)


def coarse(bits: int):
    """Runs of formulas whose positions go in steps."""
    step = 2.0 * np.pi / 2**bits
    return [replace(run, position=step * np.round(run.position / step)) for run in exact_runs()]


def test_fine_positions_bias_nothing():
    seen = observed(exact_runs())
    assert max(noise_shares(seen.data)) < 1e-6
    assert wls(seen).noise_bias is None


def test_what_steps_make_of_an_inertia_is_measured_and_counted():
    exact = wls(observed(exact_runs(), WIDE)).value
    seen = observed(coarse(13), WIDE)
    estimate = wls(seen)
    bias = estimate.noise_bias
    assert bias is not None
    # The first joint's inertia comes out too small, by as much as adding the noise again makes it smaller.
    seen_bias = estimate.value[0] - exact[0]
    assert seen_bias < 0.0
    assert bias[0] == pytest.approx(seen_bias, rel=0.3)
    assert estimate.std[0] >= abs(bias[0])
    words = bias_sentence(estimate.model.names, bias, estimate.std)
    assert words is not None
    assert "P_d2 by about" in words


def test_the_share_of_noise_is_that_of_white_steps():
    # 16 bits at 250 samples a second up to 15 Hz, over the acceleration's square.
    data = prepare(coarse(16), WIDE)
    (part, *_) = data.stretches
    step = 2.0 * np.pi / 2**16
    power = 2.0 * step**2 / 12.0 / part.rate * (2.0 * np.pi) ** 4 * WIDE[0] ** 5 / 5.0
    expected = power / np.mean(part.motion.a[0][part.used[0]] ** 2)
    assert noise_shares(data)[0] == pytest.approx(expected, rel=0.3)


def test_the_share_in_what_lags_is_that_of_two_derivatives_more():
    """Steps that make next to nothing of an acceleration make much of how it bends, which a lag behind a gear follows."""
    fine, rough = (prepare(runs, WIDE) for runs in (exact_runs(), coarse(20)))
    found, part = noise_shares(rough, OF_LAG)[0], rough.stretches[0]
    motions = (data.stretches[0].motion.a[0] for data in (fine, rough))
    bent = [differentiate(a, part.rate, WIDE[0])[2][part.used[0]] for a in motions]
    assert found == pytest.approx(np.mean((bent[1] - bent[0]) ** 2) / np.mean(bent[1] ** 2), rel=0.3)
    assert noise_shares(rough)[0] < NEGLIGIBLE < found
    assert noisy(rough, OF_LAG) and not noisy(rough) and not noisy(fine, OF_LAG)


def test_what_scatters_over_the_steps_is_counted_too():
    """Positions of 16 bits with a noise of five steps: the bias that it makes was not seen, and no part of a std."""
    step, exact, found = 2.0 * np.pi / 2**16, wls(observed(exact_runs(), WIDE)).value, []
    for seed in (5, 6, 7, 8):
        rng = np.random.default_rng(seed)
        scattered = [
            replace(run, position=step * np.round(run.position / step + 5.0 * rng.standard_normal(run.position.shape)))
            for run in exact_runs()
        ]
        estimate = wls(observed(scattered, WIDE))
        assert estimate.noise_bias is not None
        found.append((estimate.noise_bias[0], estimate.value[0] - exact[0]))
    told, made = np.mean(found, axis=0)
    assert told == pytest.approx(made, rel=0.3)


def test_the_torque_that_the_noise_makes_is_that_of_the_steps():
    fine, rough = observed(exact_runs(), WIDE), observed(coarse(13), WIDE)
    value = wls(fine).value
    differs = [
        np.concatenate([part.smooth(j, a[j] - b[j])[part.used[j]] for part, a, b in zip(rough.data.stretches, rough.predicted(value), fine.predicted(value), strict=True)])
        for j in range(2)
    ]  # fmt: skip
    assert noise_torque(rough, value) == pytest.approx([np.sqrt(np.mean(row**2)) for row in differs], rel=0.3)


def test_what_a_gap_cuts_off_at_the_end_makes_no_noise():
    """A recording of which 28 samples stood before a gap ended a diagnosis with 'index 57 out-of-bounds in add.reduceat'."""
    run, other = coarse(13)[0], coarse(13)[2]
    value = wls(observed([run, other], WIDE)).value

    def without(*lost: slice):
        kept = np.ones(len(run.time), dtype=bool)
        for rows in lost:
            kept[rows] = False
        return replace(run, time=run.time[kept], position=run.position[:, kept], effort=run.effort[:, kept])

    cut, rest = without(slice(20, 150), slice(-200, -9)), without(slice(0, 150), slice(-200, None))
    first, *_, last = observed([cut], WIDE).data.stretches
    assert not first.usable and not last.usable
    seen, same = observed([cut, other], WIDE), observed([rest, other], WIDE)
    assert noise_torque(seen, value) == pytest.approx(noise_torque(same, value), rel=0.1)
    limit = largest_noise_torque(seen, value, 0.01)
    assert limit == pytest.approx(largest_noise_torque(same, value, 0.01), rel=0.1)


def test_the_torque_that_the_noise_makes_is_made_once_for_the_same_parameters(monkeypatch: pytest.MonkeyPatch):
    seen = observed(coarse(13)[:2], WIDE)
    value = wls(seen).value
    first, made = noise_torque(seen, value), []
    monkeypatch.setattr("scara_ident.estimation.noise_bias.noise_signals", lambda *_: made.append(1) or [])
    assert noise_torque(seen, value.copy()) == pytest.approx(first, rel=0.0)
    assert np.all(largest_noise_torque(seen, value, 0.01) > first)
    assert not made


def test_other_draws_of_the_noise_are_larger_than_the_largest_by_chance_alone():
    """Steps about 40 other zeros: of their rms about the usual one a tenth lies beyond what a tenth is said to."""
    seen, fine = observed(coarse(13), WIDE), observed(exact_runs(), WIDE)
    value, step, beyond = wls(fine).value, 2.0 * np.pi / 2**13, []
    limit = largest_noise_torque(seen, value, 0.1)
    assert np.all(limit < 1.3 * noise_torque(seen, value))
    for zero in np.random.default_rng(0).uniform(0.0, step, (20, 2, 1)):
        runs = [
            replace(run, position=step * np.round((run.position + zero) / step) - zero) for run in exact_runs()[::2]
        ]
        made, true = observed(runs, WIDE), observed(exact_runs()[::2], WIDE)
        for j in range(2):
            parts = zip(made.data.stretches, made.predicted(value), true.predicted(value), strict=True)
            differs = np.concatenate([part.smooth(j, a[j] - b[j])[part.used[j]] for part, a, b in parts])
            beyond.append(np.sqrt(np.mean(differs**2)) > limit[j])
    # Of 40 by chance at most 8, of which more come in one of 100; of the usual rms half.
    assert np.mean(beyond) <= 0.2


def test_where_nothing_is_moved_nothing_is_said():
    assert bias_sentence(("a", "b"), np.array([0.1, 0.0]), np.array([1.0, 1.0])) is None


def test_without_a_band_nothing_can_be_said():
    assert noise_bias(observed(exact_runs()[:2], (None, None)), np.ones(2), np.zeros(15)) is None


def test_a_repetition_adds_nothing():
    """The bias follows from the motion: one recording of each trajectory tells what all of them do."""
    seen, weights = observed(coarse(13), WIDE), np.array([50.0, 125.0])
    assert len(set(seen.data.labels)) < len(seen.data.labels)
    once = weighted(seen.by_joint, weights).solve().value
    twice = weighted(informations(seen.model, noisier(seen.data)), weights).solve().value
    found = noise_bias(seen, weights, once)
    assert found is not None
    assert found[:5] == pytest.approx((twice - once)[:5], rel=0.1)


def test_of_more_than_is_held_noise_is_drawn_group_by_group(monkeypatch):
    seen = observed(coarse(13), WIDE)
    once = wls(seen).noise_bias
    assert once is not None
    monkeypatch.setattr(sample_columns, "MAX_VALUES", 2 * max(part.samples for part in seen.data.stretches))
    many = observed(coarse(13), WIDE)
    bias = wls(many).noise_bias
    assert bias is not None
    # Other draws of the same noise.
    assert not np.array_equal(bias, once)
    assert bias[0] == pytest.approx(once[0], rel=0.3)
    # What steps were drawn on is not kept.
    kept = [{cut for _, cut in part.stretch._filtered} for part in many.data.stretches]
    assert all(STEPLESS * many.data.stretches[0].rate not in cuts for cuts in kept)
