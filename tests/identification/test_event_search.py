"""What stands out in time: a step of some tenths of a second, and neither heavy tails nor what the motion repeats."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.identification.binned_residual import Binned, binned, bounded_noise
from scara_ident.identification.event_background import without_states, without_trends
from scara_ident.identification.event_search import Segment, standing_out
from scara_ident.motion.prepared import PreparedStretch, prepare
from scara_ident.robot.robot import load_robot
from tests.arms import swing

ROBOT = load_robot()
RATE = 250.0
STRETCHES = prepare([swing(ROBOT, f"r{k}", seed=k, seconds=20.0, rate=RATE) for k in range(4)], (8.0, 8.0)).stretches


def searched(left: list[np.ndarray]) -> list[Segment]:
    """What stands out where so much is left of the recorded torque, which has it in it."""
    parts = [with_more(part, row) for part, row in zip(STRETCHES, left, strict=True)]
    noise = bounded_noise(parts, left, range(len(parts)))
    stretches = [binned(k, part, row, noise[k]) for k, (part, row) in enumerate(zip(parts, left, strict=True))]
    return found_in(stretches)


def found_in(stretches: list[Binned]) -> list[Segment]:
    """What stands out of residuals of least squares, the robust ones and those of least squares being the same."""
    states = without_states(stretches)
    return standing_out(without_trends(states), lambda: [stretches, states])


def with_more(part: PreparedStretch, torque: np.ndarray) -> PreparedStretch:
    return replace(part, stretch=replace(part.stretch, torque=part.torque + torque))


def white(seed: int = 0) -> list[np.ndarray]:
    rng = np.random.default_rng(seed)
    return [rng.standard_normal((2, part.samples)) for part in STRETCHES]


def coloured(seed: int) -> list[np.ndarray]:
    """Noise whose correlation falls to 1/e within 0.1 s."""
    found = white(seed)
    for row in found:
        for k in range(1, row.shape[1]):
            row[:, k] += np.exp(-1.0 / (0.1 * RATE)) * row[:, k - 1]
    return found


@pytest.mark.parametrize("seconds", [0.3, 1.0, 2.0])
def test_a_push_of_three_times_the_noise_is_found_within_a_tenth_of_a_second(seconds: float):
    left = white()
    first = int(7.0 * RATE)
    left[2][0, first : first + int(seconds * RATE)] += 3.0
    (found,) = searched(left)
    assert found.binned.recording == 2
    assert found.start * found.binned.width == pytest.approx(7.0, abs=0.1)
    assert found.stop * found.binned.width == pytest.approx(7.0 + seconds, abs=0.1)
    assert found.score[0] > 1.0 > found.score[1]


def test_heavy_tails_and_noise_that_remembers_are_no_event():
    rng = np.random.default_rng(1)
    heavy = [rng.standard_t(3, (2, part.samples)) for part in STRETCHES]
    assert searched(heavy) == []
    assert searched(coloured(2)) == []


def test_a_push_of_three_times_what_a_ripple_leaves_is_found():
    left = [row + 1.5 * np.sin(50.0 * part.motion.q) for row, part in zip(white(7), STRETCHES, strict=True)]
    left[2][0, int(7.0 * RATE) : int(8.5 * RATE)] += 3.0 * np.std(left[2][0])
    (found,) = searched(left)
    assert found.binned.recording == 2
    assert found.start * found.binned.width == pytest.approx(7.0, abs=0.1)
    assert found.stop * found.binned.width == pytest.approx(8.5, abs=0.1)


@pytest.mark.slow
def test_pushes_do_not_hide_one_another():
    for begins in ((3.0,), (3.0, 8.0)):
        left = white(6)
        for k, row in enumerate(left):
            for begin in begins:
                row[k % 2, int(begin * RATE) : int((begin + 0.6) * RATE)] += 6.0
        assert len(searched(left)) == 4 * len(begins)


def test_a_push_is_found_by_the_joints_that_it_leaves_beside_one_of_which_more_is_left():
    """A UR5 pushed at 80 times the noise: the push had spoilt a wrist's friction, and nothing was said as that lasted 4 s."""
    left = white()
    first, last = int(7.0 * RATE), int(8.5 * RATE)
    left[2][0, first:last] += 6.0
    left[2][1, first : first + int(4.5 * RATE)] += 6.0
    (found,) = searched(left)
    assert found.start * found.binned.width == pytest.approx(7.0, abs=0.1)
    assert found.stop * found.binned.width == pytest.approx(8.5, abs=0.1)
    assert found.score[0] > 1.0 > found.score[1]


def test_least_squares_is_asked_for_only_where_something_stands_out():
    parts, left = [with_more(part, row) for part, row in zip(STRETCHES, white(5), strict=True)], white(5)
    noise = bounded_noise(parts, left, range(len(parts)))
    quiet = [binned(k, part, row, noise[k]) for k, (part, row) in enumerate(zip(parts, left, strict=True))]
    assert standing_out(without_trends(without_states(quiet)), lambda: pytest.fail("nothing stands out")) == []


def test_what_depends_on_the_motion_is_no_event():
    left = [row + 4.0 * (np.abs(part.motion.v) < 0.15) for row, part in zip(white(3), STRETCHES, strict=True)]
    assert searched(left) == []


def test_a_change_that_lasts_is_no_event():
    left = white(4)
    left[1][0, int(8.0 * RATE) :] += 3.0
    assert searched(left) == []


