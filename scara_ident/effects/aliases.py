"""Effects that a model absorbs exactly, whatever the arm does: not absent but invisible.

Nothing here is taken from a list of what is known of some arm: the columns of each effect are computed on random
states of the robot at hand and projected on the model's own.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from scara_ident.effects.links import point_mass, tool_of
from scara_ident.model.base_parameters import standard_regressor
from scara_ident.model.model import TorqueModel
from scara_ident.motion.motion import Motion
from scara_ident.robot.robot import Robot

Array = NDArray[np.float64]

# Share of an effect's square outside the model below which it is absorbed; above what a URDF loses by few digits.
ABSORBED = 1e-6
# Parameters that carry less than this share of the effect are not named.
NAMED = 1e-4
# Shift of a joint's zero, rad or m, and share of a link's length, for derivatives.
ZERO_STEP = 1e-4
LENGTH_STEP = 1e-2

OPENED_BY = {
    "rotor_coupling": "the rotors' inertia from a data sheet, held fixed",
    "belt_drive_inertia": "the rotors' inertia from a data sheet, held fixed",
    "constant_payload": "recordings with and without the payload",
    "link_length": "recordings with a known payload, or measuring the link",
    "zero_offset": "a known payload, symmetry of the link taken as given, or a mechanical reference for the zero",
    "asymmetric_coulomb": "the torque's reading with the drive off, which is the sensor's offset alone",
    "aerodynamic_drag": "the same motion in another pose of the other links, or the gear's friction measured apart",
    "common_torque_scale": "a known payload, or weighing one link",
    "iron_loss": "the motor run uncoupled from its gear",
}


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


def aliases(model: TorqueModel, *, seed: int = 0) -> tuple[Alias, ...]:
    """Find the effects that a model absorbs exactly.

    Parameters
    ----------
    model : TorqueModel
    seed : int, optional
        Of the random states and parameters.

    Returns
    -------
    tuple of Alias
    """
    robot = model.robot
    rng = np.random.default_rng(seed)
    motion = _random_motion(robot, rng, samples=40 + len(model.columns))
    basis = _flat(model.regressor(motion))
    size = np.linalg.norm(basis, axis=0)
    entering = np.flatnonzero(size > 0.0)
    unit = basis[:, entering] / size[entering]
    inverse = np.linalg.pinv(unit, rcond=1e-12)
    found: dict[str, tuple[list[str], set[int]]] = {}
    for effect, joint, columns in _effects(model, motion, rng):
        carriers = _carriers(unit, inverse, _flat(columns))
        if carriers is not None:
            joints, absorbed_by = found.setdefault(effect, ([], set()))
            joints += [joint] if joint is not None else []
            absorbed_by.update(int(entering[k]) for k in carriers)
    names = model.names
    return tuple(
        Alias(effect, tuple(dict.fromkeys(joints)), tuple(names[k] for k in sorted(absorbed_by)), OPENED_BY[effect])
        for effect, (joints, absorbed_by) in found.items()
    )


def _carriers(unit: Array, inverse: Array, columns: Array) -> list[int] | None:
    """Return which columns of the model carry an effect; None where they do not carry all of it."""
    total = np.sum(columns**2, axis=0)
    columns = columns[:, total > 0.0]
    if columns.shape[1] == 0:
        return []
    columns = columns / np.linalg.norm(columns, axis=0)
    sums = inverse @ columns
    if np.any(np.sum((columns - unit @ sums) ** 2, axis=0) >= ABSORBED):
        return None
    return np.flatnonzero(np.any(np.abs(sums) > NAMED, axis=1)).tolist()


def _random_motion(robot: Robot, rng: np.random.Generator, samples: int) -> Motion:
    reach = np.where(robot.prismatic, 1.0, np.pi)[:, None]
    q, v, a = (scale * rng.uniform(-1.0, 1.0, (robot.n, samples)) for scale in (reach, 2.0, 8.0))
    return Motion("random", "random", np.arange(samples, dtype=float), q, v, a, None, 1.0)


def _flat(columns: Array) -> Array:
    """Return columns (n, k, N) as (n N, k)."""
    return np.ascontiguousarray(columns.transpose(0, 2, 1)).reshape(-1, columns.shape[1])


def _effects(model: TorqueModel, motion: Motion, rng: np.random.Generator) -> Iterator[tuple[str, str | None, Array]]:
    """Give name, joint and columns (n, k, N) of everything that might be an alias."""
    robot = model.robot
    names = robot.joints
    for joint, column in _rotor_couplings(robot, motion):
        yield "rotor_coupling", names[joint], column
    for joint, column in _belt_drives(robot, motion):
        yield "belt_drive_inertia", names[joint], column
    yield "constant_payload", None, _payload(robot, motion)
    for joint, column in _link_lengths(robot, motion, rng):
        yield "link_length", names[joint], column
    for joint, column in _zero_offsets(model, motion, rng):
        yield "zero_offset", names[joint], column
    sign = robot.drive_sign[:, None] * np.sign(motion.v)
    for joint, name in enumerate(names):
        speed = robot.drive_sign[joint] * motion.v[joint]
        yield "asymmetric_coulomb", name, _row(robot, joint, sign[joint] ** 2)
        yield "aerodynamic_drag", name, _row(robot, joint, np.abs(speed) * speed)
        yield "iron_loss", name, _row(robot, joint, sign[joint], speed)
    value = rng.uniform(0.5, 1.5, len(model.columns))
    yield "common_torque_scale", None, np.einsum("jpn,p->jn", model.regressor(motion), value)[:, None]


def _row(robot: Robot, joint: int, *columns: Array) -> Array:
    result = np.zeros((robot.n, len(columns), columns[0].size))
    result[joint] = columns
    return result


def _payload(robot: Robot, motion: Motion) -> Array:
    tool = tool_of(robot)
    return np.asarray(np.einsum("jkn,k->jn", tool.columns(robot, motion), point_mass(tool.point))[:, None])


def _rotor_couplings(robot: Robot, motion: Motion) -> Iterator[tuple[int, Array]]:
    """Give the torque of each rotor's spin on the links that carry its motor, and back on the rotor.

    A rotor of joint k, mounted on the link before it and turning about the joint's axis z, has angular momentum
    ``N Jm qd_k z`` besides what turns with its motor (Siciliano, Sciavicco, Villani, Oriolo, Robotics, 2009, 7.2).
    Its rate of change loads the joints that carry the motor, and ``N Jm z . alpha`` of the motor's angular
    acceleration loads the rotor.
    """
    pinocchio, data = robot.model, robot.model.createData()
    back = np.argsort(robot.order)
    moving = [k for k in range(robot.n) if not robot.prismatic[k] and _parent(robot, k) >= 0]
    result = {k: np.zeros((robot.n, 1, motion.samples)) for k in moving}
    for sample in range(motion.samples):
        q, v, a = (part[back, sample] for part in (motion.q, motion.v, motion.a))
        pin.forwardKinematics(pinocchio, data, pin.integrate(pinocchio, pin.neutral(pinocchio), q), v, a)
        for k in moving:
            axis = _axis(robot, data, k)
            carrier = int(pinocchio.parents[int(robot.order[k]) + 1])
            turn = data.oMi[carrier].rotation
            spin, speed_up = turn @ data.v[carrier].angular, turn @ data.a[carrier].angular
            change = motion.a[k, sample] * axis + motion.v[k, sample] * np.cross(spin, axis)
            result[k][k, 0, sample] = axis @ speed_up
            i = _parent(robot, k)
            while i >= 0:
                if not robot.prismatic[i]:
                    result[k][i, 0, sample] = _axis(robot, data, i) @ change
                i = _parent(robot, i)
    for k in moving:
        yield k, result[k] * robot.row_scale[:, None, None]


def _belt_drives(robot: Robot, motion: Motion) -> Iterator[tuple[int, Array]]:
    """Give the inertia of a rotor that turns with two parallel joints together, as its belt drives from the base."""
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, pin.neutral(robot.model))
    for k in range(robot.n):
        i = _parent(robot, k)
        if i < 0 or robot.prismatic[k] or robot.prismatic[i]:
            continue
        side = float(_axis(robot, data, i) @ _axis(robot, data, k))
        if abs(side) > 1.0 - 1e-6:
            column = np.zeros((robot.n, 1, motion.samples))
            column[i, 0] = motion.a[i] + np.sign(side) * motion.a[k]
            column[k, 0] = np.sign(side) * column[i, 0]
            yield k, column * robot.row_scale[:, None, None]


def _link_lengths(robot: Robot, motion: Motion, rng: np.random.Generator) -> Iterator[tuple[int, Array]]:
    """Give what a wrong distance between a joint and the one before it does, of arbitrary bodies."""
    body = rng.uniform(0.5, 1.5, 11 * robot.n)
    body[10 * robot.n :] = 0.0
    for k in range(robot.n):
        place = int(robot.order[k]) + 1
        if _parent(robot, k) < 0 or not np.any(np.abs(robot.model.jointPlacements[place].translation) > 1e-9):
            continue
        torque = []
        for factor in (1.0 + LENGTH_STEP, 1.0 - LENGTH_STEP):
            changed = robot.model.copy()
            changed.jointPlacements[place].translation = factor * robot.model.jointPlacements[place].translation
            regressor = standard_regressor(replace(robot, model=changed), motion.q, motion.v, motion.a)
            torque.append(np.einsum("jpn,p->jn", regressor, body))
        yield k, ((torque[0] - torque[1]) * robot.row_scale[:, None])[:, None]


def _zero_offsets(model: TorqueModel, motion: Motion, rng: np.random.Generator) -> Iterator[tuple[int, Array]]:
    """Give what a wrong zero of a joint does to the torque of rigid bodies, of arbitrary base parameters."""
    term = model.rigid_body
    value = rng.uniform(0.5, 1.5, len(term.columns))
    rigid = np.einsum("jpn,p->jn", term.regressor(motion), value)
    for k in range(model.robot.n):
        torque = []
        for step in (ZERO_STEP, -ZERO_STEP):
            q = motion.q.copy()
            q[k] += step
            moved = replace(motion, q=q)
            torque.append(np.einsum("jpn,p->jn", term.regressor(moved), value))
        change = torque[0] - torque[1]
        # What rounding leaves of no change at all is not a column.
        if np.max(np.abs(change)) < 1e-12 * np.max(np.abs(rigid)):
            change = np.zeros_like(change)
        yield k, change[:, None]


def _parent(robot: Robot, joint: int) -> int:
    """Return the place of the joint that carries a joint; -1 for the base."""
    carrier = int(robot.model.parents[int(robot.order[joint]) + 1])
    return -1 if carrier == 0 else int(np.flatnonzero(robot.order == carrier - 1)[0])


def _axis(robot: Robot, data: pin.Data, joint: int) -> Array:
    """Return the axis of a joint in the base frame, at the configuration last computed."""
    place = int(robot.order[joint]) + 1
    subspace = robot.model.joints[place].createData().S
    direction = np.asarray(subspace).reshape(6, -1)[3:, 0]
    return np.asarray(data.oMi[place].rotation @ direction)
