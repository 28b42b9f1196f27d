"""The torque of the identified bodies as a multiple of that of the URDF's: a scale that recordings cannot determine."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from scara_ident.estimation.estimate import Estimate
from scara_ident.estimation.observations import Observations
from scara_ident.model.regressor.kernel import configurations
from scara_ident.model.terms import Friction
from scara_ident.model.urdf_values import urdf_values
from scara_ident.robot.robot import Robot

# The URDF's torque tells the scale of a joint where it leaves less than this share of the identified bodies' torque.
MAX_UNEXPLAINED = 0.5
# A scale is significant where it is so many of its standard deviations.
SIGNIFICANT_STDS = 5.0
# Torques of gravity below this, N m for each kg, are rounding.
ROUNDING = 1e-9
# A scale within this factor of 1 is what a URDF with rough masses gives.
USUAL = 2.0
# Joints within this factor of their middle are scaled alike.
SAME_SCALE_FACTOR = 1.5
# Torque of the bodies below this share of that of the joint that bears most is as much as a centre of mass a little off makes.
SLIGHT = 0.01


@dataclass(frozen=True)
class JointScale:
    """The torque of the identified bodies on a joint beside that of the URDF's.

    Attributes
    ----------
    scale : float
        The first as a multiple of the second.
    significant : bool
        Whether the scale differs significantly from zero.
    sure : bool
        Whether what is left differs significantly from zero.
    left : float
        Share of the identified torque that the URDF's does not explain in any scale.
    torque, nominal : float
        Rms of the identified torque and of the URDF's, N m or N.
    """

    scale: float
    significant: bool
    sure: bool
    left: float
    torque: float = np.nan
    nominal: float = np.nan


def urdf_scale(estimate: Estimate, observations: Observations) -> dict[str, float]:
    """Return the torque of the identified bodies as a multiple of that of the URDF's bodies.

    Gravity and inertia are taken together, along the recorded motion, and only parameters of which the URDF says
    something.

    Returns
    -------
    dict of str to float
        By joint, negative where the signs are opposite; without those where it is not significant, or the identified
        torque is not that of the URDF in any scale.
    """
    each = joint_scales(estimate, observations)
    return {joint: own.scale for joint, own in each.items() if own.significant and own.left < MAX_UNEXPLAINED}


def unlike_urdf(estimate: Estimate, observations: Observations) -> tuple[str, ...]:
    """Return the joints whose identified bodies surely take another torque than the URDF's in any scale."""
    each = joint_scales(estimate, observations)
    return tuple(joint for joint, own in each.items() if own.sure and not own.left < MAX_UNEXPLAINED)


def joint_scales(estimate: Estimate, observations: Observations) -> dict[str, JointScale]:
    """Compare the torque of the identified bodies with that of the URDF's on each joint where these take any."""
    model = observations.model
    stated = urdf_values(model)
    # What has no finite variance is not determined, though the estimate may have a value for it.
    known = np.isfinite(stated) & ~estimate.undetermined & np.isfinite(estimate.std)
    found = {}
    for joint, rows in zip(model.robot.joints, observations.joints, strict=True):
        own = rows.columns[use := known[rows.columns]]
        columns = rows.table[:-1][use]
        nominal = stated[own] @ columns
        size = float(nominal @ nominal)
        if not size > 0.0:
            continue
        identified = estimate.value[own] @ columns
        # The scale is a sum of parameters, so its spread follows from theirs.
        share = columns @ nominal / size
        # Of a covariance rounding may leave less than nothing along what is known best.
        variance = max(0.0, float(share @ estimate.covariance[np.ix_(own, own)] @ share))
        scale, std = float(share @ estimate.value[own]), float(np.sqrt(variance))
        own_size = float(np.linalg.norm(identified))
        left = float(np.linalg.norm(identified - scale * nominal))
        spread = float(np.sum(columns * (estimate.covariance[np.ix_(own, own)] @ columns)))
        sure = left > SIGNIFICANT_STDS * np.sqrt(max(0.0, spread))
        count = np.sqrt(nominal.size)
        left = left / own_size if own_size else np.inf
        found[joint] = JointScale(
            scale, abs(scale) > SIGNIFICANT_STDS * std, sure, left, own_size / count, np.sqrt(size) / count
        )
    return found


