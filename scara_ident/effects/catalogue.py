"""All effects that the diagnosis tries: those built in, and those of installed packages."""

from __future__ import annotations

from difflib import get_close_matches
from functools import cache
from importlib.metadata import EntryPoint, entry_points

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
from scara_ident.errors import UsageError

GROUP = "scara_ident.effects"
"""Group of entry points by which a package adds a subclass of `Effect`, or an instance of one."""

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


@cache
def available_effects() -> tuple[Effect, ...]:
    """Return the effects built in, then those of installed packages.

    Raises
    ------
    UsageError
        If a package's effect cannot be loaded; the line names the package.
    """
    return (*CATALOGUE, *(_loaded(point) for point in entry_points(group=GROUP)))


def effects_named(*names: str) -> tuple[Effect, ...]:
    """Return the families of the given names, all that share one, in the order of `available_effects`.

    Raises
    ------
    UsageError
        If there is none of a name.
    """
    known = tuple(dict.fromkeys(effect.name for effect in available_effects()))
    for name in names:
        if name not in known:
            near = get_close_matches(name, known, n=1)
            hint = f"did you mean {near[0]}? " if near else ""
            raise UsageError(f"effect {name!r}: no such effect; {hint}there are {', '.join(known)}")
    return tuple(effect for effect in available_effects() if effect.name in names)


def _loaded(point: EntryPoint) -> Effect:
    package = point.value if point.dist is None else point.dist.name
    try:
        found = point.load()
        found = found() if isinstance(found, type) else found
    except Exception as error:
        reason = " ".join(str(error).split())
        raise UsageError(f"package {package}: effect {point.name}: {type(error).__name__}: {reason}") from None
    if not isinstance(found, Effect):
        raise UsageError(f"package {package}: effect {point.name}: {point.value} is no scara_ident.effects.Effect")
    missing = [part for part in ("name", "summary") if not getattr(found, part, "")]
    if missing:
        raise UsageError(f"package {package}: effect {point.name}: {point.value} has no {' and no '.join(missing)}")
    return found
