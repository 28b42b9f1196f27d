"""A virtual arm for any robot, and the one that resembles the SCARA03 of Indri et al. 2002."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from scara_ident.arrays import Array
from scara_ident.robot.kinematics import farthest_point
from scara_ident.robot.robot import Robot, load_robot
from scara_ident.simulation.arm import Controller, VirtualArm

# Table 5, column OJD (a0, a1, a2 of the two joints; cubic friction left out) and sigma of Table 1, row L1.
SCARA_FRICTION = ((0.210, 0.093, -0.016, 0.0), (0.088, 0.049, -0.007, 0.0))
SCARA_NOISE = (0.037, 0.012)
STEPS_PER_TURN = 2000.0
# Where no gear is known the encoder is on the joint.
STEPS_PER_JOINT_TURN = 2.0**18
# Closed-loop pole of every joint's PID, rad/s, thrice: s^3 + 3 p s^2 + 3 p^2 s + p^3.
POLE = 15.0
# Shares of a usual torque that friction and noise get on an arm of which neither is known.
COULOMB_SHARE, VISCOUS_SHARE, NOISE_SHARE = 0.08, 0.06, 0.02
# Rotor inertia of an arm without one, seen at the joint: a share of the links' inertia about it, and at wrists, which
# hardly have any, of the largest inertia of the arm.
ROTOR_SHARE, WRIST_SHARE = 0.3, 0.02
USUAL_ACCELERATION = 3.0


def virtual_arm(robot: Robot | None = None) -> VirtualArm:
    """Return the virtual arm of a robot, with typical values for everything that its URDF does not contain.

    Parameters
    ----------
    robot : Robot, optional
        Without it the embedded SCARA03, with the friction of the paper's Table 5 (column OJD), the torque noise
        of its Table 1, 2000 encoder steps per motor turn and the inertias of the URDF, which carry Table 5 too.

    Returns
    -------
    VirtualArm
        For another robot: the bodies of the URDF; unknown rotor inertias are a share of the links' inertia; friction
        and noise are shares of a typical torque; PID gains place three poles for the mean inertia.
    """
    robot = load_robot() if robot is None else robot
    mass, gravity = _usual(robot)
    given = robot.reduction**2 * robot.rotor_inertia
    largest = np.array([mass[robot.prismatic == kind].max() for kind in robot.prismatic])
    armature = np.where(given > 0.0, given, np.maximum(ROTOR_SHARE * mass, WRIST_SHARE * largest))
    inertia = mass + armature
    scale = np.abs(robot.row_scale) * np.hypot(gravity, inertia * USUAL_ACCELERATION)
    speed = np.where(robot.prismatic, 0.3, 1.0)
    friction = np.zeros((robot.n, 4))
    friction[:, 0] = COULOMB_SHARE * scale
    friction[:, 1] = VISCOUS_SHARE * scale / speed
    noise = NOISE_SHARE * scale
    if robot.name == "scara03" and robot.effort_side == "motor" and robot.n == 2:
        friction, noise = np.array(SCARA_FRICTION), np.array(SCARA_NOISE)
    turns = np.abs(robot.reduction)
    return VirtualArm(
        robot=robot,
        bodies=robot.standard_parameters()[: 10 * robot.n].reshape(robot.n, 10),
        rotor_inertia=armature / robot.reduction**2,
        friction=friction,
        torque_offset=np.zeros(robot.n),
        encoder_steps=np.where(turns >= 20.0, STEPS_PER_TURN, STEPS_PER_JOINT_TURN / turns),
        torque_noise=noise,
        controller=placed_poles(inertia),
        torque_scale=scale,
        tool=farthest_point(robot),
    )


def placed_poles(inertia: Array) -> Controller:
    """Return PID gains that give each joint of this inertia, alone, three poles at ``-POLE`` rad/s."""
    return Controller(3.0 * POLE**2 * inertia, POLE**3 * inertia, 3.0 * POLE * inertia)


def _usual(robot: Robot) -> tuple[Array, Array]:
    """Return mean link inertia and rms gravity torque of every joint over its range, at the joint."""
    model, data = robot.model, robot.model.createData()
    random = np.random.default_rng(0)
    lower = np.where(np.isfinite(robot.lower), robot.lower, -np.pi)
    upper = np.where(np.isfinite(robot.upper), robot.upper, np.pi)
    inertia, gravity = np.zeros(robot.n), np.zeros(robot.n)
    poses = 64
    for _ in range(poses):
        q = np.empty(robot.n)
        q[robot.order] = random.uniform(lower, upper)
        full = pin.integrate(model, pin.neutral(model), q)
        inertia += np.diag(pin.crba(model, data, full))[robot.order] / poses
        gravity += pin.computeGeneralizedGravity(model, data, full)[robot.order] ** 2 / poses
    return inertia, np.sqrt(gravity)
