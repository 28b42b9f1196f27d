"""Exported models as the programs read them that they are for: recorded torque at states, shape (n, N) each way.

Readers take the folder that was written, the robot, and q, v, a of shape (n, N) in the robot's order.
"""

from __future__ import annotations

import ctypes
import subprocess
from collections.abc import Sequence
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import yaml
from numpy.typing import NDArray

from scara_ident.export.c_header import c_name
from scara_ident.robot.robot import Robot

Array = NDArray[np.float64]
WARNINGS = ("-Wall", "-Wextra", "-pedantic", "-Werror")
PARTS = ("torque", "mass", "bias", "friction")


def module(path: Path) -> Any:
    """Load a Python file."""
    spec = spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None
    found = module_from_spec(spec)
    spec.loader.exec_module(found)
    return found


def compiled(header: Path, robot: Robot, command: Sequence[str] = ("gcc", "-std=c99"), real: str = "double") -> Any:
    """Compile a header into a library, quickly, every warning an error; its functions take pointers."""
    low = c_name(robot.name)
    source = header.with_name("library.c" if "gcc" in command[0] else "library.cpp")
    linkage = "" if "gcc" in command[0] else 'extern "C" '
    define = f"#define {low.upper()}_FLOAT\n" if real == "float" else ""
    arguments = {"torque": "qva", "mass": "q", "bias": "qv", "friction": "qva"}
    text = f'{define}#include "{header.name}"\n'
    for name, letters in arguments.items():
        given = "".join(f"const {real} *{letter}, " for letter in letters)
        text += f"{linkage}void {name}({given}{real} *out);\n{linkage}void {name}({given}{real} *out)\n"
        text += f"{{ {low}_{name}({', '.join(letters)}, out); }}\n"
    source.write_text(text)
    library = source.with_suffix(f".{real}.so")
    subprocess.run([*command, "-O0", *WARNINGS, "-shared", "-fPIC", source, "-o", library, "-lm"], check=True)
    return ctypes.CDLL(str(library))


def called(function: Any, inputs: Sequence[Array], size: int, dtype: Any = np.float64) -> Array:
    """Call a compiled function at one state after the other."""
    kind = ctypes.POINTER(ctypes.c_double if dtype == np.float64 else ctypes.c_float)
    result = np.zeros((size, inputs[0].shape[1]))
    out = np.zeros(size, dtype=dtype)
    for k in range(result.shape[1]):
        given = [np.ascontiguousarray(part[:, k], dtype=dtype) for part in inputs]
        function(*(part.ctypes.data_as(kind) for part in given), out.ctypes.data_as(kind))
        result[:, k] = out
    return result


def by_c(folder: Path, robot: Robot, q: Array, v: Array, a: Array) -> Array:
    """Torque of the C header."""
    library = compiled(folder / f"{c_name(robot.name)}.h", robot)
    return called(library.torque, (q, v, a), robot.n)


def by_casadi(folder: Path, robot: Robot, q: Array, v: Array, a: Array) -> Array:
    """Torque of the CasADi module."""
    function = module(folder / f"{c_name(robot.name)}_casadi.py").functions()["inverse_dynamics"]
    return np.array(function(q, v, a))


def by_pinocchio(folder: Path, robot: Robot, q: Array, v: Array, a: Array, *, effects: bool = False) -> Array:
    """Torque of the loader's model, with the effects if wanted."""
    found = module(folder / f"{c_name(robot.name)}_pinocchio.py")
    model, further = found.load_with_effects() if effects else (found.load(), None)
    data, result = model.createData(), np.zeros_like(q)
    for k in range(q.shape[1]):
        v_k, a_k = np.zeros(model.nv), np.zeros(model.nv)
        v_k[robot.order], a_k[robot.order] = v[:, k], a[:, k]
        configuration = found.configuration(model, q[:, k])
        result[:, k] = found.inverse_dynamics(model, data, configuration, v_k, a_k, further)[robot.order]
    return result * robot.row_scale[:, None]


