"""All effects that the diagnosis tries: those built in, and those of installed packages."""

from __future__ import annotations

from itertools import chain, groupby
from typing import Any

from scara_ident.effects.compact_payload import CompactPayload
from scara_ident.effects.coupling import DriveCoupling, InertiaCoupling
from scara_ident.effects.drift import OffsetDrift, WarmUp
from scara_ident.effects.effect import Effect
from scara_ident.effects.elasticity import Backlash, JointElasticity
from scara_ident.effects.filters.position_filter import PositionFilter
from scara_ident.effects.filters.torque_filter import TorqueFilter
from scara_ident.effects.friction import AsymmetricFriction, FrictionCoupling, PositionDependentFriction, Stribeck
from scara_ident.effects.gear import TransmissionLoss
from scara_ident.effects.joint_zero import JointZero
from scara_ident.effects.measurement import BentTorqueSensor, TimeDelay, TorqueGainMismatch, TorqueSensorNonlinearity
from scara_ident.effects.payload import FreePayloadChange, GravityCounterbalance, PayloadChange, PayloadOfRecordings
from scara_ident.effects.payload_intervals import PayloadInIntervals
from scara_ident.effects.periodic import EncoderEccentricity, TorqueRipple, Vibration
from scara_ident.effects.position import RopeWeight, Spring
from scara_ident.effects.presliding import Presliding
from scara_ident.effects.recording_delays import DelayOfEachRecording
from scara_ident.effects.shaft import CoupledShaft
from scara_ident.effects.smooth_coulomb import SmoothCoulomb
from scara_ident.effects.tilt import BaseTilt, NominalBaseTilt
from scara_ident.errors import ArgumentError
from scara_ident.registry import Registry

CATALOGUE: tuple[Effect, ...] = (
    TransmissionLoss(),
    Stribeck(),
    AsymmetricFriction(),
    Presliding(),
    SmoothCoulomb(),
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
    RopeWeight(),
    BaseTilt(),
    NominalBaseTilt(),
    PayloadChange(),
    FreePayloadChange(),
    PayloadInIntervals(),
    PayloadOfRecordings(),
    CompactPayload(),
    GravityCounterbalance(),
    TorqueSensorNonlinearity(),
    BentTorqueSensor(),
    TorqueGainMismatch(),
    TimeDelay(),
    DelayOfEachRecording(),
    TorqueFilter(),
    PositionFilter(),
    JointZero(),
    JointElasticity(),
    Backlash(),
    InertiaCoupling(),
    DriveCoupling(),
    CoupledShaft(),
    CoupledShaft("difference"),
)


def _families(found: Any) -> tuple[Effect, ...]:
    """Return what a package adds, a subclass of `Effect`, an instance or a tuple of them, as families."""
    made = found() if isinstance(found, type) else found
    families: tuple[Any, ...] = made if isinstance(made, tuple) else (made,)
    for family in families:
        if not isinstance(family, Effect):
            raise TypeError(f"{family!r} is no scara_ident.effects.Effect")
        missing = [part for part in ("name", "summary") if not getattr(family, part, "")]
        if missing:
            raise TypeError(f"{type(family).__name__} has no {' and no '.join(missing)}")
    return families


EFFECTS: Registry[tuple[Effect, ...]] = Registry(
    "effect",
    "scara_ident.effects",
    {name: tuple(same) for name, same in groupby(CATALOGUE, lambda effect: effect.name)},
    _families,
)
"""Families by the name of the effect, which several share."""


def available_effects() -> tuple[Effect, ...]:
    """Return the effects built in, then those of installed packages.

    Warns
    -----
    PluginWarning
        For every effect of a package that cannot be used.
    """
    return tuple(chain.from_iterable(EFFECTS.all().values()))


def effects_named(*names: str) -> tuple[Effect, ...]:
    """Return the families of the given names; several families can share a name.

    Raises
    ------
    UsageError
        If there is no family of a name.
    ArgumentError
        If an argument is no string.
    ScaraIdentError
        If a package's effect cannot be used; the line names the package.
    """
    if other := [name for name in names if not isinstance(name, str)]:
        raise ArgumentError(f"effects_named: expected names, one after the other; found {type(other[0]).__name__}")
    return tuple(chain.from_iterable(EFFECTS.get(name) for name in dict.fromkeys(names)))
