"""Is an effort in other units than those of the other joints? Bodies that move several joints tell, whatever their masses are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scara_ident.estimation.joint_scales import joint_scales
from scara_ident.estimation.least_squares import weighted_value
from scara_ident.estimation.observations import Observations, observe
from scara_ident.identification.channel_check import NARROWED, wide_bands
from scara_ident.identification.channel_comparison import far_less, few, first_runs, held_out, relative
from scara_ident.identification.channel_fault import percent
from scara_ident.threads import one_blas_thread

# Units differ by more than this factor, which is what an effect of the torque's scale is looked for within.
OTHER_UNIT = 2.0


def gain_said(observations: Observations) -> str | None:
    """Say which efforts are in other units than the others, and roughly by what factor; None where none is, or it does not show.

    Where a joint is explained badly, those are suspected whose effort is more than twice, or less than half, as many times the
    torque of the URDF's bodies as it is on most joints. They count if all parameters, free, leave at most half as much with
    these factors, on blocks of time that they were not fitted to: other masses would leave as little without them.

    Parameters
    ----------
    observations : Observations
        The first run of every trajectory is used.
    """
    with one_blas_thread():
        held = first_runs(observations)
        poor = relative(weighted_value(held.by_joint), held) > NARROWED
        if not np.any(poor):
            return None
        # A torque in another unit has narrowed its own band until little is seen in it.
        held = observe(held.model, held.data.at(wide_bands(held)))
        if few(held):
            return None
        scales = joint_scales(held)
        usual = float(np.median(list(scales.values()))) if scales else 0.0
        factors = {j: usual / scale for j, scale in scales.items() if not _same(usual / scale)}
        # Of two joints either may be the one that is wrong.
        if len(scales) - len(factors) <= max(1, len(factors)):
            return None
        if not factors:
            return None
        said = far_less(held_out(held), held_out(_times(held, factors)), np.inf, poor=True)
    if said is None:
        return None
    robot = held.model.robot
    each = " and ".join(
        f"{float(f'{factor * robot.effort_gain[j]:.2g}'):g} instead of {robot.effort_gain[j]:.3g} on {robot.joints[j]}"
        for j, factor in factors.items()
    )
    return (
        f"effort is in another unit on {' and '.join(robot.joints[j] for j in factors)} than on the other joints: with an effort_gain of roughly "
        f"{each} the unexplained part of the torque falls from {percent(said[0])} to {percent(said[1])} %; state it in robot.yaml"
    )


def _same(factor: float) -> bool:
    """Tell whether a scale is of one unit with another; one of the opposite sign is a matter of signs."""
    return not (factor > OTHER_UNIT or 0.0 < factor < 1.0 / OTHER_UNIT)


def _times(held: Observations, factors: dict[int, float]) -> Observations:
    """Return observations with the torque of some joints times a factor each."""
    scale = np.ones(len(held.joints))
    scale[list(factors)] = list(factors.values())
    tables = [
        np.concatenate([rows.table[:-1], size * rows.table[-1:]]) for rows, size in zip(held.joints, scale, strict=True)
    ]
    joints = tuple(replace(rows, table=table) for rows, table in zip(held.joints, tables, strict=True))
    return replace(held, joints=joints)
