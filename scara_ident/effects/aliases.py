"""Aliases: effects that a model absorbs exactly, whatever the arm does, and so cannot be excluded.

Nothing here is taken from a list of what is known of some arm: the columns of each effect are computed on random
states of the robot at hand and projected on the model's own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from scara_ident.arrays import Array
from scara_ident.effects.joint_zero import JointZero, zero_columns
from scara_ident.effects.links import point_mass, tool_of
from scara_ident.effects.spanned import Span, random_motion, rows_by_sample
from scara_ident.model.base_parameters import standard_regressor
from scara_ident.model.model import TorqueModel
from scara_ident.motion.motion import Motion
from scara_ident.robot.kinematics import axis, parent

Columns = Iterator[tuple[int | None, Array]]
Candidates = Callable[[TorqueModel, Motion, np.random.Generator], Columns]

# Share of a link's length for a central difference: torque is quadratic in it, so that a long step is exact.
LENGTH_STEP = 1e-2


@dataclass(frozen=True)
class Alias:
    """An effect that this model cannot show on any data.

    Attributes
    ----------
    effect : str
    joints : tuple of str
        The joints of which it is so.
    absorbed_by : tuple of str
        Parameters of the model that carry it; none where it does nothing to the torque at all.
    opened_by : str
        What would show it.
    """

    effect: str
    joints: tuple[str, ...]
    absorbed_by: tuple[str, ...]
    opened_by: str


@dataclass(frozen=True)
class Hidden:
    """An effect that might be an alias.

    Attributes
    ----------
    effect : str
    opened_by : str
        What would show it.
    columns : callable
        Gives place of the joint, or None, and columns (n, k, N) on a motion; arbitrary parameters from the generator.
    """

    effect: str
    opened_by: str
    columns: Candidates


def aliases(model: TorqueModel, *, seed: int = 0) -> tuple[Alias, ...]:
    """Find the effects that a model absorbs exactly.

    Parameters
    ----------
    model : TorqueModel
    seed : int, optional
        Of the random states and parameters.
    """
    rng = np.random.default_rng(seed)
    motion = random_motion(model.robot, rng, 40 + len(model.columns))
    span = Span.of(rows_by_sample(model.regressor(motion)))
    names = model.names
    found = []
    for hidden in HIDDEN:
        joints: list[str] = []
        absorbed_by: set[int] = set()
        absorbed = False
        for joint, columns in hidden.columns(model, motion, rng):
            carriers = span.carriers(rows_by_sample(columns))
            if carriers is not None:
                absorbed = True
                joints += [] if joint is None else [model.robot.joints[joint]]
                absorbed_by.update(carriers)
        if absorbed:
            found.append(
                Alias(hidden.effect, tuple(joints), tuple(names[k] for k in sorted(absorbed_by)), hidden.opened_by)
            )
    return tuple(found)


def _payload(model: TorqueModel, motion: Motion, rng: np.random.Generator) -> Columns:
    """Give a mass at the tool that all recordings have."""
    tool = tool_of(model.robot)
    yield None, np.einsum("jkn,k->jn", tool.columns(model.robot, motion), point_mass(tool.point))[:, None]


def _of_speed(*laws: Callable[[Array], Array]) -> Candidates:
    """Return what gives torques of each joint that are laws of its own speed in the direction of the drive."""

    def columns(model: TorqueModel, motion: Motion, rng: np.random.Generator) -> Columns:
        for joint, v in enumerate(model.robot.drive_sign[:, None] * motion.v):
            result = np.zeros((model.robot.n, len(laws), motion.samples))
            result[joint] = [law(v) for law in laws]
            yield joint, result

    return columns


def _counterbalances(model: TorqueModel, motion: Motion, rng: np.random.Generator) -> Columns:
    """Give sine and cosine of each turning joint's position: the torque of a spring or weight that balances it.

    A link whose horizontal axis is the first, or comes right after a vertical one, has gravity of the same form.
    """
    for joint in np.flatnonzero(~model.robot.prismatic):
        result = np.zeros((model.robot.n, 2, motion.samples))
        result[joint] = np.sin(motion.q[joint]), np.cos(motion.q[joint])
        yield int(joint), result


def _common_torque_scale(model: TorqueModel, motion: Motion, rng: np.random.Generator) -> Columns:
    """Give a torque scale that is wrong for all joints alike, of arbitrary parameters."""
    value = rng.uniform(0.5, 1.5, len(model.columns))
    yield None, np.einsum("jpn,p->jn", model.regressor(motion), value)[:, None]


def _rotor_couplings(model: TorqueModel, motion: Motion, rng: np.random.Generator) -> Columns:
    """Give the torque of each rotor's spin on the links that carry its motor, and back on the rotor.

    A rotor of joint k, mounted on the link before it and turning about the joint's axis z, has angular momentum
    ``N Jm qd_k z`` besides what turns with its motor (Siciliano, Sciavicco, Villani, Oriolo, Robotics, 2009, 7.2).
    Its rate of change loads the joints that carry the motor, and ``N Jm z . alpha`` of the motor's angular
    acceleration loads the rotor.
    """
    robot = model.robot
    pinocchio, data = robot.model, robot.model.createData()
    back = np.argsort(robot.order)
    moving = [k for k in range(robot.n) if not robot.prismatic[k] and parent(robot, k) >= 0]
    result = {k: np.zeros((robot.n, 1, motion.samples)) for k in moving}
    for sample in range(motion.samples):
        q, v, a = (part[back, sample] for part in (motion.q, motion.v, motion.a))
        pin.forwardKinematics(pinocchio, data, pin.integrate(pinocchio, pin.neutral(pinocchio), q), v, a)
        for k in moving:
            turn_axis = axis(robot, data, k)
            carrier = int(pinocchio.parents[int(robot.order[k]) + 1])
            turn = data.oMi[carrier].rotation
            spin, speed_up = turn @ data.v[carrier].angular, turn @ data.a[carrier].angular
            change = motion.a[k, sample] * turn_axis + motion.v[k, sample] * np.cross(spin, turn_axis)
            result[k][k, 0, sample] = turn_axis @ speed_up
            i = parent(robot, k)
            while i >= 0:
                if not robot.prismatic[i]:
                    result[k][i, 0, sample] = axis(robot, data, i) @ change
                i = parent(robot, i)
    for k in moving:
        yield k, result[k] * robot.row_scale[:, None, None]


def _belt_drives(model: TorqueModel, motion: Motion, rng: np.random.Generator) -> Columns:
    """Give the inertia of a rotor that turns with two parallel joints together, as its belt drives from the base."""
    robot = model.robot
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, pin.neutral(robot.model))
    for k in range(robot.n):
        i = parent(robot, k)
        if i < 0 or robot.prismatic[k] or robot.prismatic[i]:
            continue
        side = float(axis(robot, data, i) @ axis(robot, data, k))
        if abs(side) > 1.0 - 1e-6:
            column = np.zeros((robot.n, 1, motion.samples))
            column[i, 0] = motion.a[i] + np.sign(side) * motion.a[k]
            column[k, 0] = np.sign(side) * column[i, 0]
            yield k, column * robot.row_scale[:, None, None]


def _link_lengths(model: TorqueModel, motion: Motion, rng: np.random.Generator) -> Columns:
    """Give what a wrong distance between a joint and the one before it does, of arbitrary bodies."""
    robot = model.robot
    body = rng.uniform(0.5, 1.5, 11 * robot.n)
    body[10 * robot.n :] = 0.0
    for k in range(robot.n):
        place = int(robot.order[k]) + 1
        if parent(robot, k) < 0 or not np.any(np.abs(robot.model.jointPlacements[place].translation) > 1e-9):
            continue
        torque = []
        for factor in (1.0 + LENGTH_STEP, 1.0 - LENGTH_STEP):
            changed = robot.model.copy()
            changed.jointPlacements[place].translation = factor * robot.model.jointPlacements[place].translation
            regressor = standard_regressor(replace(robot, model=changed), motion.q, motion.v, motion.a)
            torque.append(np.einsum("jpn,p->jn", regressor, body))
        yield k, ((torque[0] - torque[1]) * robot.row_scale[:, None])[:, None]


HIDDEN = (
    Hidden("rotor_coupling", "the rotors' inertia from a data sheet, held fixed", _rotor_couplings),
    Hidden("belt_drive_inertia", "the rotors' inertia from a data sheet, held fixed", _belt_drives),
    Hidden("constant_payload", "recordings with and without the payload", _payload),
    Hidden("link_length", "recordings with a known payload, or a measurement of the link's length", _link_lengths),
    Hidden(
        JointZero.name,
        "a known payload, a link that is known to be symmetric, or a mechanical reference for the zero",
        zero_columns,
    ),
    Hidden(
        "gravity_counterbalance",
        "recordings with the base at another tilt (gravity in robot.yaml), or with the balancer removed",
        _counterbalances,
    ),
    Hidden(
        "asymmetric_coulomb",
        "the torque reading with the drive off, which is the offset of the sensor alone",
        _of_speed(lambda v: np.sign(v) ** 2),
    ),
    Hidden(
        "aerodynamic_drag",
        "the same motion in another pose of the other links, or a separate measurement of the gear's friction",
        _of_speed(lambda v: np.abs(v) * v),
    ),
    Hidden("iron_loss", "the motor run uncoupled from its gear", _of_speed(np.sign, lambda v: v)),
    Hidden("common_torque_scale", "a known payload, or weighing one link", _common_torque_scale),
)
"""What might be an alias, in the order in which it is tried."""
