"""The closed loop: sampled PID on the motor encoder around the integrated arm."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from scara_ident.arrays import Array
from scara_ident.simulation.compiled import at_hand, compiled
from scara_ident.simulation.external import SAME_TIME, until_change
from scara_ident.simulation.forces import Room, State, make_room
from scara_ident.simulation.integrate import Stages, first_stage, make_stages, make_state, step
from scara_ident.simulation.plant import Plant, Sensors


class Gains(NamedTuple):
    """A PID of every joint, on the joint side, and the low-pass of its velocity.

    Attributes
    ----------
    proportional, integral, derivative : ndarray, shape (n,)
        N m/rad, N m/(rad s), N m s/rad.
    filter : ndarray, shape (5,)
        Coefficients b0, b1, b2, a1, a2 of the velocity filter.
    """

    proportional: Array
    integral: Array
    derivative: Array
    filter: Array


def no_gains(n: int) -> Gains:
    """Return the gains of no controller, whose velocity is not filtered."""
    none = np.zeros(n)
    return Gains(none, none, none, np.array([1.0, 0.0, 0.0, 0.0, 0.0]))


class Trace(NamedTuple):
    """What happened at every tick, each of shape (N, n), Pinocchio's order, joint side.

    ``measured`` and ``velocity`` are what the controller saw; ``drive`` is the torque held from this tick to the next.
    """

    theta: Array
    omega: Array
    alpha: Array
    q: Array
    v: Array
    a: Array
    drive: Array
    load: Array
    direction: Array
    mode: Array
    measured: Array
    velocity: Array


class Controller(NamedTuple):
    """What the controller holds: its integral, the torque it gives, the last position, and the velocity filter's memory."""

    integral: Array
    drive: Array
    before: Array
    memory: Array


def make_trace(samples: int, n: int) -> Trace:
    """Allocate a trace."""
    return Trace(*(np.empty((samples, n)) for _ in range(12)))


@compiled
def _track(
    plant: Plant,
    sensors: Sensors,
    gains: Gains,
    room: Room,
    x: State,
    s: Stages,
    held: Controller,
    period: float,
    substeps: int,
    reference: Array,
    feed: Array,
    controlled: bool,
    out: Trace,
) -> int:
    samples, n = out.theta.shape
    integral, drive, before, memory = held.integral, held.drive, held.before, held.memory
    h = period / substeps
    events = 0
    b0, b1, b2, a1, a2 = gains.filter
    for k in range(samples):
        t = k * period
        for j in range(n):
            seen = x.theta[j]
            if sensors.eccentricity[j] != 0.0:
                angle = sensors.eccentricity_order[j] * x.theta[j] + sensors.eccentricity_phase[j]
                seen += sensors.eccentricity[j] * np.sin(angle)
            grid = sensors.resolution[j]
            if grid > 0.0:
                seen = grid * np.floor(seen / grid + sensors.shift[j])
            if k == 0:
                # As if it had been moving at this speed before.
                for m in range(4):
                    memory[j, m] = x.omega[j]
                raw = x.omega[j]
            else:
                raw = (seen - before[j]) / period
            before[j] = seen
            smooth = b0 * raw + b1 * memory[j, 0] + b2 * memory[j, 1] - a1 * memory[j, 2] - a2 * memory[j, 3]
            memory[j, 1], memory[j, 0] = memory[j, 0], raw
            memory[j, 3], memory[j, 2] = memory[j, 2], smooth
            out.measured[k, j] = seen
            out.velocity[k, j] = smooth
            if controlled:
                error = reference[0, k, j] - seen
                slope = gains.integral[j] * error * period
                wanted = gains.proportional[j] * error + gains.derivative[j] * (reference[1, k, j] - smooth)
                wanted += integral[j] + feed[k, j]
                limit = sensors.torque_limit[j]
                drive[j] = min(max(wanted, -limit), limit)
                # No winding up: at the limit the integral may only go back.
                if drive[j] == wanted or slope * wanted < 0.0:
                    integral[j] += slope
            else:
                drive[j] = feed[k, j]
        for sub in range(substeps):
            now = t + sub * h
            first_stage(plant, room, x, s, now, drive)
            if sub == 0:
                for j in range(n):
                    out.theta[k, j], out.omega[k, j], out.alpha[k, j] = x.theta[j], x.omega[j], s.alpha[0, j]
                    out.q[k, j], out.v[k, j], out.a[k, j] = x.q[j], x.v[j], s.a[0, j]
                    out.drive[k, j], out.load[k, j] = drive[j], room.load[j]
                    out.direction[k, j] = room.direction[j]
                    out.mode[k, j] = x.mode[j]
                if k == samples - 1:
                    break
            left = h
            while True:
                part = until_change(plant, now, left)
                events += step(plant, room, x, s, now, part, drive)
                left -= part
                if left <= SAME_TIME * h:
                    break
                now += part
                first_stage(plant, room, x, s, now, drive)
        for j in range(n):
            if not np.isfinite(x.theta[j]):
                return k
    return -1 - events


def track(
    plant: Plant,
    sensors: Sensors,
    gains: Gains,
    *,
    period: float,
    substeps: int,
    reference: Array,
    feed: Array,
    start: Array,
    initial: tuple[Array, Array, Array, Array],
    controlled: bool = True,
) -> tuple[Trace, int]:
    """Run the loop along a reference.

    Parameters
    ----------
    plant, sensors, gains
        The arm, in Pinocchio's order and on the joint side.
    period : float
        Of the controller, s.
    substeps : int
        Integration steps per period.
    reference : ndarray, shape (2, N, n)
        Positions and velocities wanted.
    feed : ndarray, shape (N, n)
        Torque added to the controller's, or the whole torque where ``controlled`` is false.
    start : ndarray, shape (n,)
        Torque that the integral holds at first.
    initial : tuple of ndarray, shape (n,)
        Link positions and velocities, drive positions and velocities.
    controlled : bool
        Whether the PID acts.

    Returns
    -------
    events : int
        How often a joint stopped; negative is -1 - the sample at which the motion became infinite.
    """
    samples, n = feed.shape
    x = make_state(n, len(plant.shaft_joint))
    for target, value in zip(x[:4], initial, strict=True):
        target[:] = value
    # As if it had been moving so before: friction that builds up over a distance is there.
    x.dahl[:n] = np.sign(x.omega)
    out = make_trace(samples, n)
    held = Controller(start.copy(), np.zeros(n), np.zeros(n), np.zeros((n, 4)))
    status = _track(
        plant, sensors, gains, make_room(n), x, make_stages(x), held, period, substeps, np.ascontiguousarray(reference),
        np.ascontiguousarray(feed), controlled, out,
    )  # fmt: skip
    return out, -1 - status


def at_once() -> bool:
    """Return whether `track` runs at once, without being compiled first."""
    return at_hand(_track)


def velocity_filter(rate: float, cutoff: float, damping: float = 1.0) -> Array:
    """Return the bilinear second-order low-pass b0, b1, b2, a1, a2 of a sampled velocity.

    Parameters
    ----------
    rate : float
        Samples per second.
    cutoff : float
        Natural frequency, Hz; the bilinear transform is pre-warped to it.
    damping : float
        Damping factor, 1 in Indri et al. 2002.
    """
    c = 1.0 / np.tan(np.pi * cutoff / rate)
    a0 = c * c + 2.0 * damping * c + 1.0
    b = [1.0, 2.0, 1.0]
    a = [2.0 - 2.0 * c * c, c * c - 2.0 * damping * c + 1.0]
    return np.array(b + a) / float(a0)