def test_what_stands_out_in_a_state_that_the_arm_is_in_once_is_no_event_unless_it_is_large():
    for size, found in ((1.5, 0), (6.0, 1)):
        left = white(8)
        left[2][0, int(7.0 * RATE) : int(8.0 * RATE)] += size
        parts = [with_more(part, row) for part, row in zip(STRETCHES, left, strict=True)]
        noise = bounded_noise(parts, left, range(len(parts)))
        usual = [binned(k, part, row, noise[k]) for k, (part, row) in enumerate(zip(parts, left, strict=True))]
        assert len(found_in(usual)) == 1
        # The torque is as large as usual, and at no other time against such a speed.
        *motion, torque = usual[2].state
        against = np.where((np.arange(torque.shape[1]) >= 175) & (np.arange(torque.shape[1]) < 200), -torque, torque)
        once = [*usual[:2], replace(usual[2], state=(*motion, against)), usual[3]]
        assert len(found_in(once)) == found


def test_next_to_a_slow_motion_is_none_the_other_way():
    left = white(8)
    left[2][0, int(7.0 * RATE) : int(8.0 * RATE)] += 1.5
    parts = [with_more(part, row) for part, row in zip(STRETCHES, left, strict=True)]
    noise = bounded_noise(parts, left, range(len(parts)))
    # Slow from 2 to 18 s, and forth at all times, or back while something is left.
    forth = [binned(k, part, row, noise[k]) for k, (part, row) in enumerate(zip(parts, left, strict=True))]
    place = np.arange(forth[2].taken.shape[1])
    q, v, a, load = forth[2].state
    speed = np.where((place >= 50) & (place < 450), 0.01, 1.0) * np.abs(v)
    for turns, found in ((1.0, 1), (-1.0, 0)):
        turned = np.where((place >= 175) & (place < 200), turns, 1.0) * speed
        assert len(found_in([*forth[:2], replace(forth[2], state=(q, turned, 0.0 * a, load)), forth[3]])) == found


def test_what_only_a_trend_has_made_is_no_event():
    left = white(10)
    parts = [with_more(part, row) for part, row in zip(STRETCHES, left, strict=True)]
    noise = bounded_noise(parts, left, range(len(parts)))
    plain = [binned(k, part, row, noise[k]) for k, (part, row) in enumerate(zip(parts, left, strict=True))]
    made = np.zeros_like(plain[2].taken)
    made[0, 175:200] = -3.0
    after = [*plain[:2], plain[2].without(made), plain[3]]
    assert len(standing_out(after, lambda: [after, after])) == 1
    assert standing_out(after, lambda: [after, plain]) == []


@pytest.mark.slow
def test_beside_a_state_that_the_arm_is_in_once_nothing_is_an_event_unless_it_is_large():
    for size, found in ((1.5, []), (6.0, [7.72])):
        left = white(8)
        left[2][0, int(7.0 * RATE) : int(7.32 * RATE)] += 2.5
        left[2][1, int(7.72 * RATE) : int(8.72 * RATE)] += size
        parts = [with_more(part, row) for part, row in zip(STRETCHES, left, strict=True)]
        noise = bounded_noise(parts, left, range(len(parts)))
        usual = [binned(k, part, row, noise[k]) for k, (part, row) in enumerate(zip(parts, left, strict=True))]
        *motion, torque = usual[2].state
        against = np.where((np.arange(torque.shape[1]) >= 175) & (np.arange(torque.shape[1]) < 183), -torque, torque)
        once = [*usual[:2], replace(usual[2], state=(*motion, against)), usual[3]]
        assert len(found_in(usual)) == 2
        shown = found_in(once)
        assert [segment.start * segment.binned.width for segment in shown] == pytest.approx(found, abs=0.1)


def slowed(
    share: float, push: slice, seconds: tuple[float, float], size: float = 3.0, friction: slice | None = None
) -> list[Segment]:
    """What stands out where a joint is slowed to that share of its peak speed, of a push of so many times the noise."""
    part = STRETCHES[2]
    speed = part.motion.v.copy()
    speed[0, int(seconds[0] * RATE) : int(seconds[1] * RATE)] = share * np.max(np.abs(speed[0]))
    left = white(9)
    left[2][0, push] += size
    if friction is not None:
        left[2][0, friction] += 20.0
    slow = with_more(part, left[2])
    object.__setattr__(slow, "motion", replace(part.motion, v=speed))
    parts = [*STRETCHES[:2], slow, STRETCHES[3]]
    noise = bounded_noise(parts, left, range(len(parts)))
    return found_in([binned(k, own, row, noise[k]) for k, (own, row) in enumerate(zip(parts, left, strict=True))])


def test_a_push_is_found_while_its_joint_turns_at_a_twenty_fifth_of_its_speed():
    (found,) = slowed(0.04, slice(int(7.0 * RATE), int(8.0 * RATE)), (6.0, 9.0))
    assert (found.start * found.binned.width, found.stop * found.binned.width) == pytest.approx((7.0, 8.0), abs=0.1)


def test_a_joint_is_seen_before_a_push_where_it_turns_at_a_fiftieth_of_its_speed():
    (found,) = slowed(0.02, slice(int(7.0 * RATE), int(8.0 * RATE)), (5.0, 7.0), 1.0)
    assert (found.start * found.binned.width, found.stop * found.binned.width) == pytest.approx((7.0, 8.0), abs=0.1)


def test_friction_while_a_joint_hardly_turns_does_not_lengthen_a_push():
    turning = slice(int(8.2 * RATE), int(8.5 * RATE))
    (found,) = slowed(0.002, slice(int(7.0 * RATE), int(8.0 * RATE)), (8.1, 9.0), friction=turning)
    assert (found.start * found.binned.width, found.stop * found.binned.width) == pytest.approx((7.0, 8.0), abs=0.1)
