"""The page of an excitation."""

from __future__ import annotations

import numpy as np

from scara_ident.report.html.excitation import joint_points
from scara_ident.robot.robot import load_robot
from tests.report.html.document import document


def test_a_broken_limit_is_said_at_the_top(excited):
    assert "Broken limits: joint1.velocity." in document(excited).words


def test_the_arms_points_keep_the_lengths_of_its_links():
    q = np.random.default_rng(4).uniform(-2.0, 2.0, (2, 7))
    points = joint_points(load_robot(), q)
    lengths = np.linalg.norm(np.diff(points, axis=1), axis=2)
    np.testing.assert_allclose(lengths, lengths[:1].repeat(7, axis=0), atol=1e-12)
    inner = points[:, 2, :2] - points[:, 1, :2]
    np.testing.assert_allclose(np.arctan2(inner[:, 1], inner[:, 0]), np.angle(np.exp(1j * q[0])), atol=1e-9)
