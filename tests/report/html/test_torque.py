"""Measured against predicted torque over time."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.report.html.torque import torque_group
from scara_ident.robot.robot import load_robot
from tests.report.simulated import swinging, trace_of


def test_a_residual_that_is_not_used_does_not_set_the_scale():
    residual = np.full((2, 4000), 0.01)
    residual[:, 1000:1500] = 5.0
    used = residual < 1.0
    group = torque_group(load_robot(), [("X", [trace_of(swinging(residual), used)])], (None, None))
    layers = {layer.name: layer for layer in group.figures[0].variants[0, 0].panels[1].layers}
    assert not layers["residual, not used"].fit
    assert np.nanmax(layers["residual"].y) == pytest.approx(0.01)
    assert np.nanmax(layers["residual, not used"].y) == pytest.approx(5.0)
