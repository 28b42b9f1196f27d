"""Recursive identification beside a controller, in square-root form, sample by sample or in blocks.

Samples are gathered into short blocks, and each block is absorbed by one orthogonal reduction: exactly what sample after
sample would give, for a tenth of the time. Innovations of a block feed the detector before the block is absorbed.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from scara_ident.arrays import Array
from scara_ident.errors import UsageError
from scara_ident.estimation.information import triangular
from scara_ident.files import write_whole
from scara_ident.model.model import TorqueModel
from scara_ident.motion.motion import Motion
from scara_ident.online.detector import Averages, threshold
from scara_ident.online.state import Forgetting, Memory
from scara_ident.online.suspects import Suspects, suspects_of
from scara_ident.threads import one_blas_thread

# A joint slower than this share of its velocity limit counts as at rest, where friction is unknown.
REST_SHARE = 3e-3
SIGNALS = ("position", "velocity", "acceleration", "effort")
# Samples that the size of the noise is averaged over.
NOISE_SAMPLES = 1e6
# The given noise counts as this many samples, so that the first ones do not decide.
GIVEN_SAMPLES = 1e3


@dataclass(frozen=True)
class OnlineSettings:
    """How an online identification works.

    Attributes
    ----------
    rate : float
        Samples per second.
    block : int
        Samples absorbed together; a change is looked for after each block.
    forgetting : {"directional", "exponential", "none"}
        See `Memory.forgotten`.
    memory : float
        s after which what is old weighs 1/e, while the motion excites.
    dependent : float
        Samples that one independent sample stands for: 1 for white noise; of noise that passed a filter ``rate / (2 b)`` with
        its noise bandwidth b, which is the integral of its squared gain over frequency, Hz: of a Butterworth filter of order n at B Hz
        ``B x / sin(x)`` with ``x = pi / (2 n)``, of one of order 2 run both ways 0.83 B.
    false_alarms : float
        Of the detector, per hour of motion.
    window : float
        s that the detector averages over.
    renewal : float
        Weight of what is known once an alarm was raised, so that parameters follow what changed.
    """

    rate: float = 1000.0
    block: int = 64
    forgetting: Forgetting = "directional"
    memory: float = 600.0
    dependent: float = 1.0
    false_alarms: float = 0.01
    window: float = 0.5
    renewal: float = 0.01

    def __post_init__(self) -> None:
        for name in ("rate", "block", "memory", "dependent", "false_alarms", "window"):
            if not getattr(self, name) > 0:
                raise UsageError(f"online: {name} is {getattr(self, name)}; expected a positive number")
        if self.block != int(self.block):
            raise UsageError(f"online: block is {self.block}; expected a whole number of samples")
        if self.forgetting not in ("directional", "exponential", "none"):
            raise UsageError(f"online: forgetting is {self.forgetting!r}; expected directional, exponential or none")
        if not 0.0 < self.renewal <= 1.0:
            raise UsageError(f"online: renewal is {self.renewal}; expected a weight above 0 and up to 1")

    @property
    def share(self) -> float:
        """Weight of a new block in the detector's averages."""
        return min(1.0, self.block / (self.rate * self.window))

    @property
    def blocks_between(self) -> float:
        """Blocks between false alarms on average."""
        return 3600.0 * self.rate / (self.block * self.false_alarms)


@dataclass(frozen=True)
class Alarm:
    """Something changed.

    Attributes
    ----------
    sample : int
        Samples taken in when it was seen; it is told a window later, when more is known of what it is.
    effect : str
        The likeliest: ``friction``, ``torque_scale`` or ``payload_change``.
    joint : str or None
    size : float
        How large it would be alone, averaged over the detector's window: less than the whole.
    unit : str
        "1" for a share.
    strength : float
        Square of the averaged score's length over the threshold.
    """

    sample: int
    effect: str
    joint: str | None
    size: float
    unit: str
    strength: float


