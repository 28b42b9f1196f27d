"""The points of the moving arm, and whether they stay in a plane."""

from __future__ import annotations

import numpy as np

from scara_ident.report.html.moving_arm import joint_points
from scara_ident.robot.robot import load_robot
from tests.report.html.document import data_of, document


def test_the_arms_points_keep_the_lengths_of_its_links():
    q = np.random.default_rng(4).uniform(-2.0, 2.0, (2, 7))
    points = joint_points(load_robot(), q)
    lengths = np.linalg.norm(np.diff(points, axis=1), axis=2)
    np.testing.assert_allclose(lengths, lengths[:1].repeat(7, axis=0), atol=1e-12)
    inner = points[:, 2, :2] - points[:, 1, :2]
    np.testing.assert_allclose(np.arctan2(inner[:, 1], inner[:, 0]), np.angle(np.exp(1j * q[0])), atol=1e-9)


def test_a_flat_arm_is_shown_in_its_plane_and_any_other_in_space(excited, turning):
    flat, deep = data_of(excited)["arms"]["arm-0"], data_of(turning)["arms"]["arm-0"]
    assert (flat["axes"], deep["axes"]) == (["x", "y"], ["x", "y", "z"])
    assert "The arm in its plane" in document(excited).words
    assert "The arm in space" in document(turning).words
    # A base, six joints and the arm's end.
    assert deep["points"] == 8
    assert turning.stat().st_size < 1e6
