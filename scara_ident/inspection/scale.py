"""The torque of one recorded unit of effort, by the masses that the URDF states."""

from __future__ import annotations

from scara_ident.errors import ScaraIdentError
from scara_ident.estimation.joint_scales import joint_scales
from scara_ident.estimation.observations import observe
from scara_ident.model.model import build_model
from scara_ident.motion.prepared import prepare
from scara_ident.recording.recording import Recording
from scara_ident.robot.robot import Robot

# Of both sides of the equation, Hz: gravity and inertia of an arm are below, and no choice is needed for a rough scale.
BAND = 4.0
# A scale within this factor of 1 is what a URDF with rough masses gives.
USUAL = 2.0
# A scale that is larger on every joint is as likely the reduction of a gear in front of which torque was measured: of arms it is 30 and more.
LIKE_A_GEAR = 20.0


def scale_note(recording: Recording, robot: Robot) -> str | None:
    """Return what the URDF's masses say of the scale of effort, where it is far from N m (N).

    Parameters
    ----------
    recording : Recording
        Read with ``robot``.
    robot : Robot
        With efforts on the joint side.

    Returns
    -------
    str or None
        None where the URDF's torque explains too little of any joint's effort, or the scale is near 1; a scale is negative
        where the signs are opposite.
    """
    try:
        scales = _scales(recording, robot)
    except ScaraIdentError:
        return None
    unusual = {j: scale for j, scale in scales.items() if not 1.0 / USUAL < scale < USUAL}
    if not unusual:
        return None
    sizes = {j: abs(scale) for j, scale in scales.items()}
    near = [robot.joints[j] for j, size in sizes.items() if 1.0 / USUAL < size < USUAL]
    asked = "is effort_gain to be stated" + (
        ", negative where the sign is opposite" if min(unusual.values()) < 0.0 else ""
    )
    beside = ""
    if near and any(not 1.0 / USUAL < sizes[j] < USUAL for j in unusual):
        # A URDF is often right of the large links and has the small ones roughly.
        beside, asked = f", and near 1 on {', '.join(near)}", f"{asked}, or do the masses there differ"
    if min(sizes.values()) > LIKE_A_GEAR:
        asked += ", or is it measured in front of a gear (effort_side: motor, reduction)"
    said = ", ".join(f"{scale:.2g} {robot.torque_unit(j)} on {robot.joints[j]}" for j, scale in unusual.items())
    return f"effort: by the URDF's masses, a recorded unit is roughly {said}{beside}: {asked}?"


def _scales(recording: Recording, robot: Robot) -> dict[int, float]:
    """Return the torque per recorded unit of the joints whose rigid-body torque shows in their effort."""
    bands = [min(BAND, 0.1 * recording.rate)] * robot.n
    observations = observe(build_model(robot, "basic"), prepare([recording], bands))
    return {j: 1.0 / scale for j, scale in joint_scales(observations).items()}
