"""All effects that the diagnosis tries, in one list."""

from __future__ import annotations

from scara_ident.effects.coupling import DriveCoupling, InertiaCoupling
from scara_ident.effects.drift import OffsetDrift, WarmUp
from scara_ident.effects.effect import Effect
from scara_ident.effects.elasticity import Backlash, JointElasticity
from scara_ident.effects.friction import AsymmetricFriction, FrictionCoupling, PositionDependentFriction, Stribeck
from scara_ident.effects.gear import TransmissionLoss
from scara_ident.effects.measurement import TimeDelay, TorqueGainMismatch, TorqueSensorNonlinearity
from scara_ident.effects.payload import FreePayloadChange, GravityCounterbalance, PayloadChange, PayloadOfRecordings
from scara_ident.effects.periodic import EncoderEccentricity, TorqueRipple, Vibration
from scara_ident.effects.position import Spring
from scara_ident.effects.presliding import Presliding
from scara_ident.effects.tilt import BaseTilt, NominalBaseTilt

CATALOGUE: tuple[Effect, ...] = (
    TransmissionLoss(),
    Stribeck(),
    AsymmetricFriction(),
    Presliding(),
    WarmUp(),
    PositionDependentFriction(),
    FrictionCoupling(),
    FrictionCoupling("sum"),
    FrictionCoupling("difference"),
    OffsetDrift(),
    TorqueRipple(),
    EncoderEccentricity(),
    Vibration(),
    Spring(),
    BaseTilt(),
    NominalBaseTilt(),
    PayloadChange(),
    FreePayloadChange(),
    PayloadOfRecordings(),
    GravityCounterbalance(),
    TorqueSensorNonlinearity(),
    TorqueGainMismatch(),
    TimeDelay(),
    JointElasticity(),
    Backlash(),
    InertiaCoupling(),
    DriveCoupling(),
)
