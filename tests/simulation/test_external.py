"""Forces from outside against Pinocchio."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from numba import njit

from scara_ident.simulation import ideal, virtual_arm
from scara_ident.simulation.external import push
from scara_ident.simulation.plant import Plant
from scara_ident.simulation.spatial import configuration, dynamics, turned_frames
from tests.simulation.made import tree

FORCE, POINT = np.array([3.0, -20.0, 11.0]), np.array([0.1, -0.05, 0.2])


@njit
def pushed(plant, t, e, p, force, bias):
    """Python has no door to what only compiled functions call."""
    push(plant, t, e, p, force, bias)


def bias_of(plant: Plant, t: float, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the bias torques without and with the plant's pushes."""
    n = len(q)
    e, p, mass, bias = np.empty((n, 9)), np.empty((n, 3)), np.empty((n, n)), np.empty(n)
    dynamics(
        plant.parent, plant.prismatic, plant.rotation, plant.offset, plant.bodies, plant.gravity, q, v, mass, bias,
        e, p, np.empty((n, 15)), np.empty((n, 10)),
    )  # fmt: skip
    before = bias.copy()
    pushed(plant, t, e, p, np.empty((n, 3)), bias)
    return before, bias


@pytest.mark.slow
@pytest.mark.parametrize("joint", range(4))
def test_a_push_is_the_transposed_jacobian_of_its_point_times_the_force(tmp_path: Path, joint: int) -> None:
    robot = tree(tmp_path)
    draft = ideal(virtual_arm(robot)).draft()
    turn = turned_frames(robot.model)[-1][joint]
    draft.append("push", joint, turn.T @ POINT, FORCE, np.array([1.0, 2.0, 0.02]))
    data, random = robot.model.createData(), np.random.default_rng(joint)
    for _ in range(3):
        q, v = random.uniform(-2.0, 2.0, (2, 4))
        frame = pin.Frame("point", joint + 1, pin.SE3(np.eye(3), POINT), pin.FrameType.OP_FRAME)
        model = pin.Model(robot.model)
        place = model.addFrame(frame)
        data = model.createData()
        full = configuration(model, q)
        jacobian = pin.computeFrameJacobian(model, data, full, place, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        before, after = bias_of(draft.plant(), 1.5, q, v)
        np.testing.assert_allclose(before - after, jacobian[:3].T @ FORCE, atol=1e-12 * np.abs(before).max())


@pytest.mark.slow
def test_it_comes_and_goes_by_half_a_cosine(tmp_path: Path) -> None:
    draft = ideal(virtual_arm(tree(tmp_path))).draft()
    draft.append("push", 0, POINT, FORCE, np.array([1.0, 2.0, 0.1]))
    q = np.full(4, 0.3)
    sizes = []
    for t in (0.5, 1.0, 1.05, 1.1, 1.9, 1.95, 2.0, 3.0):
        before, after = bias_of(draft.plant(), t, q, np.zeros(4))
        sizes.append(before[0] - after[0])
    np.testing.assert_allclose(np.array(sizes) / sizes[3], [0.0, 0.0, 0.5, 1.0, 1.0, 0.5, 0.0, 0.0], atol=1e-12)
