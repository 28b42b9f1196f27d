"""Contact with the arm: in recordings, and while it moves."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from scara_ident.arrays import Array
from scara_ident.errors import RecordingError, ScaraIdentError, UsageError
from scara_ident.estimation.tail import clusters
from scara_ident.export.identified_model import IdentifiedModel
from scara_ident.recording.audit.samples import GAP_STEPS
from scara_ident.recording.recording import Recording
from scara_ident.robot.kinematics import constant_force, force_torques
from scara_ident.robot.robot import Robot
from scara_ident.use.alarm import Alarm, calibrate
from scara_ident.use.external_torque import (
    BANDWIDTH,
    FEATURES,
    SETTLES,
    ExternalTorque,
    Observed,
    ObserverSettings,
    observe_recording,
)

# Share of the samples whose speed is below the usual largest.
USUAL = 0.99
# A joint is named with a contact if its mean reaches this share of its threshold while the contact is strong.
NAMED = 0.5
# A constant force at the tool explains at least this share of the squared torque of a contact there, on at least so many
# joints: on fewer nearly any torque is that of some force.
FITS, LEAST_JOINTS = 0.75, 3
# A step that is a gap is at least this share of the observer's time constant: shorter ones it bridges.
GAP_SHARE = 0.25
# States at which the tool's Jacobian is taken, and the share of a contact's peak from which on they are.
STATES, STRONG = 40, 0.5


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
    velocity : bool
        Whether it was calibrated with recorded velocities, which `update` is then given.

    Examples
    --------
    ::

        observer = contact_observer(identified_model(identify(robot, recordings)), free, rate=1.0)
        reading = observer.update(q, v, effort)  # every millisecond
    """

    def __init__(self, known: IdentifiedModel, settings: ObserverSettings, alarm: Alarm, *, velocity: bool) -> None:
        self.known, self.settings, self.alarm, self.velocity = known, settings, alarm, velocity
        self.external = ExternalTorque(known, settings)
        # Time constants: how long the observer remembers, and follows its slowest low-pass.
        self._constant = 1.0 / (2.0 * np.pi * settings.bandwidth)
        self._wait = SETTLES / (2.0 * np.pi * min(settings.bandwidth, settings.differentiator))
        self.reset()

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
            raise UsageError("v is None; thresholds were taken with recorded velocities: give them to update")
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
        raise ScaraIdentError("no recordings without contact to take thresholds from; give some")
    if not (rate > 0.0 and bandwidth > 0.0):
        raise ScaraIdentError(f"rate {rate:g} and bandwidth {bandwidth:g}: give numbers above 0")
    velocity = all(item.velocity is not None for item in free)
    settings = ObserverSettings(_usual_speed(free), bandwidth)
    external = ExternalTorque(known, settings)
    runs = [_observed(external, item, velocity=velocity) for item in free]
    return ContactObserver(known, settings, calibrate(runs, rate), velocity=velocity)


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
        raise RecordingError(f"{item.path or item.name}: no effort was recorded; contact cannot be told without")
    if velocity and item.velocity is None:
        raise RecordingError(
            f"{item.path or item.name}: no velocity was recorded, as it was without contact; record it here too"
        )
    v = item.velocity if velocity else None
    return observe_recording(external, item.name, item.time, item.position, v, item.effort)


@dataclass(frozen=True, eq=False)
class Contact:
    """One contact in a recording.

    Attributes
    ----------
    recording : str
    start, stop : float
        From the first to the last sample beyond a threshold, s since the recording began.
    joints : tuple of str
        Where it shows, the clearest first.
    score : float
        Largest torque over its threshold, above 1.
    torque : ndarray, shape (n,)
        Mean external torque while it is strong, recorded side.
    place : str
        ``tool``, or the outermost link that it may act on, as told by the joints that it loads.
    force : ndarray, shape (3,), or None
        Constant force on the tool that explains it, base frame, N; a direction that the arm cannot feel is 0.
    explained : float
        Share of the squared torque that such a force explains.
    """

    recording: str
    start: float
    stop: float
    joints: tuple[str, ...]
    score: float
    torque: Array
    place: str
    force: Array | None
    explained: float

    @property
    def entry(self) -> dict[str, Any]:
        """As in ``contacts.json``; the joints are those of the robot in its order."""
        return {
            "recording": self.recording,
            "from": round(self.start, 4),
            "to": round(self.stop, 4),
            "joints": list(self.joints),
            "score": self.score,
            "external_torque": self.torque.tolist(),
            "place": self.place,
            "force": None if self.force is None else self.force.tolist(),
            "explained": self.explained,
        }


def find_contacts(observer: ContactObserver, observed: Observed) -> tuple[Contact, ...]:
    """Find the contacts in a recording that an observer ran over."""
    threshold = observer.alarm.threshold(observed.features)
    share = np.abs(observed.torque) / threshold
    score = np.where(observed.settled, np.max(share, axis=0), 0.0)
    return tuple(
        _contact(observer, observed, threshold, share, slice(first, last + 1))
        for first, last in clusters(observed.time, score, 1.0)
    )


