"""Many arms over many dates: identified on many processes, and watched for what changes."""

from scara_ident.fleet.fleet import Fleet, Settings, watch_fleet

__all__ = ["Fleet", "Settings", "watch_fleet"]
