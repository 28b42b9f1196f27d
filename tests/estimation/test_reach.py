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
    foreseen = reach_of(model, data, value).reached(fast.effort, RATE)
    # Bins are a third of an octave wide.
    assert 0.7 * now < foreseen < 1.5 * now


def test_the_times_at_rest_of_a_motion_that_is_not_recorded_yet_are_foreseen(model: TorqueModel):
    slow, fast = (prepare([pendulum(model, 12.0, 0.02, pace=pace)], (6.0, 6.0)) for pace in (1.0, 2.0))
    reach = reach_of(model, slow, ols(observe(model, slow)).value, widening=False)
    (part,) = fast.stretches
    bands, fade = reach.foreseen(part.torque, part.motion.v, RATE)
    assert bands == (6.0, 6.0)
    # Short of a thirtieth of the time, and a fifth of that at most is not foreseen.
    assert np.all(np.mean(part.fade < 0.5, axis=1) > 0.025)
    assert np.all(np.mean((fade < 0.5) != (part.fade < 0.5), axis=1) < 0.005)
