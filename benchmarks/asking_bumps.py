"""Whether the shape of a torque that no catalogue lists is recovered by the motion asked for it: see `asking`."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from asking_sets import ASKED, EFFORT, SAMPLED, as_reference, found_effects, poor_motion, robot_named

from scara_ident.diagnosis import diagnose
from scara_ident.excitation import design_excitation, limits_of
from scara_ident.inquiry.answerability import inquire, known_rows
from scara_ident.inquiry.shape import KNOTS
from scara_ident.recording.recording import Recording
from scara_ident.simulation import ReferenceMotion, simulate, virtual_arm

# Of a bump: standard deviation over the joint's range, and height over the standard deviation of the effort.
# The first motion passes all of a bump, or it could be anything: reach, rad.
WIDTHS, SIZES, PASSING = (0.09, 0.14), (0.2, 0.6), (0.8, 1.2)


def one_bump(robot: str, number: int, seed: int) -> dict[str, Any]:
    """Return how well the shape of a torque that no catalogue lists is recovered by the motion asked for it.

    A bump over the position of a joint is added to its recorded effort, where the first motion comes by. The curve is
    that of the question, hats over the range, fitted together with the base model; what an offset takes of it is left out
    of both.
    """
    rng = np.random.default_rng([seed, number, 1])
    arm = virtual_arm(robot_named(robot))
    motion, j = poor_motion(arm, rng, PASSING), int(rng.integers(arm.robot.n))
    low, high = float(arm.robot.lower[j]), float(arm.robot.upper[j])
    centre = float(rng.uniform(motion.position[j].min(), motion.position[j].max()))
    effort = simulate(arm, motion, seed=number, rate=SAMPLED).recording.effort
    assert effort is not None
    width, size = float(rng.uniform(*WIDTHS) * (high - low)), float(rng.uniform(*SIZES) * np.std(effort[j]))

    def bump(q: np.ndarray) -> np.ndarray:
        return np.asarray(size * np.exp(-0.5 * ((q - centre) / width) ** 2))

    def bumped(followed: ReferenceMotion, run: int) -> Recording:
        plain = simulate(arm, followed, seed=number, repetition=run, rate=SAMPLED).recording
        assert plain.effort is not None
        more = plain.effort.copy()
        more[j] += bump(plain.position[j])
        return replace(plain, effort=more)

    begun = [bumped(motion, run) for run in (1, 2)]
    first = diagnose(arm.robot, begun)
    joint = arm.robot.joints[j]
    result: dict[str, Any] = {
        "robot": robot,
        "seed": seed,
        "bump": number,
        "joint": joint,
        "size": size,
        "width": width,
    }
    result |= {"verdict": first.verdict, "found": found_effects(first)}
    inquiry = inquire(first)
    wanted = [item for item in inquiry.questions if item.kind == "unexplained" and item.joint == joint]
    result["asked"] = [item.text for item in inquiry.questions]
    if not wanted:
        return result
    limits = limits_of(arm.robot, clearance=None, share=1.0)
    design = design_excitation(first.before.model, duration=ASKED, tell=inquiry, limits=limits, effort=EFFORT)
    more = as_reference(design)
    found = diagnose(arm.robot, [*begun, bumped(more, 3)])
    result |= {"verdict_after": found.verdict, "found_after": found_effects(found)}
    left = found.unexplained
    result["signals"] = None if left is None or left.joint != joint else list(left.signals)
    over = f"position of {joint}"
    # An effect in the model that took a part of it is left out: the curve stands for all of it.
    bare = replace(inquire(found, [replace(wanted[0], signals=(over,))]), in_model=(), known=None)
    hats = known_rows(bare, found.search.step.columns).solve().value[-KNOTS:]
    q = np.linspace(more.position[j].min(), more.position[j].max(), 400)
    curve = np.interp(q, np.linspace(low, high, KNOTS), hats)
    wrong, true = curve - bump(q), bump(q)
    result["error"] = float(np.std(wrong) / np.std(true))
    result["over"] = float((q[-1] - q[0]) / (high - low))
    return result
