"""Arms to export: the embedded one, three of example-robot-data, and a few written here to be awkward."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from scara_ident.model.base_parameters import standard_regressor
from scara_ident.robot.robot import Robot, load_robot

Array = NDArray[np.float64]

EXAMPLES = next(
    parent / "share" / "example-robot-data" / "robots"
    for parent in Path(pin.__file__).parents
    if (parent / "share" / "example-robot-data").is_dir()
)

# Quotes, tabs, an attribute with ">", a comment with an element in it, links without inertial, axes off the
# coordinate directions, a prismatic branch, and a tool behind a fixed and a locked joint.
BRANCHED = """<?xml version='1.0'?>
<!-- <link name="arm"> is below -->
<robot name="branched">
\t<link name="world"/>
\t<link name='column'>
\t\t<visual><geometry><mesh filename="a>b.stl"/></geometry></visual>
\t</link>
\t<link name="arm"><inertial><origin xyz="0.1 0.02 0" rpy="0.3 0.1 -0.2"/><mass value="2"/>
\t\t<inertia ixx="0.02" ixy="0.001" ixz="0" iyy="0.03" iyz="0" izz="0.025"/></inertial></link>
\t<link name="slide"/>
\t<link name="hand">
\t\t<inertial>
\t\t\t<!-- from the data sheet -->
\t\t\t<mass value='0.8'/>
\t\t\t<inertia ixx="0.002" iyy="0.002" izz="0.001" ixy="0" ixz="0" iyz="0"/>
\t\t</inertial>
\t</link>
\t<link name="tool"><inertial><origin xyz="0 0.01 0.05"/><mass value="0.3"/>
\t\t<inertia ixx="0.0004" ixy="0" ixz="0" iyy="0.0004" iyz="0" izz="0.0002"/></inertial></link>
\t<link name="finger"><inertial><origin xyz="0 0 0.02"/><mass value="0.05"/>
\t\t<inertia ixx="2e-5" ixy="0" ixz="0" iyy="2e-5" iyz="0" izz="1e-5"/></inertial></link>
\t<joint name="fixed" type="fixed"><parent link="world"/><child link="column"/></joint>
\t<joint name="shoulder" type="continuous">
\t\t<parent link="column"/><child link="arm"/><origin xyz="0 0.1 0.4" rpy="0.4 -0.3 1.0"/>
\t\t<axis xyz="0.2 0.3 0.9"/><dynamics
\t\t\tdamping = '0.5'/>
\t</joint>
\t<joint name="branch" type="prismatic">
\t\t<parent link="arm"/><child link="slide"/><origin xyz="-0.2 0 0" rpy="0 0.7 0"/><axis xyz="1 1 0"/>
\t\t<limit lower="-0.2" upper="0.3" effort="50" velocity="1"/> <!-- a screw -->
\t</joint>
\t<joint name="wrist" type="revolute">
\t\t<parent link="arm"/><child link="hand"/><origin xyz="0.3 0 0" rpy="1.57 0 0"/><axis xyz="0 -1 0"/>
\t\t<limit lower="-2" upper="2" effort="20" velocity="3"/>
\t</joint>
\t<joint name="flange" type="fixed">
\t\t<parent link="hand"/><child link="tool"/><origin xyz="0 0.05 0" rpy="0 0 0.5"/>
\t</joint>
\t<joint name="grip" type="prismatic">
\t\t<parent link="tool"/><child link="finger"/><origin xyz="0 0 0.1"/><axis xyz="0 1 0"/>
\t\t<limit lower="0" upper="0.04" effort="5" velocity="1"/>
\t</joint>
</robot>
"""
# The order differs from Pinocchio's, and one gear reverses.
BRANCHED_YAML = """urdf: branched.urdf
effort_side: motor
joints:
  wrist: {reduction: -50, rotor_inertia: 2.0e-5}
  shoulder: {reduction: 80}
  branch: {reduction: 400}
locked: {grip: 0.03}
gravity: [1.0, -2.0, -9.0]
"""

CARRIAGE = (
    '<robot name="carriage"><link name="base"/><link name="cart"/><joint name="screw" type="prismatic">'
    '<parent link="base"/><child link="cart"/><axis xyz="0 0.6 0.8"/>'
    '<limit lower="-0.5" upper="0.5" velocity="1" effort="200"/></joint></robot>'
)


def scara(_: Path) -> Robot:
    return load_robot()


def ur5(_: Path) -> Robot:
    return load_robot(EXAMPLES / "ur_description" / "urdf" / "ur5_robot.urdf")


def panda(folder: Path) -> Robot:
    joints = "".join(f"  panda_joint{i}: {{}}\n" for i in range(1, 8))
    urdf = EXAMPLES / "panda_description" / "urdf" / "panda.urdf"
    return _described(folder, f"urdf: {urdf}\njoints:\n{joints}locked: {{panda_finger_joint1: 0.02}}\n")


def double_pendulum(_: Path) -> Robot:
    return load_robot(EXAMPLES / "double_pendulum_description" / "urdf" / "double_pendulum.urdf")


def carriage(folder: Path) -> Robot:
    path = folder / "carriage.urdf"
    path.write_text(CARRIAGE)
    return load_robot(path)


def branched(folder: Path) -> Robot:
    (folder / "branched.urdf").write_text(BRANCHED)
    return _described(folder, BRANCHED_YAML)


def _described(folder: Path, text: str) -> Robot:
    path = folder / "robot.yaml"
    path.write_text(text)
    return load_robot(path)


ARMS: tuple[Callable[[Path], Robot], ...] = (scara, ur5, panda, double_pendulum, carriage, branched)


def random_standard(robot: Robot, seed: int, *, like_nominal: bool = False) -> Array:
    """Parameters of random possible bodies, or of ones a few per cent from the nominal."""
    rng = np.random.default_rng(seed)
    nominal = robot.standard_parameters()
    bodies = []
    for joint in range(robot.n):
        if like_nominal:
            # Every point moves by the same affine map, so the body stays possible.
            change = np.eye(4) + 0.02 * rng.normal(size=(4, 4))
            change[3, :3] = 0.0
            old = pin.PseudoInertia.FromDynamicParameters(nominal[10 * joint : 10 * joint + 10]).toMatrix()
            pseudo = change @ old @ change.T
        else:
            points = np.vstack([rng.normal(0.05, 0.2, (3, 12)), np.ones(12)])
            pseudo = (points * rng.uniform(0.05, 0.5, 12)) @ points.T
        bodies.append(pin.PseudoInertia.FromMatrix((pseudo + pseudo.T) / 2).toDynamicParameters())
    return np.concatenate([*bodies, rng.uniform(0.01, 2.0, robot.n)])


def random_motion(robot: Robot, seed: int, samples: int = 8) -> tuple[Array, Array, Array]:
    rng = np.random.default_rng(seed + 1)
    low, high = np.maximum(robot.lower, -2.0), np.minimum(robot.upper, 2.0)
    q = low[:, None] + (high - low)[:, None] * rng.uniform(size=(robot.n, samples))
    return q, rng.normal(0.0, 1.5, (robot.n, samples)), rng.normal(0.0, 4.0, (robot.n, samples))


def joint_torque(robot: Robot, standard: Array, q: Array, v: Array, a: Array) -> Array:
    """Torque at the joints, by the regressor that identification uses."""
    return np.asarray(np.einsum("jpn,p->jn", standard_regressor(robot, q, v, a), standard))
