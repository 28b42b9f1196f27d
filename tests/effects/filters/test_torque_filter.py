"""What a filter of the efforts leaves beside its delay: by filters of SciPy, closed forms, and of a virtual arm."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.signal import bilinear, lfilter

from scara_ident.arrays import Array
from scara_ident.effects import Member, Signals
from scara_ident.effects.filters.torque_filter import TorqueFilter
from scara_ident.effects.following import predicted_slopes
from scara_ident.effects.measurement import shifted
from scara_ident.model.model import build_model
from scara_ident.robot.robot import load_robot
from tests.effects.filters.runs import RATE, diagnosed
from tests.effects.scenes import columns, fit, moving, scene_of
from tests.effects.test_measurement import recordings

DELAY, ALL = 0.012, Member(None)


def first_order(torque: Array) -> Array:
    return np.asarray(lfilter(*bilinear([1.0], [DELAY, 1.0], RATE), torque))


def butterworth(torque: Array) -> Array:
    return np.asarray(lfilter(*bilinear([1.0], [DELAY**2 / 2.0, DELAY, 1.0], RATE), torque))


def mean(torque: Array) -> Array:
    # Of so many samples back to this one, whose mean is this late.
    count = round(2.0 * DELAY * RATE) + 1
    return np.asarray(lfilter(np.full(count, 1.0 / count), 1.0, torque))


@pytest.mark.parametrize(
    ("law", "shares", "width", "said"),
    [
        (first_order, (1.0, 0.0), DELAY, ", nearest to a low-pass of first order with the time constant 0.012 s"),
        (butterworth, (0.0, 1.0), 0.0, ", nearest to a Butterworth low-pass of second order at 19 Hz"),
        # To third order, of which a mean has as much as a third of one and two thirds of the other.
        (mean, (1.0 / 3.0, 2.0 / 3.0), DELAY / np.sqrt(3.0), ", nearest to a mean over 0.024 s"),
    ],
)
def test_a_filter_is_found_by_the_shares_of_two_laws(
    law: Callable[[Array], Array], shares: tuple[float, float], width: float, said: str
):
    made = [shifted(item, DELAY) for item in recordings(lambda u, time: law(u), noise=2e-3)]
    effect = TorqueFilter(DELAY)
    scene, value, covariance = fit(build_model(load_robot()), made, effect, ALL)
    std = np.sqrt(np.diag(covariance))
    # Friction turns faster than to third order.
    assert np.all(np.abs(value - shares) < 3.0 * std + 0.07)
    assert np.all(std < 0.1)
    found = effect.parameters(scene, ALL, value, covariance)
    assert list(found) == ["width"]
    assert effect.or_else(scene, ALL, value) == said
    assert found["width"].value == pytest.approx(width, abs=0.05 * DELAY + 3.0 * min(found["width"].std, 1e-3))
    assert effect.inadmissible(scene, ALL, value, std) is None
    assert effect.inadmissible(scene, ALL, np.array([-0.5, 1.0]), std) is not None


def test_a_delay_leaves_nothing_of_it():
    made = [shifted(item, DELAY) for item in recordings(lambda u, time: first_order(u), noise=2e-3)]
    exact = [shifted(item, 6.0 / RATE) for item in recordings(lambda u, time: np.roll(u, 6, axis=1), noise=2e-3)]
    sizes = [
        value / np.sqrt(np.diag(covariance))
        for items in (made, exact)
        for _, value, covariance in [fit(build_model(load_robot()), items, TorqueFilter(DELAY), ALL)]
    ]
    assert sizes[0][0] > 20.0
    assert np.max(np.abs(sizes[1])) < 3.5


def test_columns_are_those_of_the_laws_and_follow_the_estimate():
    scene, effect = scene_of(load_robot(), rate=RATE), TorqueFilter(DELAY)
    item = moving(scene.robot, 4.0, RATE)
    signals = Signals(scene, item)
    own = columns(effect, scene, item, ALL)
    inside = slice(400, -400)
    # The delay is a whole number of samples.
    for k, law in enumerate((first_order, butterworth)):
        expected = np.roll(law(signals.predicted), -round(DELAY * RATE), axis=1) - signals.predicted
        error = (own[:, k] - expected)[:, inside]
        assert np.max(np.abs(error)) < 0.03 * np.max(np.abs(expected[:, inside]))
    value = np.array([0.7, -0.3])
    slopes = effect.estimate_slopes(signals, ALL, value)
    for joint in range(scene.robot.n):
        places, _ = predicted_slopes(signals, joint)
        found = scene.value[places] @ slopes[joint][1]
        assert found == pytest.approx(value @ own[joint], abs=1e-9 * np.max(np.abs(own)))
    assert effect.of_torque(signals, ALL, signals.predicted) == pytest.approx(own)
    assert effect.members(scene) == ()


@pytest.mark.slow
def test_behind_a_filter_of_the_torque_inertias_are_right_and_it_is_named():
    """It was a time_delay alone, and inertias were 6 standard deviations low."""
    found = diagnosed("torque_filter:time_constant=0.01")
    names = {item.effect: item.parameters for item in found.effects}
    assert sorted(names) == ["time_delay", "torque_filter"]
    assert names["time_delay"]["delay"].value == pytest.approx(0.01, abs=2e-4)
    assert names["torque_filter"]["width"].value == pytest.approx(0.01, rel=0.05)
    assert "torque_filter" in found.not_predicted
