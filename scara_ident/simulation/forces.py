"""Accelerations of the virtual arm with friction, losses and elastic joints; and which joints stick.

Every joint has one drive coordinate (the motor, seen through the gear) and one link coordinate; they are the same
unless the joint is elastic. With the torque ``load`` that goes through the gear to the link,

    drive  = armature x acceleration + dry x direction + smooth + loss(load, direction) x load
    load   = (M(q) acceleration + h(q, v) + spring - J(q)^T force from outside) of the link.

Where a joint slides its direction is +1 or -1; where it stands still it sticks as long as the friction that holds it
stays within its bounds, which makes the contact a linear complementarity problem coupled by M.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from scara_ident.arrays import Array
from scara_ident.simulation.compiled import compiled_within
from scara_ident.simulation.external import push, shaft_friction, shaft_inertia, slid
from scara_ident.simulation.plant import Plant
from scara_ident.simulation.spatial import dynamics


class State(NamedTuple):
    """Positions and velocities of links (q, v) and drives (theta, omega), sliding modes and presliding states.

    A drive slides in the direction of its mode, +1 or -1, and sticks where that is 0. Presliding states are those of the
    drives and then of the shafts.
    """

    q: Array
    v: Array
    theta: Array
    omega: Array
    mode: Array
    dahl: Array


class Room(NamedTuple):
    """Arrays that the loop works in, allocated once."""

    mass: Array
    bias: Array
    e: Array
    p: Array
    state: Array
    composite: Array
    matrix: Array
    right: Array
    smooth: Array
    dry: Array
    direction: Array
    load: Array
    spring: Array
    sign: Array
    force: Array
    bodies: Array


def make_room(n: int) -> Room:
    """Allocate the arrays for n joints."""
    v = [np.zeros(n) for _ in range(8)]
    return Room(
        np.zeros((n, n)), v[0], np.empty((n, 9)), np.empty((n, 3)), np.empty((n, 15)), np.empty((n, 10)),
        np.zeros((n, n)), v[1], v[2], v[3], v[4], v[5], v[6], v[7], np.zeros((n, 3)), np.zeros((n, 10)),
    )  # fmt: skip


@compiled_within
def _solve(matrix: Array, x: Array) -> None:
    """Solve in place by elimination with pivoting; n is the number of joints."""
    n = x.shape[0]
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(matrix[i, k]) > abs(matrix[best, k]):
                best = i
        if best != k:
            for j in range(k, n):
                matrix[k, j], matrix[best, j] = matrix[best, j], matrix[k, j]
            x[k], x[best] = x[best], x[k]
        pivot = 1.0 / matrix[k, k]
        for i in range(k + 1, n):
            factor = matrix[i, k] * pivot
            if factor != 0.0:
                for j in range(k + 1, n):
                    matrix[i, j] -= factor * matrix[k, j]
                x[i] -= factor * x[k]
    for k in range(n - 1, -1, -1):
        total = x[k]
        for j in range(k + 1, n):
            total -= matrix[k, j] * x[j]
        x[k] = total / matrix[k, k]


@compiled_within
def _spring_torque(plant: Plant, j: int, stretch: float, rate: float) -> float:
    """Torque of an elastic joint; inside the clearance none, and a contact cannot pull."""
    half = 0.5 * plant.width[j]
    damper = plant.damping[j] * rate
    torque = 0.0
    if half == 0.0:
        torque = plant.stiffness[j] * stretch + damper
    elif stretch > half:
        torque = max(0.0, plant.stiffness[j] * (stretch - half) + damper)
    elif stretch < -half:
        torque = min(0.0, plant.stiffness[j] * (stretch + half) + damper)
    return torque


@compiled_within
def _friction(plant: Plant, room: Room, t: float, x: State, start: Array) -> None:
    """Fill the torques that do not depend on acceleration: ``smooth``, ``dry`` and ``direction``."""
    theta, omega, mode, dahl = x.theta, x.omega, x.mode, x.dahl
    n = theta.shape[0]
    for j in range(n):
        w = omega[j]
        speed = abs(w)
        side = mode[j] if plant.direction_matters[j] else np.sign(w)
        if plant.presliding[j] > 0.0:
            # The exact solution of Dahl's equation over the way gone since the step began.
            room.direction[j] = slid(dahl[j], theta[j] - start[j], plant.presliding[j])
        elif plant.smooth_velocity[j] > 0.0:
            room.direction[j] = np.tanh(w / plant.smooth_velocity[j])
        else:
            room.direction[j] = side
        f = plant.friction[j]
        warm = 1.0
        if plant.warm_share[j] != 0.0:
            warm = 1.0 + plant.warm_share[j] * np.exp(-t / plant.warm_time[j])
        dry = f[0] * warm
        if plant.position_share[j] != 0.0:
            dry *= 1.0 + plant.position_share[j] * np.sin(plant.position_order[j] * theta[j] + plant.position_phase[j])
        if plant.stribeck_amplitude[j] != 0.0:
            ratio = w / plant.stribeck_velocity[j]
            dry += plant.stribeck_amplitude[j] * np.exp(-ratio * ratio)
        if plant.signed_sine[j] != 0.0:
            dry += plant.signed_sine[j] * np.sin(3.0 * theta[plant.signed_sine_of[j]])
        room.dry[j] = dry
        smooth = warm * (f[1] * w + f[2] * w * speed + f[3] * w * w * w) + plant.constant[j]
        smooth += plant.asymmetry[j] * speed
        if plant.swinging_viscous[j] != 0.0:
            smooth += plant.swinging_viscous[j] * w * np.cos(2.0 * theta[plant.swinging_viscous_of[j]])
        room.smooth[j] = smooth
    if plant.coupled:
        for j in range(n):
            for k in range(n):
                w = omega[k]
                side = mode[k] if plant.direction_matters[k] else np.sign(w)
                room.smooth[j] += plant.coupling_viscous[j, k] * w + plant.coupling_coulomb[j, k] * side
    shaft_friction(plant, theta, omega, start, dahl[n:], room.smooth)
    for i in range(plant.ripple_joint.shape[0]):
        j = plant.ripple_joint[i]
        angle = plant.ripple_order[i] * theta[j] + plant.ripple_phase[i]
        room.smooth[j] += plant.ripple_amplitude[i] * np.sin(angle)
    for i in range(plant.vibration_joint.shape[0]):
        angle = 2.0 * np.pi * plant.vibration_frequency[i] * t + plant.vibration_phase[i]
        room.smooth[plant.vibration_joint[i]] += plant.vibration_amplitude[i] * np.sin(angle)


@compiled_within
def _loss(plant: Plant, j: int, load: float, direction: float) -> float:
    """Drive torque per load: 1/eta where the motor drives, eta where it is driven, in between while presliding."""
    eta: float = plant.efficiency[j]
    share = 1.0 / eta - 1.0 if load * direction > 0.0 else eta - 1.0
    return 1.0 + share * abs(direction)


@compiled_within
def accelerate(
    plant: Plant, room: Room, t: float, x: State, start: Array, drive: Array, a: Array, alpha: Array
) -> None:
    """Fill the accelerations of links ``a`` and drives ``alpha``, and ``room.load``, at fixed modes.

    Parameters
    ----------
    x : State
        Its presliding states are those at the start of the step.
    start : ndarray, shape (n,)
        Drive position at the start of the step.
    drive : ndarray, shape (n,)
        Torque of the drive, N m at the joint.
    """
    q, v, theta, omega, mode = x.q, x.v, x.theta, x.omega, x.mode
    n = q.shape[0]
    dynamics(
        plant.parent, plant.prismatic, plant.rotation, plant.offset, room.bodies, plant.gravity,
        q, v, room.mass, room.bias, room.e, room.p, room.state, room.composite,
    )  # fmt: skip
    shaft_inertia(plant, room.mass)
    push(plant, t, room.e, room.p, room.force, room.bias)
    _friction(plant, room, t, x, start)
    lossy = False
    for j in range(n):
        room.bias[j] += plant.spring[j] * (q[j] - plant.spring_rest[j])
        if plant.elastic[j]:
            room.spring[j] = _spring_torque(plant, j, theta[j] - q[j], omega[j] - v[j])
        elif plant.efficiency[j] < 1.0:
            lossy = True
            room.sign[j] = 1.0 if room.load[j] >= 0.0 else -1.0
    for _ in range(2 * n + 2):
        for j in range(n):
            stuck = plant.direction_matters[j] and mode[j] == 0.0
            if plant.elastic[j]:
                for k in range(n):
                    room.matrix[j, k] = room.mass[j, k]
                a[j] = room.spring[j] - room.bias[j]
            elif stuck:
                for k in range(n):
                    room.matrix[j, k] = 0.0
                room.matrix[j, j] = 1.0
                a[j] = 0.0
            else:
                m = _loss(plant, j, room.sign[j], room.direction[j])
                for k in range(n):
                    room.matrix[j, k] = m * room.mass[j, k]
                room.matrix[j, j] += plant.armature[j]
                a[j] = drive[j] - room.smooth[j] - room.dry[j] * room.direction[j] - m * room.bias[j]
        for j in range(n):
            # A held joint's acceleration is zero; without its column it comes out as exactly that.
            if plant.direction_matters[j] and mode[j] == 0.0 and not plant.elastic[j]:
                for k in range(n):
                    if k != j:
                        room.matrix[k, j] = 0.0
        _solve(room.matrix, a)
        agreed = True
        for j in range(n):
            if plant.elastic[j]:
                room.load[j] = room.spring[j]
                continue
            load = room.bias[j]
            for k in range(n):
                load += room.mass[j, k] * a[k]
            room.load[j] = load
            if lossy and plant.efficiency[j] < 1.0 and load * room.sign[j] < 0.0:
                room.sign[j] = -room.sign[j]
                agreed = False
        if agreed:
            break
    for j in range(n):
        if not plant.elastic[j]:
            alpha[j] = a[j]
        elif plant.direction_matters[j] and mode[j] == 0.0:
            alpha[j] = 0.0
        else:
            m = _loss(plant, j, room.load[j], room.direction[j])
            rest = drive[j] - room.smooth[j] - room.dry[j] * room.direction[j] - m * room.load[j]
            alpha[j] = rest / plant.armature[j]


@compiled_within
def settle(plant: Plant, room: Room, t: float, x: State, drive: Array, a: Array, alpha: Array) -> None:
    """Find which joints stick, and the accelerations; ``x.mode`` is updated.

    A standing joint is first held. If the friction that this takes exceeds its bound the joint is let go in that
    direction; if it then moves the other way it is held again. The lowest such joint changes at a time, the rule
    that ends for the complementarity problem of a mass matrix (Murty's least-index rule).
    """
    omega, mode = x.omega, x.mode
    n = omega.shape[0]
    for j in range(n):
        if plant.direction_matters[j]:
            if omega[j] > 0.0:
                mode[j] = 1.0
            elif omega[j] < 0.0:
                mode[j] = -1.0
            else:
                mode[j] = 0.0
    for _ in range(16 * n):
        accelerate(plant, room, t, x, x.theta, drive, a, alpha)
        changed = False
        for j in range(n):
            if not plant.direction_matters[j] or omega[j] != 0.0:
                continue
            if mode[j] == 0.0:
                load = room.load[j]
                eta = plant.efficiency[j]
                held = drive[j] - room.smooth[j] - load
                gain, drop = abs(load) * (1.0 / eta - 1.0), abs(load) * (1.0 - eta)
                dry = max(room.dry[j], 0.0)
                if held > dry + (gain if load > 0.0 else drop):
                    mode[j] = 1.0
                    changed = True
                elif held < -dry - (drop if load > 0.0 else gain):
                    mode[j] = -1.0
                    changed = True
            elif alpha[j] * mode[j] < 0.0:
                mode[j] = 0.0
                changed = True
            if changed:
                break
        if not changed:
            return
