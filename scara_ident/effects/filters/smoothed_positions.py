"""Positions that were smoothed before or after they were logged, by a filter without a delay."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.effects.effect import DOUBT_STDS, Effect
from scara_ident.effects.filters.position_filter import changed_columns, slopes_of
from scara_ident.effects.following import EstimateSlopes
from scara_ident.effects.links import shared
from scara_ident.effects.parameters import Coefficient, Member, NonlinearParameter
from scara_ident.effects.signals import Scene, Signals
from scara_ident.motion.low_pass import HIGHEST_CUT
from scara_ident.motion.transfer import through

# Powers of the frequency, over that of the band, by which such a filter leaves less: of the second are Gauss's and a first order that
# runs there and back, of the fourth a Butterworth filter of second order that does so. Others are between.
POWERS = (2, 4)
# Frequencies over that of the band where filters may leave nothing that are tried, and the damping ratio that stands for how narrow.
NULLS, NULL_DAMPING = np.geomspace(0.5, 2.0, 7), 0.1
# Largest damping ratio that is tried: what is as wide leaves motion at its frequency, as a gear does.
WIDEST = 0.15
# Share of it at which a fit counts as having ended there.
AS_WIDE = 0.99
# Periods of the band over which the derivatives of a signal that ends there are spread.
MEMORY_PERIODS = 4.0

Gain = Callable[[Array], Array]


class Smoothing(Effect):
    """Positions of all joints after a low-pass without a delay, as one that runs forwards and backwards: the base class of two laws.

    It is no part of an arm and in no catalogue. What such a filter takes from the motion at high frequencies, the torque has; near the
    frequency where little is left, so has a link that swings behind an elastic gear. With the positions q + d before the
    filter, a column is ``Y(q + d, v + d', a + d'') theta - Y(q, v, a) theta``.
    """

    summary = "a filter of the positions without a delay"
    all_joints = True
    follows_estimate = True
    smooth = True
    not_simulated = "it is not a property of the arm"

    @abstractmethod
    def gains(self, scene: Scene, member: Member) -> Iterable[Gain]:
        """Give for each coefficient d over q, by the frequency in Hz."""

    def signal_columns(self, signals: Signals, member: Member) -> Iterable[Array]:
        """Return what the torque of bodies and friction changes by with each d."""
        value, active = signals.scene.value, signals.scene.model.active
        for rows in self.changes(signals, member):
            yield np.array([value[own] @ each for own, each in zip(active, rows, strict=True)])

    def estimate_slopes(self, signals: Signals, member: Member, value: Array) -> EstimateSlopes:
        """Return those of the base model's columns."""
        return slopes_of(signals, value, self.changes(signals, member))

    def changes(self, signals: Signals, member: Member) -> list[list[Array]]:
        """Return for each d what it changes of the base model's columns, as `Signals.columns`; it follows from no estimate."""
        motion = signals.motion
        parts = (motion.q, motion.v, motion.a)
        return [
            changed_columns(signals, *(_times(signals, part, gain) for part in parts))
            for gain in self.gains(signals.scene, member)
        ]


class SmoothedPositions(Smoothing):
    """Smoothing that leaves some motion at all frequencies: ``d = (c2 (f / band)^2 + c4 (f / band)^4) q``."""

    name = "smoothed_positions"
    coefficients = tuple(
        Coefficient(f"share_{power}", "1", f"share by the frequency to the power of {power}") for power in POWERS
    )

    def members(self, scene: Scene) -> tuple[Member, ...]:
        """Return that of all joints."""
        return (Member(None),)

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """Return the reason if more than all of the motion would be left within the band, at 0.7 of its highest frequency."""
        weight = np.array([0.5 ** (power / 2 - 1) for power in POWERS])
        taken, spread = float(weight @ value), float(np.linalg.norm(weight * std))
        return "such a filter would amplify the motion" if taken < -DOUBT_STDS * spread else None

    def gains(self, scene: Scene, member: Member) -> Iterable[Gain]:
        """Give the powers."""
        return tuple(_power(power, scene.band) for power in POWERS)

    def changes(self, signals: Signals, member: Member) -> list[list[Array]]:
        """Return those of its only member, made once."""
        key = (self.name, signals.scene.band, signals.scene.model)
        return shared(signals.motion, key, lambda: super(SmoothedPositions, self).changes(signals, member))


class NulledPositions(Smoothing):
    """Smoothing that leaves nothing at one frequency f0, as a polynomial over a window does.

    With ``u = f / f0`` it is ``d = c u^2 / (1 - u^2) q`` and the powers of `SmoothedPositions`. The first is near f0 the real part of
    what a swing with a damping ratio has, so that it is finite.
    """

    name = "nulled_positions"
    coefficients = (
        Coefficient("share", "1", "share of the motion that is missing", "such a filter would amplify the motion"),
        *SmoothedPositions.coefficients,
    )
    # As far as those of a link that swings.
    nonlinear = (
        NonlinearParameter("frequency", "Hz", 2.0, 200.0),
        NonlinearParameter("_damping_ratio", "1", 0.01, WIDEST),
    )

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """Return the reason too if there is no frequency at which it leaves nothing."""
        if member.nonlinear[1] >= AS_WIDE * WIDEST:
            return "such a filter would leave motion at all frequencies"
        return super().inadmissible(scene, member, value, std)

    def members(self, scene: Scene) -> tuple[Member, ...]:
        """Return some within the band and about it; further away the powers do as well."""
        return tuple(Member(None, (float(ratio) * scene.band, NULL_DAMPING)) for ratio in NULLS)

    def in_place_of(self, scene: Scene, effect: Effect, member: Member, value: Array) -> Member | None:
        """Return one of what swings, with nothing left at its frequency."""
        if len(member.nonlinear) != len(self.nonlinear):
            return None
        frequency, ratio = member.nonlinear
        return Member(None, (frequency, min(ratio, WIDEST)))

    def gains(self, scene: Scene, member: Member) -> Iterable[Gain]:
        """Give the swing's, and the powers."""
        null, ratio = member.nonlinear

        def gain(frequency: Array) -> Array:
            square = (frequency / null) ** 2
            return square * (1.0 - square) / ((1.0 - square) ** 2 + 4.0 * ratio**2 * square)

        return (gain, *(_power(power, scene.band) for power in POWERS))


def _power(power: int, band: float) -> Gain:
    return lambda frequency: np.asarray((frequency / band) ** power)


def _times(signals: Signals, signal: Array, gain: Gain) -> Array:
    """Return a signal (n, N) times a gain, below the frequencies of the signal's derivatives."""
    rate, band = signals.motion.rate, signals.scene.band
    cut = signals.derivative_cut or HIGHEST_CUT * rate

    def response(omega: Array) -> NDArray[np.complexfloating]:
        frequency = omega * rate / (2.0 * np.pi)
        return np.asarray(gain(frequency) / (1.0 + (frequency / cut) ** 8), dtype=complex)

    return through(signal, response, int(np.ceil(MEMORY_PERIODS * rate / band)) + 1)[0]
