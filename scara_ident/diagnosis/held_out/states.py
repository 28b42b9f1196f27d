"""Which effects act in a held-out recording, of those that act in some only: estimated on its first part, judged on the rest.

Where effects act in intervals of recordings, see `held_out_intervals`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from scara_ident.arrays import Array
from scara_ident.diagnosis.candidates.candidates import Candidate, CandidateColumns, columns_at_hand
from scara_ident.diagnosis.fitting.at_estimate import moved_with
from scara_ident.diagnosis.fitting.correction import Correction, corrected, lower_bands
from scara_ident.diagnosis.held_out.correction import own_correction
from scara_ident.diagnosis.held_out.intervals import intervals_by_others, words_of
from scara_ident.diagnosis.selection.search import Search
from scara_ident.effects import Scene
from scara_ident.estimation import Estimate
from scara_ident.estimation.observations import Observations, observe
from scara_ident.identification.usable import with_rows
from scara_ident.motion.prepared import PreparedData, prepare
from scara_ident.recording.recording import Recording

# Of a held-out recording this share says in which state it was; it is not among the errors.
FIRST_PART = 1.0 / 3.0


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Held-out recordings and the state that the arm was in.

    Attributes
    ----------
    data : PreparedData
        What errors are of: the recordings, without their first part where their state is estimated on that.
    scene : Scene
        That knows when they began.
    chosen : tuple of Candidate
        The effects found, which also act in those of them that they were seen in.
    correction : Correction or None
        What is to be taken out of them; its own of each where each has its own.
    """

    data: PreparedData
    scene: Scene
    chosen: tuple[Candidate, ...]
    notes: tuple[str, ...]
    correction: Correction | None


def held_out_states(found: Search, after: Estimate, data: PreparedData) -> HeldOut:
    """Find the state of held-out recordings, each by its own first part.

    Parameters
    ----------
    after : Estimate
        Of the model with the effects found.
    data : PreparedData
        The held-out recordings, in the bands of the search.
    """
    optional = [k for k, item in enumerate(found.chosen) if item.effect.by_recording]
    if not data.recordings:
        return HeldOut(data, found.scene, found.chosen, (), found.correction)
    value, weights = after.value, after.weights
    by_recording = _by_recording(found, after, data, optional)
    timed = [k for k, item in enumerate(found.chosen) if item.effect.in_intervals]
    return _in_intervals(found, value, weights, by_recording, timed) if timed else by_recording


def _by_recording(found: Search, after: Estimate, data: PreparedData, optional: Sequence[int]) -> HeldOut:
    """Return in which of the recordings effects act that act in some recordings only."""
    start = {item.name: float(item.recording.time[0]) for item in data.recordings}
    scene = replace(found.scene, start={**found.scene.start, **start})
    correction = found.correction
    own = correction is not None and correction.of_each
    if not optional and not own:
        return HeldOut(data, scene, found.chosen, (), correction)
    parted = [_parted(item.recording) for item in data.recordings]
    heads, _ = with_rows(prepare([head for head, _ in parted], data.bands), scene.robot, needed=False)
    chosen, seen, notes = list(found.chosen), {}, []
    if correction is not None and own:
        training = [_parted(item.recording)[0] for item in found.uncorrected.data.recordings]
        bands = lower_bands(found.step)
        known, below = (
            with_rows(prepare(firsts, bands), scene.robot, needed=False)[0]
            for firsts in (training, [head for head, _ in parted])
        )
        correction, words = own_correction(found, after, known, below, scene, tuple(start))
        notes += words
    if heads.recordings and optional:
        for one in _observed(found, heads, correction).each:
            seen[one.name] = _acting(one, scene, chosen, optional, after.value, after.weights)
    for name in start if optional else ():
        for k in seen.get(name, ()):
            item = chosen[k]
            chosen[k] = replace(item, member=item.effect.in_recordings(scene, item.member, frozenset([name])))
        words = [found.chosen[k].label(found.scene) for k in seen.get(name, ())]
        shown = f"shows {'; '.join(words) or 'no effect that acts in some recordings only'}"
        notes.append(f"{name}: its first third {shown if name in seen else 'is too short to show which effects act'}")
    rest, useless = with_rows(prepare([rest for _, rest in parted], data.bands), scene.robot, needed=False)
    scene = moved_with(scene, found.chosen, chosen)
    notes += ["held-out errors are of the other two thirds", *useless]
    return HeldOut(rest, scene, tuple(chosen), tuple(notes), correction)


