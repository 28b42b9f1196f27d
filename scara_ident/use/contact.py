"""Contact with the arm in recordings: when, on which joints, and the force at the tool."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from scara_ident.arrays import Array
from scara_ident.estimation.tail import clusters
from scara_ident.recording.recording import Recording
from scara_ident.robot.kinematics import place_of
from scara_ident.robot.robot import Robot
from scara_ident.use.contact_force import MIN_JOINTS, ContactForce, contact_force
from scara_ident.use.contact_samples import PEAK_SHARE
from scara_ident.use.external_torque import FEATURES, Observed
from scara_ident.use.observer import ContactObserver

# A joint that moves is named with a contact if its mean reaches this share of its threshold while the contact is strong. One
# that stands still has to reach all of it: friction holds it at any torque up to there.
NAMED = 0.5
_AT_REST = FEATURES.index("at rest")


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
        ``tool``, or the outermost link that it may act on, by the joints that it loads.
    estimate : ContactForce
        What its torque says of the force.
    """

    recording: str
    start: float
    stop: float
    joints: tuple[str, ...]
    score: float
    torque: Array
    place: str
    estimate: ContactForce

    @property
    def force(self) -> Array | None:
        """Constant force on the place that explains it, base frame, N, shape (3,); None where it is not determined."""
        return self.estimate.force

    @property
    def force_covariance(self) -> Array | None:
        """Of that force, by the residual without contact, shape (3, 3); NaN along axes that the arm does not tell."""
        return self.estimate.covariance

    @property
    def explained(self) -> float:
        """Share of the squared torque that a constant force on the tool explains."""
        return self.estimate.explained

    @property
    def force_words(self) -> str:
        """Size of the force with its standard deviation, N; a dash where there is none."""
        if self.force is None or self.force_covariance is None:
            return "-"
        size = float(np.linalg.norm(self.force))
        along = self.force / size
        # Along an axis that is not determined the force is zero.
        std = float(np.sqrt(along @ np.nan_to_num(self.force_covariance) @ along))
        return f"{size:.3g} ± {float(f'{std:.1g}'):g} N"

    @property
    def point_words(self) -> str:
        """Where on its link the force acts beside the tool, m; a dash where that is not determined."""
        point, std = self.estimate.point, self.estimate.point_std
        if point is None or std is None:
            return "-"
        return ", ".join(f"{x:.3f} ± {unsure:.1g}" for x, unsure in zip(point, std, strict=True))

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
            "force_std": None if self.force_covariance is None else np.sqrt(np.diag(self.force_covariance)).tolist(),
            "point": None if self.estimate.point is None else self.estimate.point.tolist(),
            "point_std": None if self.estimate.point_std is None else self.estimate.point_std.tolist(),
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
    strong = inside[size >= PEAK_SHARE * float(np.max(size))]
    # Means, so that no peak of the noise names a joint.
    mean = np.mean(observed.torque[:, strong], axis=1)
    still = np.mean(observed.features[:, _AT_REST, strong], axis=1)
    most = np.abs(mean) / ((NAMED + (1.0 - NAMED) * still) * np.mean(threshold[:, strong], axis=1))
    named = [int(j) for j in np.argsort(-most) if most[j] >= min(1.0, float(np.max(most)))]
    estimate = contact_force(observer, observed, threshold, inside, strong)
    if estimate.at_tool and len(named) < min(MIN_JOINTS, robot.n):
        estimate = ContactForce(estimate.explained, False)
    at_last = estimate.force is not None and not estimate.at_tool
    outermost = place_of(robot, robot.model.njoints - 1) if at_last else _outermost(robot, named)
    return Contact(
        observed.name,
        float(observed.time[span.start]),
        float(observed.time[span.stop - 1]),
        tuple(robot.joints[j] for j in named),
        float(np.max(size)),
        mean,
        "tool" if estimate.at_tool else robot.links[outermost],
        estimate,
    )


def _outermost(robot: Robot, joints: Sequence[int]) -> int:
    """Return the joint farthest from the base, among those loaded."""
    return max(joints, key=lambda joint: int(robot.order[joint]))


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
        f"of motion; {alarm.rate * found.hours:.2g} false alarms are expected, at {alarm.rate:g} per hour."
    ]
    said.append(
        f"The thresholds come from {3600.0 * alarm.hours:.4g} s without contact, with {alarm.clusters} peaks of the residual."
    )
    if alarm.rate * alarm.hours < 1.0:
        said.append(
            f"That is less than the {1.0 / alarm.rate:.3g} h in which one false alarm is expected: the rate is "
            f"extrapolated and therefore less certain; record more motion without contact."
        )
    without = [each for each in found.contacts if each.force is None]
    if any(not each.estimate.at_tool for each in without):
        said.append("Where no force is given, the contact is on the named link or farther out.")
    if any(each.estimate.at_tool for each in without):
        said.append("Near a singular pose the force on the tool is not determined.")
    if found.observer.external.left_out:
        said.append(
            f"Left out, because they need more than position and velocity: {', '.join(found.observer.external.left_out)}."
        )
    return said