def by_urdf(folder: Path, robot: Robot, q: Array, v: Array, a: Array) -> Array:
    """Torque of the URDF as Pinocchio reads it: links, and the friction and damping of joints."""
    full = pin.buildModelFromUrdf(str(folder / f"{robot.name}_identified.urdf"))
    model = _reduced(full, robot)
    places = robot.order
    rigid = _links(model, robot, q, v, a)
    lost = model.damping[places, None] * v + model.upperDryFrictionLimit[places, None] * np.sign(v)
    return (rigid + lost) * robot.row_scale[:, None]


def by_ros2(folder: Path, robot: Robot, q: Array, v: Array, a: Array) -> Array:
    """Torque of a computed-torque controller with the YAML's parameters and the URDF beside it."""
    content = yaml.safe_load((folder / f"{c_name(robot.name)}_ros2.yaml").read_text())
    given = content["computed_torque"]["ros__parameters"]
    model = _reduced(pin.buildModelFromUrdf(str(folder / given["urdf"])), robot)
    torque = _links(model, robot, q, v, a) + np.array(given["armature"])[:, None] * a
    reduction = np.array(given["reduction"])[:, None]
    if given["effort_side"] == "motor":
        torque /= reduction
        v = np.sign(reduction) * v
    for word, powers in given["friction"].items():
        power = ("coulomb", "viscous", "quadratic", "cubic").index(word)
        torque += np.array(powers)[:, None] * np.sign(v) * np.abs(v) ** power
    return torque + np.array(given["offset"])[:, None]


def by_mujoco(folder: Path, robot: Robot, q: Array, v: Array, a: Array, *, effects: bool = False) -> Array:
    """Torque of MuJoCo's inverse dynamics as the actuators would be commanded, with the callback if wanted."""
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(folder / f"{robot.name}_identified.xml"))
    # Limits of joints are soft constraints, which push where a state is beyond them.
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_LIMIT)
    code = module(folder / f"{c_name(robot.name)}_mujoco.py") if effects else None
    if code is not None:
        code.install(model)
    data, result = mujoco.MjData(model), np.zeros_like(q)
    joints = [model.joint(name) for name in robot.joints]
    actuators = [model.actuator(name) for name in robot.joints]
    try:
        for k in range(q.shape[1]):
            for i, joint in enumerate(joints):
                data.qpos[joint.qposadr[0]] = q[i, k]
                data.qvel[joint.dofadr[0]] = v[i, k]
                data.qacc[joint.dofadr[0]] = a[i, k]
            mujoco.mj_inverse(model, data)
            for i, (joint, actuator) in enumerate(zip(joints, actuators, strict=True)):
                force = data.qfrc_inverse[joint.dofadr[0]] / actuator.gear[0]
                result[i, k] = force - actuator.biasprm[0]
    finally:
        if code is not None:
            code.uninstall()
    return result


def _reduced(model: pin.Model, robot: Robot) -> pin.Model:
    where, still = pin.neutral(model), []
    for name, value in robot.locked:
        joint = model.joints[model.getJointId(name)]
        where[joint.idx_q : joint.idx_q + joint.nq] = value if joint.nq == 1 else (np.cos(value), np.sin(value))
        still.append(model.getJointId(name))
    reduced = pin.buildReducedModel(model, still, where) if still else model
    reduced.gravity.linear = robot.model.gravity.linear
    return reduced


def _links(model: pin.Model, robot: Robot, q: Array, v: Array, a: Array) -> Array:
    """Torque of the links alone, at the joint."""
    data, result = model.createData(), np.zeros_like(q)
    back = np.argsort(robot.order)
    for k in range(q.shape[1]):
        where = pin.neutral(model)
        for joint in list(model.joints)[1:]:
            angle = q[back[joint.idx_v], k]
            where[joint.idx_q : joint.idx_q + joint.nq] = angle if joint.nq == 1 else (np.cos(angle), np.sin(angle))
        result[:, k] = pin.rnea(model, data, where, v[back, k], a[back, k])[robot.order]
    return result


READERS = {
    "urdf": by_urdf,
    "mjcf": by_mujoco,
    "pinocchio": by_pinocchio,
    "c": by_c,
    "casadi": by_casadi,
    "ros2": by_ros2,
}
