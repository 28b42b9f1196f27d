"""The effects of the virtual arm at multiples of their default sizes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from scara_ident.errors import UsageError
from scara_ident.simulation import Effect, VirtualArm

# How often each default size; a negative factor where the effect's sign matters.
FACTORS = (0.5, 1.0, 3.0)
SIGNED_FACTORS = (-3.0, -1.0, 1.0, 3.0)
SIGNED = (
    "asymmetric_friction",
    "base_tilt",
    "friction_coupling",
    "offset_drift",
    "spring",
    "time_delay",
    "torque_gain_mismatch",
    "torque_sensor_nonlinearity",
    "warm_up",
)
SIZE: dict[str, tuple[str, ...]] = {
    "asymmetric_friction": ("viscous_difference",),
    "backlash": ("width",),
    "base_tilt": ("tilt_x", "tilt_y"),
    "encoder_eccentricity": ("amplitude",),
    "friction_coupling": ("viscous", "coulomb"),
    "joint_elasticity": ("stiffness",),
    "offset_drift": ("rate",),
    "payload_change": ("mass",),
    "position_dependent_friction": ("share",),
    "presliding": ("presliding_distance",),
    "spring": ("stiffness",),
    "stribeck": ("amplitude",),
    "time_delay": ("delay",),
    "torque_gain_mismatch": ("ratio",),
    "torque_ripple": ("amplitude",),
    "torque_sensor_nonlinearity": ("cubic",),
    "transmission_loss": ("loss_coefficient",),
    "vibration": ("amplitude",),
    "warm_up": ("share",),
}


def sized(arm: VirtualArm, kind: type[Effect], factor: float) -> tuple[Effect, ...]:
    """Return an effect at a multiple of its default size, on every joint that can have it.

    Raises
    ------
    UsageError
        If that is out of the effect's bounds.
    """
    joints: Sequence[str | None] = arm.robot.joints
    if kind.whole_arm != "never":
        joints = (None,)
    elif kind.name == "torque_gain_mismatch":
        joints = arm.robot.joints[1:]
    effects = []
    for joint in joints:
        effect = kind(joint=joint).resolve(arm)
        values = {key: float(getattr(effect, key)) for key in SIZE[kind.name]}
        if kind.name == "joint_elasticity":  # The softer the larger.
            values = {key: value / factor for key, value in values.items()}
        elif kind.name == "torque_gain_mismatch":
            values = {key: 1.0 + factor * (value - 1.0) for key, value in values.items()}
        else:
            values = {key: factor * value for key, value in values.items()}
        effects.append(replace(effect, **values).resolve(arm))
    return tuple(effects)


def can_be(arm: VirtualArm, kind: type[Effect], factor: float) -> bool:
    """Return whether the effect has that size within its bounds."""
    try:
        sized(arm, kind, factor)
    except UsageError:
        return False
    return True
