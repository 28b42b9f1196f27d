"""The identified model at work: fed forward and in simulation, to check motions, to feel contact."""

from scara_ident.use.use import Use, use

__all__ = ["Use", "use"]
