"""The band and the times at rest of a motion before it is recorded, against what its recording then gives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.estimation.bands import choose_bands
from scara_ident.estimation.least_squares import ols
from scara_ident.estimation.observations import observe
from scara_ident.estimation.reach import reach_of
from scara_ident.model.model import TorqueModel, build_model
from scara_ident.motion.prepared import prepare
from scara_ident.robot.robot import load_robot
from tests.arms import PLANAR_2R, write_urdf
from tests.estimation.test_bands import RATE, pendulum


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> TorqueModel:
    path = write_urdf(tmp_path_factory.mktemp("arm") / "arm.urdf", PLANAR_2R)
    return build_model(load_robot(path), "basic")


def test_the_band_of_a_motion_that_is_not_recorded_yet_is_foreseen(model: TorqueModel):
    """Slow swings have a narrow band; with one that has torque farther up it is as wide as recordings then say."""
    slow, fast = pendulum(model, 12.0, 0.3), pendulum(model, 12.0, 0.02, pace=4.0)
    fit = choose_bands(model, prepare([slow]))
    data = prepare([slow], fit.bands)
    value = ols(observe(model, data)).value
    now = max(choose_bands(model, prepare([slow, replace(fast, name="fast_1")])).bands)
    assert now > 1.5 * max(fit.bands)
    assert fast.effort is not None
    foreseen = reach_of(model, data, value).reached(fast.effort, np.ones(fast.effort.shape), RATE)
    # Bins are a third of an octave wide.
    assert 0.7 * now < foreseen < 1.5 * now


def test_torque_that_is_no_motion_s_or_faster_than_noise_allows_widens_no_band(model: TorqueModel):
    """Of a swing, once with a tremble that the rate of its narrow band cannot show, once with friction at rest, either way."""
    slow = pendulum(model, 12.0, 0.02)
    data = prepare([slow], choose_bands(model, prepare([slow])).bands)
    reach = reach_of(model, data, ols(observe(model, data)).value)
    (part,) = data.stretches
    torque, v = part.torque, part.motion.v
    bands, _ = reach.foreseen(torque, v, RATE)
    assert max(bands) < 20.0
    trembling = torque + 0.02 * np.sin(2.0 * np.pi * 120.0 * part.motion.time)
    assert reach.foreseen(trembling, v, RATE)[0] == pytest.approx(bands)
    still = np.array([[1.0], [0.0]])
    sign = np.random.default_rng(1).choice([-1.0, 1.0], torque.shape[1])
    resting = reach.foreseen(np.array([torque[0], torque[1] + 0.2 * sign]), still * v, RATE)[0]
    assert resting == pytest.approx(reach.foreseen(still * torque, still * v, RATE)[0])


def test_the_times_at_rest_of_a_motion_that_is_not_recorded_yet_are_foreseen(model: TorqueModel):
    slow, fast = (prepare([pendulum(model, 12.0, 0.02, pace=pace)], (6.0, 6.0)) for pace in (1.0, 1.8))
    reach = reach_of(model, slow, ols(observe(model, slow)).value, widening=False)
    (part,) = fast.stretches
    bands, fade = reach.foreseen(part.torque, part.motion.v, RATE)
    assert bands == (6.0, 6.0)
    # Short of a thirtieth of the time, and a fifth of that at most is not foreseen.
    assert np.all(np.mean(part.moving < 0.5, axis=1) > 0.025)
    assert np.all(np.mean((fade < 0.5) != (part.moving < 0.5), axis=1) < 0.005)
