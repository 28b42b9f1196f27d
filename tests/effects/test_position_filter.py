"""What a filter of the positions leaves beside its delay: by closed form, and of links behind gears too."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.effects import Member, Signals
from scara_ident.effects.elasticity import JointElasticity
from scara_ident.effects.position_filter import PositionFilter
from scara_ident.model.model import build_model
from scara_ident.robot.robot import load_robot
from tests.effects.scenes import columns, fit, moving, scene_of
from tests.effects.test_measurement import recordings


def test_a_filter_of_the_positions_is_recognised_by_its_second_derivative():
    """Of a mean over L, without its delay, the torque is that of the positions less L^2/24 of its second derivative."""
    samples, made = 61, []
    for item in recordings(lambda u, time: u, noise=1e-3):
        # In the middle of the samples: no delay is left.
        mean = np.array([np.convolve(row, np.full(samples, 1.0 / samples), "same") for row in item.position])
        inside = slice(samples, -samples)
        assert item.effort is not None
        made.append(replace(item, time=item.time[inside], position=mean[:, inside], effort=item.effort[:, inside]))
    _, value, covariance = fit(build_model(load_robot()), made, PositionFilter(), Member(None))
    assert -value[1] == pytest.approx((samples / 500.0) ** 2 / 24.0, rel=0.1)
    assert -value[1] > 5.0 * np.sqrt(covariance[1, 1])
    # Less than half a sample.
    assert abs(value[0]) < 1e-3


def test_links_behind_gears_are_filtered_with_the_bodies():
    """Without them a filter of 40 ms beside a gear of 8 Hz was not what it is beside a rigid one."""
    robot = load_robot()
    item, gear = moving(robot), Member(1, (8.0, 0.05))
    rigid = scene_of(robot)
    elastic = replace(rigid, together=((JointElasticity(), gear),))
    own = columns(PositionFilter(), elastic, item, Member(None))
    tie = JointElasticity().tie(elastic, gear)
    assert tie is not None
    lagging = tie.value * JointElasticity().regressor(Signals(elastic, item), gear)[:, 0]
    # Far slower than the low-pass of the derivatives, but at the ends.
    inside = slice(300, -300)
    slope = np.gradient(lagging, 1.0 / item.rate, axis=1)[:, inside]
    found = (own - columns(PositionFilter(), rigid, item, Member(None)))[:, 0, inside]
    assert np.max(np.abs(found - slope)) < 0.02 * np.max(np.abs(slope))
