from dataclasses import replace

import numpy as np
import pytest

from scara_ident.excitation.sensitivity import SmoothModel
from scara_ident.model.model import build_model
from scara_ident.robot.robot import load_robot
from tests.arms import example_urdf, motion
from tests.excitation.made import panda, rigid_model, scara_with_quill

ARMS = {
    "scara": load_robot,
    "quill": scara_with_quill,
    "ur5": lambda: load_robot(example_urdf("ur5_robot.urdf")),
    "panda": panda,
}
# Eighth-order central differences.
EIGHTH = ((1, 4 / 5), (2, -1 / 5), (3, 4 / 105), (4, -1 / 280))


def by_differences(smooth, at, kind, joint, step, sum_up):
    total = 0.0
    for k, weight in EIGHTH:
        for sign in (1, -1):
            moved = getattr(at, kind).copy()
            moved[joint] += sign * k * step
            total = total + sign * weight / step * sum_up(smooth.regressor(replace(at, **{kind: moved})))
    return total


@pytest.mark.slow
@pytest.mark.parametrize("name", ARMS)
@pytest.mark.parametrize("friction", [False, True])
def test_derivatives_of_the_regressor_are_exact(name, friction):
    robot = ARMS[name]()
    model = build_model(robot) if friction else rigid_model(robot)
    rng = np.random.default_rng(0)
    at = motion(*rng.uniform(-2.0, 2.0, (3, robot.n, 6)))
    # The second derivative of sign(v) v^2 jumps at zero; differences stay on one side of it.
    at = replace(at, v=at.v + np.copysign(0.1, at.v))
    smooth = SmoothModel(model, np.full(robot.n, 0.7))
    weights = rng.standard_normal((robot.n, len(model.names), 6))
    value = rng.standard_normal(len(model.names))
    gradient, torque = smooth.derivatives(at, weights, value)
    for kind, signal in enumerate("qva"):
        for joint in range(robot.n):
            step = 0.02
            expected = by_differences(
                smooth, at, signal, joint, step, lambda columns: np.einsum("ipN,ipN->N", weights, columns)
            )
            np.testing.assert_allclose(gradient[kind, joint], expected, atol=1e-9 * np.abs(gradient).max())
            expected = by_differences(
                smooth, at, signal, joint, step, lambda columns: np.einsum("ipN,p->iN", columns, value)
            )
            np.testing.assert_allclose(torque[:, kind, joint], expected, atol=1e-9 * np.abs(torque).max())


def test_a_narrow_width_gives_the_models_own_regressor():
    robot = scara_with_quill()
    model = build_model(robot)
    at = motion(*np.random.default_rng(2).uniform(-2.0, 2.0, (3, robot.n, 20)))
    smooth = SmoothModel(model, np.full(robot.n, 1e-12))
    np.testing.assert_allclose(smooth.regressor(at), model.regressor(at), atol=1e-12)
