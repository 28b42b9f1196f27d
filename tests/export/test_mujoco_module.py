from __future__ import annotations

import numpy as np
import pytest

from scara_ident.export.exported import export_model, write_exported
from scara_ident.motion.motion import Motion
from tests.export.identified import model_torque

pytestmark = pytest.mark.slow

mujoco = pytest.importorskip("mujoco", reason="needs MuJoCo, from the extra 'test'")


@pytest.fixture
def arm(models, readers, tmp_path):
    found = models["scara", True]
    write_exported(found, export_model(found, "mjcf"), tmp_path, "x.json")
    code = readers.module(tmp_path / "scara03_mujoco.py")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "scara03_identified.xml"))
    yield found, model, code
    code.uninstall()


def test_the_callback_slows_its_own_model_and_no_other(arm):
    found, model, code = arm
    other = mujoco.MjModel.from_xml_string("<mujoco><worldbody/></mujoco>")
    code.install(model)
    mujoco.mj_forward(other, mujoco.MjData(other))
    data = mujoco.MjData(model)
    data.qvel[:2] = 1.0
    mujoco.mj_forward(model, data)
    with_code = data.qfrc_passive[:2].copy()
    code.uninstall()
    mujoco.mj_forward(model, data)
    lost = -(with_code - data.qfrc_passive[:2]) * found.robot.row_scale
    np.testing.assert_allclose(lost, code.further(data.qpos[:2], data.qvel[:2], np.zeros(2)), rtol=1e-9)


def test_a_simulated_arm_moves_as_the_model_says_with_the_callback(arm):
    """The actuators are given the model's torque along a motion; without the callback the arm goes elsewhere."""
    found, model, code = arm
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_LIMIT)
    model.opt.timestep = step = 5e-4
    omega, phase = np.array([[2.0], [3.0]]), np.array([[2.0], [3.0]]) * step * np.arange(800)
    q, v, a = 0.4 * np.sin(phase), 0.4 * omega * np.cos(phase), -0.4 * omega**2 * np.sin(phase)
    motion = Motion("states", "states", step * np.arange(800), q, v, a, None, 1e9)
    torque = model_torque(found, found.value, motion)

    def missed() -> float:
        data = mujoco.MjData(model)
        data.qvel[:2] = v[:, 0]
        left = 0.0
        for k in range(799):
            data.ctrl[[model.actuator(name).id for name in found.robot.joints]] = torque[:, k]
            mujoco.mj_step(model, data)
            left = max(left, float(np.max(np.abs(data.qpos[:2] - q[:, k + 1]))))
        return left

    alone = missed()
    code.install(model)
    assert missed() < 0.02 * alone
