"""Effects that can be switched on: one frozen dataclass each, found by the contract's names."""

from __future__ import annotations

from dataclasses import fields
from difflib import get_close_matches
from typing import Any

from scara_ident.errors import UsageError
from scara_ident.simulation.effects.contact import Push
from scara_ident.simulation.effects.drive import Spring, TorqueRipple, Vibration
from scara_ident.simulation.effects.effect import BY_ARM, Effect, Vector
from scara_ident.simulation.effects.friction import (
    AsymmetricFriction,
    FrictionCoupling,
    PositionDependentFriction,
    Presliding,
    SmoothCoulomb,
    Stribeck,
    WarmUp,
)
from scara_ident.simulation.effects.sensors import (
    EncoderEccentricity,
    JointZero,
    OffsetDrift,
    PositionFilter,
    TimeDelay,
    TorqueFilter,
    TorqueGainMismatch,
    TorqueSensorNonlinearity,
)
from scara_ident.simulation.effects.shaft import CoupledShaft
from scara_ident.simulation.effects.structure import BaseTilt, Payload, PayloadChange
from scara_ident.simulation.effects.transmission import Backlash, JointElasticity, TransmissionLoss
from scara_ident.simulation.effects.unlisted import UnlistedSignedSine, UnlistedSwingingViscous

CATALOGUE: tuple[type[Effect], ...] = (
    TransmissionLoss,
    Stribeck,
    AsymmetricFriction,
    Presliding,
    WarmUp,
    TorqueRipple,
    PositionDependentFriction,
    Spring,
    BaseTilt,
    PayloadChange,
    TimeDelay,
    TorqueSensorNonlinearity,
    TorqueGainMismatch,
    JointElasticity,
    Backlash,
    EncoderEccentricity,
    FrictionCoupling,
    OffsetDrift,
    Vibration,
)
# What an arm may have or meet beside them.
OTHERS: tuple[type[Effect], ...] = (Push, Payload, CoupledShaft, JointZero, SmoothCoulomb, TorqueFilter, PositionFilter)
UNLISTED: tuple[type[Effect], ...] = (UnlistedSignedSine, UnlistedSwingingViscous)
EFFECTS: dict[str, type[Effect]] = {effect.name: effect for effect in (*CATALOGUE, *OTHERS, *UNLISTED)}

__all__ = [
    "BY_ARM",
    "CATALOGUE",
    "EFFECTS",
    "Effect",
    "OTHERS",
    "UNLISTED",
    "parse_effect",
    *(effect.__name__ for effect in (*CATALOGUE, *OTHERS, *UNLISTED)),
]


def parse_effect(text: str) -> Effect:
    """Read an effect from the command line.

    Parameters
    ----------
    text : str
        ``NAME``, ``NAME:JOINT``, ``NAME:JOINT:KEY=VALUE,KEY=VALUE`` or ``NAME:KEY=VALUE``; values that are not given
        have defaults that suit the arm. A vector is x/y/z; with ``recording=NAME`` it acts in that recording only.

    Raises
    ------
    UsageError
        If a name or key is unknown, or a value is no number; the message lists the known ones.

    Examples
    --------
    >>> parse_effect("spring:joint2:stiffness=0.05")
    Spring(joint='joint2', stiffness=0.05, rest_position=nan)
    >>> parse_effect("push:force=15,from=4.2,direction=0/0/-1").direction
    (0.0, 0.0, -1.0)
    """
    name, *rest = (part.strip() for part in text.split(":"))
    if name not in EFFECTS:
        near = get_close_matches(name, EFFECTS, n=1)
        hint = f"did you mean {near[0]}? " if near else ""
        raise UsageError(f"effect {name!r}: no such effect; {hint}there are {', '.join(EFFECTS)}")
    kind = EFFECTS[name]
    joint: str | None = None
    values: dict[str, Any] = {}
    for part in rest:
        if "=" not in part:
            if joint is not None or values or not part:
                raise UsageError(f"effect {text!r}: expected NAME:JOINT:KEY=VALUE,KEY=VALUE")
            joint = part
            continue
        for pair in part.split(","):
            key, _, value = (word.strip() for word in pair.partition("="))
            attribute = {**kind.parameter_names(), "recording": "recording"}.get(key)
            if attribute is None:
                if key == "joint" and value:
                    raise UsageError(f"effect {text!r}: name the joint before the values: {name}:{value}:KEY=VALUE")
                known = ", ".join((*kind.parameter_names(), "recording"))
                raise UsageError(f"effect {text!r}: {kind.name} has no {key!r}; it has {known}")
            if attribute in values:
                raise UsageError(f"effect {text!r}: {key} is given twice")
            values[attribute] = _value(kind, text, key, attribute, value)
    return kind(joint=joint, **values)


def _value(kind: type[Effect], text: str, key: str, name: str, value: str) -> float | bool | str | Vector:
    field = next(item for item in fields(kind) if item.name == name)
    if field.type == "str | None":
        return value
    if field.type == "bool":
        if value.lower() not in ("true", "false", "1", "0"):
            raise UsageError(f"effect {text!r}: {key} is {value!r}; expected true or false")
        return value.lower() in ("true", "1")
    try:
        numbers = tuple(float(word) for word in value.split("/"))
    except ValueError:
        numbers = ()
    if field.type == "Vector":
        length = len(getattr(kind, name))
        if len(numbers) != length:
            raise UsageError(f"effect {text!r}: {key} is {value!r}; expected {length} numbers as in 0/0/1")
        return numbers
    if len(numbers) != 1:
        raise UsageError(f"effect {text!r}: {key} is {value!r}; expected a number")
    return numbers[0]
