"""A filter of the efforts: the part that is left after its delay was corrected."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.effects.effect import DOUBT_STDS, Effect
from scara_ident.effects.following import EstimateSlopes, predicted_slopes
from scara_ident.effects.parameters import Coefficient, Member, Parameter, deviation
from scara_ident.effects.signals import Scene, Signals
from scara_ident.motion.transfer import through

# Time constants after which less than 5e-5 of an impulse is left in a filter.
MEMORY = 10.0
# Functions of x = s T, with the delay T of the filter: a low-pass of first order, a Butterworth filter of second order.
LAWS: Mapping[str, Callable[[NDArray[np.complexfloating]], NDArray[np.complexfloating]]] = {
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
class TorqueFilter(Effect):
    """Efforts of all joints after one low-pass filter, in addition to its delay.

    `TimeDelay` corrects the mean T of the filter's impulse response; ``(exp(s T) H(s) - 1) u`` is left, with its transfer
    function H. The columns are this rest for two filters with the same delay, `LAWS`. To third order in s any filter is a
    combination of both: its transfer function is ``exp(-s T + s^2 V / 2 - s^3 W / 6)``, with the variance V and the third
    central moment W of its impulse response (its cumulants). V and W are ``T^2`` and ``2 T^3`` for the first law, 0 and
    ``-T^3`` for the second. A mean over 2 T has ``T^2 / 3`` and 0: one third of the first and two thirds of the second law. A
    pure delay has no part of either.

    Attributes
    ----------
    delay : float
        Delay that was corrected in the recordings, s.
    """

    delay: float = 0.01

    name = "torque_filter"
    summary = "effort that is recorded after a low-pass filter"
    coefficients = tuple(Coefficient(name, "1", f"share of a {name.replace('_', '-')} filter") for name in LAWS)
    all_joints = True
    follows_estimate = True
    after_correction = True
    experiment = "log the effort without a filter, or look up the corner frequency of its filter"

    def members(self, scene: Scene) -> tuple[Member, ...]:
        """Return none: `TimeDelay.leaves` suggests it where a delay was corrected."""
        return ()

    def signal_columns(self, signals: Signals, member: Member) -> Iterable[Array]:
        """Return the rest of the predicted torque for each law."""
        return list(self._left(signals, signals.predicted))

    def of_torque(self, signals: Signals, member: Member, torque: Array) -> Array | None:
        """Return the same for the torque of effects in the model, because the whole recorded effort is filtered."""
        return np.moveaxis(self._left(signals, torque), 0, 1)

    def estimate_slopes(self, signals: Signals, member: Member, value: Array) -> EstimateSlopes:
        """Return the same for each column of the base model."""
        found = {joint: predicted_slopes(signals, joint) for joint in self.rows(signals.scene, member)}
        return {
            joint: (places, np.tensordot(value, self._left(signals, rows), axes=1))
            for joint, (places, rows) in found.items()
        }

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

    def _left(self, signals: Signals, torque: Array) -> Array:
        """Return the rest of torques (k, N) for each law, shape (laws, k, N)."""
        steps = self.delay * signals.motion.rate

        def rest(law: Callable[[NDArray[np.complexfloating]], NDArray[np.complexfloating]]) -> Array:
            # Constants and straight lines have no rest.
            return through(torque, lambda omega: np.exp(1j * omega * steps) * law(1j * omega * steps) - 1.0, memory)[0]

        memory = int(np.ceil(MEMORY * steps)) + 1
        return np.stack([rest(law) for law in LAWS.values()])
