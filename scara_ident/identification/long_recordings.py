"""Files that are too long to hold: every part is prepared, freed of events, absorbed into triangular factors and forgotten.

Bands, checks of channels and the robust fit that events stand out from are of the samples that are kept, windows spread over
the file. Then each part of the file is read once. Its pieces are those that the whole would be cut into, and nothing of a piece
depends on another, so that the rows are those of the whole. What is held of them does not grow: blocks of time, each a
triangular factor, of which neighbours become one when there are too many.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from scara_ident.arrays import Array
from scara_ident.errors import RecordingError
from scara_ident.estimation.joint_rows import JointRows, joined
from scara_ident.estimation.observations import Observations, observe
from scara_ident.estimation.robust import MAX_BLOCKS
from scara_ident.identification.events import Event, find_events, without_events
from scara_ident.motion.prepared import prepare
from scara_ident.progress import Tell, silent
from scara_ident.recording.long_file import LongFile
from scara_ident.recording.recording import Recording, read_parts, refuse_backwards
from scara_ident.threads import one_blas_thread


@dataclass
class _Absorbed:
    """What is held of a long file while it is read."""

    joints: tuple[JointRows, ...] = ()
    samples: int = 0
    group: int = 1
    events: list[Event] = field(default_factory=list)
    refused: list[RecordingError] = field(default_factory=list)
    said: dict[str, list[str]] = field(default_factory=dict)
    stop: float = float("-inf")

    def absorb(self, joints: Sequence[JointRows]) -> None:
        """Take in the rows of a part."""
        columns = [rows.columns for rows in joints]
        grouped = tuple(rows.grouped(self.group) for rows in joints)
        self.joints = joined([self.joints, grouped], columns)[0] if self.joints else grouped
        while len(self.joints[0].counts) > 2 * MAX_BLOCKS:
            self.group *= 2
            self.joints = tuple(rows.grouped(2) for rows in self.joints)


def with_all_samples(
    observations: Observations, events: Sequence[Event], value: Array | None, progress: Tell = silent
) -> tuple[Observations, tuple[Event, ...], list[str]]:
    """Return observations without events, whose rows are of all samples of long files, the events, and what was found.

    Parameters
    ----------
    observations : Observations
        Of the samples in memory.
    events : sequence of Event
        Found in them.
    value : ndarray, shape (p,), or None
        Parameters that no event has steered; None where no events are looked for.

    Raises
    ------
    RecordingError
        If no part of a long file can be used, or too little is left of one.
    """
    found = list(events)
    notes: list[str] = []
    files: dict[int, _Absorbed] = {}
    for place, recording in enumerate(observations.data.sources):
        if recording.long is not None:
            held = _absorbed(observations, recording, recording.long, value, progress)
            files[place] = held
            found = [*(event for event in found if event.recording != recording.name), *held.events]
            notes += _notes(recording, recording.long, held)
    if not files:
        return without_events(observations, events), tuple(events), []
    ordered = tuple(event for item in observations.data.recordings for event in found if event.recording == item.name)
    kept = without_events(observations, ordered)
    parts = [files[k].joints if k in files else each.joints for k, each in enumerate(kept.each)]
    joints, owner = joined(parts, observations.model.active)
    counts = tuple(files[k].samples if k in files else each.samples for k, each in enumerate(kept.each))
    return replace(kept, joints=joints, owner=owner, kept=kept, counts=counts), ordered, notes


def _absorbed(
    observations: Observations, recording: Recording, long: LongFile, value: Array | None, progress: Tell
) -> _Absorbed:
    held, count = _Absorbed(), len(long.parts)
    for place, part in enumerate(read_parts(long, observations.model.robot)):
        progress(f"absorbing {recording.name}, part {place + 1} of {count}", place / count)
        try:
            if isinstance(part, RecordingError):
                raise part
            _absorb(held, observations, part, value, float(recording.time[0]))
        except RecordingError as error:
            held.refused.append(error)
    if not held.joints:
        raise held.refused[0]
    return held


@one_blas_thread()
def _absorb(held: _Absorbed, observations: Observations, part: Recording, value: Array | None, origin: float) -> None:
    """Take in a part of a long file, and nothing of one that cannot be used."""
    refuse_backwards(part, held.stop)
    rows = observe(observations.model, prepare([part], observations.data.bands))
    events = () if value is None else find_events(rows, value)
    joints = without_events(rows, events).joints
    held.stop = float(part.time[-1])
    held.samples += rows.samples
    later = float(part.time[0]) - origin
    held.events += [event.later(later) for event in events]
    for kind, message in {finding.kind: finding.message for finding in reversed(part.findings)}.items():
        held.said.setdefault(kind, []).append(message)
    held.absorb(joints)


def _notes(recording: Recording, long: LongFile, held: _Absorbed) -> list[str]:
    count, known = len(long.parts), {finding.kind for finding in recording.findings}
    whole = "all" if held.samples == long.samples else "the"
    notes = [
        f"{recording.name}: parameters, their standard deviations, events and errors within the band are from {whole} "
        f"{held.samples} samples, read in {count} parts; bands, checks, unfiltered errors and pictures are from the "
        f"{len(recording.time)} samples kept"
    ]
    if held.refused:
        notes.append(f"{held.refused[0]}; left out, {len(held.refused)} of {count} parts in all")
    notes += [
        f"{recording.name}, in {len(said)} of {count} parts: {said[0]}"
        for kind, said in held.said.items()
        if kind not in known
    ]
    return notes
