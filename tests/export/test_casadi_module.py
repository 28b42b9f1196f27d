from __future__ import annotations

import numpy as np
import pytest

from scara_ident.export.casadi_module import casadi_module
from scara_ident.export.traced_model import trace_model
from tests.export.identified import model_torque, states

ca = pytest.importorskip("casadi", reason="needs CasADi, from the extra 'casadi'")


@pytest.fixture(scope="module", params=[("scara", True), ("ur5", False)], ids=["scara with effects", "ur5"])
def arm(request, models, tmp_path_factory):
    found = models[request.param]
    path = tmp_path_factory.mktemp("casadi") / "arm.py"
    path.write_text(casadi_module(trace_model(found.model, found.value)))
    namespace: dict = {}
    exec(compile(path.read_text(), path, "exec"), namespace)
    return found, namespace["functions"]


def test_forward_dynamics_is_the_inverse_of_inverse_dynamics(arm):
    found, functions = arm
    made, motion = functions(), states(found.robot, 4, 5)
    for k in range(5):
        q, v, a = motion.q[:, k], motion.v[:, k], motion.a[:, k]
        torque = made["inverse_dynamics"](q, v, a)
        expected = model_torque(found, found.value, motion)[:, k]
        np.testing.assert_allclose(np.array(torque).ravel(), expected, rtol=0, atol=1e-12 * np.abs(expected).max())
        np.testing.assert_allclose(np.array(made["forward_dynamics"](q, v, torque)).ravel(), a, rtol=0, atol=1e-9)
        parts = made["mass"](q) @ a + made["bias"](q, v) + made["friction"](q, v, a)
        np.testing.assert_allclose(np.array(parts).ravel(), expected, rtol=0, atol=1e-12 * np.abs(expected).max())


def test_derivatives_are_those_of_differences(arm):
    found, functions = arm
    made, motion = functions(), states(found.robot, 5, 1)
    for name, derivatives, last in (
        ("inverse_dynamics", "inverse_derivatives", motion.a[:, 0]),
        ("forward_dynamics", "forward_derivatives", model_torque(found, found.value, motion)[:, 0]),
    ):
        state = [motion.q[:, 0], motion.v[:, 0], last]
        for place, slope in enumerate(made[derivatives](*state)):
            step = 1e-6 * max(1.0, float(np.abs(state[place]).max()))
            columns = []
            for k in range(found.robot.n):
                up, down = [part.copy() for part in state], [part.copy() for part in state]
                up[place][k] += step
                down[place][k] -= step
                columns.append(np.array(made[name](*up) - made[name](*down)).ravel() / (2.0 * step))
            size = max(1.0, float(np.abs(columns).max()))
            np.testing.assert_allclose(np.array(slope), np.array(columns).T, rtol=0, atol=1e-5 * size)


def test_smooth_friction_meets_the_model_s_away_from_rest_and_has_a_slope_there(arm):
    found, functions = arm
    smooth, exact = functions(smooth=0.01), functions()
    motion = states(found.robot, 6, 1)
    q, v, a = motion.q[:, 0], motion.v[:, 0], motion.a[:, 0]
    np.testing.assert_allclose(
        np.array(smooth["friction"](q, v, a)), np.array(exact["friction"](q, v, a)), rtol=0, atol=1e-9
    )
    still = np.zeros(found.robot.n)
    slope = np.diag(np.array(smooth["inverse_derivatives"](q, still, still)[1]))
    assert np.all(np.sign(found.robot.row_scale) * slope / np.abs(found.robot.row_scale) > 0.05 / 0.01)
