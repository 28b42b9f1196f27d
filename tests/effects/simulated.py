"""Simulated runs of virtual arms with one effect, and what the effect's columns say of them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scara_ident.effects import Scene
from scara_ident.motion.motion import Motion
from scara_ident.robot.robot import load_robot
from scara_ident.simulation import Effect, SimulationResult, VirtualArm, ideal, on_side, simulate, truth, virtual_arm
from tests.effects.scenes import scene_of
from tests.simulation.made import scara, swing, tree

Array = NDArray[np.float64]

ARMS = ("motor side", "joint side", "reversed gears", "tree")


def arm_of(kind: str, folder: Path) -> VirtualArm:
    """An arm without noise and encoder steps: the SCARA03 in three ways, or a branched one with a sliding joint."""
    if kind == "joint side":
        return on_side(scara(), "joint")
    if kind == "reversed gears":
        robot = load_robot()
        return replace(scara(), robot=replace(robot, reduction=-robot.reduction))
    return scara() if kind == "motor side" else ideal(virtual_arm(tree(folder)))


def run(arm: VirtualArm, effect: Effect, duration: float = 2.0) -> SimulationResult:
    """A run of a few seconds."""
    return simulate(arm, swing(arm.robot, duration), effects=[effect])


def true_motion(result: SimulationResult) -> Motion:
    """What the arm really did."""
    t = result.true
    return Motion("m", "m", result.recording.time, t.position, t.velocity, t.acceleration, None, result.rate)


def true_scene(result: SimulationResult) -> Scene:
    """The scene with the arm's own parameters."""
    value = np.array([item["value"] for item in truth(result.arm)["parameters"]])
    t = result.true
    return replace(
        scene_of(result.arm.robot, value),
        duration=float(result.recording.time[-1]),
        travel=np.ptp(t.position, axis=1),
        speed=np.abs(t.velocity).max(axis=1),
    )
