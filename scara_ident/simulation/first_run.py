"""The first run on a machine: the loop is compiled, cached, and the user informed."""

from __future__ import annotations

import numpy as np

from scara_ident.progress import Tell, Work
from scara_ident.simulation.arm import VirtualArm

COMPILING = "compiling the virtual arm, once, about a minute"
# Share of the work that compiling takes before a few runs.
SHARE = 0.8


def compiled_first(arm: VirtualArm, progress: Tell) -> Work:
    """Compile the loop now if nothing is kept of it, and return the progress of what follows.

    Parameters
    ----------
    arm : VirtualArm
        Any: the machine code is the same for all.

    Returns
    -------
    Work
        What is left of the progress.
    """
    from scara_ident.simulation.loop import at_once
    from scara_ident.simulation.simulate import free_motion

    work = Work(progress)
    if at_once():
        return work
    work(COMPILING)
    free_motion(arm, np.zeros(arm.robot.n), np.zeros(arm.robot.n), 1e-3)
    return work.part(SHARE, 1.0)
