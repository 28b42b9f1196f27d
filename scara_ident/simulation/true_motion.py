"""The true motion of an arm under its controller, sample by sample, and the step of its integration."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from scara_ident.arrays import Array
from scara_ident.errors import LostArm, UsageError
from scara_ident.simulation.arm import VirtualArm
from scara_ident.simulation.plant import PlantDraft

# Steps of this share of the fastest natural period's radian keep the Runge-Kutta step accurate and stable.
STIFF_STEP = 0.4
MAX_SUBSTEPS = 400


@dataclass(frozen=True, eq=False)
class TrueMotion:
    """What the arm really did, at the recording's times; every array of shape (n, N), the robot's order.

    Attributes
    ----------
    position, velocity, acceleration : ndarray
        Of the drives, seen through the gears; without elasticity also of the links.
    link_position, link_velocity, link_acceleration : ndarray
        Of the links.
    effort : ndarray
        Torque of the drive held from this sample to the controller's next, N m on the effort side. With the
        acceleration at this sample it satisfies the equations of motion exactly.
    load : ndarray
        Torque through the gear, without the rotor's own inertia, at the joint.
    direction : ndarray
        What dry friction is multiplied with: sign of the velocity, 0 where the joint sticks, the presliding state, or what is
        between -1 and 1 at a low speed.
    """

    position: Array
    velocity: Array
    acceleration: Array
    link_position: Array
    link_velocity: Array
    link_acceleration: Array
    effort: Array
    load: Array
    direction: Array

    def every(self, ticks: int) -> TrueMotion:
        """Return each ``ticks``-th sample, from the first."""
        return TrueMotion(*(np.ascontiguousarray(getattr(self, field.name)[:, ::ticks]) for field in fields(self)))


def true_motion(
    arm: VirtualArm,
    draft: PlantDraft,
    rate: float,
    substeps: int,
    reference: Array,
    feed: Array,
    start: Array,
    position: Array,
    velocity: Array,
    what: str,
    controlled: bool = True,
) -> tuple[Array, Array, TrueMotion, int]:
    """Let the arm move under torques that are fed and, if it is controlled, its controller's.

    Parameters
    ----------
    draft : PlantDraft
        The arm with its effects, in the order of the chain, as are all arrays.
    rate : float
        Of the controller, Hz.
    substeps : int
        Integration steps per period of the controller.
    reference : ndarray, shape (2, N, n)
        Position and velocity that the controller follows.
    feed : ndarray, shape (N, n)
        Torque at the joints beside the controller's, N m or N.
    start : ndarray, shape (n,)
        Torque at the joints at the first sample, which the integral begins at and elastic joints are wound up by.
    position, velocity : ndarray, shape (n,)
        Of the drives, at the first sample.
    what : str
        Of which arm and motion an error speaks.

    Returns
    -------
    tuple of (ndarray, ndarray, TrueMotion, int)
        Measured position and velocity, (n, N) each, in the robot's order, what the arm did, and how often a joint stopped.

    Raises
    ------
    LostArm
        If the controller loses the arm.
    """
    from scara_ident.simulation.loop import no_gains, track

    plant = draft.plant()
    # What no controller acts on has no filter either, which the rate could be too low for.
    gains = arm.controller.gains(rate, arm.robot.order) if controlled else no_gains(arm.robot.n)
    link = position - _stretch(draft, start)
    trace, stops = track(
        plant, draft.sensing(), gains, period=1.0 / rate, substeps=substeps, reference=reference, feed=feed, start=start,
        initial=(link, velocity, position, velocity), controlled=controlled,
    )  # fmt: skip
    if stops < 0:
        raise LostArm(
            f"{what}: the arm became unstable at {(-1 - stops) / rate:.3f} s; in Python give it a slower controller, or more substeps"
        )
    order = arm.robot.order

    def rows(values: Array) -> Array:
        return np.ascontiguousarray(values.T[order])

    true = TrueMotion(
        position=rows(trace.theta),
        velocity=rows(trace.omega),
        acceleration=rows(trace.alpha),
        link_position=rows(trace.q),
        link_velocity=rows(trace.v),
        link_acceleration=rows(trace.a),
        effort=rows(trace.drive) / arm.scale[:, None],
        load=rows(trace.load),
        direction=rows(trace.direction),
    )
    return rows(trace.measured), rows(trace.velocity), true, stops


def _stretch(draft: PlantDraft, torque: Array) -> Array:
    """Wind-up of elastic joints under the torque at the start, shape (n,)."""
    elastic = draft.arrays["elastic"] > 0.0
    wound = np.divide(torque, draft.arrays["stiffness"], out=np.zeros(draft.n), where=elastic)
    return np.asarray(np.where(elastic, wound + 0.5 * draft.arrays["width"] * np.sign(torque), 0.0))


def needed_substeps(arm: VirtualArm, draft: PlantDraft, rate: float) -> int:
    """Return how many steps per sample the stiffest elastic joint or dry friction needs.

    Raises
    ------
    UsageError
        If these are more than anybody would wait for.
    """
    from scara_ident.simulation.external import SHAFT_WAY

    arrays = draft.arrays
    link = arm.link_inertia()[np.argsort(arm.robot.order)]
    rotor = arrays["armature"]
    stiffness = np.where(arrays["elastic"] > 0.0, arrays["stiffness"], 0.0)
    # Inertial coupling makes a link lighter than its diagonal entry; 4 covers the arms at hand.
    square = np.divide(stiffness, rotor, out=np.zeros(draft.n), where=stiffness > 0.0)
    with np.errstate(divide="ignore"):
        # A link without mass swings on a spring without end; without a spring it is none of its own.
        square += np.divide(4.0 * stiffness, link, out=np.zeros(draft.n), where=stiffness > 0.0)
    dry = arrays["friction"][:, 0] + arrays["stribeck_amplitude"]
    sliding = arrays["presliding"]
    square += np.divide(4.0 * dry, sliding * (link + rotor), out=np.zeros(draft.n), where=sliding > 0.0)
    # Friction over so small a speed decays as fast as a spring of that frequency swings.
    smooth = arrays["smooth_velocity"]
    square += np.divide(4.0 * dry, smooth * (link + rotor), out=np.zeros(draft.n), where=smooth > 0.0) ** 2
    for i, j, coulomb in zip(*(arrays[f"shaft_{name}"] for name in ("joint", "other", "coulomb")), strict=True):
        both = np.array([i, j], dtype=int)
        square[both] += 4.0 * coulomb / (SHAFT_WAY * (link + rotor)[both])
    needed = int(np.ceil(float(np.sqrt(square.max())) / (rate * STIFF_STEP)))
    if needed > MAX_SUBSTEPS:
        joint = arm.robot.joints[int(np.flatnonzero(arm.robot.order == int(np.argmax(square)))[0])]
        raise UsageError(
            f"{joint}: so stiff that {needed} steps per sample would be needed (at most {MAX_SUBSTEPS}); "
            "lower its stiffness, or raise its presliding distance or the speed over which its friction builds up"
        )
    return needed
