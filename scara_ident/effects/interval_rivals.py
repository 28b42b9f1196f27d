"""Alternatives to a body that seems to act in intervals: offsets, friction, torque scale, a force on the tool.

Offsets and the force are others in each interval, for jumps and contacts are; they cost as many parameters.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from scara_ident.arrays import Array
from scara_ident.effects.last_link_cells import Cells
from scara_ident.effects.recording_groups import inverse_of, rows_of_last_link
from scara_ident.effects.signals import Scene
from scara_ident.model.regressor.kernel import configurations
from scara_ident.model.terms.friction import Friction
from scara_ident.motion.motion import Motion
from scara_ident.robot.kinematics import force_torques

# A weight that hangs from a tool that hardly turns is a constant force: one that explains less than so much more is no other.
MIN_ADVANTAGE = 0.05
# Intervals that are asked at the most, those that show the body most: their columns are as many times more.
MAX_INTERVALS = 12
# Twice a logarithm of odds: very strong evidence (Kass and Raftery 1995).
STRONG_EVIDENCE = 10.0

# Of a recording's name the intervals to ask about: number, begin and end in s since it began.
Asked = dict[str, list[tuple[int, float, float]]]


def beaten(scene: Scene, shown: Sequence[int], cells: Cells, asked: Asked, scatter: float) -> bool:
    """Return whether something else explains what happens in intervals better than a body does, or all of it.

    Parameters
    ----------
    scene : Scene
    shown : sequence of int
        Standard parameters of the body.
    cells : Cells
    asked : mapping
    scatter : float
        By how much squares lie above what independent rows of the noise would give.
    """
    n, k, count = scene.robot.n, len(shown), sum(map(len, asked.values()))
    left, spread = _normal(scene, shown, cells, asked)
    unit = np.eye(len(left))
    first = k + 2 * n + n * count
    body, rubbing, scale = unit[:k], unit[k : k + n], unit[k + n : k + 2 * n]
    offsets, forces = unit[k + 2 * n : first], unit[first:]
    # The same in all intervals, or others in each.
    offset, force = (np.sum(part.reshape(count, -1, len(left)), axis=0) for part in (offsets, forces))
    cost = float(np.log(sum(float(np.sum(item.rows)) for item in cells.each)))

    def squares(*columns: Array) -> float:
        sums = np.concatenate(columns)
        return explained(sums @ left, sums @ spread @ sums.T) / scatter

    alone = squares(body) - cost * k
    for other in (rubbing, scale, offset, offsets, force, forces):
        instead = squares(other)
        determined = int(np.count_nonzero(np.einsum("qa,ab,qb->q", other, spread, other) > 0.0))
        pressed = other is force or other is forces
        if instead - cost * determined > alone + max(STRONG_EVIDENCE, MIN_ADVANTAGE * alone if pressed else 0.0):
            return True
        if not pressed and squares(body, other) - instead < cost * k:
            return True
    return False


def explained(left: Array, spread: Array) -> float:
    """Return the squares that columns explain, by their products with what is left (q,) and with each other (q, q)."""
    return float(left @ inverse_of(spread) @ left)


def _normal(scene: Scene, shown: Sequence[int], cells: Cells, asked: Asked) -> tuple[Array, Array]:
    """Return the products of all columns with what is left (q,), and with each other (q, q), the base model taken off.

    They are those of the body, of friction and of the torque's scale of each joint, of offsets and of a force of each interval.
    """
    n, p, k, count = scene.robot.n, len(scene.value), len(shown), sum(map(len, asked.values()))
    size = k + 2 * n + (n + 3) * count
    value = cells.inverse @ cells.aim
    rubs = np.zeros(p, dtype=bool)
    for term in scene.model.terms:
        rubs[scene.model.place(term)] = isinstance(term, Friction)
    spread, across = np.zeros((size, size)), np.zeros((size, p + 1))
    for item in cells.each:
        if item.name not in asked:
            continue
        sums = np.zeros((n, size))
        for motion, columns in scene.columns.items():
            if motion.name != item.name:
                continue
            forces = _forces(scene, motion, asked[item.name])
            time, sure, rows = rows_of_last_link(scene, motion, columns, shown)
            since = time - scene.start[item.name] + 0.25 / scene.band
            for joint, (own, counts) in enumerate(zip(rows, sure, strict=True)):
                table, inside = np.zeros((size, len(time))), np.zeros(len(time), dtype=bool)
                for place, start, stop in asked[item.name]:
                    there = counts & (since >= start) & (since < stop)
                    inside |= there
                    table[k + 2 * n + place * n + joint, there] = 1.0
                    first = k + 2 * n + n * count + 3 * place
                    when, force = forces[place]
                    if len(when):
                        for a in range(3):
                            table[first + a, there] = np.interp(time[there], when, force[:, joint, a])
                table[:k] = np.where(inside, own[p:-1], 0.0)
                # The torque as it was recorded: what the base model makes of it has taken in part of the change.
                table[k + joint] = np.where(inside, value[rubs] @ own[:p][rubs], 0.0)
                table[k + n + joint] = np.where(inside, own[-1], 0.0)
                spread += cells.weights[joint] * table @ table.T
                across += cells.weights[joint] * table @ own[[*range(p), -1]].T
                sums[joint] += np.sum(table, axis=1)
        share = (cells.weights / np.maximum(item.rows, 1.0))[:, None] * sums
        spread -= share.T @ sums
        across -= share.T @ item.whole
    reach = across[:, :-1]
    return across[:, -1] - reach @ value, spread - reach @ cells.inverse @ reach.T


def _forces(scene: Scene, motion: Motion, asked: Sequence[tuple[int, float, float]]) -> dict[int, tuple[Array, Array]]:
    """Return for each interval times, and what a force on the tool makes of the torque then, shape (M, n, 3)."""
    robot, found = scene.robot, {}
    since = motion.time - scene.start[motion.name]
    step = max(1, int(0.5 * motion.rate / scene.band))
    for place, start, stop in asked:
        bins = np.flatnonzero((since >= start) & (since < stop))[::step]
        states = configurations(robot.model, motion.q[np.argsort(robot.order)][:, bins])
        found[place] = motion.time[bins], np.array(list(force_torques(robot, states.T)))
    return found
