"""What is no event: a trend of a run, and what is left at the same state of motion at other times."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scara_ident.identification.binned_residual import Binned, binned
from scara_ident.identification.event_background import _of_others, without_states, without_trends
from scara_ident.motion.prepared import prepare
from scara_ident.robot.robot import load_robot
from tests.arms import swing

ROBOT = load_robot()
STRETCHES = prepare([swing(ROBOT, f"r{k}", seed=k, seconds=20.0, rate=250.0) for k in range(4)], (8.0, 8.0)).stretches


def made(added: list[np.ndarray]) -> list[Binned]:
    """Residuals of white noise and what is added on the first joint."""
    rng = np.random.default_rng(2)
    found = []
    for k, (part, more) in enumerate(zip(STRETCHES, added, strict=True)):
        left = 0.1 * rng.standard_normal((2, part.samples))
        left[0] += more
        # The predicted torque, a state, is the recorded one less this residual.
        found.append(binned(k, part, left, np.full(2, 0.5)))
    return found


def size(item: Binned) -> float:
    return float(np.sqrt(np.mean(item.left[0, item.known[0] > 0.9] ** 2)))


def test_an_offset_and_a_drift_of_a_run_are_taken_off_and_a_push_is_not():
    added = [np.zeros(part.samples) for part in STRETCHES]
    added[1] += 0.3 + 0.4 * np.arange(len(added[1])) / len(added[1])
    added[2][2000:2250] += 0.4
    before = made(added)
    after = without_trends(before)
    assert size(before[1]) > 0.4
    assert size(after[1]) < 0.06
    push = slice(2000 // before[2].size + 1, 2250 // before[2].size - 1)
    assert np.mean(after[2].left[0, push]) > 0.9 * np.mean(before[2].left[0, push])


def test_a_runs_own_friction_is_taken_off_where_it_hardly_ever_turns_back():
    item = made([np.zeros(part.samples) for part in STRETCHES])[0]
    # Two seconds back among eighteen forth, in which an offset and friction add up to nothing.
    speed = np.ones(item.taken.shape)
    speed[:, 250:300] = -1.0
    q, _, a, load = item.state
    turned = replace(
        item,
        raw=item.raw + np.repeat(1.0 - speed, item.size, axis=1),
        used=np.ones_like(item.used),
        state=(q, speed, a, load),
    )
    (after,) = without_trends([turned])
    assert np.max(np.abs(np.mean(after.left[:, 255:295], axis=1))) < 0.1


def test_a_long_push_in_a_run_that_turns_twice_is_no_trend_of_it():
    item = made([np.zeros(part.samples) for part in STRETCHES])[0]
    # Three seconds forth, eight back, and forth again: a friction that falls explains most of a push in the first of them.
    speed = np.ones(item.taken.shape)
    speed[:, 75:275] = -1.0
    push = np.zeros_like(speed)
    push[:, 15:73] = 0.3
    q, _, a, load = item.state
    pushed = replace(
        item,
        raw=item.raw + np.repeat(push, item.size, axis=1),
        used=np.ones_like(item.used),
        state=(q, speed, a, load),
    )
    (after,) = without_trends([pushed])
    assert np.all(np.mean(after.left[:, 16:72], axis=1) > 0.25)


def test_what_comes_with_the_motion_in_all_recordings_is_taken_off_and_what_happens_once_is_not():
    speed = max(float(np.abs(part.motion.v[0]).max()) for part in STRETCHES)
    falling = [
        0.5 * np.sign(part.motion.v[0]) * np.exp(-np.abs(part.motion.v[0]) / (0.2 * speed)) for part in STRETCHES
    ]
    # A cable's pull is by the angle itself, which turns far.
    pulling = [0.2 * part.motion.q[0] for part in STRETCHES]
    for added in (falling, pulling):
        before = made(added)
        after = without_states(before)
        assert all(size(new) < 0.5 * size(old) for old, new in zip(before, after, strict=True))
    once = [np.zeros(part.samples) for part in STRETCHES]
    once[3][1500:1750] = 0.5
    alone = without_states(made(once))[3]
    assert np.mean(alone.left[0, 152:173]) > 0.4


def test_what_friction_lacks_is_taken_off_as_soon_as_a_joint_turns_back():
    added = [0.5 * np.sign(part.motion.v[0]) * np.sin(part.motion.q[0]) for part in STRETCHES]
    for old, new in zip(made(added), without_states(made(added)), strict=True):
        speed = np.abs(old.state[1][0])
        slow = (old.known[0] > 0.9) & (speed < 0.1 * np.max(speed))
        # The mean of ten samples of 0.1 is left; a sign that grows over a tenth of the speed leaves 0.05 and more.
        left, before = (np.sqrt(np.mean(item.left[0, slow] ** 2)) for item in (new, old))
        assert left < 0.04 < 0.1 < before


def test_a_state_that_one_recording_has_again_and_again_is_no_event_and_what_happens_once_in_it_is():
    # Only the last ever moves.
    speed = np.max(np.abs(STRETCHES[3].motion.v[0]))
    added = [
        0.5 * (part.motion.v[0] / speed) ** 3 if k == 3 else np.zeros(part.samples) for k, part in enumerate(STRETCHES)
    ]
    added[3][1500:1750] += 0.5
    items = made(added)
    still = [replace(item, state=tuple(np.zeros_like(row) for row in item.state)) for item in items[:3]]
    left = without_states([*still, items[3]])[3].left[0]
    usual = (items[3].known[0] > 0.9) & (np.abs(np.arange(len(left)) - 162) > 20)
    assert np.sqrt(np.mean(items[3].left[0, usual] ** 2)) > 0.1
    assert np.sqrt(np.mean(left[usual] ** 2)) < 0.05
    assert np.mean(left[152:173]) > 0.4


def test_a_trend_is_the_same_whatever_other_runs_are_fitted_beside():
    added = [np.zeros(part.samples) for part in STRETCHES]
    added[1] += 0.3 * np.arange(len(added[1])) / len(added[1])
    # One that others are not like: from its stretches fits begin that end elsewhere.
    added[2][2000:2750] += 0.4
    items = made(added)
    together = without_trends(items)
    for item, beside in zip(items, together, strict=True):
        (alone,) = without_trends([item])
        np.testing.assert_allclose(alone.taken, beside.taken, atol=1e-9)


def test_the_trend_of_a_run_without_noise_is_what_it_is():
    item = made([np.zeros(part.samples) for part in STRETCHES])[0]
    # More than half of the bins are met exactly: what is left of them has no scale.
    odd = np.zeros(item.taken.shape)
    odd[:, 100:150] = 1.0
    exact = replace(item, raw=np.repeat(0.2 + odd, item.size, axis=1), used=np.ones_like(item.used))
    (after,) = without_trends([exact])
    left = after.left - odd
    assert np.sqrt(np.mean(left**2)) < 0.2
    assert np.all(np.isfinite(after.left))


def test_what_no_other_part_says_anything_of_is_left_alone():
    """Of the third of four parts only the first might, as those beside it do not count: next to nothing, over nothing, is a lot."""
    rng = np.random.default_rng(0)
    starts, known = np.arange(0, 160, 40), np.ones(160, dtype=bool)
    columns = rng.standard_normal((6, 160))
    columns[:, :40] *= 1e-10
    left = 0.7 * columns[0] + 0.3 * columns[3] + 0.01 * rng.standard_normal(160)
    with np.errstate(over="raise", invalid="raise"):
        taken = _of_others(columns, left, known, starts, np.array([0]))
    assert np.max(np.abs(taken[80:120])) < 0.1
