"""Raw positions and torques in: the same whatever the pieces, as off-line, right about itself, and quick to see a change."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scara_ident.errors import UsageError
from scara_ident.estimation.least_squares import wls
from scara_ident.estimation.observations import observe
from scara_ident.motion.prepared import prepare
from scara_ident.online import OnlineIdentifier, OnlineSettings
from scara_ident.recording.recording import Recording
from scara_ident.robot.robot import load_robot
from tests.online.made import NOISE, RATE, model, signals, torque, truth
from tests.online.test_identifier import CHANGES, changed_torque

SETTINGS = OnlineSettings(rate=RATE, band=10.0, memory=60.0)
# A wide band has short blocks: much happens in few samples.
WIDE = replace(SETTINGS, band=50.0)
# Of an encoder with 17 bits a turn.
STEP = 2.0 * np.pi / 2**17


def rounded(q: np.ndarray) -> np.ndarray:
    return np.round(q / STEP) * STEP


def fed(q, effort, chosen=SETTINGS) -> OnlineIdentifier:
    online = OnlineIdentifier(model(), NOISE, chosen)
    online.update_block(q, None, None, effort)
    return online


def state_of(online: OnlineIdentifier, folder: Path) -> dict[str, np.ndarray]:
    online.save(folder / "state.npz")
    with np.load(folder / "state.npz") as held:
        return dict(held)


def made(seconds: float, lost=()) -> tuple[np.ndarray, np.ndarray]:
    states = signals(seconds)
    q, effort = rounded(states[0]), torque(states, truth())
    effort[0, list(lost)] = np.nan
    return q, effort


# Places that were lost, alone and in a row, and where the stream is cut.
PLACES = st.lists(st.integers(0, 699), max_size=12)


@pytest.mark.slow
@given(PLACES, st.integers(0, 699), st.integers(1, 80), PLACES)
@settings(max_examples=25, deadline=None)
def test_pieces_of_any_size_and_lost_samples_make_no_difference(tmp_path_factory, lost, burst, length, ends):
    folder = tmp_path_factory.mktemp("pieces")
    q, effort = made(1.4, lost)
    q[1, burst : burst + length] = np.inf
    whole, parts, single = (OnlineIdentifier(model(), NOISE, WIDE) for _ in range(3))
    whole.update_block(q, None, None, effort)
    for start, stop in zip([0, *sorted(ends)], [*sorted(ends), 700], strict=True):
        parts.update_block(q[:, start:stop], None, None, effort[:, start:stop])
    for k in range(700):
        single.update(q[:, k], None, None, effort[:, k])
    assert whole.samples == 700
    expected = state_of(whole, folder)
    for other in (parts, single):
        for name, value in state_of(other, folder).items():
            np.testing.assert_array_equal(value, expected[name])


@pytest.mark.slow
@given(st.integers(0, 700), PLACES)
@settings(max_examples=25, deadline=None)
def test_a_crash_changes_nothing(tmp_path_factory, half, lost):
    folder = tmp_path_factory.mktemp("crash")
    q, effort = made(1.4, lost)
    first = fed(q[:, :half], effort[:, :half], WIDE)
    first.save(folder / "half.npz")
    second = OnlineIdentifier.restore(folder / "half.npz", model())
    second.update_block(q[:, half:], None, None, effort[:, half:])
    expected = state_of(fed(q, effort, WIDE), folder)
    for name, value in state_of(second, folder).items():
        np.testing.assert_array_equal(value, expected[name])


@pytest.mark.slow
def test_parameters_lie_within_their_standard_deviations():
    scores = []
    for seed in range(8):
        states = signals(30.0, seed)
        online = fed(rounded(states[0]), torque(states, truth(), seed=seed + 50), replace(SETTINGS, forgetting="none"))
        scores.append((online.value - truth()) / online.std)
    # Of 88 scores, correlated ones among them.
    assert 0.75 < np.sqrt(np.mean(np.square(scores))) < 1.25


def test_it_is_the_estimate_of_the_whole_recording():
    states = signals(60.0)
    q, effort = rounded(states[0]), torque(states, truth())
    online = fed(q, effort, replace(SETTINGS, forgetting="none"))
    time = np.arange(q.shape[1]) / RATE
    recording = Recording("run_1", "run", 1, load_robot().joints, time, q, effort)
    offline = wls(observe(model(), prepare([recording], (SETTINGS.band,) * 2)), NOISE)
    apart = np.abs(online.value - offline.value) / online.std
    # Both look at the same noise; their filters have different edges, and on-line no end is left out.
    assert np.sqrt(np.mean(apart**2)) < 0.5 and np.max(apart) < 1.5
    np.testing.assert_allclose(online.std, offline.std, rtol=0.35)


@pytest.mark.slow
def test_the_size_of_each_joints_noise_is_found():
    states = signals(120.0)
    clean = torque(states, truth()) - torque(states, 0.0 * truth())
    noise = NOISE[:, None] * np.array([[3.0], [0.5]]) * np.random.default_rng(2).standard_normal(clean.shape)
    wrong, right = OnlineIdentifier(model(), NOISE, SETTINGS), OnlineIdentifier(model(), NOISE * [3.0, 0.5], SETTINGS)
    for online in (wrong, right):
        online.update_block(rounded(states[0]), None, None, clean + noise)
    # The given noise counts as 100 of 2,400 rows, and the first ones were weighed by it: not three times and half.
    np.testing.assert_allclose(wrong.std, right.std, rtol=0.2)
    assert np.max(np.abs(wrong.value - right.value) / right.std) < 0.5


@pytest.mark.slow
def test_few_lost_samples_are_bridged_and_after_many_the_filter_begins_anew():
    states = signals(60.0)
    q, effort = rounded(states[0]), torque(states, truth())
    whole, bridged = fed(q, effort), effort.copy()
    bridged[:, np.random.default_rng(0).choice(effort.shape[1], effort.shape[1] // 100, replace=False)] = np.nan
    few = fed(q, bridged)
    assert few.samples == whole.samples
    assert np.max(np.abs(few.value - whole.value) / whole.std) < 1.0
    np.testing.assert_allclose(few.std, whole.std, rtol=0.05)
    # A third of the motion is missing: over the jump nothing is learnt, and nothing is called a change.
    cut = OnlineIdentifier(model(), NOISE, SETTINGS)
    alarms = cut.update_block(q[:, :10000], None, None, effort[:, :10000])
    cut.gap()
    alarms += cut.update_block(q[:, 20000:], None, None, effort[:, 20000:])
    assert alarms == [] and cut.samples == 20000
    assert np.max(np.abs(cut.value - truth()) / cut.std) < 4.0
    gone = effort.copy()
    gone[:, 10000:20000] = np.nan
    other = fed(q, gone)
    np.testing.assert_array_equal(other.value, cut.value)
    assert other.samples == 30000


def test_a_jump_that_is_no_gap_spoils_what_is_known():
    """What `gap` is there for."""
    q, effort = made(60.0)
    spoilt = OnlineIdentifier(model(), NOISE, SETTINGS)
    spoilt.update_block(q[:, :10000], None, None, effort[:, :10000])
    assert spoilt.update_block(q[:, 20000:], None, None, effort[:, 20000:])


def test_at_rest_nothing_is_learnt_and_nothing_winds_up():
    states = signals(8.0)
    online = fed(rounded(states[0]), torque(states, truth()), replace(SETTINGS, memory=1.0))
    online.gap()
    before = online.std.copy()
    still = [np.full((2, 5000), 0.3), np.zeros((2, 5000)), np.zeros((2, 5000))]
    assert online.update_block(still[0], None, None, torque(still, truth())) == []
    np.testing.assert_array_equal(online.std, before)


def test_velocity_beside_a_band_and_none_without_are_refused():
    online = OnlineIdentifier(model(), NOISE, SETTINGS)
    q, zero = np.zeros((2, 5)), np.zeros((2, 5))
    with pytest.raises(UsageError, match="velocity is given, but with a band it is computed from positions; give None"):
        online.update_block(q, zero, None, zero)
    with pytest.raises(UsageError, match="acceleration is given, but with a band"):
        online.update(q[:, 0], None, zero[:, 0], zero[:, 0])
    with pytest.raises(UsageError, match=r"effort of shape \(3,\); expected \(2,\)"):
        online.update(q[:, 0], None, None, np.zeros(3))
    with pytest.raises(UsageError, match=r"expected \(2, N\) of each"):
        online.update_block(q, None, None, zero[:, 1:])
    plain = OnlineIdentifier(model(), NOISE, replace(SETTINGS, band=None))
    for take, one in ((plain.update, q[:, 0]), (plain.update_block, q)):
        for v, a in ((None, None), (one, None), (None, one)):
            with pytest.raises(UsageError, match=r"velocity or acceleration is None, .* give both, or a band"):
                take(one, v, a, one)
    assert online.samples == plain.samples == 0


def test_a_block_that_cannot_be_absorbed_does_not_end_it(monkeypatch: pytest.MonkeyPatch):
    q, effort = made(30.0)
    online = fed(q[:, :10000], effort[:, :10000])

    def fails(*_: object) -> None:
        raise np.linalg.LinAlgError("did not converge")

    with monkeypatch.context() as context:
        context.setattr(OnlineIdentifier, "_rows", fails)
        with pytest.raises(np.linalg.LinAlgError):
            online.update_block(q[:, 10000:10200], None, None, effort[:, 10000:10200])
    count = online.samples
    online.update_block(q[:, 10200:], None, None, effort[:, 10200:])
    assert online.samples == count + 4800
    assert np.max(np.abs(online.value - truth()) / online.std) < 4.0


@pytest.mark.slow
@CHANGES
def test_a_change_is_seen_within_a_second_and_a_half_and_named(kind, joint):
    states = signals(62.0)
    part = round(60.0 * RATE)
    before, after = ([signal[:, some] for signal in states] for some in (slice(None, part), slice(part, None)))
    online = OnlineIdentifier(model(), NOISE, SETTINGS)
    assert online.update_block(rounded(before[0]), None, None, torque(before, truth())) == []
    alarms = online.update_block(rounded(after[0]), None, None, changed_torque(kind, after))
    assert alarms and 0 < alarms[0].sample - part <= 1.5 * RATE
    assert (alarms[0].effect, alarms[0].joint) == (kind, joint)
    assert alarms[0].size > 0.0 and alarms[0].unit in ("1", "kg")


def coarse(bits: int, band: float, seconds: float = 60.0, seed: int = 0) -> OnlineIdentifier:
    """An arm behind encoders of so many bits."""
    states, step = signals(seconds, seed), 2.0 * np.pi / 2**bits
    return fed(np.round(states[0] / step) * step, torque(states, truth(), seed=seed), replace(SETTINGS, band=band))


@pytest.mark.slow
def test_a_band_too_wide_for_the_encoder_is_said_once_and_a_narrower_that_does(
    caplog: pytest.LogCaptureFixture, tmp_path: Path
):
    """Twenty times the alarms that were asked for were raised in one, and only the documentation said so."""
    online = coarse(13, 20.0)
    # Shares change as more is known.
    (note,), (_,) = caplog.messages, online.notes
    assert note.startswith("in a band of 20 Hz the noise of positions makes ")
    narrower = float(note.partition("; use a band of ")[2].partition(" Hz")[0])
    assert 2.0 < narrower < 20.0
    # Not again, neither by going on nor after a restart.
    online.save(tmp_path / "state.npz")
    again = OnlineIdentifier.restore(tmp_path / "state.npz", model())
    states = signals(10.0)
    again.update_block(rounded(states[0]), None, None, torque(states, truth()))
    assert again.notes and caplog.messages == [note]
    assert coarse(13, narrower).notes == ()
    assert caplog.messages == [note]


@pytest.mark.slow
@pytest.mark.parametrize(("bits", "band"), [(17, 10.0), (17, 20.0), (13, 5.0)])
def test_of_a_band_that_goes_with_the_encoder_nothing_is_said(bits: int, band: float, caplog: pytest.LogCaptureFixture):
    for seed in (1, 2, 3):
        assert coarse(bits, band, seed=seed).notes == ()
    assert caplog.messages == []
    # Nor without a band, where nothing is filtered.
    assert OnlineIdentifier(model(), NOISE).notes == ()


def test_a_torque_far_off_while_little_is_known_makes_no_variance_negative():
    """The other joint's part of the innovations was less than nothing: roots of negative numbers, and a singular value that did not converge."""
    for seed in range(8):
        rng, states = np.random.default_rng(seed), signals(4.0)
        effort = torque(states, truth(), seed=seed)
        start = int(rng.integers(100, effort.shape[1] - 200))
        effort[seed % 2, start : start + int(rng.integers(5, 200))] += 10.0 ** rng.uniform(1.0, 6.0)
        online = fed(states[0], effort, replace(SETTINGS, band=20.0))
        assert np.all(np.isfinite(online.value[online.determined]))
        assert np.all(np.isfinite(online.std[online.determined]))
