"""A link that flies freely in the clearance of its gear, and how its flight follows from the bodies and the width.

While the torque through the gear keeps its sign, motor and link touch on one flank. When it changes its sign the link loses
contact, and both drift apart with the acceleration that the torque would have given, until the link lands on a flank
without bouncing (Nordin and Gutman, Automatica 38(10), 2002).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.effects.links import (
    MIN_INERTIA,
    behind,
    held_link_inertia,
    lagging,
    lagging_slopes,
    link_slopes,
    rigid_rows,
    shared,
    usual_link_inertia,
)
from scara_ident.effects.signals import Signals
from scara_ident.model.terms import joint_rows
from scara_ident.motion.low_pass import HIGHEST_CUT, differentiate
from scara_ident.motion.motion import Motion

# The link's lag keeps this many times the band: beyond it its second derivative is noise.
LAG_BAND = 1.5
# Samples of a flight that are looked at first.
FIRST_SAMPLES = 64

Lag = tuple[Array, Array, Array]


@dataclass(frozen=True)
class Flight:
    """A flight: its first sample and the one after its last, and its flank, 1 or -1.

    ``since`` is the share of a sample's period by which the contact was lost before the first sample.
    """

    first: int
    stop: int
    side: float
    since: float


@dataclass(frozen=True, eq=False)
class FreeLink:
    """A joint's motor and link on a stretch of motion, with clearance between them.

    Attributes
    ----------
    width : float
        rad or m at the joint.
    """

    signals: Signals
    joint: int
    width: float

    @cached_property
    def usual(self) -> float:
        """Usual inertia of the link, at the joint; not above 0 where misjudged."""
        return usual_link_inertia(self.signals.scene, self.joint)

    @cached_property
    def lag(self) -> Lag:
        """Motor less link as a share of the width, and its first two derivatives, each (N,)."""
        return self._differentiated(self._flown[0])

    @property
    def change(self) -> Array:
        """Torque of all joints per width, recorded side, shape (n, N)."""
        return lagging(self.signals, self.joint, self.lag)

    def slopes(self) -> Iterator[tuple[NDArray[np.intp], Array]]:
        """Give of each joint the derivatives of width times `change`, the width that multiplies it held, see `Effect.slopes`.

        They are by the parameters of the rigid bodies, by the armature where these do not tell it, and by the width.
        """
        scene, motion, j = self.signals.scene, self.signals.motion, self.joint
        place, flights = self._flown
        term, scale = scene.model.rigid_body, scene.robot.row_scale[j]
        own, p = np.flatnonzero(term.pattern[j]), term.pattern.shape[1]
        rotor = np.append(scene.armature_slopes(j), 1.0)
        acting = np.union1d(own, np.append(np.flatnonzero(rotor), [p + 1]))
        bodies, turning = acting[:-1], rotor[acting[:-1], None]
        at = np.searchsorted(bodies, own)
        load, inertia = -turning * motion.a[j], -turning * np.ones(motion.samples)
        load[at] += rigid_rows(self.signals)[j] / scale
        inertia[at] += self._inertia_columns
        inertia[:, self._inertia <= MIN_INERTIA * self.usual] = 0.0
        drifts = (load - self._drift * inertia) / self._inertia
        moved = np.zeros((len(acting), motion.samples))
        for flight in flights:
            flown = slice(flight.first, flight.stop)
            moved[:-1, flown] = _apart(drifts[:, flown], flight.since * self._step, self._step, from_none=False)
            moved[-1, flown] = 0.5 * flight.side - place[flown]
        x, first, second = (self.width * part for part in self.lag)
        behind_it = joint_rows(term, behind(motion, j, (x, first, second)))
        about, lags = [link_slopes(self.signals, j)], [self._differentiated(moved)]
        for joint in range(scene.robot.n):
            own = np.flatnonzero(term.pattern[joint])
            places = np.union1d(own, acting)
            rows = np.zeros((len(places), motion.samples))
            rows[np.searchsorted(places, acting)] = lagging_slopes(self.signals, joint, (j,), about, lags)
            rows[np.searchsorted(places, own)] += behind_it[joint] - rigid_rows(self.signals)[joint]
            if joint == j:
                rows[np.searchsorted(places, bodies)] += scale * turning * second
            yield places, rows

    @property
    def _step(self) -> float:
        return 1.0 / self.signals.motion.rate

    @cached_property
    def _inertia(self) -> Array:
        return held_link_inertia(self.signals, self.joint)

    @cached_property
    def _inertia_columns(self) -> Array:
        """Inertia that the joint moves with its rotor per parameter of the rigid bodies that act on it, shape (k, N)."""
        scene, motion, j = self.signals.scene, self.signals.motion, self.joint

        def made() -> Array:
            pushed = motion.a.copy()
            pushed[j] += 1.0
            moved = Motion(motion.name, motion.trajectory, motion.time, motion.q, motion.v, pushed, None, motion.rate)
            change = joint_rows(scene.model.rigid_body, moved)[j] - rigid_rows(self.signals)[j]
            return np.asarray(change / scene.robot.row_scale[j])

        return shared(motion, ("inertia", scene.model.rigid_body, j), made)

    @cached_property
    def _drift(self) -> Array:
        load = self.signals.load(self.joint) / self.signals.scene.robot.row_scale[self.joint]
        return np.asarray(load / self._inertia)

    @cached_property
    def _flown(self) -> tuple[Array, list[Flight]]:
        return flank(self._drift, self.width, self._step)

    def _differentiated(self, signal: Array) -> Lag:
        rate, cut = self.signals.motion.rate, LAG_BAND * self.signals.scene.band
        return differentiate(signal, rate, cut if cut < HIGHEST_CUT * rate else None)


def flank(drift: Array, width: float, step: float) -> tuple[Array, list[Flight]]:
    """Return where in its clearance a link is, and its flights.

    Parameters
    ----------
    drift : ndarray, shape (N,)
        Acceleration of the motor relative to the free link: the torque through a gear without clearance over the
        link's inertia. Taken as linear from sample to sample.
    width : float
        rad or m.
    step : float
        s per sample.

    Returns
    -------
    tuple of (ndarray of shape (N,), list of Flight)
        Motor less link as a share of the width: 0.5 while the torque is positive, -0.5 while it is negative, and the
        free flight between them.
    """
    count = len(drift)
    result, flights, gains = np.empty(count), [], _gains(drift, step)
    now, side = 0, 1.0 if drift[0] >= 0.0 else -1.0
    # Where the sign changes to positive, and to negative.
    changes = {
        1.0: np.flatnonzero((drift[1:] > 0.0) & (drift[:-1] <= 0.0)) + 1,
        -1.0: np.flatnonzero((drift[1:] < 0.0) & (drift[:-1] >= 0.0)) + 1,
    }
    while now < count:
        leaves, since = now, 0.0
        if drift[now] * side >= 0.0:
            following = changes[-side]
            place = int(np.searchsorted(following, now + 1))
            leaves = int(following[place]) if place < len(following) else count
            result[now:leaves] = 0.5 * side
            if leaves == count:
                break
            since = float(drift[leaves] / (drift[leaves] - drift[leaves - 1]))
        now, lands = _fly(drift, gains, leaves, since, side, width, step, result)
        flights.append(Flight(leaves, now, side, since))
        side = lands
    return result, flights


def _fly(
    drift: Array,
    gains: tuple[Array, Array],
    first: int,
    since: float,
    side: float,
    width: float,
    step: float,
    result: Array,
) -> tuple[int, float]:
    """Fill the flight that begins at a sample, and return the sample at which it has ended, and on which flank."""
    reach = FIRST_SAMPLES
    while True:
        # A recording may have hundreds of short flights: what is the same in all of them is made before.
        stop = min(first + reach, len(drift))
        some = slice(first, stop - 1)
        way = _way(drift[first : first + 1], (gains[0][some], gains[1][some]), since * step, step, from_none=True)
        way /= width
        way += 0.5 * side
        # The first sample has hardly left its flank.
        landed = np.abs(way[1:]) >= 0.5
        end = int(landed.argmax()) + 1 if len(landed) else 0
        found = end > 0 and bool(landed[end - 1])
        if found or stop == len(drift):
            break
        reach *= 4
    if not found:
        end = len(way)
    np.minimum(np.maximum(way[:end], -0.5), 0.5, out=result[first : first + end])
    return first + end, float(np.sign(way[end])) if found else side


def _apart(drift: Array, since: float, step: float, *, from_none: bool) -> Array:
    """Return how far an acceleration, shape (..., N), has moved what was at rest ``since`` s before the first sample.

    It is linear from sample to sample; before the first it grew from none, or was as large.
    """
    return _way(drift[..., :1], _gains(drift, step), since, step, from_none=from_none)


def _gains(drift: Array, step: float) -> tuple[Array, Array]:
    """Return by how much speed and way grow from sample to sample of what an acceleration moves, the way without its speed."""
    before, after = drift[..., :-1], drift[..., 1:]
    return 0.5 * step * (after + before), step**2 * (before / 3.0 + after / 6.0)


def _way(first: Array, gains: tuple[Array, Array], since: float, step: float, *, from_none: bool) -> Array:
    """Return what `_apart` does, of the first acceleration and the gains."""
    speed, way = (first * since / 2.0, first * since**2 / 6.0) if from_none else (first * since, first * since**2 / 2.0)
    result = np.empty((*first.shape[:-1], gains[0].shape[-1] + 1))
    result[..., :1] = way
    ways = result[..., 1:]
    ways[..., :1] = speed
    np.add.accumulate(gains[0][..., :-1], axis=-1, out=ways[..., 1:])
    ways[..., 1:] += speed
    ways *= step
    ways += gains[1]
    np.add.accumulate(ways, axis=-1, out=ways)
    ways += way
    return result
