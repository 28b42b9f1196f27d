"""Recordings prepared for one choice of bands: everything that does not depend on a model, each part computed once.

Both sides of a joint's torque equation are faded out towards rest, where friction is unknown, and towards the ends,
where the acceleration is unknown, and then low-passed at the joint's band. Of the low-passed samples only as many are kept as the band leaves independent; they stand in blocks of
time, long against the filter's memory.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import chain
from numbers import Real

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.errors import UsageError
from scara_ident.manners import Frozen
from scara_ident.motion.low_pass import HIGHEST_CUT, ROWS_AT_ONCE, low_pass, low_pass_between, low_pass_every
from scara_ident.motion.motion import Motion, Stretch, motion_of, stretches, torque_of, with_effort_of
from scara_ident.motion.periods import Periods, periods_of
from scara_ident.motion.rest import Bands, at_ends, fading, position_cuts, standstill
from scara_ident.motion.sampling import (
    ROUNDING,
    SMOOTH_PER_PERIOD,
    block_seconds,
    row_step,
    samples_per,
)
from scara_ident.motion.trajectories import Trajectories, trajectories_of
from scara_ident.recording.recording import Recording
from scara_ident.threads import made_once, side_by_side

# Periods of the band left out at both ends of a stretch, where the filter's continuation is a guess, and the least
# number of samples, where an unfiltered derivative rings.
END_PERIODS = 1.0
END_SAMPLES = 20


@dataclass(frozen=True, eq=False)
class PreparedStretch:
    """A gapless part of a recording, ready for one choice of bands.

    Attributes
    ----------
    stretch : Stretch
    bands : tuple of float or None, one per joint
        Low-pass on both sides of each joint's equation, Hz; None filters nothing.
    left_out : ndarray of bool, shape (N,), or False
        Samples that count as at rest, for an event left out of the fit.
    rests_as : PreparedStretch or None
        Another of the same motion, which says where the joints stand still.
    """

    stretch: Stretch
    bands: tuple[float | None, ...]
    left_out: NDArray[np.bool_] | bool = False
    rests_as: PreparedStretch | None = None

    @property
    def name(self) -> str:
        """The recording it belongs to."""
        return self.stretch.name

    @property
    def rate(self) -> float:
        """Samples per second."""
        return self.stretch.rate

    @property
    def samples(self) -> int:
        """Number of samples N."""
        return len(self.stretch.time)

    def at(self, bands: Bands) -> PreparedStretch:
        """Return it in other bands."""
        rests_as = None if self.rests_as is None else self.rests_as.at(bands)
        return replace(self, bands=tuple(bands), rests_as=rests_as)

    def with_torque_of(self, stretch: Stretch) -> PreparedStretch:
        """Return it with a stretch that differs only in torque; results that depend on the motion alone are shared."""
        shared = {name: made for name, made in self.__dict__.items() if name not in ("stretch", "decimated")}
        found = replace(self, stretch=stretch)
        found.__dict__.update(shared, motion=self.motion.with_torque(stretch.torque))
        if "decimated" in self.__dict__ and self.decimation > 1:
            found.__dict__["decimated"] = self.decimated.with_torque(found._decimated_torque())
        return found

    def with_positions_of(self, stretch: Stretch, factor: Array, shift: Array) -> PreparedStretch:
        """Return it with a stretch whose positions are ``factor`` times these, 1 or -1, and ``shift``, shape (n,) each.

        Filters are linear and preserve constants, so results that depend on these positions are shared.
        """
        sign = factor[:, None]
        moved = replace(
            self.motion,
            q=sign * self.motion.q + shift[:, None],
            v=sign * self.motion.v,
            a=sign * self.motion.a,
            torque=stretch.torque,
        )
        found = self.with_torque_of(stretch)
        found.__dict__.pop("decimated", None)
        found.__dict__.update(motion=moved)
        return found

    @made_once
    def motion(self) -> Motion:
        """Filtered position, velocity and acceleration on the whole time grid, with where the joints stand still."""
        found = motion_of(self.stretch, self.cuts)
        if self.rests_as is not None:
            return replace(found, fade=self.rests_as.motion.fade)
        still = standstill(self.stretch, found, self.bands) | self.stretch.clipped
        return replace(found, fade=fading(still, self.rate, self.bands))

    @made_once
    def cuts(self) -> tuple[float | None, ...]:
        """Low-pass of each joint's positions, Hz, see `position_cuts`."""
        return position_cuts(self.stretch, self.bands) if self.rests_as is None else self.rests_as.cuts

    @property
    def torque(self) -> Array:
        """Recorded torque, shape (n, N), not filtered."""
        return torque_of(self.stretch)

    @made_once
    def trim(self) -> int:
        """Samples left out at each end."""
        slowest = min((band for band in self.bands if band is not None), default=np.inf)
        return max(END_SAMPLES, int(np.ceil(END_PERIODS * self.rate / slowest * (1.0 - ROUNDING))))

    @property
    def usable(self) -> bool:
        """Whether anything is left between its ends."""
        return self.samples > 2 * self.trim + 1

    @made_once
    def rest(self) -> NDArray[np.bool_]:
        """Where each joint stands still, widened by the memory of the position's filter, or is left out, shape (n, N)."""
        return np.asarray((self._moving == 0.0) | self.left_out)

    @made_once
    def fade(self) -> Array:
        """Weight of both sides of the equation, shape (n, N): `moving`, reduced towards the ends, see `at_ends`."""
        return self.moving * at_ends(self.samples, self.trim)

    @property
    def moving(self) -> Array:
        """Weight of every sample, shape (n, N): 0 at rest, 1 away from it, see `fading`."""
        return self._moving if self.left_out is False else fading(self.rest, self.rate, self.bands)

    @property
    def _moving(self) -> Array:
        assert self.motion.fade is not None
        return self.motion.fade

    @made_once
    def used(self) -> NDArray[np.bool_]:
        """Samples that are used, shape (n, N): neither at rest nor at the ends."""
        used = ~self.rest
        used[:, : self.trim] = used[:, max(self.trim, self.samples - self.trim) :] = False
        return used

    @made_once
    def steps(self) -> tuple[int, ...]:
        """Number of samples per kept row of each joint."""
        return tuple(row_step(self.rate, band) for band in self.bands)

    @made_once
    def decimation(self) -> int:
        """Number of samples per sample of `decimated`: as many as the band allows."""
        return samples_per(self.rate, self.bands, SMOOTH_PER_PERIOD)

    @made_once
    def decimated(self) -> Motion:
        """The motion at the samples that smooth functions of it need within the bands; often the motion itself."""
        every = self.decimation
        if every == 1:
            return self.motion
        return self.motion.decimated(every, self._decimated_torque())

    def _decimated_torque(self) -> Array | None:
        return None if self.motion.torque is None else self.decimate(self.motion.torque)

    def decimate(self, signals: Array) -> Array:
        """Return signals (k, N) at the samples of `decimated`, low-passed against aliasing."""
        return low_pass_every(signals, self.rate, HIGHEST_CUT * self.rate / self.decimation, self.decimation)

    @made_once
    def blocks(self) -> NDArray[np.intp]:
        """Bounds of the blocks of time, samples, shape (blocks + 1,)."""
        length = max(1, int(self.rate * block_seconds(self.bands) * (1.0 + ROUNDING)))
        inside = self.samples - 2 * self.trim
        return np.linspace(self.trim, self.samples - self.trim, max(1, round(inside / length)) + 1).astype(np.intp)

    @made_once
    def kept(self) -> tuple[NDArray[np.intp], ...]:
        """Samples whose rows are kept, joint by joint."""
        return tuple(step * np.flatnonzero(own[::step]) for own, step in zip(self.used, self.steps, strict=True))

    def block_starts(self, joint: int) -> NDArray[np.intp]:
        """Return the first kept row of a joint in each block, shape (blocks + 1,)."""
        return np.asarray(np.searchsorted(self.kept[joint], self.blocks), dtype=np.intp)

    def rows(self, joint: int, signals: Array, every: int = 1) -> Array:
        """Return signals within a joint's band at its kept samples, weighted to stand for all samples, shape (k, K).

        Parameters
        ----------
        joint : int
        signals : ndarray, shape (k, N)
            Columns of the joint's equation, or its torque.
        every : int, optional
            The signals are given at every so many samples.
        """
        acting = np.any(signals, axis=1)
        if not np.all(acting):
            # What does not act here, as on other joints or in other recordings, is not filtered.
            found = np.zeros((len(signals), len(self.kept[joint])))
            found[acting] = self.rows(joint, signals[acting], every)
            return found
        step, band, fade = self.steps[joint], self.bands[joint], self.fade[joint, ::every]
        if band is None or every == 1:
            rows = low_pass_every(signals, self.rate, band, step, fade)
        else:
            rows = low_pass_between(signals, self.rate, band, step, every, fade)
        return np.asarray(rows.take(self.kept[joint] // step, axis=1) * np.sqrt(step))

    def rows_of(self, signals: Sequence[tuple[int, Array]], every: int = 1) -> list[Array]:
        """Return the result of `rows` for single signals, each given with its joint; those of a joint are filtered together."""
        own = [[place for place, (k, _) in enumerate(signals) if k == joint] for joint in range(len(self.bands))]
        parts = [part[k : k + ROWS_AT_ONCE] for part in own for k in range(0, len(part), ROWS_AT_ONCE)]
        # Computed once, and not in two threads.
        _ = self.fade, self.kept

        def passed(places: list[int]) -> Array:
            return self.rows(signals[places[0]][0], np.array([signals[place][1] for place in places]), every)

        made = side_by_side(passed, parts) if len(parts) > 1 else [passed(places) for places in parts]
        found = dict(zip(chain.from_iterable(parts), chain.from_iterable(made), strict=True))
        return [found[place] for place in range(len(signals))]

    def smooth(self, joint: int, signal: Array) -> Array:
        """Return a signal of a joint's equation, shape (..., N), faded out towards rest and within the joint's band."""
        return low_pass(self.fade[joint] * signal, self.rate, self.bands[joint], self.steps[joint])


@dataclass(frozen=True, eq=False)
class PreparedRecording:
    """A recording with its stretches, ready for one choice of bands.

    Attributes
    ----------
    recording : Recording
    stretches : tuple of PreparedStretch, at least one
    """

    recording: Recording
    stretches: tuple[PreparedStretch, ...]

    @property
    def name(self) -> str:
        """Name of the recording."""
        return self.recording.name

    @property
    def bands(self) -> tuple[float | None, ...]:
        """Low-pass of each joint, Hz."""
        return self.stretches[0].bands

    @property
    def longest(self) -> PreparedStretch:
        """Its longest stretch."""
        return max(self.stretches, key=lambda part: part.samples)

    def at(self, bands: Bands) -> PreparedRecording:
        """Return it in other bands; results that do not depend on the bands are shared."""
        if tuple(bands) == self.bands:
            return self
        return replace(self, stretches=tuple(part.at(bands) for part in self.stretches))

    def with_effort_of(self, recording: Recording) -> PreparedRecording:
        """Return it with the effort of another recording of the same samples; the motion is shared."""
        parts = (part.with_torque_of(with_effort_of(part.stretch, recording)) for part in self.stretches)
        return PreparedRecording(recording, tuple(parts))


@dataclass(frozen=True, eq=False, repr=False)
class PreparedData(Frozen):
    """Recordings prepared for one choice of bands.

    Attributes
    ----------
    recordings : tuple of PreparedRecording
    bands : tuple of float or None, one per joint
    """

    recordings: tuple[PreparedRecording, ...]
    bands: tuple[float | None, ...]
    _motions: list[Trajectories] = field(default_factory=list, repr=False)
    _periods: list[tuple[Periods | None, ...]] = field(default_factory=list, repr=False)
    _part_of: tuple[PreparedData, tuple[int, ...]] | None = field(default=None, repr=False)

    @property
    def motions(self) -> Trajectories:
        """Which recordings have the same motion, computed once for all bands; for a part, as in the whole."""
        if self._part_of is not None:
            return self._part_of[0].motions.of(self._part_of[1])
        self._motions[:] = self._motions or [trajectories_of([item.longest.stretch for item in self.recordings])]
        return self._motions[0]

    @property
    def periods(self) -> tuple[Periods | None, ...]:
        """Where each recording repeats its own motion, None if it does not; computed once for all bands."""
        if self._part_of is not None:
            whole, places = self._part_of
            return tuple(whole.periods[k] for k in places)
        stretches = [item.longest.stretch for item in self.recordings]
        self._periods[:] = self._periods or [tuple(side_by_side(periods_of, stretches))]
        return self._periods[0]

    @property
    def labels(self) -> tuple[str, ...]:
        """Trajectory of each recording: the same for repetitions of one motion."""
        return self.motions.labels

    @property
    def trajectories(self) -> tuple[str, ...]:
        """Trajectories in the order in which they come."""
        return tuple(dict.fromkeys(self.labels))

    @property
    def sources(self) -> tuple[Recording, ...]:
        """The recordings as they were read."""
        return tuple(item.recording for item in self.recordings)

    @property
    def stretches(self) -> tuple[PreparedStretch, ...]:
        """All stretches, recording by recording."""
        return tuple(part for item in self.recordings for part in item.stretches)

    def at(self, bands: Bands) -> PreparedData:
        """Return the recordings in other bands; results that do not depend on the bands are shared."""
        return replace(self, recordings=tuple(item.at(bands) for item in self.recordings), bands=tuple(bands))

    def of(self, places: Sequence[int]) -> PreparedData:
        """Return some of the recordings."""
        return PreparedData(tuple(self.recordings[k] for k in places), self.bands, _part_of=(self, tuple(places)))


def prepare(recordings: Sequence[Recording], bands: Bands = ()) -> PreparedData:
    """Cut recordings at their gaps and prepare them for a choice of bands.

    Parameters
    ----------
    recordings : sequence of Recording
    bands : sequence of float or None, one per joint, optional
        Low-pass of both sides of each joint's equation, Hz; default: not filtered.

    Returns
    -------
    PreparedData

    Raises
    ------
    UsageError
        If there is not one band for each joint, or a band is not positive.
    RecordingError
        If a recording has no stretch that is long enough.
    """
    made = []
    for recording in recordings:
        chosen = tuple(bands) or (None,) * len(recording.joints)
        _check_bands(chosen, recording.joints)
        made.append(PreparedRecording(recording, tuple(PreparedStretch(part, chosen) for part in stretches(recording))))
    return PreparedData(tuple(made), made[0].bands if made else tuple(bands))


def _check_bands(bands: Bands, joints: Sequence[str]) -> None:
    if len(bands) != len(joints):
        raise UsageError(f"bands: {len(bands)} given; expected one for each of {', '.join(joints)}")
    for joint, band in zip(joints, bands, strict=True):
        if band is not None and not (isinstance(band, Real) and 0.0 < band < np.inf):
            raise UsageError(f"band of {joint} is {band!r}; expected a frequency above 0 in Hz, or None")
