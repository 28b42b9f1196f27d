"""The torque of a motion without effects, and the controller's initial state."""

from __future__ import annotations

import numpy as np

from scara_ident.arrays import Array
from scara_ident.simulation.arm import VirtualArm
from scara_ident.simulation.reference import ReferenceMotion


def torque_at_start(arm: VirtualArm, motion: ReferenceMotion, bodies: Array | None = None) -> Array:
    """Return the torque of the arm without effects at the first sample, at the joint; at rest it is gravity's alone.

    ``bodies``, shape (n, 10), stand for the arm's own where it carries something.
    """
    v = motion.velocity[:, 0]
    a = np.where(v != 0.0, motion.acceleration[:, 0], 0.0)
    bodies = arm.bodies if bodies is None else bodies
    return inverse_dynamics(arm, bodies, motion.position[:, :1], v[:, None], a[:, None])[:, 0]


def inverse_dynamics(arm: VirtualArm, bodies: Array, q: Array, v: Array, a: Array) -> Array:
    """Return the torque of bodies, rotors, friction and offset along a motion.

    Parameters
    ----------
    bodies : ndarray, shape (n, 10)
        Instead of the arm's own.
    q, v, a : ndarray, shape (n, N)
        rad (m) and derivatives, in the robot's order.

    Returns
    -------
    ndarray, shape (n, N)
        N m (N) at the joint.
    """
    # Imported here since it loads numba.
    from scara_ident.simulation.spatial import configuration, torque_by_regressor

    robot = arm.robot
    back = np.argsort(robot.order)
    model, moved = robot.model, bodies[back]
    data = model.createData()
    torque = np.empty_like(q)
    for k in range(q.shape[1]):
        full = configuration(model, q[back, k])
        torque[:, k] = torque_by_regressor(model, data, moved, full, v[back, k], a[back, k])[robot.order]
    size = np.abs(arm.scale)[:, None]
    a0, a1, a2, a3 = (arm.friction[:, i, None] for i in range(4))
    sign = np.sign(v)
    torque += arm.armature[:, None] * a + size * (a0 * sign + a1 * v + a2 * sign * v * v + a3 * v**3)
    return np.asarray(torque + (arm.scale * arm.torque_offset)[:, None])
