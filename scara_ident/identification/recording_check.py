"""Held-out recordings that are not explained while those fitted are: another payload, or another state of the robot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from scara_ident.arrays import Array
from scara_ident.estimation.observations import Observations
from scara_ident.identification.events import Event, find_events
from scara_ident.model.base_parameters import standard_regressor
from scara_ident.motion.prepared import PreparedData

# A recording is not explained where its error is this many times that of the fitted ones, and of the worst of these.
WORSE_RATIO, WORSE_THAN_WORST_RATIO = 2.0, 1.5
# Another payload explains at least this share of its squared residual.
PAYLOAD_FITS = 0.7
# An error within so many of the standard deviations that the parameters, or what runs differ by, make is theirs: 95 %.
UNSURE_STDS = 2.0
# Of what an offset of each joint leaves, a payload leaves no more than this share.
OF_OFFSETS = 0.5
# Samples of a recording that a payload is fitted to.
SAMPLES = 1500
# Directions of the payload's parameters that show less than this share of the best are none.
SHOWN = 1e-3


def held_out_events(value: Array, training: Observations, held_out: Observations) -> tuple[Event, ...]:
    """Return what stands out in recordings held out: whole ones that parameters explain much worse, and stretches of others.

    Parameters
    ----------
    value : ndarray, shape (p,)
    training, held_out : Observations
        Of the same model; with the columns at every sample.

    Returns
    -------
    tuple of Event
        A whole recording is of kind ``other payload`` where a body on the last link explains what is left of it.
    """
    if not held_out.data.recordings:
        return ()
    within = find_events(held_out, value, training)
    rest = without_stretches(held_out, within)
    whole = np.array([rows.rms(value) for rows in training.joints])
    worst = np.max([[rows.rms(value) for rows in item.joints] for item in training.each], axis=0)
    found = []
    for item in rest.each:
        rms = np.array([rows.rms(value) for rows in item.joints])
        least = np.maximum(WORSE_RATIO * whole, WORSE_THAN_WORST_RATIO * worst)
        ratio = np.where(least > 0.0, rms / np.where(least > 0.0, least, 1.0), 0.0)
        if not np.any(ratio > 1.0):
            continue
        shown = [int(j) for j in np.argsort(-ratio) if ratio[j] > 1.0]
        joints = tuple(training.model.robot.joints[j] for j in shown)
        time = item.data.sources[0].time
        kind = "other payload" if payload_share(value, item, whole) >= PAYLOAD_FITS else "unknown"
        sizes = tuple(float(rms[j]) for j in shown)
        torque = [rows.rms(np.zeros_like(value)) for rows in item.joints]
        beyond = tuple(training.model.robot.joints[j] for j in shown if rms[j] > torque[j])
        last = float(time[-1] - time[0])
        found.append(Event(item.name, 0.0, last, joints, sizes[0], kind, held_out=True, sizes=sizes, beyond=beyond))
    whole_ones = {event.recording for event in found}
    return (*found, *(event for event in within if event.recording not in whole_ones))


def own_uncertainty(event: Event, unsure: Mapping[str, float], apart: Mapping[str, float]) -> Event:
    """Return an event as no event of its recording where what is known of the arm makes as much of it.

    Parameters
    ----------
    event : Event
        Of recordings held out; only a whole one of kind ``unknown`` is changed.
    unsure : mapping of str to float
        Rms error of each joint that a right model has there, known as it is.
    apart : mapping of str to float
        Rms torque by which runs were found to differ.
    """
    if event.kind != "unknown" or np.isfinite(event.score):
        return event
    theirs, of_runs = UNSURE_STDS * unsure[event.joints[0]], UNSURE_STDS * apart[event.joints[0]]
    if event.rms <= theirs:
        return replace(event, kind="parameters unsure")
    return replace(event, kind="runs differ") if event.rms <= np.hypot(theirs, of_runs) else event


def quiet_blocks(data: PreparedData, events: Sequence[Event]) -> Array:
    """Return 0 for each block of time in which an event is, whole recordings aside, and 1 for all others, shape (blocks,)."""
    stretches = [event for event in events if np.isfinite(event.score)]
    kept: list[bool] = []
    for item in data.recordings:
        own = [event for event in stretches if event.recording == item.name]
        for part in (part for part in item.stretches if part.usable):
            ends = part.stretch.time[np.minimum(part.blocks, part.samples - 1)] - item.recording.time[0]
            kept += [not any(event.start <= b and event.stop >= a for event in own) for a, b in pairwise(ends)]
    return np.array(kept, dtype=float)


def without_stretches(observations: Observations, events: Sequence[Event]) -> Observations:
    """Return observations whose blocks of time in which events are count for nothing, see `quiet_blocks`; for errors alone."""
    shares = quiet_blocks(observations.data, events)
    return observations if np.all(shares) else observations.faded(shares)


def payload_share(value: Array, item: Observations, noise: Array) -> float:
    """Return the share of a recording's squared residual that a body on the last link explains, the second half by the first.

    It is 0 where an offset of each joint explains as much: of little motion, a sensor that was zeroed is as heavy as a load.

    Parameters
    ----------
    value : ndarray, shape (p,)
    item : Observations
        Of one recording.
    noise : ndarray, shape (n,)
        Residual of each joint that it is weighed by.
    """
    robot = item.model.robot
    last = int(np.argmax(robot.order))
    parts = [(part, left) for part, left in zip(item.data.stretches, item.residuals(value).banded, strict=True)]
    step = max(1, sum(part.samples for part, _ in parts) // SAMPLES)
    rows, rights, ones = [], [], []
    for part, left in parts:
        places = np.flatnonzero(np.any(part.used, axis=0))[::step]
        if not len(places):
            continue
        motion = part.motion
        body = standard_regressor(robot, motion.q[:, places], motion.v[:, places], motion.a[:, places])
        weight = np.where(part.used[:, places], 1.0, 0.0) / np.where(noise > 0.0, noise, 1.0)[:, None]
        columns = robot.row_scale[:, None, None] * body[:, 10 * last : 10 * last + 10] * weight[:, None]
        rows.append(np.moveaxis(columns, 1, 2).reshape(len(places) * robot.n, 10, order="F"))
        rights.append((weight * left[:, places]).reshape(-1, order="F"))
        ones.append(
            np.moveaxis(weight[:, None] * np.eye(robot.n)[:, :, None], 1, 2).reshape(rows[-1].shape[0], -1, order="F")
        )
    if not rows:
        return 0.0
    right = np.concatenate(rights)
    load, offsets = (_share(np.concatenate(each), right) for each in (rows, ones))
    return load if 1.0 - load < OF_OFFSETS * (1.0 - offsets) else 0.0


def _share(matrix: Array, right: Array) -> float:
    """Return the share of the second half's squares that columns explain as they were fitted to the first."""
    half = len(right) // 2
    size = np.linalg.norm(matrix, axis=0)
    scale = np.where(size > 0.0, 1.0 / np.where(size > 0.0, size, 1.0), 0.0)
    value = scale * np.linalg.lstsq(matrix[:half] * scale, right[:half], rcond=SHOWN)[0]
    total = float(right[half:] @ right[half:])
    return 1.0 - float(np.sum((right[half:] - matrix[half:] @ value) ** 2)) / total if total > 0.0 else 0.0
