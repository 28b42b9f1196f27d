"""What the numbers of an exported file are measured in: directions, sides of the gear, gravity, locked joints."""

from __future__ import annotations

from scara_ident.manners import listed
from scara_ident.robot.robot import Robot


def convention_lines(robot: Robot) -> tuple[str, ...]:
    """Say the directions and sides that every exported file has, one line each."""
    lines = ["q, v and a are those of the joints, behind the gear, with the zero and the direction of the URDF."]
    lines += ["A torque is what the drive must give: friction has the direction of the motion."]
    reversed_ = [joint for joint, sign in zip(robot.joints, robot.drive_sign, strict=True) if sign < 0.0]
    if reversed_:
        lines.append(
            f"The gear reverses at {listed(reversed_, 12)}: recorded torque moves the joint the other way, and there the gains "
            f"of a loop are below 0."
        )
    x, y, z = robot.model.gravity.linear
    lines.append(f"Gravity is {x:.10g}, {y:.10g}, {z:.10g} m/s^2 in the base frame.")
    if robot.locked:
        lines.append(f"Locked: {listed([f'{name} at {place:.10g}' for name, place in robot.locked], 12)} (rad or m).")
    return tuple(lines)