def _in_intervals(found: Search, value: Array, weights: Array, held: HeldOut, timed: Sequence[int]) -> HeldOut:
    """Return in which intervals of the recordings effects act that act in some."""
    chosen, notes = list(held.chosen), list(held.notes)
    if held.data.recordings:
        for one in _observed(found, held.data, held.correction).each:
            for k in timed:
                item = chosen[k]
                apart, seen = intervals_by_others(one, held.scene, held.chosen, k, value, weights)
                chosen[k] = replace(item, member=replace(item.member, intervals=(*item.member.intervals, *apart)))
                notes.append(
                    f"{one.name}: {item.effect.name} acts {words_of(seen)}; each joint is predicted with the intervals "
                    f"that the torque of the other joints gives"
                )
    scene = moved_with(held.scene, held.chosen, chosen)
    return replace(held, scene=scene, chosen=tuple(chosen), notes=tuple(notes))


def _observed(found: Search, data: PreparedData, correction: Correction | None) -> Observations:
    """Return observations of the base model, without what is taken out of them."""
    observations = observe(found.base, data)
    return observations if correction is None else observations.with_torque(corrected(data, correction))


def _acting(
    one: Observations, scene: Scene, chosen: Sequence[Candidate], optional: Sequence[int], value: Array, weights: Array
) -> tuple[int, ...]:
    """Return which of the effects act in a recording: those that leave the least of it."""
    names = frozenset([one.name])
    here = replace(scene, columns=columns_at_hand(one))
    everywhere = [
        replace(item, member=item.effect.in_recordings(here, item.member, names)) if k in optional else item
        for k, item in enumerate(chosen)
    ]
    rows = CandidateColumns(one).rows(here, everywhere)
    stop = np.cumsum([one.parameters, *(len(next(iter(item.values()))) for item in rows)])
    left = [item.left(value) for item in one.joints]
    added = [
        {joint: value[a:b] @ part for joint, part in item.items()}
        for item, a, b in zip(rows, stop[:-1], stop[1:], strict=True)
    ]
    best: tuple[float, tuple[int, ...]] = (np.inf, ())
    for which in product((False, True), repeat=len(optional)):
        acting = tuple(k for k, acts in zip(optional, which, strict=True) if acts)
        total = 0.0
        for joint, weight in enumerate(weights):
            error = left[joint].copy()
            for k, torque in enumerate(added):
                if (k in acting or k not in optional) and joint in torque:
                    error -= torque[joint]
            total += float(weight**2 * error @ error)
        best = min(best, (total, acting))
    return best[1]


def _parted(recording: Recording) -> tuple[Recording, Recording]:
    """Return the first part of a recording, and the rest."""
    edge = recording.time[0] + FIRST_PART * (recording.time[-1] - recording.time[0])
    place = int(np.searchsorted(recording.time, edge))
    return _window(recording, slice(None, place)), _window(recording, slice(place, None))


def _window(recording: Recording, window: slice) -> Recording:
    def cut(signal: Array | None) -> Array | None:
        return None if signal is None else signal[:, window]

    return replace(
        recording,
        time=recording.time[window],
        position=recording.position[:, window],
        effort=cut(recording.effort),
        velocity=cut(recording.velocity),
        acceleration=cut(recording.acceleration),
        temperature=cut(recording.temperature),
        link_position=cut(recording.link_position),
    )
