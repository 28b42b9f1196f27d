"""Tentative effects: worth a look, not believed, with the experiment that would decide."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from scara_ident.arrays import Array
from scara_ident.diagnosis.checks.noise_check import BY_NOISE
from scara_ident.diagnosis.selection.search import Search
from scara_ident.diagnosis.testing.acceptance import Decision
from scara_ident.diagnosis.testing.selection_step import best_of_each
from scara_ident.motion.position_noise import MIN_TRAVEL_SHARE, noise_sizes
from scara_ident.robot.robot import Robot

# Number of tentative effects in the result, those with the largest gain first; no decision depends on it.
MAX_TENTATIVE = 6
# Settles an effect that noise may cause, if another motion does not help: a motion that shows the effect better shows
# the noise as well.
LESS_NOISE = "record positions with less noise: no rounding, time stamps with all digits"


@dataclass(frozen=True)
class TentativeEffect:
    """An effect that is not in the model.

    Attributes
    ----------
    why : str
        Why it is not believed.
    settled_by : str
        What to record.
    gain : float
        Share of the squared residual of its joints that it would remove in cross-validation.
    p_value : float
        Corrected for the candidates tried.
    decision : Decision or None
        With its member and coefficients, where it was judged.
    """

    effect: str
    joint: str | None
    description: str
    why: str
    settled_by: str
    gain: float
    p_value: float
    decision: Decision | None = None


def tentative_effects(
    found: Search, demoted: Sequence[Decision], believed: Collection[tuple[str, str | None]]
) -> tuple[TentativeEffect, ...]:
    """Return the effects that an arm could have and that these recordings do not settle, the largest gain first.

    Parameters
    ----------
    demoted : sequence of Decision
        On effects that were let in and did not stay.
    believed : collection of (str, str or None)
        Name and joint of the effects in the model, which are not listed again.
    """
    scene = found.scene
    # Scan points of an effect that was refined and refused must not bring it back.
    tried = {item.label: item for item in demoted}
    best = [item for item in best_of_each(found.decisions).values() if item.tentative and item.label not in tried]
    best += tried.values()
    result = []
    for decision in sorted(best, key=lambda item: -item.gain):
        candidate = decision.candidate
        name, joint = candidate.effect.name, candidate.joint(scene)
        if (name, joint) not in believed:
            p_value = min(1.0, decision.examination.p_value * found.tried)
            words = candidate.effect.description(scene, candidate.member)
            settled = settled_by(found, [decision])
            result.append(TentativeEffect(name, joint, words, decision.why, settled, decision.gain, p_value, decision))
    return tuple(result[:MAX_TENTATIVE])


def settled_by(found: Search, decisions: Sequence[Decision]) -> str:
    """Return what to record to settle an effect on some joints: less noise relative to the motion if noise may cause it, else its experiment."""
    if not all(decision.why.startswith(BY_NOISE) for decision in decisions):
        return decisions[0].candidate.effect.experiment
    scene = found.scene
    robot, steps, noise = scene.robot, *_steps_and_noise(found)
    joints = [decision.candidate.member.joint for decision in decisions]
    asked = range(robot.n) if None in joints else [joint for joint in joints if joint is not None]
    turn = np.where(robot.prismatic, np.inf, 2.0 * np.pi)
    reach = np.fmin(robot.upper - robot.lower, turn)
    little = [j for j in asked if scene.travel[j] < MIN_TRAVEL_SHARE * reach[j] < np.inf]
    if little:
        each = "; ".join(_moved(robot, j, float(scene.travel[j]), float(reach[j]), steps[j], noise[j]) for j in little)
        return f"move {', '.join(robot.joints[j] for j in little)} further and faster: {each}"
    coarse = [j for j in asked if steps[j] > 0.0 and noise[j] <= steps[j]]
    if coarse:
        each = ", ".join(f"{steps[j]:.2g} {robot.position_unit(j)} on {robot.joints[j]}" for j in coarse)
        return f"record positions with a finer encoder: the steps are {each}"
    return LESS_NOISE


def _steps_and_noise(found: Search) -> tuple[Array, Array]:
    """Return the largest step of each joint's positions, 0 where there is none, and the standard deviation of their white noise."""
    sizes = [part for parts in noise_sizes(found.data) for part in parts]
    steps = np.max([[step or 0.0 for step, _ in part] for part in sizes], axis=0)
    return steps, np.median([[level for _, level in part] for part in sizes], axis=0)


def _moved(robot: Robot, joint: int, travel: float, reach: float, step: float, noise: float) -> str:
    """Say how far a joint moved, of what it can, and what of that its positions hide."""
    unit = robot.position_unit(joint)
    if step > 0.0:
        hidden = f"which is {travel / step:.2g} encoder steps of {step:.2g} {unit}"
    else:
        hidden = f"with position noise of {noise:.2g} {unit}"
    return f"it moved by {travel:.2g} {unit} of {reach:.2g} {unit}, {hidden}"
