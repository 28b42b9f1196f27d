"""Effects that a rigid body with polynomial friction lacks, one file per physical family."""

from scara_ident.effects.catalogue import CATALOGUE
from scara_ident.effects.effect import Effect, EffectTerm, Member, NonlinearParameter, Parameter, Resolved
from scara_ident.effects.signals import Scene, Signals

__all__ = [
    "CATALOGUE",
    "Effect",
    "EffectTerm",
    "NonlinearParameter",
    "Member",
    "Parameter",
    "Resolved",
    "Scene",
    "Signals",
]
