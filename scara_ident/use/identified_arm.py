"""The virtual arm that has identified parameters, and found effects."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from scara_ident.arrays import Array
from scara_ident.calling import asked_for
from scara_ident.errors import RobotError, UsageError
from scara_ident.export.identified_model import Entry, IdentifiedModel
from scara_ident.manners import listed
from scara_ident.model.model import build_model
from scara_ident.model.terms import Offset, RigidBody
from scara_ident.robot.robot import Robot
from scara_ident.simulation.arm import VirtualArm
from scara_ident.simulation.defaults import placed_poles, virtual_arm
from scara_ident.simulation.effects import EFFECTS, Effect
from scara_ident.simulation.spatial import mass_and_bias

# Models whose parameters the virtual arm has.
_MODELS = ("complete", "reduced", "basic")
# Standard parameters of a body by kind: mass, first moments, moments of inertia.
_KINDS = (slice(0, 1), slice(1, 4), slice(4, 10))
# A kind of parameter that the URDF has none of counts as this share of the kind's largest one on the arm.
_MIN_SHARE = 1e-3
# Of the arm's largest rotor: less than nothing by less is rounding.
_ROUNDING = 1e-9
# Random poses at which the inertia must be positive.
_POSES = 64


def arms_of(model: IdentifiedModel) -> tuple[VirtualArm, VirtualArm]:
    """Return the virtual arms with a model's parameters, before and after the effects found, which they are without.

    Raises
    ------
    UsageError
        If the virtual arm has no such model.
    RobotError
        See `arm_with`.
    """
    if model.model.name not in _MODELS:
        raise UsageError(f"the virtual arm does not have its model {model.model.name!r}")
    near = model.standard
    bare, whole = (arm_with(model.robot, by_name(model, value), near) for value in (model.before, model.value))
    return bare, whole


def by_name(model: IdentifiedModel, value: Array) -> dict[str, float]:
    """Return numbers of a model's first parameters by name; what is not known is left out."""
    return {name: float(x) for name, x in zip(model.model.names, value, strict=False) if np.isfinite(x)}


def arm_with(robot: Robot, parameters: Mapping[str, float], near: Array | None = None) -> VirtualArm:
    """Return the virtual arm whose complete model has given parameters.

    Torque tells base parameters only; of all bodies with these, those are taken that are nearest to given ones, each kind
    of parameter in units of the arm's largest. Every motion then takes the same torque, whichever they are; only a rotor
    that torque itself tells to be of less than no inertia has none instead, see `rotor_note`.

    Parameters
    ----------
    parameters : mapping of str to float
        By the names of the complete model; those that it lacks are zero.
    near : ndarray, shape (11 n,), optional
        Standard parameters of bodies and rotors: those of an estimate that has them, by default the URDF's.

    Raises
    ------
    RobotError
        If no arm with these parameters can move: its inertia is not positive somewhere.
    """
    arm, model = virtual_arm(robot), build_model(robot, "complete")
    value = np.array([float(parameters.get(name, 0.0)) for name in model.names])
    n, count = robot.n, len(model.rigid_body.kept)
    standard, _ = _nearest(arm, model.rigid_body, value[:count], near)
    made = replace(
        arm,
        bodies=standard[: 10 * n].reshape(n, 10),
        rotor_inertia=standard[10 * n :] / robot.reduction**2,
        friction=value[count : count + 4 * n].reshape(n, 4),
        torque_offset=next(term for term in model.terms if isinstance(term, Offset)).of_joints(value[count + 4 * n :]),
    )
    return replace(made, controller=placed_poles(_mean_inertia(made)))


def rotor_note(model: IdentifiedModel) -> str:
    """Say which rotors of a model have less than no inertia, which `arms_of` takes as none; empty where none has.

    Least squares end there where a rotor's share of the torque is small beside the noise, or beside what the model lacks.
    """
    robot, body = model.robot, build_model(model.robot, "complete").rigid_body
    below = np.zeros(robot.n)
    for value in (model.before, model.value):
        known = by_name(model, value)
        base = np.array([known.get(column.name, 0.0) for column in body.columns])
        lost = _nearest(virtual_arm(robot), body, base, model.standard)[1]
        below = np.where(lost < 0.0, lost, below)
    said = [
        f"{joint} {below[j]:.3g} {robot.armature_unit(j)}" for j, joint in enumerate(robot.joints) if below[j] < 0.0
    ]
    if not said:
        return ""
    return (
        f"The fit has a negative rotor inertia, at the joint: {listed(said, 6)}. No arm has one: it is set to 0 in the "
        f"virtual arm and in the feed-forward; identify with {asked_for('--method consistent')}, or from a motion with better "
        f"excitation."
    )


