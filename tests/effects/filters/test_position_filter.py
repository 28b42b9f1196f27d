"""What a filter of the positions leaves beside its delay: by filters of SciPy, by Pinocchio, of links behind gears, of a virtual arm."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import bilinear, lfilter, lfilter_zi

from scara_ident.arrays import Array
from scara_ident.effects import Member, Signals
from scara_ident.effects.elasticity import JointElasticity
from scara_ident.effects.filters.position_filter import PositionFilter
from scara_ident.effects.measurement import shifted
from scara_ident.model.model import build_model
from scara_ident.robot.robot import load_robot
from tests.effects.filters.runs import RATE, diagnosed
from tests.effects.scenes import columns, fit, moving, scene_of
from tests.effects.test_measurement import recordings

DELAY, ALL = 0.012, Member(None)


def through(up: Array, down: Array, positions: Array) -> Array:
    start = lfilter_zi(up, down)
    return np.array([lfilter(up, down, row, zi=start * row[0])[0] for row in positions])


def first_order(positions: Array) -> Array:
    return through(*bilinear([1.0], [DELAY, 1.0], RATE), positions)


def butterworth(positions: Array) -> Array:
    return through(*bilinear([1.0], [DELAY**2 / 2.0, DELAY, 1.0], RATE), positions)


def mean(positions: Array) -> Array:
    count = round(2.0 * DELAY * RATE) + 1
    return through(np.full(count, 1.0 / count), np.array([1.0]), positions)


def late(positions: Array) -> Array:
    steps = round(DELAY * RATE)
    return through(np.eye(steps + 1)[steps], np.array([1.0]), positions)


@pytest.mark.parametrize(
    ("law", "shares", "said"),
    [
        (first_order, (1.0, 0.0), ", nearest to a low-pass of first order with the time constant 0.012 s"),
        (butterworth, (0.0, 1.0), ", nearest to a Butterworth low-pass of second order at 19 Hz"),
        # Of 13 samples, whose variance is 168/12 of a step squared; the third moment of any combination is that of a mean, zero.
        (mean, (14.0 / 36.0, 28.0 / 36.0), ", nearest to a mean over 0.024 s"),
        (late, (0.0, 0.0), ", nearest to a Butterworth low-pass of second order at 19 Hz"),
    ],
)
def test_a_filter_is_found_by_the_shares_of_two_laws(
    law: Callable[[Array], Array], shares: tuple[float, float], said: str
):
    made = []
    for item in recordings(lambda u, time: u, noise=1e-4):
        seen = shifted(replace(item, position=law(item.position)), -DELAY)
        # The filter stood at the first position, where the joints already moved.
        inside = slice(300, -300)
        assert seen.effort is not None
        made.append(
            replace(seen, time=seen.time[inside], position=seen.position[:, inside], effort=seen.effort[:, inside])
        )
    effect = PositionFilter(DELAY)
    scene, value, covariance = fit(build_model(load_robot()), made, effect, ALL, band=8.0)
    std = np.sqrt(np.diag(covariance))
    # Friction turns by more than the third order.
    assert np.all(np.abs(value - shares) < 3.0 * std + (0.02, 0.07))
    assert std[0] < 0.02
    assert effect.or_else(scene, ALL, value) == said
    found = effect.parameters(scene, ALL, value, covariance)["width"]
    assert found.value == pytest.approx(DELAY * np.sqrt(shares[0]), abs=0.03 * DELAY + 3.0 * min(found.std, 1e-3))


def test_columns_are_the_torque_of_the_positions_before_each_law():
    """Of large fast motion too, where inertias change by far within the filter's memory."""
    scene, effect = scene_of(load_robot(), rate=RATE), PositionFilter(DELAY)
    item = moving(scene.robot, 4.0, RATE)
    smooth = np.array(scene.value)
    for term in scene.model.terms[1:]:
        smooth[scene.model.place(term)] = 0.0
    rigid = replace(scene, value=smooth)
    inside = slice(400, -400)
    for k, law in enumerate((first_order, butterworth)):
        # Recorded positions are late, and are compared with the torque as late: the delay is a whole number of samples.
        seen = replace(item, **{part: law(getattr(item, part)) for part in ("q", "v", "a")}, torque=None)
        own = columns(effect, rigid, seen, ALL)[:, k]
        steps = round(DELAY * RATE)
        expected = np.roll(Signals(rigid, item).rigid, steps, axis=1) - Signals(rigid, seen).rigid
        error = (own - expected)[:, inside]
        # The trapezoidal rule of the filters changes the third order by 1.4 %, twelve times the square of a step over the delay.
        assert np.max(np.abs(error)) < 0.02 * np.max(np.abs(expected[:, inside]))


def test_the_derivatives_by_parameters_are_those_of_the_columns():
    scene, effect = scene_of(load_robot(), rate=RATE), PositionFilter(DELAY)
    signals = Signals(scene, moving(scene.robot, 1.0, RATE))
    own, value = columns(effect, scene, signals.motion, ALL), np.array([0.7, -0.3])
    for joint, (places, rows) in effect.estimate_slopes(signals, ALL, value).items():
        assert scene.value[places] @ rows == pytest.approx(value @ own[joint], abs=1e-9 * np.max(np.abs(own)))
    assert effect.members(scene) == ()


def test_links_behind_gears_are_filtered_with_the_bodies():
    """Without them a filter of 40 ms beside a gear of 8 Hz was not what it is beside a rigid one."""
    robot, effect = load_robot(), PositionFilter(DELAY)
    item, gear = moving(robot), Member(1, (8.0, 0.05))
    rigid = scene_of(robot)
    elastic = replace(rigid, together=((JointElasticity(), gear),))
    tie = JointElasticity().tie(elastic, gear)
    assert tie is not None
    lagging = tie.value * JointElasticity().regressor(Signals(elastic, item), gear)[:, 0]
    added = columns(effect, elastic, item, ALL) - columns(effect, rigid, item, ALL)
    assert added == pytest.approx(np.moveaxis(effect.rest(lagging, item.rate, 3.0 * rigid.band), 0, 1), abs=1e-9)
    assert np.max(np.abs(added)) > 1e-3 * np.max(np.abs(lagging))


@pytest.mark.slow
def test_behind_a_filter_of_the_positions_inertias_are_right_and_it_is_named():
    found = diagnosed("position_filter:time_constant=0.01")
    names = {item.effect: item.parameters for item in found.effects}
    assert sorted(names) == ["position_filter", "time_delay"]
    # A fifth of a sample: friction turns by another time in this band than the filter moves it.
    assert names["time_delay"]["delay"].value == pytest.approx(-0.01, abs=0.2 / RATE)
    assert names["position_filter"]["width"].value == pytest.approx(0.01, rel=0.1)
    assert "position_filter" in found.not_predicted
