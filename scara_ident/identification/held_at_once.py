"""Folders with more samples than a diagnosis holds at once: recordings, and parts of long ones, evenly over all of them."""

from __future__ import annotations

from dataclasses import replace

from scara_ident.estimation.sample_columns import MAX_VALUES, evenly
from scara_ident.motion.prepared import PreparedData, PreparedRecording


def held_at_once(data: PreparedData, held_out: PreparedData) -> tuple[PreparedData, PreparedData, list[str]]:
    """Return recordings, and those held out, as they are, or where they are too many samples those that are looked at.

    Every rate and every sample in a row stays: means over samples would blur where friction changes its sign.

    Parameters
    ----------
    data, held_out : PreparedData

    Returns
    -------
    notes : list of str
        What is not looked at.
    """
    count, most = _samples(data) + _samples(held_out), MAX_VALUES / max(1, len(data.bands))
    if count <= most:
        return data, held_out, []
    # What is held out has its share of what is held.
    kept, kept_out = (_spread(part, most * _samples(part) / count) for part in (data, held_out))
    shown = []
    for part, own, words in ((data, kept, ""), (held_out, kept_out, " held out")):
        if _samples(own) < _samples(part):
            share = _samples(own) / sum(_size(part.recordings[k]) for k in _places(part, own))
            of_them = "" if share == 1.0 else f"{share:.0%} of the samples of "
            shown.append(f"{of_them}{len(own.recordings)} of {len(part.recordings)} recordings{words}")
    if not shown:
        return data, held_out, []
    note = (
        f"{count} samples of {len(data.bands)} joints are more than a diagnosis can hold at once ({most:.0f}): it uses "
        f"{' and '.join(shown)}, evenly over all; to choose others give only the recordings that matter"
    )
    return kept, kept_out, [note]


def _size(item: PreparedRecording) -> int:
    return sum(part.samples for part in item.stretches)


def _samples(data: PreparedData) -> int:
    return sum(map(_size, data.recordings))


def _places(data: PreparedData, some: PreparedData) -> list[int]:
    names = {item.recording for item in some.recordings}
    return [k for k, item in enumerate(data.recordings) if item.recording in names]


def _spread(data: PreparedData, most: float) -> PreparedData:
    """Return recordings of so many samples: whole motions with all repetitions, else single ones, else parts of one."""
    sizes = [_size(item) for item in data.recordings]
    motions = [[k for k, label in enumerate(data.labels) if label == own] for own in data.trajectories]
    for units in (motions, [[k] for k in range(len(sizes))]):
        for number in range(len(units), 0, -1):
            chosen = sorted(k for place in evenly(len(units), number) for k in units[place])
            # Two motions at least, or two repetitions, where there are any.
            if sum(sizes[k] for k in chosen) <= most and len(chosen) >= min(2, len(sizes)):
                return data.of(chosen)
    return _parts(data, most)


def _parts(data: PreparedData, most: float) -> PreparedData:
    """Return parts of the first two recordings, each with its share of so many samples, or one part."""
    some = data.of(range(min(2, len(data.recordings))))
    cut = []
    for item in some.recordings:
        stretches, share = item.stretches, most * _size(item) / _samples(some)
        for number in range(len(stretches), 0, -1):
            chosen = [stretches[k] for k in evenly(len(stretches), number)]
            if sum(part.samples for part in chosen) <= share or number == 1:
                cut.append(replace(item, stretches=tuple(chosen)))
                break
    return replace(some, recordings=tuple(cut))
