"""An identified model as parameters of ros2_control controllers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from scara_ident.arrays import Array
from scara_ident.export.identified_model import IdentifiedModel
from scara_ident.model.terms import Friction, Offset
from scara_ident.motion.motion import Motion
from scara_ident.robot.robot import Robot

WORDS = ("coulomb", "viscous", "quadratic", "cubic")
# Poses over which a joint's inertia is averaged for the gains that a loop may begin with, and that loop's frequency, Hz.
POSES, LOOP = 40, 3.0


def ros2_text(found: IdentifiedModel, value: Array, armature: Array, urdf: str, about: Sequence[str] = ()) -> str:
    """Write the parameters as YAML.

    ``joint_trajectory_controller`` commands effort, with viscous friction fed forward and gains to begin with: those of a
    critically damped loop of `LOOP` Hz on each joint's mean inertia, below 0 where the gear reverses. ``computed_torque`` has
    what a controller needs that computes torque from the URDF beside it: ``rnea`` of the links, armature, friction by powers of
    speed, offset. The equation that they belong to is written above it.

    Parameters
    ----------
    value : ndarray, shape (p,)
        The model's parameters as they are written.
    armature : ndarray, shape (n,)
    urdf : str
        Name of the URDF beside it.
    about : sequence of str, optional
        What the reader of the file should know, one line each.
    """
    import yaml

    class Plain(yaml.SafeDumper):
        """Without anchors and aliases, which ROS 2's parser does not know."""

        def ignore_aliases(self, data: object) -> bool:
            return True

    robot, model = found.robot, found.model
    joints = list(robot.joints)
    friction: dict[str, list[float]] = {word: [0.0] * robot.n for word in WORDS}
    offset = [0.0] * robot.n
    for term in model.terms:
        own = value[model.place(term)]
        if isinstance(term, Friction):
            table = own.reshape(robot.n, -1)
            friction |= {WORDS[power]: table[:, k].tolist() for k, power in enumerate(term.powers)}
        elif isinstance(term, Offset):
            offset = term.of_joints(own).tolist()
    inertia = _mean_inertia(found, value)
    pace = 2.0 * np.pi * LOOP
    # Where the gear reverses, a torque of the motor moves the joint the other way.
    gains = {
        name: {
            "p": float(sign * pace**2 * inertia[j]),
            "i": 0.0,
            "d": float(sign * 2.0 * pace * inertia[j]),
            "ff_velocity_scale": float(sign * friction["viscous"][j]),
        }
        for j, (name, sign) in enumerate(zip(joints, robot.drive_sign, strict=True))
    }
    content = {
        "joint_trajectory_controller": {
            "ros__parameters": {
                "joints": joints,
                "command_interfaces": ["effort"],
                "state_interfaces": ["position", "velocity"],
                "gains": gains,
            }
        },
        "effort_controller": {"ros__parameters": {"joints": joints, "interface_name": "effort"}},
        "computed_torque": {
            "ros__parameters": {
                "joints": joints,
                "urdf": urdf,
                "gravity": robot.model.gravity.linear.tolist(),
                "effort_side": robot.effort_side,
                "effort_gain": robot.effort_gain.tolist(),
                "reduction": robot.reduction.tolist(),
                "armature": armature.tolist(),
                "friction": friction,
                "offset": offset,
                "effort_limit": [float(limit) if np.isfinite(limit) else 0.0 for limit in robot.torque_limit],
            }
        },
    }
    head = "".join(f"# {line}\n" for line in (*about, *_equation(robot)))
    return head + yaml.dump(content, Dumper=Plain, sort_keys=False, default_flow_style=None, width=120)


def _equation(robot: Robot) -> tuple[str, ...]:
    """Say what the numbers of ``computed_torque`` and the gains are, one line each."""
    motor = robot.effort_side == "motor"
    unit = "[N m]" if motor or not robot.prismatic.any() else "[N m], or force [N] of a joint that slides,"
    load, turn = ("/ reduction", "sign(reduction) * ") if motor else ("", "")
    return (
        f"Torque {unit} on the {robot.effort_side} side, of q [rad or m], v and a per second:",
        f"  (rnea(q, v, a) + armature * a) {load}".rstrip(),
        f"  + {turn}(coulomb * sign(v) + viscous * v + quadratic * v * |v| + cubic * v^3) + offset",
        "Gains and effort_limit are those of this torque. Divided by effort_gain it is in the unit that was recorded.",
        "An effort_limit of 0 is one that the URDF does not state.",
    )


def _mean_inertia(found: IdentifiedModel, value: Array) -> Array:
    """Return each joint's own inertia, averaged over poses, as recorded torque per acceleration, shape (n,)."""
    robot, term = found.robot, found.model.rigid_body
    own = value[found.model.place(term)]
    reach = np.where(robot.prismatic, 1.0, np.pi)[:, None]
    q = reach * np.random.default_rng(0).uniform(-1.0, 1.0, (robot.n, POSES))
    still = np.zeros_like(q)
    result = np.zeros(robot.n)
    for j in range(robot.n):
        pushed = still.copy()
        pushed[j] = 1.0
        both = (
            term.torque(Motion("", "", np.arange(float(POSES)), q, still, a, None, 1.0), own)[j]
            for a in (pushed, still)
        )
        moved, rest = both
        result[j] = float(np.mean(np.abs(moved - rest)))
    return result