def slight_joints(estimate: Estimate, observations: Observations) -> tuple[str, ...]:
    """Return the joints on which the bodies take so little torque that its scale says nothing of the efforts'.

    By the URDF and as identified, beside what the URDF has on the joint that bears most, of those with torques of one unit.
    """
    robot = observations.model.robot
    each = joint_scales(estimate, observations)
    units = {joint: robot.torque_unit(robot.joints.index(joint)) for joint in each}
    most = {unit: max(each[joint].nominal for joint in each if units[joint] == unit) for unit in set(units.values())}
    return tuple(joint for joint, own in each.items() if max(own.torque, own.nominal) < SLIGHT * most[units[joint]])


@dataclass(frozen=True)
class FrictionSides:
    """Joints whose friction surely takes energy out, as it does, and those where it surely feeds energy in.

    Attributes
    ----------
    brakes : tuple of str
        There efforts have the sign of the positions.
    pushes : tuple of str
        There they have not: one of the two counts backwards.
    """

    brakes: tuple[str, ...] = ()
    pushes: tuple[str, ...] = ()


def friction_sides(estimate: Estimate, observations: Observations) -> FrictionSides:
    """Ask of each joint whether its friction brakes, by the energy that it takes over the recorded motion.

    Of a law with several powers of the speed no coefficient need be sure where what they say together is.
    """
    model, brakes, pushes = observations.model, list[str](), list[str]()
    known = ~estimate.undetermined & np.isfinite(estimate.std)
    for term in model.terms:
        if not isinstance(term, Friction) or 1 not in term.powers:
            continue
        start, count = model.place(term).start, len(term.powers)
        for j, (joint, rows) in enumerate(zip(model.robot.joints, observations.joints, strict=True)):
            own = start + j * count + np.arange(count)
            use = np.flatnonzero(np.isin(rows.columns, own) & known[rows.columns])
            speed = rows.table[:-1][rows.columns == own[term.powers.index(1)]]
            if not len(speed):
                continue
            places, taken = rows.columns[use], rows.table[use] @ speed[0]
            # Of a covariance rounding may leave less than nothing along what is known best.
            variance = max(0.0, float(taken @ estimate.covariance[np.ix_(places, places)] @ taken))
            energy = float(taken @ estimate.value[places])
            if abs(energy) > SIGNIFICANT_STDS * np.sqrt(variance):
                (brakes if energy > 0.0 else pushes).append(joint)
    return FrictionSides(tuple(brakes), tuple(pushes))


def scale_sentence(
    scales: Mapping[str, float] | None,
    robot: Robot,
    unlike: Sequence[str] = (),
    slight: Sequence[str] = (),
    friction: FrictionSides | None = None,
) -> str:
    """Say what scale recordings cannot tell, and how the URDF's compares, where scales are given.

    Parameters
    ----------
    scales : mapping of str to float, or None
        See `urdf_scale`.
    robot : Robot
    unlike : sequence of str, optional
        See `unlike_urdf`.
    slight : sequence of str, optional
        See `slight_joints`: nothing is asked for their sake.
    friction : FrictionSides, optional
        A gain of the wrong sign is none of a joint's that friction brakes.
    """
    friction = friction or FrictionSides()
    said = _compared(scales, robot, slight, friction)
    if not scales or not unlike:
        return said
    return f"{said} On {', '.join(unlike)} no scale makes them those of the URDF."


def gravity_acts(robot: Robot) -> bool:
    """Whether gravity makes a torque on some joint: its acceleration is known, so it tells the scale of time."""
    steps = np.linspace(-1.0, 1.0, 4)
    states = configurations(robot.model, np.outer(np.arange(1.0, robot.model.nv + 1.0), steps))
    torques = [pin.computeGeneralizedGravity(robot.model, robot.model.createData(), state) for state in states.T]
    bodies = sum(body.mass for body in robot.model.inertias)
    return bool(np.max(np.abs(torques)) > ROUNDING * bodies)


