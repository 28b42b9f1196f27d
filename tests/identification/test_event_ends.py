"""Where an event begins and ends: while the arm stands still by the step of the torque, and where nothing is said, between."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.identification.event_ends import Ends, event_ends

WIDTH = 0.04
# It moves up to bin 100 and from bin 150 on; in between it stands still, and nothing is said of four bins on either side.
REST = slice(104, 146)


def pair(ends: Ends) -> tuple[int, int]:
    return ends.start, ends.stop


def found(push: slice, friction: float = 0.0, window: slice | None = None) -> Ends:
    """The ends found of a push of five times the noise on the first of two joints."""
    rng = np.random.default_rng(3)
    left = rng.standard_normal((2, 300))
    left[0, push] += 5.0
    trust, still = np.ones_like(left), np.full_like(left, np.nan)
    trust[:, 100:150] = 0.0
    still[:, REST] = left[:, REST] + friction
    window = slice(push.start, min(push.stop, 100)) if window is None else window
    free, shows = np.ones(300, dtype=bool), np.array([True, False])
    return event_ends(left, trust, still, free, window, shows, WIDTH)


@pytest.mark.parametrize("stop", [90, 115, 130])
def test_a_push_ends_where_the_torque_steps_at_rest_whatever_friction_is_there(stop: int):
    start, end = pair(found(slice(70, stop), friction=-9.0))
    assert start == pytest.approx(70, abs=1)
    assert end == pytest.approx(stop, abs=1)


def test_it_begins_so_too():
    start, end = pair(found(slice(120, 190), friction=7.0, window=slice(150, 190)))
    assert start == pytest.approx(120, abs=1)
    assert end == pytest.approx(190, abs=1)


def test_a_rest_without_a_step_says_nothing_of_it():
    assert found(slice(70, 148)).stop == pytest.approx(102, abs=2)


@pytest.mark.parametrize(("trust", "end"), [(0.0, 115), (0.2, 128)])
def test_bins_of_less_trust_say_where_it_ends_and_between_those_of_none_the_middle_is_as_good_as_any(
    trust: float, end: int
):
    rng = np.random.default_rng(4)
    left = rng.standard_normal((1, 300))
    left[0, 60:128] += 6.0
    weight = np.ones_like(left)
    weight[:, 100:130] = trust
    nothing, every = np.full_like(left, np.nan), np.ones(300, dtype=bool)
    ends = event_ends(left, weight, nothing, every, slice(60, 100), np.array([True]), WIDTH)
    assert pair(ends) == (pytest.approx(60, abs=1), pytest.approx(end, abs=1))
    # Where nothing is said of the end, it may be anywhere there, and that is stated.
    assert ends.begins == (pytest.approx(59, abs=1), pytest.approx(61, abs=1))
    assert ends.ends[0] <= 128 <= ends.ends[1]
    assert (ends.ends[1] - ends.ends[0] > 20) == (trust == 0.0)


def test_a_force_whose_torque_changes_its_sign_along_the_motion_begins_before_it_does():
    rng = np.random.default_rng(5)
    shape = np.clip(0.25 * (np.arange(300.0)[None] - 100.0), -6.0, 6.0)
    left = rng.standard_normal((1, 300))
    left[:, 91:160] += shape[:, 91:160]
    weight, nothing, every = np.ones_like(left), np.full_like(left, np.nan), np.ones(300, dtype=bool)
    asked: list[tuple[int, int]] = []

    def expected(start: int, stop: int) -> np.ndarray:
        asked.append((start, stop))
        return shape

    place = slice(120, 155), np.array([True]), WIDTH
    start, stop = pair(event_ends(left, weight, nothing, every, *place, expected))
    assert (start, stop) == (pytest.approx(91, abs=2), pytest.approx(160, abs=1))
    # By the mean alone it is late.
    assert asked == [pair(event_ends(left, weight, nothing, every, *place))]
    assert asked[0][0] > 98


def test_what_comes_three_seconds_later_is_something_else():
    left = np.random.default_rng(6).standard_normal((1, 300))
    left[0, 60:128] += 6.0
    left[0, 200:215] += 40.0
    trust, nothing, every = np.ones_like(left), np.full_like(left, np.nan), np.ones(300, dtype=bool)
    start, stop = pair(event_ends(left, trust, nothing, every, slice(70, 120), np.array([True]), WIDTH))
    assert (start, stop) == (pytest.approx(60, abs=1), pytest.approx(128, abs=1))


def test_a_friction_at_rest_that_is_not_constant_does_not_move_an_end_seen_in_motion():
    rng = np.random.default_rng(7)
    left = rng.standard_normal((2, 300))
    left[:, 60:92] += 20.0
    trust, still = np.ones_like(left), np.full_like(left, np.nan)
    trust[:, 100:150] = 0.0
    still[:, REST] = rng.standard_normal((2, 42))
    # It creeps at first, and yields before it moves on.
    still[:, 104:108] += 60.0
    still[:, 140:146] -= 60.0
    free, shows = np.ones(300, dtype=bool), np.array([True, True])
    assert pair(event_ends(left, trust, still, free, slice(62, 92), shows, WIDTH)) == (60, 92)


def test_what_another_joint_keeps_after_it_is_not_taken_for_the_event():
    left = np.random.default_rng(8).standard_normal((2, 300))
    left[0, 60:100] += 30.0
    left[1, 60:100] += 5.0
    left[1, 100:112] -= 5.0
    weight, nothing, every = np.ones_like(left), np.full_like(left, np.nan), np.ones(300, dtype=bool)
    ends = event_ends(left, weight, nothing, every, slice(62, 98), np.array([True, True]), WIDTH)
    assert pair(ends) == (60, 100)
    assert ends.ends[0] <= 100 <= ends.ends[1] <= 102


def test_a_force_that_is_wrong_about_a_joint_does_not_shorten_it():
    left = np.random.default_rng(9).standard_normal((2, 300))
    left[:, 60:100] += np.array([[8.0], [12.0]])
    weight, nothing, every = np.ones_like(left), np.full_like(left, np.nan), np.ones(300, dtype=bool)
    weight[0, 60:70] = 0.1
    shape = np.repeat([[8.0], [-12.0]], 300, axis=1)
    ends = event_ends(
        left, weight, nothing, every, slice(72, 98), np.array([True, True]), WIDTH, lambda start, stop: shape
    )
    assert pair(ends) == (60, 100)


def test_what_stands_out_once_a_third_of_a_second_after_it_does_not_lengthen_it():
    rng = np.random.default_rng(8)
    left = rng.standard_normal((2, 300))
    left[:, 60:90] += np.array([[15.0], [30.0]])
    left[1, 98] += 25.0
    nothing, every = np.full_like(left, np.nan), np.ones(300, dtype=bool)
    force = np.repeat(np.array([[14.0], [27.0]]), 300, axis=1)
    ends = event_ends(
        left, np.ones_like(left), nothing, every, slice(62, 88), np.ones(2, dtype=bool), WIDTH, lambda *_: force
    )
    assert pair(ends) == (pytest.approx(60, abs=1), pytest.approx(90, abs=1))


def test_friction_that_goes_as_a_rest_begins_and_comes_as_it_ends_is_no_step_of_the_push():
    rng = np.random.default_rng(9)
    left = rng.standard_normal((2, 300))
    left[0, 70:125] += 5.0
    trust, still = np.ones_like(left), np.full_like(left, np.nan)
    trust[:, 100:150] = 0.0
    still[:, REST] = left[:, REST]
    still[0, 104:107] -= 30.0
    still[0, 142:146] += 40.0
    free, shows = np.ones(300, dtype=bool), np.array([True, False])
    ends = event_ends(left, trust, still, free, slice(70, 100), shows, WIDTH)
    assert pair(ends) == (pytest.approx(70, abs=1), pytest.approx(125, abs=1))
