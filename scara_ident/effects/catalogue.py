"""All effects that the diagnosis tries, in one list."""

from __future__ import annotations

from scara_ident.effects.effect import Effect
from scara_ident.effects.gear import TransmissionLoss
from scara_ident.effects.measurement import TimeDelay, TorqueGainMismatch, TorqueSensorNonlinearity
from scara_ident.effects.position import Spring

CATALOGUE: tuple[Effect, ...] = (
    TransmissionLoss(),
    Spring(),
    TorqueSensorNonlinearity(),
    TorqueGainMismatch(),
    TimeDelay(),
)