def _compared(scales: Mapping[str, float] | None, robot: Robot, slight: Sequence[str], friction: FrictionSides) -> str:
    geared = np.any(robot.reduction != 1.0)
    said = "Recordings cannot determine a common scale of all torques and masses"
    if gravity_acts(robot):
        said += f": it depends on {'effort_gain and effort_side' if geared else 'effort_gain'}"
    else:
        rest = "effort_gain, effort_side and the clock" if geared else "effort_gain and the clock"
        said += f", nor, without gravity, the scale of time: these depend on {rest}"
    if scales is None:
        return f"{said}."
    if not scales:
        return f"{said}; these recordings do not show whether the torques are those of the URDF's bodies."
    # A scale that all joints share is one, whatever each of them bears.
    shared = _alike(scales.values()) and any(joint not in slight for joint in scales)
    little = {joint: scales[joint] for joint in slight if joint in scales and not 1.0 / USUAL < scales[joint] < USUAL}
    if little and not shared:
        others = {joint: scale for joint, scale in scales.items() if joint not in little}
        few = ", ".join(f"{scale:.2g} times the URDF's on {joint}" for joint, scale in little.items())
        begun = f"{_compared(others, robot, (), friction)} They" if others else f"{said}. Torques of the bodies"
        return f"{begun} are {few}, but they are so small there that a small error of a centre of mass explains this."
    size = np.array(list(scales.values()))
    turned = [joint for joint, scale in scales.items() if scale < 0.0]
    if turned:
        return f"{said}. Torques of the bodies have the opposite sign of the URDF's on {_turned(turned, friction)}"
    middle = float(np.exp(np.median(np.log(size))))
    usual = (size > 1.0 / USUAL) & (size < USUAL)
    if np.all(usual):
        spread = " to ".join(dict.fromkeys((f"{size.min():.2g}", f"{size.max():.2g}")))
        same = "those of the URDF" if spread == "1" else f"{spread} times the URDF's"
        return f"{said}. Torques of the bodies are {same}."
    asked = "are effort_gain and effort_side right" if geared else "is effort_gain right"
    # Of few joints it is not known whether it is all that are scaled.
    if _alike(scales.values()) and 2 * len(scales) > robot.n:
        return f"{said}. All inertial parameters are {middle:.2g} of the URDF's: {asked}?"
    odd = ", ".join(
        f"{scale:.2g} times the URDF's on {joint}"
        for (joint, scale), fits in zip(scales.items(), usual, strict=True)
        if not fits
    )
    # A URDF is often right of the large links and has the small ones roughly.
    or_masses = " there, or do the masses differ" if np.any(usual) else ""
    return f"{said}. Torques of the bodies are {odd}: {asked}{or_masses}?"


def _turned(turned: Sequence[str], friction: FrictionSides) -> str:
    """Name joints whose torques have the opposite sign, and say what that may be by what friction does there."""
    pushed = [joint for joint in turned if joint in friction.pushes]
    braked = [joint for joint in turned if joint in friction.brakes]
    others = [joint for joint in turned if joint not in (*pushed, *braked)]
    said = []
    if pushed:
        said.append(
            f"{', '.join(pushed)}, and friction feeds energy in there: efforts or positions have the wrong sign; "
            f"negate effort_gain or the position's scale."
        )
    if braked:
        said.append(
            f"{', '.join(braked)}, but friction brakes there, so efforts and positions have consistent signs: the "
            f"centre of mass is not where the URDF has it, or both signs are opposite to the URDF's axis, or gravity "
            f"has another direction."
        )
    if others:
        said.append(
            f"{', '.join(others)}: negate effort_gain there, or the axis, unless gravity has another direction."
        )
    return " They also have the opposite sign on ".join(said)


def _alike(scales: Iterable[float]) -> bool:
    """Whether scales are of one sign and within a factor of their middle."""
    size = np.array(list(scales))
    if np.any(size <= 0.0):
        return False
    middle = float(np.exp(np.median(np.log(size))))
    return bool(np.all(size < SAME_SCALE_FACTOR * middle) and np.all(size > middle / SAME_SCALE_FACTOR))
