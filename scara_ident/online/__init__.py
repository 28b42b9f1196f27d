"""Identification beside a running controller: a sample in, parameters at any time, and an alarm when something changes."""

from scara_ident.online.detector import Alarm
from scara_ident.online.identifier import OnlineIdentifier
from scara_ident.online.settings import OnlineSettings

__all__ = ["Alarm", "OnlineIdentifier", "OnlineSettings"]
