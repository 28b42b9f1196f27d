"""Which share of the time takes no part in an error, joint by joint."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from scara_ident.estimation.observations import Observations


def left_out_share(observations: Observations) -> dict[str, float]:
    """Return for each joint the share of the recorded time at its rests and turns and at the ends.

    Events are not counted. Empty without recordings.
    """
    seconds = sum(part.samples / part.rate for part in observations.data.stretches)
    if not seconds:
        return {}
    ends = observations.left_out_ends / seconds
    shares = [ends + (1.0 - ends) * rest for rest in observations.left_out_rest]
    return observations.model.robot.by_joint(shares)


def left_out_words(content: Mapping[str, Any]) -> str:
    """Say of which part of the time errors are, of the content of a result; nothing without recordings.

    Parameters
    ----------
    content : mapping
        With ``left_out``, what `left_out_share` returns by kind of recordings.
    """
    shares = _percents(share for each in content["left_out"].values() for share in each.values())
    if not shares:
        return ""
    return (
        f"Errors are for the time in which a joint moves: {' to '.join(shares)} % of the time, at rest, at reversals "
        f"and at the ends of recordings, is left out."
    )


def _percents(shares: Iterable[float]) -> list[str]:
    """Return the least and the largest in percent, one where both read alike."""
    found = sorted(shares)
    return list(dict.fromkeys(f"{100.0 * share:.0f}" for share in (found[0], found[-1]))) if found else []
