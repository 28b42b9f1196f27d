"""A few samples of recordings on which hundreds of readings of the channels are compared within seconds."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.estimation.observations import Observations
from scara_ident.identification.channel_reading import JointReading, Reading, Signal, offsets, signs
from scara_ident.model.model import TorqueModel
from scara_ident.motion.low_pass import low_pass
from scara_ident.motion.motion import Motion
from scara_ident.motion.prepared import PreparedStretch
from scara_ident.threads import side_by_side

# Samples that readings are compared by, as many times as there are parameters.
SAMPLES = 6
# What a fade leaves where it takes nothing, and periods of the band that the low-pass remembers.
WHOLE, MEMORY = 0.999, 1.0
# Rounds in which joints are weighed by what is left of each.
ROUNDS = 3
# Share of a column's square that keeps undetermined ones from growing.
HELD = 1e-9
# Share of a joint's torque that counts as none left.
MIN_NOISE_SHARE = 1e-6


@dataclass(frozen=True, eq=False)
class FewRows:
    """Samples of recordings spread over their time, each joint's torque within its band.

    Attributes
    ----------
    model : TorqueModel
    q, v, a, torque : ndarray, shape (n, N)
    weight : ndarray, shape (n, N)
        1 where a joint moves, else 0.
    """

    model: TorqueModel
    q: Array
    v: Array
    a: Array
    torque: Array
    weight: Array
    _left: dict[Reading, Array] = field(default_factory=dict, repr=False)

    def left(self, reading: Reading) -> Array:
        """Return what a reading leaves of each joint's torque, as a share of it, shape (n,), NaN without samples.

        The fit weighs each joint by what is left of it.
        """
        if reading not in self._left:
            motions = tuple(JointReading(1, own.position, own.quarters) for own in reading)
            self._fit(motions, [reading])
        return self._left[reading]

    def exchanged(self, signal: Signal, joints: tuple[int, int]) -> FewRows:
        """Return the samples with a signal of two joints exchanged."""
        order = np.arange(len(self.q))
        order[list(joints)] = joints[::-1]
        motion = order if "position" in signal else slice(None)
        torque = self.torque[order] if "effort" in signal else self.torque
        return FewRows(self.model, self.q[motion], self.v[motion], self.a[motion], torque, self.weight)

    def leave(self, readings: list[Reading]) -> None:
        """Find what `left` will be asked for; those that differ by their efforts alone share their columns."""
        alike: dict[Reading, list[Reading]] = {}
        for reading in readings:
            if reading not in self._left:
                motions = tuple(JointReading(1, own.position, own.quarters) for own in reading)
                alike.setdefault(motions, []).append(reading)
        side_by_side(self._fit, alike.keys(), alike.values())

    def _fit(self, motions: Reading, readings: list[Reading]) -> None:
        products, along, power = self._products(motions)
        for reading in readings:
            effort, _ = signs(reading)
            self._left[reading] = _left(products, effort[:, None] * along, power)

    def _products(self, motions: Reading) -> tuple[Array, Array, Array]:
        """Return of each joint its columns by each other, (n, p, p), by its torque, (n, p), and that by itself, (n,)."""
        _, position = signs(motions)
        sign, shift = position[:, None], offsets(motions)[:, None]
        count = self.q.shape[1]
        motion = Motion("", "", np.arange(float(count)), sign * self.q + shift, sign * self.v, sign * self.a, None, 1.0)
        columns = self.model.joint_columns(motion)
        p = len(self.model.columns)
        products, along = np.zeros((len(columns), p, p)), np.zeros((len(columns), p))
        for j, (own, rows) in enumerate(zip(self.model.active, columns, strict=True)):
            weighted = rows * self.weight[j]
            products[j][np.ix_(own, own)] = weighted @ weighted.T
            along[j, own] = weighted @ self.torque[j]
        return products, along, np.sum(self.weight * self.torque**2, axis=1)


def _left(products: Array, along: Array, power: Array) -> Array:
    known = power > 0.0
    left = np.full(len(power), np.nan)
    left[known] = 1.0
    for _ in range(ROUNDS):
        weight = np.zeros(len(power))
        weight[known] = 1.0 / (power[known] * np.maximum(left[known], MIN_NOISE_SHARE) ** 2)
        whole = np.tensordot(weight, products, 1)
        size = np.sqrt(np.diag(whole))
        scale = 1.0 / np.where(size > 0.0, size, 1.0)
        scaled = whole * np.outer(scale, scale)
        np.fill_diagonal(scaled, 1.0 + HELD)
        value = scale * np.linalg.solve(scaled, scale * (weight @ along))
        by_value = products @ value
        squares = power - 2.0 * along @ value + by_value @ value
        left[known] = np.sqrt(np.maximum(squares[known] / power[known], MIN_NOISE_SHARE**2))
    return left


def few_rows(observations: Observations, *, widest: bool = False) -> FewRows:
    """Take samples evenly over all recordings, within the narrowest band of all joints or the widest: one for all."""
    parts = [part for part in observations.data.stretches if part.usable]
    wanted = SAMPLES * observations.parameters
    inside = sum(part.samples - 2 * part.trim for part in parts)
    step = max(1, inside // wanted)
    taken: list[list[Array]] = []
    chosen = max if widest else min
    band = chosen((own for own in observations.data.bands if own is not None), default=None)
    for part in parts:
        at = np.arange(part.trim, part.samples - part.trim, step)
        motion, moves = part.motion, part.used & _away_from_turns(part, band)
        # Noise of accelerations is taken off as by the filter of the columns, which are not filtered.
        signals = (low_pass(own, part.rate, band) for own in (motion.q, motion.v, motion.a, part.torque))
        taken.append([*(own[:, at] for own in signals), moves[:, at].astype(float)])
    q, v, a, torque, weight = (np.concatenate(each, axis=1) for each in zip(*taken, strict=True))
    return FewRows(observations.model, q, v, a, torque, weight)


def _away_from_turns(part: PreparedStretch, band: float | None) -> NDArray[np.bool_]:
    """Tell where a low-pass sees nothing of a joint's rest or of its turning round, shape (n, N): friction jumps there."""
    memory = 0 if band is None else int(np.ceil(MEMORY * part.rate / band))
    turns = np.diff(np.sign(part.motion.v), axis=1, append=0.0) != 0.0
    seen = np.cumsum(np.pad((part.moving < WHOLE) | turns, [(0, 0), (memory + 1, memory)]), axis=1)
    return np.asarray(seen[:, 2 * memory + 1 :] == seen[:, : part.samples])
