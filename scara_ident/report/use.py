"""A model in use as JSON, ``use.json``, and as sentences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from scara_ident.arrays import Array
from scara_ident.errors import ScaraIdentError
from scara_ident.export.identified_model import IdentifiedModel

if TYPE_CHECKING:
    from scara_ident.use import Use
    from scara_ident.use.worth import EffectWorth

# What is fed forward does harm where it leaves so many times the error that is left without, and more of that of the PID alone
# than a draw of the arm changes, and than is written: in whole per cent the two would be one number.
HARM_RATIO, HARM_SHARE_OF_PID = 1.1, 0.01
# What is fed forward, in words.
WORDS = {
    "pid": "PID alone",
    "urdf": "with the URDF fed forward",
    "identified": "with the identified model",
    "effects": "with the effects found",
    "mujoco_identified": "in MuJoCo with the identified model",
    "mujoco_effects": "in MuJoCo with the effects found",
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
        "notes": list(result.notes),
        "tracking": {name: robot.by_joint(value.tolist()) for name, value in result.rms().items()},
        "units": robot.by_joint(map(robot.position_unit, range(robot.n))),
        "rollout": {
            name: {
                f"{horizon:g}": robot.by_joint(row.tolist())
                for horizon, row in zip(result.horizons, rows, strict=True)
                if np.all(np.isfinite(row))
            }
            for name, rows in result.rollouts.items()
        },
    }


def worth_dict(model: IdentifiedModel) -> dict[str, Any]:
    """Return what ``diagnosis.json`` holds under ``worth``: tracking errors with and without the effects found.

    Where that cannot be said ``tracking`` is None, and ``why`` says why.
    """
    # Imported here since it loads the virtual arm.
    from scara_ident.use.worth import worth

    try:
        found = worth(model)
    except ScaraIdentError as error:
        return {"tracking": None, "why": str(error), "summary": [f"What the effects cost is not known: {error}."]}
    robot = model.robot
    return {
        "summary": [_shares_said(found.rms), *(_cost_said(item, found.rms) for item in found.each), *found.notes],
        "trajectory": {"name": found.motion.name, "duration": found.motion.duration},
        "tracking": {name: robot.by_joint(errors.tolist()) for name, errors in found.rms.items()},
        "effects": [
            {
                "effect": item.entry["effect"],
                "joint": item.entry["joint"],
                "pid_without_it": robot.by_joint(item.alone.tolist()),
                "fed_without_it": None if item.not_fed is None else robot.by_joint(item.not_fed.tolist()),
            }
            for item in found.each
        ],
        "not_simulated": list(found.missing),
        "units": robot.by_joint(map(robot.position_unit, range(robot.n))),
        "why": None,
    }


def _cost_said(item: EffectWorth, rms: Mapping[str, Array]) -> str:
    alone = rms["pid"]
    where = f" of {item.entry['joint']}" if item.entry["joint"] else ""
    said = f"{item.entry['effect']}{where}: if the arm did not have it, the error of the PID alone would be {total(item.alone, alone):.0%} of its present value"
    if item.not_fed is None:
        return f"{said}."
    fed, without = total(rms["effects"], alone), total(item.not_fed, alone)
    if f"{fed:.0%}" == f"{without:.0%}":
        # Two equal numbers would read as if it did nothing.
        return f"{said}."
    harm = ": it does harm, so leave it out of the feed-forward" if _harms(fed, without) else ""
    return f"{said}; with all effects in the feed-forward the error is {fed:.0%} of that value, with all but this one {without:.0%}{harm}."


def _harms(fed: float, without: float) -> bool:
    """Tell whether errors with and without what is fed forward, in shares of that of the PID alone, speak against it."""
    return fed > HARM_RATIO * without and fed - without > HARM_SHARE_OF_PID


def total(errors: Array, alone: Array) -> float:
    """Return one number for all joints: the rms of each joint's error over that of the PID alone."""
    return float(np.sqrt(np.mean((errors / np.maximum(alone, np.finfo(float).tiny)) ** 2)))


def _shares_said(rms: Mapping[str, Array]) -> str:
    shares = {name: total(value, rms["pid"]) for name, value in rms.items() if name != "pid"}
    last = f" and {shares['effects']:.0%} {WORDS['effects']}." if "effects" in shares else "; no effects were found."
    return (
        f"The tracking error, relative to the PID alone, is {shares['urdf']:.0%} {WORDS['urdf']}, "
        f"{shares['identified']:.0%} {WORDS['identified']}{last}"
    )


def _harm_said(joints: Sequence[str], rms: Mapping[str, Array]) -> list[str]:
    """Say on which joints the effects fed forward leave a larger error than the model without them."""
    if "effects" not in rms:
        return []
    worse = [
        f"{joint} ({fed / alone:.0%} of the PID's error, without them {without / alone:.0%})"
        for joint, alone, without, fed in zip(joints, rms["pid"], rms["identified"], rms["effects"], strict=True)
        if alone > 0.0 and _harms(fed / alone, without / alone)
    ]
    return [f"In the feed-forward the effects do harm on {', '.join(worse)}: leave them out there."] if worse else []


def sentences(result: Use) -> list[str]:
    """Say in words what was won."""
    said = [_shares_said(result.rms()), *_harm_said(result.model.robot.joints, result.rms())]
    said += [f"{doubt[0].upper()}{doubt[1:]}; it is in the feed-forward." for doubt in result.model.doubts]
    for name, rows in result.rollouts.items():
        words = WORDS[name]
        if name == "effects" and result.missing:
            words += f" but {', '.join(result.missing)}"
        place = int(np.argmin(np.abs(np.array(result.horizons) - 0.2)))
        if not np.all(np.isfinite(rows[place])):
            if np.any(np.isinf(rows)):
                said.append(f"Simulated {words} the arm diverges.")
            else:
                said.append(
                    f"Simulated {words}: the recording has no moment at which all joints move and "
                    f"{max(result.horizons):g} s follow; give a recording in which all joints move at the same time."
                )
            continue
        ends = ", ".join(
            f"{joint} {value:.2g} {result.model.robot.position_unit(j)}"
            for j, (joint, value) in enumerate(zip(result.model.robot.joints, rows[place], strict=True))
        )
        said.append(f"Simulated {words}, the position error after {result.horizons[place]:g} s is {ends}.")
    if result.not_mujoco:
        said.append(f"Not simulated in MuJoCo: {result.not_mujoco}.")
    if result.missing:
        said.append(f"Not simulated: {', '.join(result.missing)}.")
    return [*said, *result.notes]
