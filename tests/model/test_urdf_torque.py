"""The torque of the URDF's bodies, inertia and gravity apart."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from scara_ident.model.urdf_torque import urdf_torques
from tests.arms import motion, rnea, sines
from tests.simulation.made import tree


def test_inertia_and_gravity_add_up_to_pinocchios_torque(tmp_path: Path) -> None:
    robot = tree(tmp_path)
    q, v, a = sines(np.random.default_rng(0), np.arange(200) / 100.0, robot.n)
    parts = urdf_torques(robot, motion(q, v, a))
    for gravity in ((0.0, 0.0, -9.81), (3.0, -2.0, 1.0)):
        robot.model.gravity.linear = np.array(gravity)
        whole = np.einsum("jkt,k->jt", parts, [1.0, *gravity])
        # Both sum the same products, in another order.
        expected = robot.row_scale[:, None] * rnea(robot, q, v, a)
        np.testing.assert_allclose(whole, expected, rtol=0.0, atol=1e-12 * np.max(np.abs(expected)))
