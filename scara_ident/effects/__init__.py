"""Effects that a rigid body with polynomial friction lacks, one file per physical family."""

from scara_ident.effects.catalogue import CATALOGUE
from scara_ident.effects.effect import Effect, EffectTerm, Knob, Member, Parameter, Resolved
from scara_ident.effects.signals import Scene, Signals

__all__ = ["CATALOGUE", "Effect", "EffectTerm", "Knob", "Member", "Parameter", "Resolved", "Scene", "Signals"]
