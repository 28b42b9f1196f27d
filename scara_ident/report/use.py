"""What is told of a model in use: ``use.json`` and the sentences."""

from __future__ import annotations

from typing import Any

import numpy as np

from scara_ident.arrays import Array
from scara_ident.use import Use

# What is fed forward, in words.
WORDS = {
    "pid": "PID alone",
    "urdf": "with the URDF fed forward",
    "identified": "with the identified model",
    "effects": "with the effects found",
}


def use_dict(result: Use) -> dict[str, Any]:
    """Return the content of ``use.json``."""
    robot = result.model.robot
    return {
        "robot": robot.name,
        "summary": list(sentences(result)),
        "trajectory": {"name": result.motion.name, "duration": result.motion.duration},
        "arms": len(result.runs),
        "effects": [effect.as_dict() for effect in result.effects],
        "not_simulated": list(result.missing),
        "tracking": {
            name: dict(zip(robot.joints, value.tolist(), strict=True)) for name, value in result.rms().items()
        },
        "units": dict(zip(robot.joints, map(robot.position_unit, range(robot.n)), strict=True)),
        "rollout": {
            name: {
                f"{horizon:g}": dict(zip(robot.joints, row.tolist(), strict=True))
                for horizon, row in zip(result.horizons, rows, strict=True)
                if np.all(np.isfinite(row))
            }
            for name, rows in result.rollouts.items()
        },
    }


def total(errors: Array, alone: Array) -> float:
    """Return one number for all joints: the rms of each joint's error over that of the PID alone."""
    return float(np.sqrt(np.mean((errors / np.maximum(alone, np.finfo(float).tiny)) ** 2)))


def sentences(result: Use) -> list[str]:
    """Say in words what was won."""
    rms = result.rms()
    alone = rms["pid"]
    shares = {name: total(value, alone) for name, value in rms.items() if name != "pid"}
    said = [
        f"Of the PID's tracking error {WORDS['urdf']} leaves {shares['urdf']:.0%}, {WORDS['identified']} "
        f"{shares['identified']:.0%}"
        + (
            f", {WORDS['effects']} {shares['effects']:.0%}."
            if "effects" in shares
            else "; no effects were found to add."
        )
    ]
    for name, rows in result.rollouts.items():
        place = int(np.argmin(np.abs(np.array(result.horizons) - 0.2)))
        if not np.all(np.isfinite(rows[place])):
            gone = np.any(np.isinf(rows))
            said.append(f"Simulated {WORDS[name]} the arm {'gets lost' if gone else 'was recorded for too short'}.")
            continue
        ends = ", ".join(
            f"{joint} {value:.2g} {result.model.robot.position_unit(j)}"
            for j, (joint, value) in enumerate(zip(result.model.robot.joints, rows[place], strict=True))
        )
        said.append(f"Simulated {WORDS[name]} the arm is off after {result.horizons[place]:g} s by {ends}.")
    if result.missing:
        said.append(f"Not simulated: {', '.join(result.missing)}.")
    return said
