"""Many online identifications of one motion in step with each other, each with noise of its own, to count false alarms.

What `scara_ident.online.OnlineIdentifier` does block by block, in stacked arrays: at a block of 50 samples of two joints calling
NumPy takes it ten times as long as the arithmetic. `benchmarks/online.py` compares both before it counts.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from scara_ident.arrays import Array
from scara_ident.estimation.information import triangular
from scara_ident.model.model import TorqueModel
from scara_ident.motion.motion import Motion
from scara_ident.online import OnlineSettings
from scara_ident.online.detector import DETERMINED, threshold
from scara_ident.online.identifier import REST_SHARE
from scara_ident.online.noise import GIVEN_SAMPLES, NOISE_SAMPLES
from scara_ident.online.state import Memory
from scara_ident.online.suspects import suspects_of


@dataclass(frozen=True, eq=False)
class Block:
    """A block of the motion: the torque in noise's units is reduced to what the columns see of it and what they do not.

    Attributes
    ----------
    moves : ndarray, shape (n, B)
        1 where a joint moves, 0 where it is at rest.
    turns, factors : tuple of ndarray, shape (k, B) and (k, p)
        Of each joint's rows, in noise's units: Q' and R.
    told : ndarray, shape (r, p)
        Triangular factor of all of them.
    """

    moves: Array
    turns: tuple[Array, ...]
    factors: tuple[Array, ...]
    told: Array


def blocks_of(model: TorqueModel, sigma: Array, motion: Motion, size: int) -> list[Block]:
    """Return the blocks of a motion."""
    found, p = [], len(model.columns)
    columns, limit = model.joint_columns(motion), model.robot.velocity_limit
    moves = (np.abs(motion.v) > REST_SHARE * np.where(np.isfinite(limit), limit, 1.0)[:, None]).astype(float)
    for start in range(0, motion.samples, size):
        turns, factors = [], []
        some = moves[:, start : start + size]
        for own, rows, noise, mask in zip(model.active, columns, sigma, some, strict=True):
            turn, factor = np.linalg.qr((rows[:, start : start + size] * mask / noise).T)
            wide = np.zeros((len(factor), p))
            wide[:, own] = factor
            turns.append(turn.T)
            factors.append(wide)
        found.append(Block(some, tuple(turns), tuple(factors), triangular(np.concatenate(factors))))
    return found


@dataclass(eq=False)
class Lanes:
    """The state of L identifications with directional forgetting and white noise.

    Attributes
    ----------
    lanes : int
    alarms : list of (int, int)
        Block and lane of each.
    """

    model: TorqueModel
    settings: OnlineSettings
    lanes: int
    alarms: list[tuple[int, int]] = field(default_factory=list)

    def __post_init__(self) -> None:
        p = len(self.model.columns)
        self._suspects = suspects_of(self.model)
        c = len(self._suspects.names)
        self._limit = threshold(c, self.settings.share, self.settings.blocks_between)
        self._keep = float(np.exp(-self.settings.block / (self.settings.rate * self.settings.memory)))
        self.factor = np.zeros((self.lanes, p, p + 1))
        self._vector = np.zeros((self.lanes, c))
        self._squares = np.full(self.lanes, GIVEN_SAMPLES)
        self._counted, self._done = GIVEN_SAMPLES, 0
        self._seen = np.full(self.lanes, -1)

    @property
    def value(self) -> Array:
        """Parameters, shape (L, p)."""
        return np.asarray(np.linalg.solve(self.factor[:, :, :-1], self.factor[:, :, -1:])[:, :, 0])

    def absorb(self, block: Block, torque: Array) -> None:
        """Take in a block of torque, shape (L, n, B), in noise's units."""
        settings, p = self.settings, self.factor.shape[1]
        torque = torque * block.moves
        seen = [torque[:, j] @ turn.T for j, turn in enumerate(block.turns)]
        beyond = np.sum(torque**2, axis=2) - np.stack([np.sum(part**2, axis=1) for part in seen], axis=1)
        rows = np.concatenate(block.factors)
        right = np.concatenate(seen, axis=1)
        known = Memory(self.factor[0]).determined
        old = self._forgotten(block.told) if known else self.factor
        stacked = np.concatenate(
            [old, np.concatenate([np.broadcast_to(rows, (self.lanes, *rows.shape)), right[:, :, None]], axis=2)], axis=1
        )
        self.factor = np.linalg.qr(stacked, mode="r")[:, :p]
        self._done += 1
        if not known:
            return
        value = np.linalg.solve(old[:, :, :-1], old[:, :, -1:])[:, :, 0]
        left = np.empty((self.lanes, len(rows), 1 + self._vector.shape[1]))
        left[:, :, 0] = right - value @ rows.T
        left[:, :, 1:] = self._causes(block, value)
        turned = np.linalg.solve(np.swapaxes(self.factor[:, :, :-1], 1, 2), rows.T @ left)
        products = np.swapaxes(left, 1, 2) @ left - np.swapaxes(turned, 1, 2) @ turned
        products[:, 0, 0] += np.sum(beyond, axis=1)
        scale, moving = self._squares / self._counted, float(np.sum(block.moves))
        fade = max(0.0, 1.0 - moving / NOISE_SAMPLES)
        self._squares = fade * self._squares + products[:, 0, 0]
        self._counted = fade * self._counted + moving
        share = settings.share
        white = _white(products[:, 1:, 0] / np.sqrt(scale)[:, None], products[:, 1:, 1:])
        self._vector = (1.0 - share) * self._vector + share * white
        strength = np.sum(self._vector**2, axis=1) * (2.0 - share) / share / self._limit
        self._seen[(self._seen < 0) & (strength > 1.0)] = self._done
        late = self._done - self._seen >= settings.window * settings.rate / settings.block
        told = np.flatnonzero((self._seen >= 0) & late)
        self.alarms += [(self._done, int(lane)) for lane in told]
        self.factor[told] *= np.sqrt(settings.renewal)
        self._vector[told], self._seen[told] = 0.0, -1

    def _causes(self, block: Block, value: Array) -> Array:
        """Return what `scara_ident.online.suspects.Suspects.torques` does, of every lane."""
        ends = np.cumsum([0, *(len(own) for own in block.factors)])
        found = np.zeros((self.lanes, ends[-1], self._vector.shape[1]))
        for k, (joint, part) in enumerate(self._suspects.joints):
            found[:, ends[joint] : ends[joint + 1], k] = (part * value) @ block.factors[joint].T
        if np.any(self._suspects.payload):
            found[:, :, -1] = np.concatenate(block.factors) @ self._suspects.payload
        return found

    def _forgotten(self, told: Array) -> Array:
        upper = self.factor[:, :, :-1]
        each = np.swapaxes(
            np.linalg.solve(np.swapaxes(upper, 1, 2), np.broadcast_to(told.T, (self.lanes, *told.T.shape))), 1, 2
        )
        _, singular, turn = np.linalg.svd(each, full_matrices=False)
        kept = np.sqrt(np.maximum(self._keep, 1.0 - np.minimum(singular**2, 1.0)))
        less = np.swapaxes((1.0 - kept)[:, :, None] * turn, 1, 2) @ (turn @ self.factor)
        return np.asarray(np.linalg.qr(self.factor - less, mode="r"))


def _white(scores: Array, information: Array) -> Array:
    """Return what `scara_ident.online.detector.white_scores` does, of every lane."""
    size = np.sqrt(np.maximum(np.einsum("lii->li", information), np.finfo(float).tiny))
    values, vectors = np.linalg.eigh(information / (size[:, :, None] * size[:, None, :]))
    told = values > DETERMINED * np.maximum(values[:, -1:], np.finfo(float).tiny)
    root = np.where(told, 1.0 / np.sqrt(np.where(told, values, 1.0)), 0.0)
    aims = np.einsum("lij,li->lj", vectors, scores / size)
    return np.asarray(np.einsum("lij,lj->li", vectors, root * aims))
