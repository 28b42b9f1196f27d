"""Positions that were smoothed before or after they were logged, by a filter without a delay."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.effects.effect import DOUBT_STDS, Effect
from scara_ident.effects.filters.position_filter import changed_columns
from scara_ident.effects.parameters import Coefficient, Member
from scara_ident.effects.signals import Scene, Signals
from scara_ident.motion.low_pass import HIGHEST_CUT
from scara_ident.motion.transfer import through

# Powers of the frequency, over that of the band, by which such a filter leaves less: of the second are Gauss's and a first order that
# runs there and back, of the fourth a Butterworth filter of second order that does so. Others are between.
POWERS = (2, 4)
# Periods of the band over which the derivatives of a signal that ends there are spread.
MEMORY_PERIODS = 4.0


class SmoothedPositions(Effect):
    """Positions of all joints after a low-pass without a delay, as one that runs forwards and backwards over a recording.

    It is no part of an arm and in no catalogue. What it takes from the motion at high frequencies, the torque has: near the
    frequency where little is left, a link that swings behind an elastic gear has as much more torque than motion. The
    positions before such a filter are ``q + c2 (f / band)^2 q + c4 (f / band)^4 q`` and so on; a column is the change of the torque by
    one of these, ``Y(q + d, v + d', a + d'') theta - Y(q, v, a) theta``.
    """

    name = "smoothed_positions"
    summary = "a filter of the positions without a delay"
    coefficients = tuple(
        Coefficient(f"share_{power}", "1", f"share by the frequency to the power of {power}") for power in POWERS
    )
    all_joints = True
    follows_estimate = True
    smooth = True
    not_simulated = "it is not a property of the arm"

    def members(self, scene: Scene) -> tuple[Member, ...]:
        """Return that of all joints."""
        return (Member(None),)

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """Return the reason if more than all of the motion would be left within the band, at 0.7 of its highest frequency."""
        weight = np.array([0.5 ** (power / 2 - 1) for power in POWERS])
        taken, spread = float(weight @ value), float(np.linalg.norm(weight * std))
        return "such a filter would amplify the motion" if taken < -DOUBT_STDS * spread else None

    def signal_columns(self, signals: Signals, member: Member) -> Iterable[Array]:
        """Return what the torque of bodies and friction changes by with each power."""
        value, active = signals.scene.value, signals.scene.model.active
        motion = signals.motion
        for power in POWERS:
            rows = changed_columns(
                signals, *(_missing(signals, part, power) for part in (motion.q, motion.v, motion.a))
            )
            yield np.array([value[own] @ each for own, each in zip(active, rows, strict=True)])


def _missing(signals: Signals, signal: Array, power: int) -> Array:
    """Return a signal (n, N) times a power of the frequency over that of the band, below that of the signal's derivatives."""
    rate, band = signals.motion.rate, signals.scene.band
    cut = signals.derivative_cut or HIGHEST_CUT * rate

    def response(omega: Array) -> NDArray[np.complexfloating]:
        frequency = omega * rate / (2.0 * np.pi)
        return np.asarray((frequency / band) ** power / (1.0 + (frequency / cut) ** 8), dtype=complex)

    return through(signal, response, int(np.ceil(MEMORY_PERIODS * rate / band)) + 1)[0]
