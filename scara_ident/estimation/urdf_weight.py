"""The weight of the identified bodies beside their inertia: a torque gain scales both, a counterweight does not.

And whether rotors are as stated; with `scale_in_words`, which says how all of that compares with the URDF.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from scara_ident.arrays import Array
from scara_ident.estimation.estimate import Estimate
from scara_ident.estimation.observations import Observations
from scara_ident.estimation.urdf_scale import (
    SAME_SCALE_FACTOR,
    SIGNIFICANT_STDS,
    USUAL,
    friction_sides,
    scale_sentence,
    slight_joints,
    unlike_urdf,
    urdf_scale,
)
from scara_ident.model.urdf_values import urdf_values
from scara_ident.robot.robot import Robot

# Weight and inertia are compared where each makes at least this share of the URDF's torque: what is smaller is mostly what
# the bodies' shapes make of it.
SHARE = 0.02
# A weight that is off by less than this share of the torque on the joint that bears most is what centres of mass a few cm off
# make of a wrist.
HEAVY = 0.1
# Inertia up to this multiple of the URDF's is that of its bodies: what balances them moves with them, and doubles it or so.
HEAVIEST = 3.0
# Samples that are looked at; the torque of bodies is smooth.
SAMPLES = 2000
# A rotor is not as stated from this share on: data sheets leave out so much of shaft and brake.
ROTOR = 0.1


@dataclass(frozen=True)
class WeightScale:
    """Weight and inertia of the identified bodies on a joint, each as a multiple of the URDF's."""

    weight: float
    inertia: float


def scale_in_words(estimate: Estimate, observations: Observations) -> str:
    """Say how the scale of the identified bodies compares with the URDF's."""
    seen = estimate, observations
    scales, slight, loaded = urdf_scale(*seen), slight_joints(*seen), otherwise_loaded(*seen)
    others = {joint: scale for joint, scale in scales.items() if joint not in loaded}
    unlike = [joint for joint in unlike_urdf(*seen) if joint not in loaded]
    # Where nothing else is compared that is no reason to say that nothing can be.
    compared = others if others or not loaded else None
    said = scale_sentence(compared, observations.model.robot, unlike, slight, friction_sides(*seen))
    return f"{said} {_loaded_sentence(loaded, observations.model.robot)}" if loaded else said


def turned_bodies(estimate: Estimate, observations: Observations) -> tuple[str, ...]:
    """Return the joints on which torques of the bodies have the opposite sign of the URDF's, and no friction says that efforts have theirs.

    Where it brakes a centre of mass may lie elsewhere, and where the bodies make little one that is a little off does.
    """
    seen = estimate, observations
    turned = [joint for joint, scale in urdf_scale(*seen).items() if scale < 0.0]
    if not turned:
        return ()
    explained = {*friction_sides(*seen).brakes, *slight_joints(*seen), *otherwise_loaded(*seen)}
    return tuple(joint for joint in turned if joint not in explained)


def otherwise_loaded(estimate: Estimate, observations: Observations) -> dict[str, WeightScale]:
    """Return the joints whose weight is surely not the URDF's while their inertia is about that, which no gain makes."""
    observations = observations.in_memory
    model = observations.model
    rigid, robot, place = model.rigid_body, model.robot, model.place(model.rigid_body)
    stated, value, std = urdf_values(model)[place], estimate.value[place], estimate.std[place]
    known = np.isfinite(stated) & ~estimate.undetermined[place] & np.isfinite(std)
    covariance = estimate.covariance[place, place]
    moving, still = _columns(observations)
    units = [robot.torque_unit(j) for j in range(robot.n)]
    places = [np.flatnonzero(pattern) for pattern in rigid.pattern]
    borne = [
        float(np.linalg.norm(stated[own][known[own]] @ rows[known[own]]))
        for own, rows in zip(places, moving, strict=True)
    ]
    found = {}
    for j, joint in enumerate(robot.joints):
        use = known[places[j]]
        own, weight = places[j][use], still[j][use]
        inertia = moving[j][use] - weight
        parts = [stated[own] @ part for part in (weight, inertia)]
        most = max(size for size, unit in zip(borne, units, strict=True) if unit == units[j])
        off = np.linalg.norm((value[own] - stated[own]) @ weight)
        if not (min(map(np.linalg.norm, parts)) > SHARE * borne[j] and off > HEAVY * most):
            continue
        shares = [columns @ part / (part @ part) for columns, part in zip((weight, inertia), parts, strict=True)]
        heavy, inert = (float(share @ value[own]) for share in shares)
        among = covariance[np.ix_(own, own)]
        apart, unsure = (np.sqrt(max(0.0, float(s @ among @ s))) for s in (shares[0] - shares[1], shares[1]))
        if (
            1.0 / USUAL < inert < HEAVIEST
            and inert > SIGNIFICANT_STDS * unsure
            and not 1.0 / USUAL < heavy < USUAL
            and abs(heavy - inert) > SIGNIFICANT_STDS * apart
            and not inert / SAME_SCALE_FACTOR < heavy < inert * SAME_SCALE_FACTOR
        ):
            found[joint] = WeightScale(heavy, inert)
    return found


