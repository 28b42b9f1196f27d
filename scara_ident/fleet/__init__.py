"""Many arms over many dates: identified on many processes, and watched for what changes."""

from scara_ident.fleet.fleet import Fleet, watch_fleet
from scara_ident.fleet.work import Settings

__all__ = ["Fleet", "Settings", "watch_fleet"]
