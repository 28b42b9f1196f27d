"""Whether recorded positions are setpoints instead of measurements, and which effects can be believed then.

An arm lags behind its setpoints by what its controller needs to build up the torque, which turns round with friction over some way of
them: nothing in the recordings tells that from friction or a gear that yields.
"""

from __future__ import annotations

from scara_ident.diagnosis.testing.acceptance import Decision
from scara_ident.diagnosis.testing.selection_step import SelectionStep
from scara_ident.effects import Effect, Member
from scara_ident.motion.encoder_steps import encoder_step
from scara_ident.motion.prepared import PreparedData
from scara_ident.recording.audit.position import is_computed

# A simulator may record positions that are as exact, beside efforts with noise.
OR_ELSE = "; the positions are smoother than any encoder's: if they are setpoints, this is the lag of the controller"


def setpoint_objection(step: SelectionStep, decision: Decision) -> str | None:
    """Say so where positions are computed, beside efforts in steps, which no simulator needs to have, and an effect is determined by small ways.

    Parameters
    ----------
    step : SelectionStep
        The model that the effect was tried beside.
    decision : Decision
        That lets it in.
    """
    effect, member, data = decision.candidate.effect, decision.candidate.member, step.observations.data
    if not may_be_setpoints(data, effect, member) or not _in_steps(data, member.place):
        return None
    return (
        "the positions have neither noise nor steps but the efforts have steps, so the positions look like setpoints, "
        "and the lag of a controller looks like this effect: log the measured positions"
    )


def may_be_setpoints(data: PreparedData, effect: Effect, member: Member) -> bool:
    """Whether an effect is determined by small ways of a joint, and all recordings have computed positions of that joint."""
    if not effect.in_small_ways or member.joint is None:
        return False
    return all(is_computed(item.recording.position[member.joint]) for item in data.recordings)


def _in_steps(data: PreparedData, joint: int) -> bool:
    efforts = [item.recording.effort for item in data.recordings]
    return all(effort is not None and encoder_step(effort[joint]) is not None for effort in efforts)
