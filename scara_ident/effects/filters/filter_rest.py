"""What a low-pass filter does in addition to its delay, as two laws whose combinations are any filter to third order."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.effects.effect import DOUBT_STDS, Effect
from scara_ident.effects.filters.late_turn import LateTurn
from scara_ident.effects.parameters import Coefficient, Member, Parameter, deviation
from scara_ident.effects.signals import Scene
from scara_ident.motion.transfer import through

Law = Callable[[NDArray[np.complexfloating]], NDArray[np.complexfloating]]

# If a signal is late by T seconds because of a filter, motion up to this over T, Hz, is known: a mean over 2 T or a lag of first
# order leaves 86 or 73 % of it. Of a fifth over T they leave less, and elastic gears of single joints may be fitted in their place.
FILTERED = 0.15
# Time constants after which less than 5e-5 of an impulse is left in a filter.
MEMORY = 10.0
# Functions of x = s T, with the delay T of the filter: a low-pass of first order, a Butterworth filter of second order.
LAWS: Mapping[str, Law] = {
    "first_order": lambda x: 1.0 / (1.0 + x),
    "second_order": lambda x: 1.0 / (1.0 + x + x * x / 2.0),
}
# Common filters: their shares of the laws to third order, and their description, given the delay T, s.
KNOWN: tuple[tuple[tuple[float, float], Callable[[float], str]], ...] = (
    ((1.0, 0.0), lambda delay: f"a low-pass of first order with the time constant {delay:.2g} s"),
    ((0.0, 1.0), lambda delay: f"a Butterworth low-pass of second order at {np.sqrt(0.5) / (np.pi * delay):.2g} Hz"),
    ((1.0 / 3.0, 2.0 / 3.0), lambda delay: f"a mean over {2.0 * delay:.2g} s"),
)


@dataclass(frozen=True)
class FilterRest(Effect):
    """Signals of all joints after one low-pass filter, in addition to its delay: the base class of both such effects.

    `TimeDelay` corrects the mean T of the filter's impulse response. To third order in s any filter is a combination of `LAWS`:
    its transfer function is ``exp(-s T + s^2 V / 2 - s^3 W / 6)``, with the variance V and the third
    central moment W of its impulse response (its cumulants). V and W are ``T^2`` and ``2 T^3`` for the first law, 0 and
    ``-T^3`` for the second. A mean over 2 T has ``T^2 / 3`` and 0: one third of the first and two thirds of the second law. A
    pure delay has no part of either.

    Attributes
    ----------
    delay : float
        Delay of the filter, which was corrected in the recordings, s.
    inverse : bool
        Whether the filter is undone, because the model is computed from the filtered signal; for subclasses to state.
    """

    delay: float = 0.01

    inverse: ClassVar[bool] = False
    coefficients = tuple(Coefficient(name, "1", f"share of a {name.replace('_', '-')} filter") for name in LAWS)
    all_joints = True
    follows_estimate = True
    after_correction = True

    def members(self, scene: Scene) -> tuple[Member, ...]:
        """Return none: `TimeDelay.leaves` suggests it where a delay was corrected."""
        return ()

    def distinguished_from(self, scene: Scene, member: Member) -> tuple[tuple[Effect, Member], ...]:
        """Return when the friction of each joint turns: a narrow band moves that by an own time, and a filter too."""
        return tuple((LateTurn(), Member(joint)) for joint in self.rows(scene, member))

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """Return the reason if the variance of the impulse response is negative."""
        if value[0] >= -DOUBT_STDS * std[0]:
            return None
        return "the impulse response of the filter would have a negative variance"

    def parameters(self, scene: Scene, member: Member, value: Array, covariance: Array) -> Mapping[str, Parameter]:
        """Return the standard deviation of the impulse response; for a first-order filter this is its time constant."""
        share, std = max(float(value[0]), 0.0), deviation(covariance)
        # From the derivative of the root; its argument is limited because it is infinite at zero.
        spread = std / (2.0 * np.sqrt(max(share, std)))
        return {"width": Parameter(float(self.delay * np.sqrt(share)), float(self.delay * spread), "s", 2.0)}

    def or_else(self, scene: Scene, member: Member, value: Array) -> str:
        """Name the filter with the nearest share of the first law, which is determined better than the second."""
        _, said = min(KNOWN, key=lambda known: abs(known[0][0] - value[0]))
        return f", nearest to {said(self.delay)}"

    def rest(self, signal: Array, rate: float, cut: float = np.inf) -> Array:
        """Return what the filter changes in signals (k, N), for each law, below a frequency in Hz; shape (laws, k, N)."""
        steps = self.delay * rate

        def changed(law: Law) -> Array:
            def response(omega: Array) -> NDArray[np.complexfloating]:
                x = 1j * omega * steps
                gain = np.exp(x) * law(x)
                # The inverse makes any kink at the ends ring through the whole signal, unless it is limited as derivatives are.
                below = 1.0 / (1.0 + (omega * rate / (2.0 * np.pi * cut)) ** 8)
                return np.asarray(((1.0 / gain if self.inverse else gain) - 1.0) * below)

            # Constants and straight lines do not change.
            return through(signal, response, memory)[0]

        memory = int(np.ceil(MEMORY * steps)) + 1
        return np.stack([changed(law) for law in LAWS.values()])