@dataclass(eq=False)
class OnlineIdentifier:
    """Identification beside a running controller.

    Parameters
    ----------
    model : TorqueModel
    noise : array_like, shape (n,)
        Standard deviation of one sample of each joint's torque, as `wls` weighs by; a common factor is estimated.
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
        self._keep = float(np.exp(-self.settings.block / (self.settings.rate * self.settings.memory)))
        self._memory = Memory.empty(len(self.model.columns))
        self._averages = Averages.none(self._causes)
        self._squares = self._counted = GIVEN_SAMPLES
        self._buffer = np.zeros((self.settings.block, 4, joints))
        self._filled = self._samples = self._seen = 0

    def update(self, q: ArrayLike, v: ArrayLike, a: ArrayLike, effort: ArrayLike) -> Alarm | None:
        """Take in one sample.

        Parameters
        ----------
        q, v, a : array_like, shape (n,)
            Position, velocity and acceleration, in the order of the robot's joints; what is not measured is filtered
            as the torque is.
        effort : array_like, shape (n,)
            Torque on the recorded side. A sample with a number that is not finite is lost, and its time counts.

        Returns
        -------
        Alarm or None
            Where a change is told with this sample.

        Raises
        ------
        UsageError
            If the shapes are not these.
        """
        row = self._buffer[self._filled]
        for place, signal in enumerate((q, v, a, effort)):
            if np.shape(signal) != row.shape[1:]:
                raise UsageError(f"online: {SIGNALS[place]} of shape {np.shape(signal)}; expected {row.shape[1:]}")
            row[place] = signal
        if not np.isfinite(row).all():
            self._samples += 1
            return None
        self._filled += 1
        return self._absorb() if self._filled == len(self._buffer) else None

    def update_block(self, q: Array, v: Array, a: Array, effort: Array) -> list[Alarm]:
        """Take in many samples, shape (n, N) each; the result is that of one after the other, bit for bit.

        Raises
        ------
        UsageError
            If the shapes are not these.
        """
        found: list[Alarm] = []
        shapes = {np.shape(signal) for signal in (q, v, a, effort)}
        if len(shapes) > 1 or len(shape := next(iter(shapes))) != 2 or shape[0] != self.model.robot.n:
            told = ", ".join(map(str, sorted(shapes)))
            raise UsageError(f"online: signals of shapes {told}; expected ({self.model.robot.n}, N) of each")
        signals = np.array([q, v, a, effort], dtype=float)
        finite = np.isfinite(signals).all(axis=(0, 1))
        if not finite.all():
            signals = signals[:, :, finite]
            self._samples += int(np.count_nonzero(~finite))
        start, count = 0, signals.shape[2]
        while start < count:
            size = min(count - start, len(self._buffer) - self._filled)
            self._buffer[self._filled : self._filled + size] = signals[:, :, start : start + size].transpose(2, 0, 1)
            self._filled += size
            start += size
            if self._filled == len(self._buffer) and (alarm := self._absorb()) is not None:
                found.append(alarm)
        return found

    @property
    def samples(self) -> int:
        """Samples taken in."""
        return self._samples + self._filled

    @property
    def determined(self) -> bool:
        """Whether every parameter is known."""
        return self._now().determined

    @property
    def value(self) -> Array:
        """The parameters with all samples so far, shape (p,); NaN as long as one of them is undetermined."""
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
            "sums": np.array([self._squares, self._counted]),
            "counts": np.array([self._filled, self._samples, self._seen]),
            "buffer": self._buffer,
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
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise UsageError(f"{path}: no state of an online identification ({type(error).__name__})") from None
        if names != model.names:
            raise UsageError(f"{path}: the state of a model with {', '.join(names[:3])}, ...; give that model")
        found = cls(model, state["noise"], settings)
        found._memory = Memory(state["factor"])
        found._averages = Averages(state["vector"], state["scores"], state["information"])
        found._squares, found._counted = (float(x) for x in state["sums"])
        found._filled, found._samples, found._seen = (int(x) for x in state["counts"])
        found._buffer[:] = state["buffer"]
        return found

    @property
    def _scale(self) -> float:
        """Variance of the noise, in units of what was given."""
        return self._squares / self._counted

    def _now(self) -> Memory:
        """Return the memory with what has not been absorbed yet."""
        if not self._filled:
            return self._memory
        with one_blas_thread():
            return self._memory.absorbed(np.concatenate(self._rows()[0]))

    def _rows(self) -> tuple[list[Array], int]:
        """Return the triangular factors of the rows ``[W | u]`` of each joint in units of its noise, and their number.

        Samples at rest count for nothing.
        """
        q, v, a, effort = np.ascontiguousarray(self._buffer[: self._filled].transpose(1, 2, 0))
        motion = Motion("online", "online", np.arange(float(self._filled)), q, v, a, None, self.settings.rate)
        tables = [np.empty((len(own) + 1, self._filled)) for own in self.model.active]
        self.model.joint_columns(motion, [table[:-1] for table in tables])
        rows, moving, parameters = [], 0, len(self.model.columns)
        for j, (own, table) in enumerate(zip(self.model.active, tables, strict=True)):
            moves = np.abs(v[j]) > self._rest[j]
            moving += int(np.count_nonzero(moves))
            table[-1] = effort[j]
            table *= np.where(moves, self._weight[j], 0.0)
            factor = triangular(table.T)
            wide = np.zeros((len(factor), parameters + 1))
            wide[:, own], wide[:, -1] = factor[:, :-1], factor[:, -1]
            rows.append(wide)
        return rows, moving

    def _absorb(self) -> Alarm | None:
        try:
            with one_blas_thread():
                each, moving = self._rows()
                rows = np.concatenate(each)
                old = self._memory.forgotten(self._keep, rows, self.settings.forgetting)
                new = old.absorbed(rows)
                alarm = self._innovated(old, new, each, moving) if moving and old.determined else None
        finally:
            # Of a block that cannot be absorbed the next ones know nothing.
            self._samples += self._filled
            self._filled = 0
        self._memory = new
        if alarm is not None:
            self.forget(self.settings.renewal)
        return alarm

    def _innovated(self, old: Memory, new: Memory, each: Sequence[Array], moving: int) -> Alarm | None:
        """Take the innovations of a block into the noise and the averages, and look for a change."""
        value = old.value()
        parts = [rows[:, :-1] for rows in each]
        columns, torque = np.concatenate(parts), np.concatenate([rows[:, -1] for rows in each])
        left = np.column_stack([torque - columns @ value, self._suspects.torques(parts, value)])
        # With V = 1 + A P A', x' V^-1 y = x' y - (A' x)' (P^-1 + A' A)^-1 (A' y), and the sum is the new memory's square.
        known = new.solved(left.T @ columns)
        products = left.T @ left - known.T @ known
        scale = self._scale
        fade = max(0.0, 1.0 - moving / NOISE_SAMPLES)
        self._squares = fade * self._squares + float(products[0, 0])
        self._counted = fade * self._counted + moving / self.settings.dependent
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
