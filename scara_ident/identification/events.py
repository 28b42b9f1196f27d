"""Events, which are local in time and no parameter: found with a robust fit, named, and left out of the fit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from scara_ident.arrays import Array
from scara_ident.estimation.information import MIN_NOISE_SHARE
from scara_ident.estimation.least_squares import weighted_value
from scara_ident.estimation.observations import Observations, observe
from scara_ident.identification.binned_residual import BIN, Binned, binned, bounded_noise
from scara_ident.identification.event_background import without_states, without_trends
from scara_ident.identification.event_search import Segment, standing_out
from scara_ident.identification.usable import check_rows
from scara_ident.model.regressor.kernel import configurations
from scara_ident.motion.prepared import PreparedData, PreparedRecording, PreparedStretch
from scara_ident.motion.trajectories import LARGEST_SHIFT, SAME_RATE, alignment
from scara_ident.robot.kinematics import constant_force, force_torques
from scara_ident.robot.robot import Robot
from scara_ident.threads import one_blas_thread

# Events closer than this count as one; as much is left out on either side, which is the accuracy of the ends, s.
MARGIN = 0.1
# An end that is less accurate than this, s, is reported with its interval.
SAID_UNSURE = 0.3
# Time stamps are known to rounding only, s.
ROUNDING = 1e-6
# A constant force at the tool explains at least this share of the squared residual of a contact there.
FITS = 0.75
# Time on either side of an event in which the torque of its force is computed, s.
NEAR_ENDS = 2.0
# States at which the tool's Jacobian is taken.
STATES = 40
# Two lists hold the same event where their times overlap by this share.
SAME_OVERLAP = 0.5
# Number of events reported in sentences: a long file may have hundreds.
MAX_SENTENCES = 20
# Another joint is named with an event if it exceeds this share of the threshold of an event.
SHARED = 0.45
# If a repetition has this share of the residual at the same place, it comes from the motion.
REPEATED = 0.4


@dataclass(frozen=True)
class Event:
    """A stretch of a recording that is not explained while others are.

    Attributes
    ----------
    start, stop : float
        Seconds since the recording began.
    joints : tuple of str
        Where it shows, the strongest first.
    rms : float
        Of the residual on the first of them, N m or N.
    kind : {"contact", "push", "other payload", "parameters unsure", "runs differ", "unknown"}
        ``contact``: a constant force at the tool explains it; ``push``: it loads the inner joints only, as a force on a
        link before the tool does; ``other payload``: of a whole recording, a body on the last link does; ``parameters unsure``: the
        fitted recordings tell the parameters so badly that they err there by as much; ``runs differ``: those fitted were seen to
        differ from one another as much; ``unknown``: none.
    score : float
        By how much it stands out: from 1 on an event, infinite for a whole recording.
    held_out : bool
        Whether the recording took no part in the fit anyway.
    force : tuple of float or None
        What acts on the tool in a contact, in the base frame, N; a direction that the arm cannot feel is 0.
    begins, ends : tuple of float or None
        Between which times it begins, and ends, with 95 %; None of a whole recording.
    sizes : tuple of float
        Rms of the residual on each of the joints, N m or N; empty where only that of the first is known.
    beyond : tuple of str
        Joints of a whole recording whose error is larger than their torque: no prediction at all would err less.
    """

    recording: str
    start: float
    stop: float
    joints: tuple[str, ...]
    rms: float
    kind: str
    score: float = np.inf
    held_out: bool = False
    force: tuple[float, float, float] | None = None
    begins: tuple[float, float] | None = None
    ends: tuple[float, float] | None = None
    sizes: tuple[float, ...] = ()
    beyond: tuple[str, ...] = ()

    @property
    def sized(self) -> tuple[tuple[str, float], ...]:
        """Joints of known size, the largest first."""
        known = zip(self.joints, self.sizes or (self.rms,), strict=False)
        return tuple(sorted(known, key=lambda item: -item[1]))

    @property
    def entry(self) -> dict[str, Any]:
        """As in the JSON results."""
        found = {
            "recording": self.recording,
            "from": round(self.start, 3),
            "to": round(self.stop, 3),
            "joints": list(self.joints),
            "rms": self.rms,
            "kind": self.kind,
        }
        if self.sizes:
            found["rms_by_joint"] = dict(zip(self.joints, self.sizes, strict=True))
        for name, value in (("from_within", self.begins), ("to_within", self.ends)):
            if value is not None:
                found[name] = [round(time, 3) for time in value]
        return found if self.force is None else {**found, "force": list(self.force)}

    def later(self, by: float) -> Event:
        """Return it so many seconds later."""
        begins, ends = ((span[0] + by, span[1] + by) if span else None for span in (self.begins, self.ends))
        return replace(self, start=self.start + by, stop=self.stop + by, begins=begins, ends=ends)

    def sentence(self, robot: Robot) -> str:
        """Return it in words."""
        force = "" if self.force is None else f", {np.linalg.norm(self.force):.3g} N if it acts at the tool"
        units = robot.torque_units
        where = ", ".join(f"{size:.3g} {units[joint]} on {joint}" for joint, size in self.sized)
        others = self.joints[len(self.sized) :]
        more = f" and {', '.join(others)}" if others else ""
        done = "" if self.held_out else "; left out of the fit"
        if np.isinf(self.score):
            why = "" if self.kind == "unknown" else f" ({self.kind})"
            lost = (
                f"; more than the torque itself on {', '.join(self.beyond)}: the model does not hold there"
                if self.beyond
                else ""
            )
            return (
                f"{self.recording} is explained much worse than the fitted recordings{why}: {where}{more}{lost}{done}"
            )
        unsure = [
            f", {word} between {least:.2f} and {most:.2f} s"
            for word, (least, most) in (("beginning", self.begins or (0.0, 0.0)), ("ending", self.ends or (0.0, 0.0)))
            if most - least > SAID_UNSURE
        ]
        time = f"from {self.start:.2f} to {self.stop:.2f} s{''.join(unsure)}"
        return f"{self.recording}: {self.kind} {time}, {where}{more}{force}{done}"


def event_notes(robot: Robot, events: Sequence[Event]) -> list[str]:
    """Return events in sentences; of very many the clearest ones."""
    least = sorted((event.score for event in events), reverse=True)[:MAX_SENTENCES]
    said = [event for event in events if event.score >= least[-1]][:MAX_SENTENCES] if least else []
    more = [f"{len(events) - len(said)} more events are listed in the result"] if len(events) > len(said) else []
    return [*(event.sentence(robot) for event in said), *more]


@one_blas_thread()
def find_events(observations: Observations, value: Array, fitted: Observations | None = None) -> tuple[Event, ...]:
    """Find events in recordings; parts that were left out are included again.

    Parameters
    ----------
    observations : Observations
        With the columns at every sample.
    value : ndarray, shape (p,)
        Parameters that no event has steered, see `robust_fit`.
    fitted : Observations, optional
        Observations of the fitted recordings, if these are others: the usual residual is taken from them too.
    """
    data, robot = observations.data, observations.model.robot
    parts, left, owner = _residuals(observations, value)
    if fitted is not None:
        more = _residuals(fitted, value)
        parts, left = [*parts, *more[0]], [*left, *more[1]]
        owner += [len(data.recordings) + k for k in more[2]]
    if not parts:
        return ()
    noise = bounded_noise(parts, left, owner)
    stretches = [binned(k, part, row, noise[k]) for k, part, row in zip(owner, parts, left, strict=True)]

    # A repetition is checked too, after the part that depends on the motion is subtracted.
    without_motion = without_states(stretches)
    clean = without_trends(without_motion)

    def earlier() -> list[list[Binned]]:
        if fitted is not None:
            return [stretches, without_motion]
        least = _residuals(observations, weighted_value(observations.by_joint))[1]
        return [
            [binned(k, part, row, noise[k]) for k, part, row in zip(owner, parts, least, strict=True)],
            without_motion,
        ]

    whole = {id(part): row for part, row in zip(parts, left, strict=True)}
    found = [
        _event(robot, data, item, whole[id(item.binned.part)], held_out=fitted is not None)
        for item in standing_out(clean, earlier, lambda *event: _of_tool_force(robot, *event))
        if item.binned.recording < len(data.recordings) and not _repeated(item, clean, data)
    ]
    if found:
        # The residual of an exact fit is rounding, which may look like an event.
        least = MIN_NOISE_SHARE * observations.unfiltered_torque_rms
        found = [event for event in found if event.rms > least[robot.joints.index(event.joints[0])]]
    return tuple(sorted(found, key=lambda event: (data_place(data, event.recording), event.start)))


def _residuals(observations: Observations, value: Array) -> tuple[list[PreparedStretch], list[Array], list[int]]:
    """Return the stretches of two bins at the least, their residual (n, N), not filtered, and the place of their recording."""
    data = observations.data
    places = [k for k, item in enumerate(data.recordings) for _ in item.stretches]
    found = zip(data.stretches, observations.predicted(value), places, strict=True)
    usable = [(part, part.torque - predicted, k) for part, predicted, k in found if _long(part)]
    return [part for part, _, _ in usable], [left for _, left, _ in usable], [k for _, _, k in usable]


def _long(part: PreparedStretch) -> bool:
    return part.usable and part.samples > 2.0 * BIN * part.rate + 1.0


def data_place(data: PreparedData, name: str) -> int:
    """Return the place of a recording by its name."""
    return next(k for k, item in enumerate(data.recordings) if item.name == name)


def without_events(observations: Observations, events: Sequence[Event]) -> Observations:
    """Return observations with only the events left out; the columns at every sample are shared.

    Parameters
    ----------
    events : sequence of Event
        Those of other recordings do not matter.

    Raises
    ------
    RecordingError
        If too little is left.
    """
    data = left_out(observations.data, events)
    if data is observations.data:
        return observations
    found = observe(observations.model, data, known=observations)
    check_rows(found)
    return found


def left_out(data: PreparedData, events: Sequence[Event]) -> PreparedData:
    """Return recordings that count as at rest during events, and at no other time because of an event."""
    recordings = tuple(
        _left_out(item, [event for event in events if event.recording == item.name]) for item in data.recordings
    )
    same = all(a is b for a, b in zip(recordings, data.recordings, strict=True))
    return data if same else replace(data, recordings=recordings)


def _left_out(item: PreparedRecording, events: Sequence[Event]) -> PreparedRecording:
    parts = []
    for part in item.stretches:
        time = part.stretch.time - item.recording.time[0]
        inside = np.zeros(len(time), dtype=bool)
        for event in events:
            inside |= (time >= event.start - MARGIN - ROUNDING) & (time <= event.stop + MARGIN + ROUNDING)
        same = np.array_equal(inside, part.left_out) or not (np.any(inside) or np.any(part.left_out))
        parts.append(part if same else replace(part, left_out=inside if np.any(inside) else False))
    return (
        item
        if all(a is b for a, b in zip(parts, item.stretches, strict=True))
        else replace(item, stretches=tuple(parts))
    )


def same_events(one: Sequence[Event], other: Sequence[Event]) -> bool:
    """Whether two lists contain the same events, up to small differences of their ends."""

    def held(event: Event, events: Sequence[Event]) -> bool:
        both = (
            min(event.stop, item.stop) - max(event.start, item.start)
            for item in events
            if item.recording == event.recording
        )
        return max(both, default=0.0) >= SAME_OVERLAP * (event.stop - event.start)

    return all(held(event, other) for event in one) and all(held(event, one) for event in other)


def _event(robot: Robot, data: PreparedData, segment: Segment, left: Array, *, held_out: bool) -> Event:
    item = segment.binned
    inside = slice(segment.start * item.size, segment.stop * item.size)
    size = np.sqrt(np.mean(left[:, inside] ** 2, axis=1))
    ranked = [
        int(j) for j in np.argsort(-segment.score) if segment.score[j] >= min(SHARED, float(np.max(segment.score)))
    ]
    record = data.recordings[item.recording]
    times = item.part.stretch.time[inside] - record.recording.time[0]
    shown = tuple(robot.joints[j] for j in ranked)
    force, fit = tool_force(robot, item, segment.start, segment.stop)
    zero = float(times[0]) - segment.start * item.width
    begins, ends = (
        (zero + least * item.width, zero + most * item.width)
        for least, most in (segment.ends.begins, segment.ends.ends)
    )
    inner = max(ranked) < robot.n - 1
    kind = "contact" if fit >= FITS and len(ranked) > 1 else "push" if inner else "unknown"
    return Event(
        record.name,
        float(times[0]),
        float(times[-1]),
        shown,
        float(size[ranked[0]]),
        kind,
        float(np.max(segment.score)),
        held_out,
        (float(force[0]), float(force[1]), float(force[2])) if kind == "contact" else None,
        begins,
        ends,
        tuple(float(size[j]) for j in ranked),
    )


def _of_tool_force(robot: Robot, item: Binned, start: int, stop: int) -> Array | None:
    """Return the torque in every bin near an event of the constant tool force that fits it, if one does, shape (n, M)."""
    force, fit = tool_force(robot, item, start, stop)
    if fit < FITS:
        return None
    reach = round(NEAR_ENDS / item.width)
    found = np.zeros_like(item.left)
    bins = range(max(0, start - reach), min(found.shape[1], stop + reach))
    found[:, bins.start : bins.stop] = np.stack([turned @ force for turned in _per_force(robot, item, bins)], axis=1)
    return found


def _per_force(robot: Robot, item: Binned, bins: Sequence[int]) -> Iterator[Array]:
    """Return the change of the drives' torque by a unit of each force on the tool, recorded side, shape (n, 3)."""
    states = configurations(robot.model, item.state[0][np.argsort(robot.order)][:, list(bins)])
    return (-turned for turned in force_torques(robot, states.T))


