"""The identified arm in MuJoCo, as it is exported: the MJCF with the code beside it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import ModuleType

import numpy as np

from scara_ident.arrays import Array
from scara_ident.errors import ScaraIdentError
from scara_ident.export.exported import export_model
from scara_ident.export.identified_model import IdentifiedModel

# Longest step of the simulation, s.
STEP = 1e-3

# Positions, shape (n, N), of an arm that goes on from position and velocity, (n,), with a torque, (n, N), on the effort side,
# at so many samples per second.
Free = Callable[[Array, Array, Array, float], Array]


@contextmanager
def mujoco_arm(model: IdentifiedModel) -> Iterator[Free]:
    """Give the free motion of a model in MuJoCo.

    MuJoCo has one callback for all models; it is this one's until the end. Limits of joints do not act.

    Raises
    ------
    ScaraIdentError
        If MuJoCo is not installed, or the model cannot be exported to it, or it does not take what was.
    """
    try:
        import mujoco
    except ImportError:
        raise ScaraIdentError('MuJoCo is not installed; install it with: pip install "scara-ident[mujoco]"') from None
    robot = model.robot
    text, code = export_model(model, "mjcf").files.values()
    beside = ModuleType(f"{robot.name}_mujoco")
    exec(code, vars(beside))
    try:
        plant = mujoco.MjModel.from_xml_string(text)
    except ValueError as error:
        raise ScaraIdentError(f"MuJoCo does not take the model: {' '.join(str(error).split())}") from None
    plant.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_LIMIT)
    places = np.array([plant.joint(name).qposadr[0] for name in robot.joints])
    speeds = np.array([plant.joint(name).dofadr[0] for name in robot.joints])
    drives = np.array([plant.actuator(name).id for name in robot.joints])

    def free(q: Array, v: Array, torque: Array, rate: float) -> Array:
        steps = int(np.ceil(1.0 / (rate * STEP)))
        plant.opt.timestep = 1.0 / (rate * steps)
        data = mujoco.MjData(plant)
        data.qpos[places], data.qvel[speeds] = q, v
        found = np.empty_like(torque)
        found[:, 0] = q
        first, change = torque.T[:-1, None], np.diff(torque).T[:, None]
        held = first + ((np.arange(steps) + 0.5) / steps)[:, None] * change
        for k, controls in enumerate(held):
            for control in controls:
                data.ctrl[drives] = control
                mujoco.mj_step(plant, data)
            found[:, k + 1] = data.qpos[places]
        # MuJoCo starts anew where it diverges.
        lost = any(int(warning.number) for warning in data.warning)
        return np.full_like(found, np.inf) if lost else found

    beside.install(plant)
    try:
        yield free
    finally:
        beside.uninstall()
