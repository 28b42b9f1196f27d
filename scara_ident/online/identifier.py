"""Recursive identification beside a controller, in square-root form, sample by sample or in blocks.

Samples are gathered into short blocks, and each block is absorbed by one orthogonal reduction: exactly what sample after
sample would give, for a tenth of the time. Innovations of a block feed the detector before the block is absorbed.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Sequence
from dataclasses import asdict, astuple, dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from scara_ident.arrays import Array, runs_of
from scara_ident.errors import UsageError
from scara_ident.estimation.information import triangular
from scara_ident.files import write_whole
from scara_ident.model.model import TorqueModel
from scara_ident.online.detector import Alarm, Averages, threshold
from scara_ident.online.filtered import RowFilter
from scara_ident.online.noise import (
    GIVEN_ROWS,
    GIVEN_SAMPLES,
    PositionNoise,
    TorqueNoise,
    inertia_at,
    too_wide,
)
from scara_ident.online.sampled import rows_of_samples
from scara_ident.online.settings import OnlineSettings
from scara_ident.online.state import Memory
from scara_ident.online.suspects import Suspects, suspects_of
from scara_ident.progress import log_notes
from scara_ident.threads import one_blas_thread

_LOG = logging.getLogger(__name__)
# A joint slower than this share of its velocity limit counts as at rest, where friction is unknown.
REST_SHARE = 3e-3


@dataclass(eq=False)
class OnlineIdentifier:
    """Identification beside a running controller.

    Parameters
    ----------
    model : TorqueModel
    noise : array_like, shape (n,)
        Standard deviation of one sample of each joint's torque, as `wls` weighs by; a common factor is estimated. With a band that
        of white noise which is as strong within it, and a factor is estimated for each joint.
    settings : OnlineSettings, optional

    Examples
    --------
    >>> import numpy as np
    >>> from scara_ident import build_model, load_robot
    >>> model = build_model(load_robot())
    >>> online = OnlineIdentifier(model, [0.04, 0.01])
    >>> online.update(np.zeros(2), np.zeros(2), np.zeros(2), np.zeros(2)) is None
    True
    """

    model: TorqueModel
    noise: ArrayLike
    settings: OnlineSettings = field(default_factory=OnlineSettings)

    def __post_init__(self) -> None:
        joints = self.model.robot.n
        sigma = np.asarray(self.noise, dtype=float)
        if sigma.shape != (joints,) or not np.all(sigma > 0.0) or not np.all(np.isfinite(sigma)):
            raise UsageError(f"online: noise is {sigma}; expected a positive number for each of {joints} joints")
        self._weight = 1.0 / (sigma * np.sqrt(self.settings.dependent))
        self._rest = REST_SHARE * np.where(
            np.isfinite(self.model.robot.velocity_limit), self.model.robot.velocity_limit, 1.0
        )
        self._suspects: Suspects = suspects_of(self.model)
        self._causes = len(self._suspects.names)
        self._limit = threshold(self._causes, self.settings.share, self.settings.blocks_between)
        self._filter = self.settings.row_filter
        self._memory = Memory.empty(len(self.model.columns))
        self._averages = Averages.none(self._causes)
        given = (1, GIVEN_SAMPLES) if self._filter is None else (joints, GIVEN_ROWS)
        self._noise = TorqueNoise.given(*given)
        # Raw samples, or a block with nothing to filter.
        shape = (int(self.settings.block), 4) if self._filter is None else (self._filter.window, 2)
        self._buffer = np.zeros((*shape, joints))
        self._position_noise = PositionNoise.none(joints)
        self._filled = self._samples = self._seen = self._lost = self._logged = 0

    def update(self, q: ArrayLike, v: ArrayLike | None, a: ArrayLike | None, effort: ArrayLike) -> Alarm | None:
        """Take in one sample.

        Parameters
        ----------
        q, v, a : array_like, shape (n,)
            Position, velocity and acceleration, in the order of the robot's joints. With a band the position is raw, and velocity
            and acceleration are None: they are made of it.
        effort : array_like, shape (n,)
            Torque on the recorded side, raw with a band. A sample with a number that is not finite is lost, and its time counts.

        Returns
        -------
        Alarm or None
            Where a change is reported with this sample.

        Raises
        ------
        UsageError
            If the shapes are not these, or velocity or acceleration are given with a band or are missing without one.
        """
        row = self._buffer[self._filled]
        for place, (name, signal) in enumerate(self._given(q, v, a, effort)):
            if np.shape(signal) != row.shape[1:]:
                raise UsageError(f"online: {name} of shape {np.shape(signal)}; expected {row.shape[1:]}")
            row[place] = signal
        if not self._lost and np.isfinite(row).all():
            self._filled += 1
            return self._absorb() if self._filled == len(self._buffer) else None
        found = self._take(row[None].copy())
        return found[0] if found else None

    def update_block(self, q: Array, v: Array | None, a: Array | None, effort: Array) -> list[Alarm]:
        """Take in many samples, shape (n, N) each; the result is that of one after the other, bit for bit.

        Raises
        ------
        UsageError
            If the shapes are not these, or velocity or acceleration are given with a band or are missing without one.
        """
        given = [signal for _, signal in self._given(q, v, a, effort)]
        shapes = {np.shape(signal) for signal in given}
        if len(shapes) > 1 or len(shape := next(iter(shapes))) != 2 or shape[0] != self.model.robot.n:
            shapes_given = ", ".join(map(str, sorted(shapes)))
            raise UsageError(f"online: signals of shapes {shapes_given}; expected ({self.model.robot.n}, N) of each")
        return self._take(np.array(given, dtype=float).transpose(2, 0, 1))

    def gap(self) -> None:
        """Say that the next sample does not follow the last one, as after a pause: with a band the filter begins anew."""
        if self._filter is not None:
            self._samples += self._filled + self._lost
            self._filled = self._lost = 0

    @property
    def samples(self) -> int:
        """Samples taken in."""
        return self._samples + self._filled + self._lost

    @property
    def determined(self) -> bool:
        """Whether every parameter is known."""
        return self._now().determined

    @property
    def value(self) -> Array:
        """The parameters with all samples so far, with a band all whole blocks, shape (p,); NaN as long as one is undetermined."""
        now = self._now()
        return now.value() if now.determined else np.full(now.parameters, np.nan)

    @property
    def covariance(self) -> Array:
        """Their covariance, shape (p, p); infinite as long as one of them is undetermined."""
        now = self._now()
        if not now.determined:
            return np.full((now.parameters, now.parameters), np.inf)
        half = np.linalg.inv(now.factor[:, :-1])
        return np.asarray(self._scale * (half @ half.T))

    @property
    def std(self) -> Array:
        """Standard deviation of each parameter, shape (p,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def notes(self) -> tuple[str, ...]:
        """What of the settings does not go with what was taken in so far; the first time it is logged as a warning too."""
        band, joints = self.settings.band, self.model.robot.joints
        if band is None:
            return ()
        seen, rows = self._noise.seen(GIVEN_ROWS), self._noise.counted - GIVEN_ROWS
        said = too_wide(self._position_noise.in_rows, seen, rows, band, joints)
        return () if said is None else (said,)

    def forget(self, share: float) -> None:
        """Let all that is known weigh only a share, as when a part was exchanged.

        Raises
        ------
        UsageError
            If the share is not above 0 and up to 1.
        """
        if not 0.0 < share <= 1.0:
            raise UsageError(f"online: a share of {share}; expected one above 0 and up to 1")
        self._memory = self._memory.forgotten(share, np.zeros((0, self._memory.parameters + 1)), "exponential")
        self._averages = Averages.none(self._causes)

    def save(self, path: Path) -> None:
        """Write the state to a file, whole or not at all; `restore` goes on from it bit for bit."""
        state = {
            "factor": self._memory.factor,
            "vector": self._averages.vector,
            "scores": self._averages.scores,
            "information": self._averages.information,
            "torque_noise": np.array([self._noise.squares, self._noise.counted]),
            "position_noise": np.array(astuple(self._position_noise)),
            "counts": np.array([self._filled, self._samples, self._seen, self._lost, self._logged]),
            "buffer": self._buffer[: self._filled],
            "noise": np.asarray(self.noise, dtype=float),
            "settings": np.array(json.dumps(asdict(self.settings))),
            "names": np.array(self.model.names),
        }

        def write(place: Path) -> None:
            with place.open("wb") as file:
                np.savez(file, allow_pickle=False, **state)

        write_whole(Path(path), write)

    @classmethod
    def restore(cls, path: Path, model: TorqueModel) -> OnlineIdentifier:
        """Go on from a saved state.

        Raises
        ------
        UsageError
            If the file is none, or of another model.
        """
        try:
            with np.load(path, allow_pickle=False) as held:
                state = dict(held)
            names, settings = tuple(state["names"].tolist()), OnlineSettings(**json.loads(str(state["settings"])))
            noise = TorqueNoise(*state["torque_noise"]), PositionNoise(*state["position_noise"])
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise UsageError(f"{path}: no state of an online identification ({type(error).__name__})") from None
        if names != model.names:
            raise UsageError(f"{path}: the state of a model with {', '.join(names[:3])}, ...; give that model")
        found = cls(model, state["noise"], settings)
        found._memory = Memory(state["factor"])
        found._averages = Averages(state["vector"], state["scores"], state["information"])
        found._noise, found._position_noise = noise
        found._filled, found._samples, found._seen, found._lost, found._logged = (int(x) for x in state["counts"])
        found._buffer[: found._filled] = state["buffer"]
        return found

    @property
    def _scale(self) -> float:
        """Variance of the noise of rows, in units of what they were divided by."""
        return float(self._noise.scale[0]) if self._filter is None else 1.0

    def _now(self) -> Memory:
        """Return the memory with what has not been absorbed yet."""
        if self._filter is not None or not self._filled:
            return self._memory
        with one_blas_thread():
            return self._memory.absorbed(np.concatenate(self._rows()[0]))

    def _rows(self) -> tuple[list[Array], Array]:
        """Return the triangular factors of the rows ``[W | u]`` of each joint in units of its noise, and their numbers, (n,).

        Samples at rest count for nothing.
        """
        if self._filter is None:
            signals, rate = self._buffer[: self._filled], self.settings.rate
            tables, moving = rows_of_samples(self.model, signals, self._rest, self._weight, rate)
        else:
            tables, moving = self._filtered(self._filter)
        rows, parameters = [], len(self.model.columns)
        for own, table in zip(self.model.active, tables, strict=True):
            factor = triangular(table)
            wide = np.zeros((len(factor), parameters + 1))
            wide[:, own], wide[:, -1] = factor[:, :-1], factor[:, -1]
            rows.append(wide)
        return rows, moving

    def _filtered(self, way: RowFilter) -> tuple[list[Array], Array]:
        """Return each joint's rows that a filter makes, shape (N, k + 1), and their numbers."""
        window = np.ascontiguousarray(self._buffer.transpose(1, 2, 0))
        motion = way.motion(window)
        self._position_noise = self._position_noise.after(window, motion, self._rest, way)
        moving = way.moving(motion, np.maximum(self._rest, self._position_noise.rest(way)))
        rows = way.rows(self.model, motion, moving, self._weight / np.sqrt(self._noise.scale))
        return rows, np.array([len(own) for own in rows])

    def _given(
        self, q: ArrayLike, v: ArrayLike | None, a: ArrayLike | None, effort: ArrayLike
    ) -> list[tuple[str, ArrayLike]]:
        """Return the signals that are taken in, with their names."""
        if self._filter is None:
            if v is None or a is None:
                raise UsageError(
                    "online: velocity or acceleration is None, and without a band they cannot be computed from positions; give both, or a band"
                )
            return [("position", q), ("velocity", v), ("acceleration", a), ("effort", effort)]
        for name, signal in (("velocity", v), ("acceleration", a)):
            if signal is not None:
                raise UsageError(f"online: {name} is given, but with a band it is computed from positions; give None")
        return [("position", q), ("effort", effort)]

    def _take(self, samples: Array) -> list[Alarm]:
        """Take in samples, shape (N, signals, n), of which some may be lost."""
        finite = np.all(np.isfinite(samples), axis=(1, 2))
        if finite.all() and not self._lost:
            return self._push(samples)
        found, done = [], 0
        for start, stop in runs_of(finite):
            self._lost += start - done
            found += self._bridge(samples[start]) + self._push(samples[start:stop])
            done = stop
        self._lost += len(samples) - done
        return found

    def _bridge(self, sample: Array) -> list[Alarm]:
        """Put a straight line up to a sample, shape (signals, n), in the place of few lost ones before it, if a filter needs it."""
        lost = self._lost
        if self._filter is None:
            self._samples, self._lost = self._samples + lost, 0
        elif not self._filled or lost > self._filter.bridged:
            self.gap()
        elif lost:
            last, share = self._buffer[self._filled - 1], np.arange(1, lost + 1) / (lost + 1)
            self._lost = 0
            return self._push(last + share[:, None, None] * (sample - last))
        return []

    def _push(self, samples: Array) -> list[Alarm]:
        """Take in samples, shape (N, signals, n)."""
        found, start = [], 0
        while start < len(samples):
            size = min(len(samples) - start, len(self._buffer) - self._filled)
            self._buffer[self._filled : self._filled + size] = samples[start : start + size]
            self._filled += size
            start += size
            if self._filled == len(self._buffer) and (alarm := self._absorb()) is not None:
                found.append(alarm)
        return found

    def _absorb(self) -> Alarm | None:
        kept = 0
        try:
            with one_blas_thread():
                each, moving = self._rows()
                rows = np.concatenate(each)
                old = self._memory.forgotten(self.settings.keep, rows, self.settings.forgetting)
                new = old.absorbed(rows)
                alarm = self._innovated(old, new, each, moving) if moving.any() and old.determined else None
            # What the next block needs too.
            kept = len(self._buffer) - self.settings.new
            self._buffer[:kept] = self._buffer[self.settings.new :].copy()
        finally:
            # Of a block that cannot be absorbed the next ones know nothing.
            self._samples += self._filled - kept
            self._filled = kept
        self._memory = new
        if alarm is not None:
            self.forget(self.settings.renewal)
        return alarm

    def _innovated(self, old: Memory, new: Memory, each: Sequence[Array], moving: Array) -> Alarm | None:
        """Take the innovations of a block into the noise and the averages, and look for a change."""
        value = old.value()
        parts = [rows[:, :-1] for rows in each]
        columns, torque = np.concatenate(parts), np.concatenate([rows[:, -1] for rows in each])
        left = np.column_stack([torque - columns @ value, self._suspects.torques(parts, value)])
        # With V = 1 + A P A', x' V^-1 y = x' y - (A' x)' (P^-1 + A' A)^-1 (A' y), and the sum is the new memory's square.
        known = new.solved(left.T @ columns)
        products = left.T @ left - known.T @ known
        scale = self._scale
        if self._filter is None:
            self._noise = self._noise.after(products[:1, 0], np.array([moving.sum()]), self.settings.dependent)
        else:
            # The sum over a joint's rows of e (V^-1 e): its mean is their number.
            own = left[:, 0] * (left[:, 0] - columns @ new.solved_back(known[:, 0]))
            starts = np.cumsum([0, *map(len, parts[:-1])])
            squares = np.array([np.sum(own[a:b]) for a, b in zip(starts, [*starts[1:], None], strict=True)])
            # A joint's part of that sum may be less than nothing where another joint's torque is far off, which a variance is not.
            squares = np.maximum(squares, 0.0)
            self._noise = self._noise.after(self._noise.scale * squares, moving, self.settings.dependent)
            # Before so many rows inertias may still be far off.
            counts = np.where(self._noise.counted >= 2.0 * GIVEN_ROWS, moving, 0)
            inertia = inertia_at(self.model, value, self._buffer[len(self._buffer) // 2, 0])
            self._position_noise = self._position_noise.after_rows(inertia, self._weight, counts, self._filter)
            if not self._logged and self.notes:
                self._logged = 1
                log_notes(_LOG, self.notes)
        share = self.settings.share
        self._averages = self._averages.after(products[1:, 0] / np.sqrt(scale), products[1:, 1:], share)
        strength = self._averages.length(share) / self._limit
        if not self._seen and strength > 1.0:
            self._seen = self._samples + self._filled
        # What it is, a window of it tells better than the first block.
        if not self._seen or self._samples + self._filled - self._seen < self.settings.window * self.settings.rate:
            return None
        place, sizes = self._averages.likeliest()
        effect, joint, unit = self._suspects.names[place]
        size = float(sizes[place] * np.sqrt(scale))
        seen, self._seen = self._seen, 0
        return Alarm(seen, effect, joint, size, unit, strength)
