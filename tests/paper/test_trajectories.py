"""The printed trajectories and the tool's acceleration on them."""

from __future__ import annotations

import json

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings

from scara_ident import paper
from tests.paper.made import SEEDS, random_states
from tests.shared import shared_path


@pytest.mark.parametrize("trajectory", [paper.OJK, paper.OJD], ids=lambda t: t.name)
def test_velocity_and_acceleration_are_derivatives_of_position(trajectory: paper.Trajectory) -> None:
    time = np.linspace(0.1, trajectory.duration - 0.1, 101)
    step = 1e-3
    weights = np.array([1.0, -8.0, 8.0, -1.0]) / (12.0 * step)
    nearby = [trajectory.motion(time + k * step) for k in (-2, -1, 1, 2)]
    _, v, a = trajectory.motion(time)
    # Five points: the error is step^4 / 30 times the fifth derivative, below 1e-9 here.
    for order, exact in ((0, v), (1, a)):
        numeric = sum(weight * near[order] for weight, near in zip(weights, nearby, strict=True))
        np.testing.assert_allclose(numeric, exact, rtol=0, atol=1e-9)


def test_motion_starts_at_the_printed_centre_with_the_printed_harmonics() -> None:
    q, v, a = paper.OJD.motion([0.0])
    np.testing.assert_allclose(q[:, 0], [1.57, 0.0])
    np.testing.assert_allclose(v[:, 0], [-2.18166 * 1.37509, 2.18166 * 1.17865], rtol=1e-15)
    np.testing.assert_array_equal(a[:, 0], 0.0)


@settings(max_examples=20)
@given(seed=SEEDS)
def test_tool_acceleration_is_pinocchios(arm: pin.Model, seed: int) -> None:
    q, v, a = random_states(seed, 4)
    model = arm.copy()
    tool = model.addFrame(
        pin.Frame("tool", 2, pin.SE3(np.eye(3), np.array([paper.LINK_LENGTH, 0.0, 0.0])), pin.FrameType.OP_FRAME)
    )
    data = model.createData()
    found = paper.tool_acceleration(q, v, a)
    for k in range(q.shape[1]):
        pin.forwardKinematics(model, data, q[:, k], v[:, k], a[:, k])
        expected = pin.getFrameClassicalAcceleration(model, data, tool, pin.LOCAL_WORLD_ALIGNED).linear
        np.testing.assert_allclose(found[k], np.linalg.norm(expected), rtol=1e-12)


def test_trajectories_are_typed_as_printed() -> None:
    printed = json.loads(shared_path("paper", "tables.json").read_text(encoding="utf-8"))["formula7"]
    for trajectory in (paper.OJK, paper.OJD):
        figures = printed[trajectory.name]
        assert trajectory.duration == figures["duration"]
        assert list(trajectory.offset) == figures["offset"]
        assert [list(x) for x in trajectory.amplitude] == figures["amplitude"]
        assert [list(x) for x in trajectory.omega] == figures["omega"]
