"""Whether recordings hold the same samples, whatever their files, names, times and beginnings are."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.recording.recording import Recording

Hashes = NDArray[np.uint64]
# Hashes, ascending, and the place of the recording that has each.
Sketch = tuple[Hashes, NDArray[np.intp]]

# Samples in a row that are compared as one. Two runs of one motion on coarse channels may agree in a sample or two.
WINDOW = 32
# At least this share of them differs from the sample before: at rest everything agrees.
MOVING_SHARE = 0.5
# Of all windows of the recordings compared with, those with the smallest hashes are kept, so many; 16 bytes each.
KEPT_WINDOWS = 65536
# A copy of this share of a recording is no accident, if it is at least so many windows.
MIN_SHARE, MIN_WINDOWS = 0.02, 3
# Samples at a time.
CHUNK = 65536
# Of single samples of one joint one in 2 to the power of this is looked at to tell whether recordings may share any samples.
SPARSE_BITS = 4
_MIX = np.uint64(0x9E3779B97F4A7C15)
_ODD = np.uint64(0xBF58476D1CE4E5B9)
_EMPTY: Sketch = (np.zeros(0, dtype=np.uint64), np.zeros(0, dtype=np.intp))


def shared_samples(
    known: Sequence[Recording], others: Sequence[Recording]
) -> Iterator[tuple[Recording, Recording, float]]:
    """Find recordings that hold samples of known ones: positions and efforts that are the same, bit by bit.

    Each run of `WINDOW` samples is one hash; of those of the known recordings the smallest are kept (a bottom-k
    sketch: Broder, "On the resemblance and containment of documents", 1997), so that time is proportional to the
    samples and memory is constant. Times are not compared: a copy may begin anywhere and have another clock.

    Yields
    ------
    other, first, share : Recording, Recording, float
        A recording, the known one that it shares most with, and the share of its samples that are in known ones.
    """
    if not len(others):
        return
    sketch = _EMPTY
    for place, recording in enumerate(known):
        sketch = _with_windows(sketch, recording, place)
    for other in others:
        found = _max_shared(sketch, other, known)
        if found is not None:
            yield other, *found


def copies_among(recordings: Sequence[Recording]) -> dict[int, tuple[Recording, float]]:
    """Find recordings that hold samples of ones before them, see `shared_samples`.

    Returns
    -------
    dict of int to tuple
        By the place of such a recording the one before it that it shares most with, and the share of its samples.
    """
    sketch, copies = _EMPTY, {}
    for place in _may_share(recordings):
        recording = recordings[place]
        found = _max_shared(sketch, recording, recordings)
        if found is None:
            sketch = _with_windows(sketch, recording, place)
        else:
            copies[place] = found
    return copies


def _may_share(recordings: Sequence[Recording]) -> list[int]:
    """Return the places of recordings that have some single samples of the first joint in common with others.

    To hash all windows of all recordings takes a fifth as long as to identify from them.
    """
    few = [_few(recording) for recording in recordings]
    if not few:
        return []
    values, counts = np.unique(np.concatenate(few), return_counts=True)
    common = values[counts > 1]
    shared = [np.count_nonzero(np.isin(own, common, assume_unique=True)) for own in few]
    return [k for k, own in enumerate(few) if shared[k] > 0.5 * MIN_SHARE * len(own)]


def _few(recording: Recording) -> Hashes:
    """Return different hashes of the first joint's samples, of one in so many, which are chosen by the bits of their positions."""
    position = recording.position[0] + 0.0
    asked = (position.view(np.uint64) * _ODD) >> np.uint64(64 - SPARSE_BITS) == 0
    signals = [recording.position] if recording.effort is None else [recording.position, recording.effort]
    return np.unique(_samples([signal[:1, asked] for signal in signals]))


def _with_windows(sketch: Sketch, recording: Recording, place: int) -> Sketch:
    """Return the smallest hashes of all recordings so far and of one more, and the place of the first that has each."""
    values, owners = sketch
    for hashes in _windows(recording):
        values = np.concatenate([values, hashes])
        owners = np.concatenate([owners, np.full(len(hashes), place, dtype=np.intp)])
        values, first = np.unique(values, return_index=True)
        values, owners = values[:KEPT_WINDOWS], owners[first][:KEPT_WINDOWS]
    return values, owners


def _max_shared(sketch: Sketch, other: Recording, known: Sequence[Recording]) -> tuple[Recording, float] | None:
    """Return the known recording with which another shares most and the share that is in any; None by accident."""
    values, owners = sketch
    if not len(values):
        return None
    # Below this bound every window of the known recordings is among those kept.
    bound = values[-1] if len(values) == KEPT_WINDOWS else np.iinfo(np.uint64).max
    seen, hits = 0, np.zeros(len(known), dtype=np.intp)
    for hashes in _windows(other):
        asked = hashes[hashes <= bound]
        places = np.minimum(np.searchsorted(values, asked), len(values) - 1)
        same = values[places] == asked
        seen += len(asked)
        hits += np.bincount(owners[places[same]], minlength=len(known))
    total = int(hits.sum())
    if total < MIN_WINDOWS or total < MIN_SHARE * seen:
        return None
    return known[int(np.argmax(hits))], total / seen


def _windows(recording: Recording) -> Iterator[Hashes]:
    """Yield a hash for each run of samples in which the arm moves, some thousands at a time."""
    signals = [recording.position] if recording.effort is None else [recording.position, recording.effort]
    count = len(recording.time)
    for start in range(0, count - WINDOW + 1, CHUNK):
        rows = _samples([signal[:, start : min(start + CHUNK + WINDOW - 1, count)] for signal in signals])
        fresh = np.concatenate([[True], rows[1:] != rows[:-1]])
        moved = np.concatenate([[0], np.cumsum(fresh)])
        hashes, size = rows, 1
        while size < WINDOW:
            # Two halves, of which the first is mixed so that their order counts.
            hashes = _mixed(hashes[:-size]) + hashes[size:]
            size *= 2
        yield _mixed(hashes)[moved[WINDOW:] - moved[:-WINDOW] >= MOVING_SHARE * WINDOW]


def _samples(signals: Sequence[Array]) -> Hashes:
    """Return a hash of the bits of every sample, shape (N,)."""
    result = np.zeros(signals[0].shape[1], dtype=np.uint64)
    for signal in signals:
        for channel in signal:
            # Zero has two signs.
            bits = np.ascontiguousarray(channel + 0.0).view(np.uint64)
            result = _mixed(result) + bits * _ODD
    return _mixed(result)


def _mixed(values: Hashes) -> Hashes:
    """Spread what hashes hold over all their bits."""
    mixed = (values ^ (values >> np.uint64(31))) * _MIX
    return (mixed ^ (mixed >> np.uint64(29))) * _ODD