def tool_force(robot: Robot, item: Binned, start: int, stop: int) -> tuple[Array, float]:
    """Return the constant force on the tool, base frame, N, shape (3,), that fits an event best, and the share it explains.

    The event is from a bin to before another.

    A force f on the tool at the end of the Jacobian J takes ``J.T @ f`` from the torque that the drives have to give.
    """
    bins = range(start, stop, max(1, (stop - start) // STATES))
    rows, rights = [], []
    spread = np.sqrt(np.mean(item.left**2, axis=1)) + 1e-12
    left = item.bounded(np.inf)
    for k, turned in zip(bins, _per_force(robot, item, bins), strict=True):
        weight = np.where(item.known[:, k] > 0.5, 1.0 / spread, 0.0)
        rows.append(weight[:, None] * turned)
        rights.append(weight * left[:, k])
    return constant_force(rows, rights)


def _repeated(segment: Segment, stretches: Sequence[Binned], data: PreparedData) -> bool:
    """Whether another run of the same motion has the like at the same place: then it is the motion's doing."""
    own = segment.binned
    label = data.labels[own.recording]
    for other in stretches:
        among = other.recording < len(data.recordings) and other.recording != own.recording
        if not among or data.labels[other.recording] != label:
            continue
        rate = own.part.rate
        if abs(other.part.rate / rate - 1.0) > SAME_RATE:
            continue
        shift = alignment(own.part.stretch.position, other.part.stretch.position, round(LARGEST_SHIFT * rate))
        if shift is None:
            continue
        moved = round(shift / own.size)
        bins = np.arange(segment.start, segment.stop)
        bins = bins[(bins >= moved) & (bins - moved < other.left.shape[1])]
        shown = segment.score >= min(1.0, float(np.max(segment.score)))
        here = own.known[shown][:, bins] * own.left[shown][:, bins]
        there = other.known[shown][:, bins - moved] * other.left[shown][:, bins - moved]
        power = np.sum(here**2, axis=1)
        like = np.sum(here * there, axis=1) / np.where(power > 0.0, power, np.inf)
        if len(like) and float(np.median(like)) > REPEATED:
            return True
    return False
