"""An observer of contact with the arm: sample by sample, or over recordings, beside thresholds from motion without."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from scara_ident.arrays import Array
from scara_ident.errors import RecordingError, ScaraIdentError, UsageError
from scara_ident.export.identified_model import IdentifiedModel
from scara_ident.recording.audit.samples import GAP_STEPS
from scara_ident.recording.recording import Recording
from scara_ident.robot.kinematics import felt_directions
from scara_ident.use.alarm import Alarm, calibrate
from scara_ident.use.external_torque import (
    BANDWIDTH,
    SETTLES,
    ExternalTorque,
    Observed,
    ObserverSettings,
    observe_recording,
)
from scara_ident.use.residual_scatter import ResidualScatter, residual_scatter

# Share of the samples whose speed is below the usual largest.
USUAL = 0.99
# A step that is a gap is at least this share of the observer's time constant: shorter ones it bridges.
GAP_SHARE = 0.25


class Reading(NamedTuple):
    """What an observer says of one sample; arrays of shape (n,), recorded side.

    Attributes
    ----------
    contact : bool
        Whether any joint is beyond its threshold; False until the observer has forgotten how it began, 0.4 s at 4 Hz.
    torque, threshold : ndarray
        External torque, and what it must exceed in size.
    """

    contact: bool
    torque: Array
    threshold: Array


class ContactObserver:
    """Says of every sample whether something touches the arm.

    Parameters
    ----------
    known : IdentifiedModel
    settings : ObserverSettings
    alarm : Alarm
    scatter : ResidualScatter
    velocity : bool
        Whether it was calibrated with recorded velocities, which `update` is then given.

    Examples
    --------
    ::

        observer = contact_observer(identified_model(identify(robot, recordings)), free, rate=1.0)
        reading = observer.update(q, v, effort)  # every millisecond
    """

    def __init__(
        self,
        known: IdentifiedModel,
        settings: ObserverSettings,
        alarm: Alarm,
        scatter: ResidualScatter,
        *,
        velocity: bool,
    ) -> None:
        self.known, self.settings, self.velocity = known, settings, velocity
        self.alarm, self.scatter = alarm, scatter
        self.external = ExternalTorque(known, settings)
        # Time constants: how long the observer remembers, and follows its slowest low-pass.
        self._constant = 1.0 / (2.0 * np.pi * settings.bandwidth)
        self._wait = SETTLES / (2.0 * np.pi * min(settings.bandwidth, settings.differentiator))
        self.reset()

    @cached_property
    def felt(self) -> int:
        """Directions of a force on the tool that the arm feels somewhere."""
        robot = self.known.robot
        anywhere = np.random.default_rng(0).uniform(-np.pi, np.pi, (8, robot.n))
        return felt_directions(robot, map(self.external.arm.configuration, anywhere))

    def reset(self) -> None:
        """Forget all before."""
        self.external.reset()
        self._since, self._lost, self._step = 0.0, 0.0, np.inf

    def update(self, q: Array, v: Array | None, effort: Array, step: float = 1e-3) -> Reading:
        """Take one sample.

        One with a value that is not finite is lost: the reading is that before, and the step counts to the next. After a gap, of
        `GAP_STEPS` times the step before and `GAP_SHARE` of the observer's time constant or more, all before is forgotten.

        Parameters
        ----------
        q : ndarray, shape (n,)
            Positions in the robot's order, rad or m.
        v : ndarray, shape (n,), or None
            Velocities, if it was calibrated with them; else None.
        effort : ndarray, shape (n,)
            Times ``effort_gain``: N m or N on the recorded side.
        step : float
            s since the sample before.

        Raises
        ------
        UsageError
            If an array has another shape, velocities are missing, or the step is not above 0.
        """
        if self.velocity and v is None:
            raise UsageError("v is None, but the thresholds come from recorded velocities; give velocities to update")
        if not 0.0 < step < np.inf:
            raise UsageError(f"step is {step:g} s; expected the time since the sample before, above 0")
        q, effort = self._one("q", q), self._one("effort", effort)
        v = self._one("v", v) if self.velocity and v is not None else None
        if math.isfinite(sum([*q.tolist(), *effort.tolist(), *(() if v is None else v.tolist())])):
            step += self._lost
            if step > max(GAP_STEPS * self._step, GAP_SHARE * self._constant):
                self.reset()
            self.external.update(q, v, effort, step)
            self._since += step if math.isfinite(self._step) else 0.0
            self._lost, self._step = 0.0, step
        else:
            self._lost += step
        torque, threshold = self.external.torque, self.alarm.threshold(self.external.features)
        touched = self._since > self._wait and bool((np.abs(torque) > threshold).any())
        return Reading(touched, torque, threshold)

    def _one(self, name: str, value: Array) -> Array:
        """Return one number for each joint, or say that they are not."""
        value, robot = np.asarray(value, dtype=float), self.known.robot
        if value.shape != (robot.n,):
            raise UsageError(f"{name} has the shape {value.shape}; expected ({robot.n},), one number for each joint of {robot.name}")  # fmt: skip
        return value

    def observe(self, recording: Recording) -> Observed:
        """Run over a recording, from its beginning, and forget it."""
        observed = _observed(self.external, recording, velocity=self.velocity)
        self.reset()
        return observed


def contact_observer(
    known: IdentifiedModel, free: Sequence[Recording], *, rate: float = 1.0, bandwidth: float = BANDWIDTH
) -> ContactObserver:
    """Make an observer with thresholds from recordings without contact.

    Recorded velocities are used where all of them have them; else positions and efforts pass one low-pass.

    Parameters
    ----------
    known : IdentifiedModel
    free : sequence of Recording
        Motion like that to be watched, without contact; best not what the model was identified from.
    rate : float
        False alarms per hour of such motion.
    bandwidth : float
        Hz: wider sees a contact sooner, and more noise.

    Raises
    ------
    ScaraIdentError
        If there are no such recordings, or they are too short or lack efforts.
    """
    if not free:
        raise ScaraIdentError("no recordings without contact, which the thresholds need; give some")
    if not (rate > 0.0 and bandwidth > 0.0):
        raise ScaraIdentError(f"rate {rate:g} and bandwidth {bandwidth:g}: give numbers above 0")
    velocity = all(item.velocity is not None for item in free)
    settings = ObserverSettings(_usual_speed(free), bandwidth)
    external = ExternalTorque(known, settings)
    runs = [_observed(external, item, velocity=velocity) for item in free]
    return calibrated(known, settings, runs, rate=rate, velocity=velocity)


def calibrated(
    known: IdentifiedModel, settings: ObserverSettings, runs: Sequence[Observed], *, rate: float, velocity: bool
) -> ContactObserver:
    """Return an observer with thresholds from runs without contact, see `contact_observer`."""
    return ContactObserver(known, settings, calibrate(runs, rate), residual_scatter(runs), velocity=velocity)


def _usual_speed(free: Sequence[Recording]) -> Array:
    """Return the speed that each joint rarely exceeds, shape (n,), from steps long against the encoder's."""
    found = []
    for item in free:
        every = max(1, round(0.02 * item.rate))
        found.append(np.abs(np.diff(item.position[:, ::every], axis=1)) / np.diff(item.time[::every]))
    speed = np.quantile(np.concatenate(found, axis=1), USUAL, axis=1)
    return np.asarray(np.maximum(speed, 1e-6))


def _observed(external: ExternalTorque, item: Recording, *, velocity: bool) -> Observed:
    if item.effort is None:
        raise RecordingError(f"{item.path or item.name}: no effort was recorded; contact cannot be detected without")
    if velocity and item.velocity is None:
        raise RecordingError(
            f"{item.path or item.name}: no velocity was recorded, but the recordings without contact have it; record it here too"
        )
    v = item.velocity if velocity else None
    return observe_recording(external, item.name, item.time, item.position, v, item.effort)
