"""Identification beside a running controller: a sample in, parameters at any time, and a word when something changes."""

from scara_ident.online.identifier import Alarm, OnlineIdentifier, OnlineSettings

__all__ = ["Alarm", "OnlineIdentifier", "OnlineSettings"]
