"""One step of the virtual arm: Runge-Kutta between events, and the events of joints that stop, stick and slip."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from scara_ident.arrays import Array
from scara_ident.simulation.compiled import compiled_in_place, compiled_within
from scara_ident.simulation.external import SHAFT_WAY, carry, slid
from scara_ident.simulation.forces import Room, State, accelerate, settle
from scara_ident.simulation.plant import Plant

# Within one step every joint may stop and start again a few times; more would be an error of the model.
EVENTS_PER_JOINT = 4


class Stages(NamedTuple):
    """Room for the stages of the Runge-Kutta step, each of shape (4, n), and the states that it passes and reaches."""

    v: Array
    a: Array
    omega: Array
    alpha: Array
    trial: State
    new: State


def make_state(n: int, shafts: int = 0) -> State:
    """Allocate a state at rest."""
    q, v, theta, omega, mode = np.zeros((5, n))
    return State(q, v, theta, omega, mode, np.zeros(n + shafts))


def make_stages(x: State) -> Stages:
    """Allocate the stages of steps from a state; modes and presliding states, which a step keeps, are its own."""
    n = len(x.q)
    trial, new = (State(q, v, theta, omega, x.mode, x.dahl) for q, v, theta, omega in np.zeros((2, 4, n)))
    v, a, omega, alpha = np.zeros((4, 4, n))
    return Stages(v, a, omega, alpha, trial, new)


@compiled_in_place
def _runge_kutta(plant: Plant, room: Room, x: State, s: Stages, t: float, h: float, drive: Array) -> None:
    """Fill ``s.new`` by one step of the classical method; stage 0 is there already."""
    n = x.q.shape[0]
    for stage in range(1, 4):
        part = h if stage == 3 else 0.5 * h
        for j in range(n):
            s.trial.theta[j] = x.theta[j] + part * s.omega[stage - 1, j]
            s.trial.omega[j] = x.omega[j] + part * s.alpha[stage - 1, j]
            if plant.elastic[j]:
                s.trial.q[j] = x.q[j] + part * s.v[stage - 1, j]
                s.trial.v[j] = x.v[j] + part * s.a[stage - 1, j]
            else:
                s.trial.q[j] = s.trial.theta[j]
                s.trial.v[j] = s.trial.omega[j]
        accelerate(plant, room, t + part, s.trial, x.theta, drive, s.a[stage], s.alpha[stage])
        for j in range(n):
            s.v[stage, j] = s.trial.v[j]
            s.omega[stage, j] = s.trial.omega[j]
    w = h / 6.0
    for j in range(n):
        s.new.theta[j] = x.theta[j] + w * (s.omega[0, j] + 2.0 * (s.omega[1, j] + s.omega[2, j]) + s.omega[3, j])
        s.new.omega[j] = x.omega[j] + w * (s.alpha[0, j] + 2.0 * (s.alpha[1, j] + s.alpha[2, j]) + s.alpha[3, j])
        if plant.elastic[j]:
            s.new.q[j] = x.q[j] + w * (s.v[0, j] + 2.0 * (s.v[1, j] + s.v[2, j]) + s.v[3, j])
            s.new.v[j] = x.v[j] + w * (s.a[0, j] + 2.0 * (s.a[1, j] + s.a[2, j]) + s.a[3, j])
        else:
            s.new.q[j] = s.new.theta[j]
            s.new.v[j] = s.new.omega[j]


@compiled_in_place
def first_stage(plant: Plant, room: Room, x: State, s: Stages, t: float, drive: Array) -> None:
    """Fill stage 0 at the state itself, after deciding what is carried and which standing joints stick."""
    n = x.q.shape[0]
    carry(plant, t, room.bodies)
    standing = False
    for j in range(n):
        if plant.direction_matters[j]:
            if x.omega[j] == 0.0:
                standing = True
            else:
                x.mode[j] = 1.0 if x.omega[j] > 0.0 else -1.0
        s.v[0, j] = x.v[j]
        s.omega[0, j] = x.omega[j]
    if standing:
        settle(plant, room, t, x, drive, s.a[0], s.alpha[0])
    else:
        accelerate(plant, room, t, x, x.theta, drive, s.a[0], s.alpha[0])


@compiled_in_place
def _first_to_stop(plant: Plant, x: State, s: Stages) -> int:
    """Return the joint whose velocity left its direction earliest in the step, by linear interpolation; -1: none."""
    first, earliest = -1, 2.0
    for j in range(x.q.shape[0]):
        if plant.direction_matters[j] and x.mode[j] != 0.0 and s.new.omega[j] * x.mode[j] < 0.0:
            part = x.omega[j] / (x.omega[j] - s.new.omega[j])
            if part < earliest:
                first, earliest = j, part
    return first


@compiled_within
def _instant_of_stop(
    plant: Plant, room: Room, x: State, s: Stages, t: float, left: float, drive: Array, stopping: int
) -> tuple[int, float]:
    """Return the first joint to stop and the length of the step that takes it there; ``s.new`` is then its end."""
    taken = left
    low, low_value = 0.0, x.omega[stopping]
    high, high_value = left, s.new.omega[stopping]
    for _ in range(20):
        taken = low - low_value * (high - low) / (high_value - low_value)
        _runge_kutta(plant, room, x, s, t, taken, drive)
        other = _first_to_stop(plant, x, s)
        if other >= 0 and other != stopping and x.omega[other] != 0.0:
            # Another joint has stopped even before.
            stopping = other
            low, low_value = 0.0, x.omega[stopping]
            high, high_value = taken, s.new.omega[stopping]
            continue
        value = s.new.omega[stopping]
        if abs(value) <= 1e-13 + 1e-12 * abs(x.omega[stopping]):
            break
        # False position, with the end that stays halved so that it too moves (the Illinois rule).
        if value * low_value > 0.0:
            low, low_value = taken, value
            high_value *= 0.5
        else:
            high, high_value = taken, value
            low_value *= 0.5
    return stopping, taken


@compiled_in_place
def step(plant: Plant, room: Room, x: State, s: Stages, t: float, h: float, drive: Array) -> int:
    """Advance the state by ``h``; stage 0 must be there. Returns the number of events.

    A joint that would change direction within the step is brought to the instant at which it stops (false position
    on the length of the step), its velocity is set to exactly zero, and the rest of the step starts from there.
    """
    n = x.q.shape[0]
    left = h
    events = 0
    while True:
        _runge_kutta(plant, room, x, s, t, left, drive)
        stopping = _first_to_stop(plant, x, s)
        taken = left
        last = stopping < 0 or events >= EVENTS_PER_JOINT * n
        if not last:
            events += 1
            if x.omega[stopping] == 0.0:
                # Let go and turned back within one step: it is held for the rest of it.
                x.mode[stopping] = 0.0
                accelerate(plant, room, t, x, x.theta, drive, s.a[0], s.alpha[0])
                continue
            stopping, taken = _instant_of_stop(plant, room, x, s, t, left, drive, stopping)
        for k in range(plant.shaft_joint.shape[0]):
            i, j = plant.shaft_joint[k], plant.shaft_other[k]
            way = s.new.theta[i] - x.theta[i] + plant.shaft_sign[k] * (s.new.theta[j] - x.theta[j])
            x.dahl[n + k] = slid(x.dahl[n + k], way, SHAFT_WAY)
        for j in range(n):
            if plant.presliding[j] > 0.0:
                x.dahl[j] = slid(x.dahl[j], s.new.theta[j] - x.theta[j], plant.presliding[j])
            turned = plant.direction_matters[j] and s.new.omega[j] * x.mode[j] < 0.0
            x.q[j], x.v[j], x.theta[j], x.omega[j] = s.new.q[j], s.new.v[j], s.new.theta[j], s.new.omega[j]
            if j == stopping or turned:
                x.omega[j] = 0.0
                if not plant.elastic[j]:
                    x.v[j] = 0.0
        if last:
            return events
        t += taken
        left -= taken
        if left <= 1e-9 * h:
            return events
        first_stage(plant, room, x, s, t, drive)
