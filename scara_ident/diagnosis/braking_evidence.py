"""Whether friction dissipates: where it drives the joint, the model lacks something that friction stands for, whether the residual is noise or not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from scara_ident.diagnosis.evidence.evidence import Evidence
from scara_ident.diagnosis.found_effect import FoundEffect
from scara_ident.estimation import Estimate
from scara_ident.estimation.observations import Observations
from scara_ident.estimation.pushing import pushes


def braking_evidence(
    shown: Sequence[Evidence], after: Estimate, training: Observations, effects: Sequence[FoundEffect]
) -> tuple[Evidence, ...]:
    """Say that something is missing on joints whose friction gives energy at a speed that they had.

    Friction acts on its own joint alone, so that it is there. A joint on which an effect was found is not asked: its
    friction may be in both.

    Parameters
    ----------
    shown : sequence of Evidence
        By joint.
    training : Observations
        Of the training recordings, with the effects found.
    effects : sequence of FoundEffect
        That were found.
    """
    robot, found = after.model.robot, []
    of_effects = {effect.joint for effect in effects}
    for j, (item, push) in enumerate(zip(shown, pushes(after, training), strict=True)):
        if push is not None and not item.lacks and item.joint not in of_effects:
            force = f"{push.torque:.3g} ± {push.std:.1g} {robot.torque_unit(j)}"
            why = (
                f"its friction pushes with {force} at {push.speed:.3g} {robot.position_unit(j)}/s, which no friction "
                f"does: another torque depends on its speed, or the effort is not what the description says"
            )
            item = replace(item, shown=False, by="", why=why, lacks=True)
        found.append(item)
    return tuple(found)