def _contact(observer: ContactObserver, observed: Observed, threshold: Array, share: Array, span: slice) -> Contact:
    robot = observer.known.robot
    inside = np.arange(span.start, span.stop)
    size = np.max(share[:, span], axis=0)
    strong = inside[size >= STRONG * float(np.max(size))]
    # Means, so that no peak of the noise names a joint.
    mean = np.mean(observed.torque[:, strong], axis=1)
    most = np.abs(mean) / np.mean(threshold[:, strong], axis=1)
    named = [int(j) for j in np.argsort(-most) if most[j] >= min(NAMED, float(np.max(most)))]
    force, explained = tool_force(observer, observed, threshold, strong)
    at_tool = explained >= FITS and len(named) >= min(LEAST_JOINTS, robot.n)
    return Contact(
        observed.name,
        float(observed.time[span.start]),
        float(observed.time[span.stop - 1]),
        tuple(robot.joints[j] for j in named),
        float(np.max(size)),
        mean,
        "tool" if at_tool else robot.links[_outermost(robot, named)],
        force if at_tool else None,
        explained,
    )


def _outermost(robot: Robot, joints: Sequence[int]) -> int:
    """Return the joint farthest from the base, among those loaded."""
    return max(joints, key=lambda joint: int(robot.order[joint]))


def tool_force(observer: ContactObserver, observed: Observed, threshold: Array, places: Array) -> tuple[Array, float]:
    """Return the constant force on the tool, base frame, N, that fits samples best, and the share that it explains.

    A force f on the tool at the end of the Jacobian J is the external torque ``J^T f``. Joints are weighted by their
    thresholds.
    """
    some = places[:: max(1, len(places) // STATES)]
    states = (observer.external.arm.configuration(observed.position[:, k]) for k in some)
    turned = force_torques(observer.known.robot, states)
    rows = [each / threshold[:, k, None] for k, each in zip(some, turned, strict=True)]
    return constant_force(rows, [observed.torque[:, k] / threshold[:, k] for k in some])


@dataclass(frozen=True, eq=False)
class ContactFindings:
    """What an observer found in recordings.

    Attributes
    ----------
    observer : ContactObserver
    observed : tuple of Observed
    contacts : tuple of Contact
    """

    observer: ContactObserver
    observed: tuple[Observed, ...]
    contacts: tuple[Contact, ...]

    @property
    def hours(self) -> float:
        """Length of the recordings."""
        return sum(float(np.ptp(run.time)) for run in self.observed) / 3600.0


def look_for_contact(observer: ContactObserver, recordings: Sequence[Recording]) -> ContactFindings:
    """Look for contact in recordings."""
    runs = tuple(observer.observe(item) for item in recordings)
    return ContactFindings(observer, runs, tuple(each for run in runs for each in find_contacts(observer, run)))


def contacts_dict(found: ContactFindings) -> dict[str, Any]:
    """Return the content of ``contacts.json``."""
    observer = found.observer
    robot, alarm = observer.known.robot, observer.alarm
    return {
        "summary": sentences(found),
        "robot": robot.name,
        "model": observer.known.model.name,
        "joints": list(robot.joints),
        "torque_units": [robot.torque_unit(j) for j in range(robot.n)],
        "contacts": [each.entry for each in found.contacts],
        "hours": found.hours,
        "false_alarms": {
            "per_hour": alarm.rate,
            "expected": alarm.rate * found.hours,
            "hours_without_contact": alarm.hours,
            "clusters": alarm.clusters,
            "tail_shape": alarm.shape,
            "log_rate_std": alarm.spread,
        },
        "observer": {
            "bandwidth_hz": observer.settings.bandwidth,
            "velocity": "recorded" if observer.velocity else "differentiated",
            "usual_speed": observer.settings.speed.tolist(),
            "left_out": list(observer.external.left_out),
            "features": list(FEATURES),
            "thresholds": {
                joint: {"per_feature": row.tolist(), "least": float(floor)}
                for joint, row, floor in zip(robot.joints, alarm.scale, alarm.floor, strict=True)
            },
        },
    }


def sentences(found: ContactFindings) -> list[str]:
    """Say in a few sentences what was found, and how often that is wrong."""
    alarm, count = found.observer.alarm, len(found.contacts)
    said = [
        f"{'No contact' if count == 0 else '1 contact' if count == 1 else f'{count} contacts'} in {3600.0 * found.hours:.4g} s "
        f"of motion; {alarm.rate * found.hours:.2g} false alarms are to be expected, at {alarm.rate:g} an hour."
    ]
    said.append(
        f"Thresholds rest on {3600.0 * alarm.hours:.4g} s without contact, {alarm.clusters} peaks of the residual."
    )
    if alarm.rate * alarm.hours < 1.0:
        said.append(
            f"That is less than the {1.0 / alarm.rate:.3g} h in which one false alarm is stated: the rate is extrapolated, "
            "and the more uncertain; record more motion without contact."
        )
    if found.observer.external.left_out:
        said.append(
            f"Left out, as they take more than position and velocity: {', '.join(found.observer.external.left_out)}."
        )
    return said
