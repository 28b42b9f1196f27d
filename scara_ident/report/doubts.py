"""Doubts that concern all parameters, such as efforts of opposite sign: they stand first wherever parameters are reported."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from scara_ident.estimation import Estimate
from scara_ident.estimation.observations import Observations
from scara_ident.estimation.urdf_weight import turned_bodies
from scara_ident.identification.channel_fault import ChannelFault
from scara_ident.identification.gravity_check import gravity_said


def doubts(
    estimate: Estimate,
    observations: Observations,
    base: Observations,
    scale: str,
    channels: Sequence[ChannelFault] = (),
) -> tuple[str, ...]:
    """Return sentences that question the whole result: channels, gravity, and bodies of the opposite sign.

    Parameters
    ----------
    observations : Observations
        That the estimate is of.
    base : Observations
        Of the model without effects.
    scale : str
        How the scale of the bodies compares with the URDF's, in a sentence that is one of these where signs differ.
    channels : sequence of ChannelFault, optional
        Under efforts of opposite sign bodies and gravity are nobody's, and nothing is said of them.
    """
    if channels:
        return tuple(f"{fault}." for fault in channels)
    gravity = gravity_said(base)
    turned = turned_bodies(estimate, observations)
    return (*([] if gravity is None else [gravity]), *([scale] if turned else []))


def parted(content: Mapping[str, Any]) -> tuple[list[str], list[str]]:
    """Return the sentences of a result, as its JSON has them, that question it, and all others."""
    count = len(content["doubts"])
    return content["summary"][:count], content["summary"][count:]
