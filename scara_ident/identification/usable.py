"""Which recordings can be used: one without information is left out and named; if none remains, that is an error."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import chain

import numpy as np

from scara_ident.errors import RecordingError, UsageError
from scara_ident.estimation.bands import BandChoice, choose_bands
from scara_ident.estimation.observations import Observations, kept_rows
from scara_ident.identification.held_at_once import held_at_once
from scara_ident.identification.in_step import in_step
from scara_ident.manners import listed
from scara_ident.memory import keep_freed
from scara_ident.model.model import TorqueModel
from scara_ident.motion.motion import torque_of
from scara_ident.motion.position_noise import coarse_positions
from scara_ident.motion.prepared import PreparedData, PreparedRecording, prepare
from scara_ident.motion.velocity_audit import audit_velocity, velocity_remarks
from scara_ident.recording.recording import Recording
from scara_ident.recording.shared_samples import copies_among
from scara_ident.robot.robot import Robot
from scara_ident.threads import side_by_side

# A recording with more than this share of samples of an earlier one counts as a copy, whatever the rest is.
MOSTLY = 0.5
# Number of recordings that a note lists by name; for more there is one note, with the numbers of the first.
LISTED = 3
# A number that is not part of a name, and the plural of words behind it: once or several times.
_NUMBER = re.compile(r"(?<![\w.])[-+]?\d[\w.+-]*|(?<=[a-z])s\b")
# An rms of so many independent values is known to 1 / sqrt(2 N), here 22 % (the standard error of a standard deviation).
MIN_ROWS = 10


def usable_in_bands(
    model: TorqueModel,
    recordings: Sequence[Recording],
    validation: Sequence[Recording] = (),
    bands: Sequence[float | None] | None = None,
    *,
    alike: bool = False,
    held: bool = False,
) -> tuple[PreparedData, PreparedData, list[str]]:
    """Prepare recordings in their bands, without those that contain no information.

    Parameters
    ----------
    recordings : sequence of Recording
        At least one of them is left.
    validation : sequence of Recording, optional
        Not used in the choice of bands; if there are any, at least one remains.
    bands : sequence of float or None, one per joint, optional
        Hz; chosen from the recordings by default.
    alike : bool, optional
        Whether a choice gives all joints the widest of their bands.
    held : bool, optional
        Whether of more samples than a diagnosis holds some are chosen, see `held_at_once`.

    Returns
    -------
    notes : list of str
        Findings in the data, and what was left out and why.

    Raises
    ------
    UsageError
        If there are no recordings.
    RecordingError
        If none of the recordings, or of those held out, has effort and four samples in a row, or none of the latter has rows.
    """
    if not recordings:
        raise UsageError("no recordings to identify from")
    keep_freed()
    recordings, copied = without_copies(recordings)
    data, useless = usable_data(recordings)
    held_out, more = usable_data(validation)
    notes = [*copied, *useless, *more, *data_notes(data, held_out)]
    if held:
        data, held_out, more = held_at_once(data, held_out)
        notes += more
    useless = []
    if bands is None:
        chosen, data, useless = _bands_of(model, data, alike=alike)
        bands, notes = chosen.bands, [*notes, *chosen.notes]
    data, short = with_rows(data.at(bands), model.robot, needed=True)
    held_out, more = with_rows(held_out.at(bands), model.robot, needed=False)
    if validation and not held_out.recordings:
        raise RecordingError(f"{more[0]}, and nothing else is held out")
    return data, held_out, [*notes, *useless, *short, *more, *in_step(model.robot, data)]


def _bands_of(model: TorqueModel, data: PreparedData, *, alike: bool) -> tuple[BandChoice, PreparedData, list[str]]:
    """Choose bands from the recordings that have rows in them, and return these, and which have none."""
    useless: list[str] = []
    while True:
        choice = choose_bands(model, data)
        if alike:
            # A joint with a missing effect seems to have a smaller band than it has.
            choice = replace(choice, bands=(max(choice.bands),) * len(choice.bands))
        left, short = with_rows(data.at(choice.bands), model.robot, needed=True)
        if not short:
            return choice, left, useless
        data, useless = left, [*useless, *short]


def without_copies(recordings: Sequence[Recording]) -> tuple[list[Recording], list[str]]:
    """Return recordings without copies of others, which would make standard deviations too small, with notes on the copies."""
    copies, kept, notes = copies_among(recordings), [], []
    for place, recording in enumerate(recordings):
        if place not in copies:
            kept.append(recording)
            continue
        first, share = copies[place]
        said = f"{recording.path or recording.name}: {share:.0%} of its samples are those of {first.path or first.name}"
        if share > MOSTLY:
            notes.append(f"{said}; left out")
        else:
            notes.append(f"{said}, so these samples count twice; give each recording once")
            kept.append(recording)
    return kept, notes


def usable_data(recordings: Sequence[Recording]) -> tuple[PreparedData, list[str]]:
    """Prepare recordings, without those that have no effort or no four samples in a row, with notes on these.

    Raises
    ------
    RecordingError
        The error of the first recording, if none remains.
    """
    kept, notes, errors = [], [], []
    for recording in recordings:
        try:
            (item,) = prepare([recording]).recordings
            torque_of(item.longest.stretch)
        except RecordingError as error:
            errors.append(error)
            notes.append(f"{error}; left out")
        else:
            kept.append(item)
    if errors and not kept:
        raise errors[0]
    return PreparedData(tuple(kept), kept[0].bands if kept else ()), notes


def with_rows(data: PreparedData, robot: Robot, *, needed: bool) -> tuple[PreparedData, list[str]]:
    """Return recordings in their bands without those that have almost no rows, with notes on these.

    Parameters
    ----------
    needed : bool
        Whether at least one must remain; if all have too few rows, all are kept.
    """
    rows = side_by_side(kept_rows, data.recordings)
    kept = [k for k, count in enumerate(rows) if count >= MIN_ROWS]
    if len(kept) == len(rows) or (needed and not kept):
        return data, []
    said = (
        (
            str(item.recording.path or item.name),
            f"{count} independent rows remain without the ends and the times at rest{_because(item, robot)}; left out",
            None,
        )
        for item, count in zip(data.recordings, rows, strict=True)
        if count < MIN_ROWS
    )
    return data.of(kept), _once(said)


def _because(item: PreparedRecording, robot: Robot) -> str:
    coarse = coarse_positions(item, robot.position_unit)
    return "" if coarse is None else f" ({coarse})"


def check_rows(observations: Observations) -> None:
    """Refuse fewer rows than parameters: any such rows are fitted exactly, and the result predicts nothing.

    Raises
    ------
    RecordingError
    """
    rows = sum(joint.table.shape[1] for joint in observations.joints)
    moved = np.zeros(observations.parameters, dtype=bool)
    for joint in observations.joints:
        moved[joint.columns[np.any(joint.table[:-1] != 0.0, axis=1)]] = True
    if rows <= np.count_nonzero(moved):
        first, unit = observations.data.sources[0], observations.model.robot.position_unit
        raise RecordingError(
            f"{first.path or first.name}: {rows} independent rows within the bands for {np.count_nonzero(moved)} parameters; "
            f"{coarse_positions(observations.data.recordings[0], unit) or 'record longer, or give a wider band'}"
        )


def data_notes(*data: PreparedData) -> list[str]:
    """Return the findings of the audits, with one line for the same finding on many recordings, and contradictions of names and motions."""
    items = [item for part in data for item in part.recordings]
    audits = side_by_side(lambda item: audit_velocity(item.recording, item.longest.stretch), items)
    notes = _once((item.name, finding.message, finding.joint) for item in items for finding in item.recording.findings)
    audited = [(item.name, item.longest.rate, own) for item, own in zip(items, audits, strict=True)]
    notes += [f"{_listed(names)}: {remark}" for names, remark in velocity_remarks(audited)]
    return [*notes, *(note for part in data for note in part.motions.notes)]


def _once(said: Iterable[tuple[str, str, str | None]]) -> list[str]:
    """Return remarks on recordings, each a name, a remark and a joint, with one line for the same remark on many."""
    found: dict[str, dict[tuple[str, str | None], list[str]]] = {}
    for name, remark, joint in said:
        alike = _NUMBER.sub("", remark if joint is None else remark.removeprefix(joint))
        found.setdefault(alike, {}).setdefault((remark, joint), []).append(name)
    return [note for alike in found.values() for note in _in_one(alike)]


def _in_one(alike: Mapping[tuple[str, str | None], Sequence[str]]) -> list[str]:
    """Return remarks that differ by their joints and numbers, each with its recordings, or one for all where they are many."""
    names = list(dict.fromkeys(chain.from_iterable(alike.values())))
    if len(alike) == 1 or max(len(names), len(alike)) <= LISTED:
        return [f"{_listed(own)}: {remark}" for (remark, _), own in alike.items()]
    (first, joint), own = next(iter(alike.items()))
    others = dict.fromkeys(other for _, other in alike if other not in (None, joint))
    if not others:
        return [f"{_listed(names)}: {first}; numbers of {own[0]}"]
    return [f"{_listed(names)}: {first}; so {listed(list(others), LISTED)}; numbers of {joint} in {own[0]}"]


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names) if len(names) <= LISTED else f"{names[0]} and {len(names) - 1} more recordings"
