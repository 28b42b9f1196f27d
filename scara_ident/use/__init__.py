"""The identified model at work: fed forward and in simulation, to check motions, to feel contact."""

from scara_ident.use.use import Use, UsedModel, use, used_model

__all__ = ["Use", "UsedModel", "use", "used_model"]
