"""Friction over velocity."""

from __future__ import annotations

import numpy as np

from scara_ident.model.terms import Friction
from scara_ident.motion.motion import Motion
from scara_ident.report.html.friction import friction_curve
from scara_ident.robot.robot import load_robot
from tests.report.html.document import data_of


def test_friction_is_shown_apart_for_each_direction_of_motion(identified):
    """A mean over standstill would lie between the two Coulomb levels, where no friction is."""
    data = data_of(identified)
    for joint in (0, 1):
        layers = data["figures"][f"friction-{joint}"]["variants"][""]["panels"][0]["layers"]
        dots = [layer for layer in layers if layer["t"] == "dots"]
        assert len(dots) == 2
        for layer in dots:
            assert len({v > 0.0 for v in layer["x"]}) == 1
            assert all(x * y > 0.0 for x, y in zip(layer["x"], layer["y"], strict=True))


def test_the_friction_curve_is_what_the_model_predicts(result):
    robot = load_robot()
    v = np.array([-2.0, -0.1, 0.3, 1.7])
    value, std = friction_curve(next(t for t in result.model.terms if isinstance(t, Friction)), result.estimate, 0, v)
    motion = Motion("X", "X", np.arange(4.0), np.zeros((2, 4)), np.array([v, 0 * v]), np.zeros((2, 4)), None, 1.0)
    term = next(t for t in result.model.terms if isinstance(t, Friction))
    place = result.model.place(term)
    np.testing.assert_allclose(value, term.regressor(motion)[0].T @ result.estimate.value[place], rtol=1e-12)
    assert np.all(std > 0.0)
    assert robot.drive_sign[0] == 1.0
