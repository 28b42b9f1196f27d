"""Effects that a rigid body with polynomial friction lacks, one file per physical family."""

from scara_ident.effects.catalogue import CATALOGUE, EFFECTS, available_effects, effects_named
from scara_ident.effects.effect import Effect
from scara_ident.effects.effect_term import EffectTerm
from scara_ident.effects.parameters import (
    Coefficient,
    Interval,
    Member,
    NonlinearParameter,
    Parameter,
    SpectralLine,
    Tie,
    View,
)
from scara_ident.effects.signals import Scene, Signals

__all__ = [
    "CATALOGUE",
    "EFFECTS",
    "Coefficient",
    "Effect",
    "EffectTerm",
    "Interval",
    "Member",
    "NonlinearParameter",
    "Parameter",
    "Scene",
    "Signals",
    "SpectralLine",
    "Tie",
    "View",
    "available_effects",
    "effects_named",
]
