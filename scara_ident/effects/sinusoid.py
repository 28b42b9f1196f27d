"""Effects that are a sine of something: two coefficients, reported as amplitude and phase."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.effects.effect import DOUBT_STDS, Effect
from scara_ident.effects.links import shared
from scara_ident.effects.parameters import Coefficient, Member, Parameter
from scara_ident.effects.signals import Scene, Signals

# Samples whose powers are taken together, so that they stay in the cache.
AT_ONCE = 2048


def amplitude_and_phase(value: Array, covariance: Array) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return amplitude and phase of ``value[0] sin x + value[1] cos x = amplitude sin(x + phase)``, with deviations.

    Parameters
    ----------
    value : ndarray, shape (2,)
    covariance : ndarray, shape (2, 2)

    Returns
    -------
    amplitude, phase : tuple of (float, float)
        Value and standard deviation; the phase in rad, from -pi to pi.
    """
    amplitude = float(np.hypot(value[0], value[1]))
    phase = float(np.arctan2(value[1], value[0]))
    along = np.array([np.cos(phase), np.sin(phase)])
    across = np.array([-along[1], along[0]])
    spread = float(np.sqrt(max(along @ covariance @ along, 0.0)))
    turn = float(np.sqrt(max(across @ covariance @ across, 0.0))) / amplitude if amplitude > 0.0 else np.inf
    return (amplitude, spread), (phase, float(min(turn, np.pi / np.sqrt(3.0))))


def sine_and_cosine(name: str, meaning: str, unit: str = "{torque}") -> tuple[Coefficient, Coefficient]:
    """Return the coefficients of a sine and a cosine; ``{part}`` in the meaning is which of them."""
    sine, cosine = (
        Coefficient(name.replace("{part}", part), unit, meaning.replace("{part}", part)) for part in ("sine", "cosine")
    )
    return sine, cosine


class Sinusoid(Effect):
    """A family whose two coefficients are those of a sine and a cosine, reported as amplitude and phase."""

    amplitude_name: ClassVar[str] = "amplitude"

    def parameters(self, scene: Scene, member: Member, value: Array, covariance: Array) -> Mapping[str, Parameter]:
        """Return amplitude and phase."""
        amplitude, phase = amplitude_and_phase(value, covariance)
        unit = self.columns(scene, member)[0].unit
        return {self.amplitude_name: Parameter(*amplitude, unit), "phase": Parameter(*phase, "rad")}


def min_amplitude(value: Array, std: Array) -> float:
    """Return the amplitude of a sine and a cosine less what it may be too large by."""
    return float(np.hypot(*value)) - DOUBT_STDS * float(np.max(std))


def sines(signals: Signals, joint: int, order: float) -> tuple[Array, Array]:
    """Return sine and cosine of ``order`` times the motor's angle of a joint, shape (N,) each.

    Those of whole orders are powers of ``exp(i angle)``: sine and cosine of many turns take ten times as long.
    """
    turns = signals.motor_turns[joint]
    if turns.dtype == object or order != round(order) or order < 1.0:
        return np.sin(order * turns), np.cos(order * turns)
    once = shared(signals, ("once a turn", joint), lambda: np.array([np.sin(turns), np.cos(turns)]))
    found = np.empty_like(once)
    for start in range(0, len(turns), AT_ONCE):
        some = slice(start, start + AT_ONCE)
        power = _power(once[1, some] + 1j * once[0, some], int(order))
        found[0, some], found[1, some] = power.imag, power.real
    return found[0], found[1]


def _power(base: NDArray[np.complex128], order: int) -> NDArray[np.complex128]:
    """Return a power by squaring, order at least 1."""
    if order == 1:
        return base
    half = _power(base, order // 2)
    return half * half * base if order % 2 else half * half
