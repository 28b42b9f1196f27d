"""A delay of each recording: its columns, its mean, and that of no recording in another's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from scara_ident.effects import Member
from scara_ident.effects.filters.position_filter import PositionFilter
from scara_ident.effects.filters.torque_filter import TorqueFilter
from scara_ident.effects.measurement import TimeDelay
from scara_ident.effects.recording_delays import MAX_RECORDINGS, DelayOfEachRecording
from scara_ident.estimation.run_variation import MIN_RUNS
from scara_ident.robot.robot import load_robot
from tests.effects.scenes import columns, moving, scene_of

EFFECT, ARM = DelayOfEachRecording(), Member(None)


def scene(*names: str):
    return scene_of(load_robot(), start={name: 0.0 for name in names or ("a_1", "m", "b_1")})


def test_each_recording_has_a_column_that_is_zero_in_all_others():
    item = moving(load_robot(), 1.0)
    assert item.name == "m"
    found = columns(EFFECT, scene(), item, ARM)
    # When Coulomb friction turns is no part of them.
    here = scene()
    names = np.array(here.model.names)
    smooth = replace(here, value=np.where(np.char.startswith(names, "a0"), 0.0, here.value))
    assert_allclose(found[:, [1]], columns(TimeDelay(), smooth, item, ARM), rtol=1e-6, atol=1e-9)
    assert not np.allclose(found[:, [1]], columns(TimeDelay(), here, item, ARM))
    assert not np.any(found[:, [0, 2]])
    assert [column.name for column in EFFECT.columns(scene(), ARM)] == ["delay_a_1", "delay_m", "delay_b_1"]
    assert not np.any(columns(EFFECT, scene(), replace(item, name="c_1"), ARM))


def test_it_is_tried_where_recordings_are_enough_and_not_too_many():
    names = [f"r_{k}" for k in range(MAX_RECORDINGS + 1)]
    assert [bool(EFFECT.members(scene(*names[:count]))) for count in (MIN_RUNS - 1, MIN_RUNS)] == [False, True]
    assert [bool(EFFECT.members(scene(*names[:count]))) for count in (-1, None)] == [True, False]


def test_the_mean_is_unsure_by_how_much_recordings_differ():
    value, covariance = np.array([0.001, 0.004, 0.004]), np.diag([4e-8, 1e-8, 4e-8])
    found = EFFECT.parameters(scene(), ARM, value, covariance)
    assert found["delay"].value == pytest.approx(0.003)
    # Of a mean of three the variances over nine, and what they scatter by over three.
    assert found["delay"].std == pytest.approx(np.sqrt(9e-8 / 9.0 + 3e-6 / 3.0))
    assert [found[f"delay_{name}"].value for name in ("a_1", "m", "b_1")] == value.tolist()
    assert found["delay_m"].std == pytest.approx(1e-4)
    one = EFFECT.alike(value[:1], covariance[:1, :1])
    assert (one[0].tolist(), one[1].tolist()) == ([0.001], [[4e-8]])


def test_delays_that_do_not_differ_are_reported_as_one():
    """Of a filter of the torque five recordings had a delay of 0.0154 s each, `by another time in each recording`."""
    value, covariance = 0.0154 + 1e-6 * np.arange(3), np.diag([4e-8, 1e-8, 4e-8])
    assert list(EFFECT.parameters(scene(), ARM, value, covariance)) == ["delay"]
    assert EFFECT.or_else(scene(), ARM, value) == "; here the delay is the same in all"
    slow = replace(scene(), rate=50.0)
    assert EFFECT.negligible(slow, ARM, value).startswith(
        "effort and position are +15 ms apart, less than one sample, for example"
    )
    assert EFFECT.negligible(replace(scene(), rate=500.0), ARM, value) is None
    apart = value + np.array([0.0, 1e-3, 0.0])
    assert len(EFFECT.parameters(scene(), ARM, apart, covariance)) == 4
    assert EFFECT.or_else(scene(), ARM, apart) == ""


def test_what_is_asked_of_a_delay_is_asked_of_the_largest():
    here = replace(scene(), rate=500.0)
    small, large = np.array([0.001, -0.0005, 0.0]), np.array([0.001, -0.003, 0.0])
    assert "-0.5 to +1 ms apart, differently in each recording" in EFFECT.negligible(here, ARM, small)
    assert EFFECT.negligible(here, ARM, large) is None
    assert (
        EFFECT.inadmissible(here, ARM, 30.0 * large, np.full(3, 1e-4))
        == "a delay of -0.09 s is longer than any measurement has"
    )
    assert EFFECT.inadmissible(here, ARM, large, np.full(3, 1e-4)) is None
    assert EFFECT.settled(np.array([1e-6, -1e-5])) and not EFFECT.settled(np.array([0.0, -1e-4]))
    assert "the delay is negative" in EFFECT.or_else(here, ARM, large)
    assert EFFECT.leaves(here, ARM, large) is None


def test_of_what_is_late_in_all_recordings_the_rest_of_a_filter_may_be_left():
    """A rigid Panda behind a lag of 18 ms had delays of each recording, and elastic gears of two joints for what the filter left."""
    here, late = replace(scene(), rate=500.0), np.array([-0.018, -0.0179, -0.0181])
    one, all_ = (
        effect.leaves(here, ARM, delays) for effect, delays in ((TimeDelay(), np.array([-0.018])), (EFFECT, late))
    )
    assert one is not None and all_ is not None
    assert one == (PositionFilter(0.018), ARM, pytest.approx(all_[2]))
    assert all_[:2] == (PositionFilter(pytest.approx(0.018)), ARM)
    assert EFFECT.leaves(here, ARM, late + np.array([0.0, 0.02, 0.0])) is None
    # A rigid UR5 whose torque lagged by 12 ms had delays of each recording too, 11.8 ms in all, and nothing was left of them.
    filtered = EFFECT.leaves(here, ARM, -late)
    assert filtered is not None
    assert filtered[:2] == (TorqueFilter(pytest.approx(0.018)), ARM)
