"""The residual that figures draw is the one whose rms the results hold."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from scara_ident.estimation import ols
from scara_ident.estimation.observations import Observations, observe
from scara_ident.estimation.residuals import Residuals
from scara_ident.model.model import build_model
from scara_ident.motion.prepared import prepare
from scara_ident.robot.robot import load_robot
from tests.arms import PLANAR_2R, noisy, swing, write_urdf


@pytest.fixture(scope="module", params=[(10.0, 10.0), (6.0, 25.0), (None, None)], ids=str)
def observations(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Observations:
    """Two recordings with noise, the second with a gap."""
    model = build_model(load_robot(write_urdf(tmp_path_factory.mktemp("arm") / "arm.urdf", PLANAR_2R)), "basic")
    rng = np.random.default_rng(0)
    first, second = (noisy(swing(model.robot, f"s_{k}", k), rng, (0.5, 0.1)) for k in (1, 2))
    keep = (second.time < 4.0) | (second.time > 4.5)
    gap = replace(second, time=second.time[keep], position=second.position[:, keep], effort=second.effort[:, keep])
    return observe(model, prepare([first, gap], request.param))


def test_on_kept_samples_it_has_the_rms_of_the_information(observations: Observations):
    for item in (observations, *observations.each):
        value = ols(observations).value
        banded = Residuals(item.data, item.predicted(value)).banded
        assert len(banded) == len(item.data.stretches)
        for j, information in enumerate(item.by_joint):
            pairs = zip(item.data.stretches, banded, strict=True)
            kept = np.concatenate([np.sqrt(part.steps[j]) * rows[j][part.kept[j]] for part, rows in pairs])
            found = np.sqrt(np.sum(kept**2) / information.rows)
            assert found == pytest.approx(information.rms(value), rel=1e-9)


def test_it_is_the_banded_torque_less_the_banded_prediction(observations: Observations):
    value = np.random.default_rng(1).standard_normal(observations.parameters)
    predicted = observations.predicted(value)
    for part, torque, found in zip(
        observations.data.stretches, predicted, Residuals(observations.data, predicted).banded, strict=True
    ):
        smooth = np.array(
            [part.smooth(j, row - own) for j, (row, own) in enumerate(zip(part.torque, torque, strict=True))]
        )
        assert_allclose(found, smooth, atol=1e-9)