def rotor_sentence(estimate: Estimate, observations: Observations) -> str | None:
    """Say which rotors are surely not as stated, of those that are a parameter of their own; None where none are.

    Nothing is said of joints where the scale of the bodies leaves ``effort_gain`` in doubt, and with it all that was identified.
    """
    said = _other_rotors(estimate)
    if said:
        loaded = otherwise_loaded(estimate, observations)
        scales = urdf_scale(estimate, observations)
        doubtful = {joint for joint, scale in scales.items() if not 1.0 / USUAL < scale < USUAL}
        said = {joint: own for joint, own in said.items() if joint in loaded or joint not in doubtful}
    if not said:
        return None
    each = "; ".join(f"rotor inertia of {joint}: {own}" for joint, own in said.items())
    remedy = "Correct rotor_inertia, unless something else moves with the joint, such as a counterweight."
    return f"{each[0].upper()}{each[1:]}. {remedy}"


def _other_rotors(estimate: Estimate) -> dict[str, str]:
    """Return what is stated and what was identified, by joint, in words."""
    model = estimate.model
    robot, rigid, place = model.robot, model.rigid_body, model.place(model.rigid_body)
    values = estimate.value[place], estimate.std[place], urdf_values(model)[place]
    said = {}
    for k, (value, std, stated) in enumerate(zip(*values, strict=True)):
        j = int(rigid.base.kept[rigid.kept[k]]) - 10 * robot.n
        alone = np.count_nonzero(rigid.base.grouping[rigid.kept[k]]) == 1
        if j < 0 or not alone or not stated > 0.0 or estimate.undetermined[place][k]:
            continue
        if not abs(value - stated) > max(SIGNIFICANT_STDS * std, ROTOR * stated):
            continue
        unit = "kg" if robot.prismatic[j] and robot.reduction[j] == 1.0 else "kg m^2"
        was, now, spread = (number / robot.reduction[j] ** 2 for number in (stated, value, std))
        said[robot.joints[j]] = f"stated {was:.3g} {unit}, identified {now:.3g} ± {spread:.1g}"
    return said


def _loaded_sentence(loaded: Mapping[str, WeightScale], robot: Robot) -> str:
    turning = any(not robot.prismatic[robot.joints.index(joint)] for joint in loaded)
    each = ", ".join(f"{own.weight:.2g} and {own.inertia:.2g} times the URDF's on {j}" for j, own in loaded.items())
    return (
        f"Weight and inertia of the bodies are {each}, which no effort_gain explains: the URDF lacks a counterweight, "
        f"a balancing spring or cylinder, or a payload"
        + (", or a centre of mass in the URDF is wrong." if turning else ".")
    )


def _columns(observations: Observations) -> tuple[list[Array], list[Array]]:
    """Return the columns of each joint's bodies at some samples: in motion, and at the same positions at rest."""
    rigid = observations.model.rigid_body
    parts = [part.motion for part in observations.data.stretches if part.usable]
    every = max(1, sum(part.samples for part in parts) // SAMPLES)
    motions = [part.decimated(every, None) for part in parts]
    counts = rigid.pattern.sum(axis=1).tolist()
    sides: tuple[list[list[Array]], list[list[Array]]] = ([], [])
    for motion in motions:
        nothing = np.zeros_like(motion.q)
        for side, state in zip(sides, (motion, replace(motion, v=nothing, a=nothing)), strict=True):
            rows = [np.zeros((count, motion.samples)) for count in counts]
            rigid.fill(state, rows)
            side.append(rows)
    moving, still = ([np.concatenate(rows, axis=1) for rows in zip(*side, strict=True)] for side in sides)
    return moving, still
