"""The truth of a simulated arm, as JSON beside its recording."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from scara_ident.files import slug, written_together
from scara_ident.model.model import build_model
from scara_ident.model.terms import Offset
from scara_ident.recording.recording import write_recording
from scara_ident.simulation.arm import VirtualArm
from scara_ident.simulation.effects import Effect
from scara_ident.simulation.simulate import SimulationResult


def truth(arm: VirtualArm, effects: Sequence[Effect] = ()) -> dict[str, Any]:
    """Describe an arm and its effects.

    Parameters
    ----------
    effects : sequence of Effect
        Sizes that were left open are taken from the arm.

    Returns
    -------
    dict
        ``parameters`` has the form and names of ``identification.json`` for the complete model, ``effects`` those of
        ``diagnosis.json``; ``standard_parameters`` are the bodies', ``encoder_resolution`` is at the joint.
    """
    robot = arm.robot
    model = build_model(robot, "complete")
    values = _complete_parameters(arm)
    return {
        "robot": robot.name,
        "effort_side": robot.effort_side,
        "joints": list(robot.joints),
        "reduction": robot.reduction.tolist(),
        "parameters": [column.entry(value=value) for column, value in zip(model.columns, values, strict=True)],
        "standard_parameters": {
            name: row.tolist() for name, row in zip(robot.links, np.asarray(arm.bodies), strict=True)
        },
        "rotor_inertia": arm.rotor_inertia.tolist(),
        "friction": {name: row.tolist() for name, row in zip(robot.joints, arm.friction, strict=True)},
        "torque_offset": arm.torque_offset.tolist(),
        "torque_noise": arm.torque_noise.tolist(),
        "encoder_resolution": arm.encoder_resolution.tolist(),
        "controller": {
            "proportional": arm.controller.proportional.tolist(),
            "integral": arm.controller.integral.tolist(),
            "derivative": arm.controller.derivative.tolist(),
            "velocity_cutoff": arm.controller.cutoff,
            "velocity_damping": arm.controller.damping,
        },
        "tool": arm.tool.tolist(),
        "effects": [effect.resolve(arm).as_dict() for effect in effects],
    }


def write_simulation(result: SimulationResult, folder: Path | str) -> Path:
    """Write a simulated recording and what was behind it, both or neither.

    Parameters
    ----------
    folder : path
        Made if it is not there. ``<trajectory>_<repetition>.parquet`` is the recording, with efforts divided by the
        robot's gains; ``<trajectory>_<repetition>.truth.json`` is beside it.

    Returns
    -------
    Path
        Of the recording.

    Raises
    ------
    ScaraIdentError
        If the folder cannot be written to.
    """
    folder = Path(folder)
    path = folder / f"{slug(result.recording.trajectory, 'motion')}_{result.repetition}.parquet"
    content = truth(result.arm, result.effects) | {
        "recording": path.name,
        "seed": result.seed,
        "repetition": result.repetition,
        "rate": result.rate,
        "substeps": result.substeps,
    }
    with written_together(folder) as place:
        write_recording(result.recording, place / path.name, effort_gain=result.arm.robot.effort_gain)
        (place / path.name).with_suffix(".truth.json").write_text(
            json.dumps(content, indent=1) + "\n", encoding="utf-8"
        )
    return path


def _complete_parameters(arm: VirtualArm) -> list[float]:
    """Values of the complete model's columns: base parameters, friction joint by joint, offsets where the model has one."""
    model = build_model(arm.robot, "complete")
    body = model.rigid_body
    standard = np.concatenate([arm.bodies.ravel(), arm.armature])
    base = body.base.grouping[body.kept] @ standard
    places = [place for term in model.terms if isinstance(term, Offset) for place in term.places]
    return [*base.tolist(), *arm.friction.ravel().tolist(), *arm.torque_offset[places].tolist()]
