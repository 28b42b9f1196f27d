"""Recordings of random rigid arms in closed loop, and what the arm really did, to add the torque of something to.

What an effect adds to the torque along a given motion is exact whatever the controller would have done about it: a virtual
arm that has the effect is not needed. Arms, motions, encoders and noise are drawn as in `virtual_sets`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from virtual_conditions import Asked, Conditions, draw_conditions, draw_states
from virtual_motions import random_motion, refuse_shaking
from virtual_sets import random_arm, under_control, usual_torque

from scara_ident.recording.recording import Recording
from scara_ident.robot.robot import Robot
from scara_ident.simulation import SimulationResult, TorqueNoise, TrueMotion, VirtualArm, simulate

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class RigidRuns:
    """Recordings of an arm as it is described to the identifier, and its true motion in each.

    Attributes
    ----------
    arm : VirtualArm
    robot : Robot
        As the identifier is told of it.
    conditions : Conditions
    recordings : tuple of Recording
        Those to train on, then those held out.
    true : tuple of TrueMotion
    """

    arm: VirtualArm
    robot: Robot
    conditions: Conditions
    recordings: tuple[Recording, ...]
    true: tuple[TrueMotion, ...]

    def with_torque(self, added: Callable[[int, TrueMotion], Array]) -> tuple[list[Recording], list[Recording]]:
        """Add ``added(k, motion)``, (n, N) on the recorded side, to run k; return training and held-out recordings."""
        made = [
            replace(item, effort=item.effort + added(k, true))
            for k, (item, true) in enumerate(zip(self.recordings, self.true, strict=True))
        ]
        count = sum(not run.held_out for run in self.conditions.runs)
        return made[:count], made[count:]


def rigid_runs(robot: str, seed: int, folder: Path, asked: Asked) -> RigidRuns:
    """Draw an arm, its motions and conditions, and simulate it; what is added is not changed by what runs differ in."""
    arms, sorts, moves, states = (np.random.default_rng(part) for part in np.random.SeedSequence(seed).spawn(4))
    conditions = draw_conditions(sorts, replace(asked, averaged=False, start="with the motion"))
    arm, described = random_arm(robot, conditions.stated, conditions.bits, folder, arms)
    motions = {}
    for run in conditions.runs:
        if run.motion not in motions:
            motions[run.motion] = random_motion(f"M{run.motion + 1}", arm, run.kind, run.duration, moves)
    usual = usual_torque(arm, [motions[run.motion] for run in conditions.runs if not run.held_out])
    arm = replace(arm, torque_noise=conditions.noise * usual)
    drawn = draw_states(states, arm, conditions, usual)
    noise = TorqueNoise(conditions.noise_kind, conditions.correlation_time)

    def simulated(arm: VirtualArm) -> list[SimulationResult]:
        results = []
        for run, state in zip(conditions.runs, drawn, strict=True):
            result = simulate(
                arm, motions[run.motion], seed=seed, repetition=run.repetition, rate=conditions.rate,
                ticks=conditions.ticks, averaged=False, noise=noise, run=state,
            )  # fmt: skip
            refuse_shaking(motions[run.motion], result.true.acceleration)
            results.append(result)
        return results

    arm, results = under_control(arm, simulated)
    # Names tell nothing, so that nothing can be told by them.
    named = [
        replace(item.recording, name=f"run_{k + 1:02d}", trajectory="run", repetition=k + 1)
        for k, item in enumerate(results)
    ]
    return RigidRuns(arm, described, conditions, tuple(named), tuple(item.true for item in results))
