"""A filter of the positions: the part that is left after its delay was corrected."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from scara_ident.arrays import Array
from scara_ident.effects.filters.filter_rest import FilterRest
from scara_ident.effects.following import EstimateSlopes
from scara_ident.effects.friction import friction_places
from scara_ident.effects.links import shared
from scara_ident.effects.parameters import Member
from scara_ident.effects.signals import Signals
from scara_ident.motion.low_pass import HIGHEST_CUT
from scara_ident.motion.motion import Motion


@dataclass(frozen=True)
class PositionFilter(FilterRest):
    """Positions of all joints after one low-pass filter, in addition to its delay.

    The torque follows from the positions before the filter, which are the recorded ones after its inverse. With the transfer
    function H of the filter and its delay T, which `TimeDelay` corrects, a column is
    ``Y(q + d, v + d', a + d'') theta - Y(q, v, a) theta`` with ``d = (exp(-s T) / H(s) - 1) q``. There is one for each of two filters
    with the same delay: a low-pass of first order and a Butterworth filter of second order; it is exact for this filter alone.
    To third order in s any filter is a combination of both, see `FilterRest`. A pure delay has no part of either.

    Coulomb friction jumps where the velocity before the filter turns. The links behind
    elastic gears follow from the same positions, so what they change of the torque is filtered too. An elastic gear of one
    joint, whose link lags by its load, does to the torque what a filter does by all loads.
    """

    name = "position_filter"
    summary = "positions that are recorded after a low-pass filter"
    beside_together = True
    smooth = True
    inverse = True
    experiment = "log the positions of the encoders without a filter"

    def signal_columns(self, signals: Signals, member: Member) -> Iterable[Array]:
        """Return the change of the torque of bodies, viscous friction and links that lag, for each law."""
        value, active = signals.scene.value, signals.scene.model.active
        lagging = self.rest(signals.of_together, signals.motion.rate, _cut(signals))
        for changed, left in zip(self._changed(signals), lagging, strict=True):
            yield left + np.array([value[own] @ rows for own, rows in zip(active, changed, strict=True)])

    def estimate_slopes(self, signals: Signals, member: Member, value: Array) -> EstimateSlopes:
        """Return those of the base model's columns: how links lag by other bodies is small beside it."""
        return slopes_of(signals, value, self._changed(signals))

    def _changed(self, signals: Signals) -> list[list[Array]]:
        """Return for each law the change of the base model's columns, as `Signals.columns`; it follows from no estimate."""
        key = ("position filter", self.delay, _cut(signals), signals.scene.model)
        return shared(signals.motion, key, lambda: list(self._made_changes(signals)))

    def _made_changes(self, signals: Signals) -> Iterator[list[Array]]:
        motion = signals.motion
        changes = (self.rest(part, motion.rate, _cut(signals)) for part in (motion.q, motion.v, motion.a))
        for q, v, a in zip(*changes, strict=True):
            yield changed_columns(signals, q, v, a)


def changed_columns(signals: Signals, q: Array, v: Array, a: Array) -> list[Array]:
    """Return what changes of positions and their derivatives, shape (n, N) each, change of the base model's columns, as `Signals.columns`."""
    motion, scene = signals.motion, signals.scene
    coulomb = [friction_places(scene, joint).get(0, -1) for joint in range(scene.robot.n)]
    moved = replace(motion, q=motion.q + q, v=motion.v + v, a=motion.a + a, torque=None)
    turned = scene.robot.drive_sign[:, None] * (_mean_sign(moved) - _mean_sign(motion))
    there = scene.model.joint_columns(moved)
    return [
        np.where((own == place)[:, None], turn, new - old)
        for own, place, turn, new, old in zip(scene.model.active, coulomb, turned, there, signals.columns, strict=True)
    ]


def slopes_of(signals: Signals, value: Array, changes: Sequence[Sequence[Array]]) -> EstimateSlopes:
    """Return `Effect.estimate_slopes` of coefficients (k,), each of which changes the base model's columns by its own of `changed_columns`."""
    return {
        joint: (own, sum(x * rows for x, rows in zip(value.tolist(), each, strict=True)))
        for joint, (own, each) in enumerate(zip(signals.scene.model.active, zip(*changes, strict=True), strict=True))
    }


def _mean_sign(motion: Motion) -> Array:
    """Return the mean sign of the velocity from half a sample before to half a sample after each, shape (n, N).

    A turn moves by less than a sample, which the sign at the samples does not show.
    """
    change = np.abs(motion.a) / (2.0 * motion.rate)
    return np.clip(motion.v / np.maximum(change, np.finfo(float).tiny), -1.0, 1.0)


def _cut(signals: Signals) -> float:
    return signals.derivative_cut or HIGHEST_CUT * signals.motion.rate