def _nearest(arm: VirtualArm, body: RigidBody, base: Array, near: Array | None) -> tuple[Array, Array]:
    """Return the standard parameters nearest to given ones that have these base parameters, and rotors below zero.

    Returns
    -------
    standard : ndarray, shape (11 n,)
        With no rotor below zero.
    below : ndarray, shape (n,)
        Inertia at the joint of the rotors that no other parameter can stand in for; 0 for all others.
    """
    n, grouping = arm.robot.n, body.base.grouping[body.kept]
    standard = np.concatenate([arm.bodies.ravel(), arm.armature]) if near is None else near.copy()
    size = np.concatenate([np.tile(_sizes(arm.bodies), n), np.full(n, max(float(np.max(arm.armature)), _MIN_SHARE))])
    rotors = np.arange(10 * n, 11 * n)
    # A rotor that is shared with a link leaves to it what would take it below zero.
    free = np.ones(11 * n, dtype=bool)
    for _ in range(n + 1):
        scaled = (grouping * size)[:, free]
        standard[free] += size[free] * (np.linalg.pinv(scaled) @ (base - grouping @ standard))
        negative = rotors[standard[rotors] < 0.0]
        if not len(negative):
            break
        standard[negative], free[negative] = 0.0, False
    share = grouping[:, rotors]
    left = share.T @ (base - grouping @ standard) / np.maximum(np.sum(share**2, axis=0), np.finfo(float).tiny)
    determined = ~free[rotors] & (left < -_ROUNDING * size[rotors])
    return standard, np.where(determined, left, 0.0)


def simulated(found: Sequence[Entry]) -> tuple[tuple[tuple[Effect, Entry], ...], tuple[str, ...]]:
    """Return the virtual arm's effects for those of a ``diagnosis.json``, and the names of those that it cannot have.

    Parameters
    ----------
    found : sequence of mapping
        With ``effect``, ``joint`` and ``parameters``.

    Returns
    -------
    pairs : tuple of (Effect, mapping)
        Each effect with what it was made of.
    """
    made: list[tuple[Effect, Entry]] = []
    missing: list[str] = []
    for item in found:
        kind = EFFECTS.get(item["effect"])
        names = {} if kind is None else kind.parameter_names()
        known: dict[str, Any] = {
            names[key]: float(entry["value"])
            for key, entry in item["parameters"].items()
            if key in names and entry["value"] is not None
        }
        if kind is None or not known:
            missing.append(item["effect"])
            continue
        rest = item["parameters"].get("rest_position")
        if rest is not None and (rest.get("std") is None or not np.isfinite(rest["std"])):
            # It is the model's offset in other words, which the arm has: with both it would count twice.
            known["rest_position"] = 0.0
        effect = kind(joint=None if kind.whole_arm == "always" else item["joint"])
        made.append((replace(effect, **known), item))
    return tuple(made), tuple(missing)


def _sizes(bodies: Array) -> Array:
    """Return the largest of each kind of standard parameter of a body, shape (10,)."""
    size = np.empty(10)
    for kind in _KINDS:
        size[kind] = np.max(np.abs(bodies[:, kind]))
    return np.maximum(size, _MIN_SHARE * np.max(size))


def light_joint(arm: VirtualArm) -> str:
    """Say which joint of an arm is the lightest beside what its controller is made for, and by how much.

    With all other joints free a joint has less inertia than while they are held; a controller that is made for the
    latter is too fast for it where that is next to nothing.
    """
    robot, total = arm.robot, np.zeros(arm.robot.n)
    least = np.full(robot.n, np.inf)
    for mass in _masses(arm):
        total += np.diag(mass)[robot.order] / _POSES
        least = np.minimum(least, 1.0 / np.diag(np.linalg.inv(mass))[robot.order])
    j = int(np.argmin(least / total))
    rotor = ", of which the rotor has almost nothing" if arm.armature[j] < 0.01 * least[j] else ""
    return (
        f"{robot.joints[j]} has a mean inertia of {total[j]:.2g} {robot.armature_unit(j)}{rotor}, and down to "
        f"{least[j]:.2g} when the other joints move freely"
    )


def _mean_inertia(arm: VirtualArm) -> Array:
    """Return the mean inertia about each joint over its range, rotors included, shape (n,).

    Raises
    ------
    RobotError
        If an inertia is not positive.
    """
    robot, total = arm.robot, np.zeros(arm.robot.n)
    for mass in _masses(arm):
        if np.linalg.eigvalsh(mass)[0] <= 0.0:
            raise RobotError(
                f"{robot.name}: no arm with these parameters can move, because its inertia is not positive; identify "
                f"with {asked_for('--method consistent')}, or from a motion with better excitation"
            )
        total += np.diag(mass)[robot.order] / _POSES
    return total


def _masses(arm: VirtualArm) -> Iterator[Array]:
    """Give the mass matrix of an arm, rotors included, in poses over its range, shape (n, n) in the model's order."""
    robot = arm.robot
    back = np.argsort(robot.order)
    lower = np.where(np.isfinite(robot.lower), robot.lower, -np.pi)
    upper = np.where(np.isfinite(robot.upper), robot.upper, np.pi)
    random = np.random.default_rng(0)
    bodies, still = arm.bodies[back], np.zeros(robot.n)
    for _ in range(_POSES):
        pose = random.uniform(lower, upper)[back]
        yield mass_and_bias(robot.model, bodies, pose, still)[0] + np.diag(arm.armature[back])
