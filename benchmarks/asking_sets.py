"""Poor first recordings of an arm with one effect, and what one further motion tells: see `asking`."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from itertools import permutations
from typing import Any

import numpy as np
from virtual_motions import RATE, random_motion, ranges
from virtual_sets import random_effect

from scara_ident.diagnosis import Diagnosis, diagnose
from scara_ident.diagnosis.candidates.candidates import CandidateColumns
from scara_ident.diagnosis.fitting.correction import corrected
from scara_ident.diagnosis.testing.candidate_tests import examine
from scara_ident.diagnosis.testing.fitted_model import FittedModel
from scara_ident.diagnosis.testing.selection_step import fitted_model
from scara_ident.estimation.observations import observe
from scara_ident.excitation import Design, Effort, Limits, design_excitation, limits_of
from scara_ident.excitation.promise import all_rows
from scara_ident.identification.usable import usable_in_bands
from scara_ident.inquiry.answerability import inquire, knowing
from scara_ident.inquiry.belief import believed
from scara_ident.inquiry.questions import Question, Suspect, suspects_in_model
from scara_ident.inquiry.torque_noise import noise_density
from scara_ident.model.model import build_model
from scara_ident.recording.recording import Recording
from scara_ident.robot.robot import Robot, load_robot
from scara_ident.simulation import Effect, ReferenceMotion, VirtualArm, simulate, virtual_arm

PAIRS = (
    ("spring", "base_tilt"),
    ("stribeck", "presliding"),
    ("transmission_loss", "torque_sensor_nonlinearity"),
    ("joint_elasticity", "time_delay"),
    ("position_dependent_friction", "torque_ripple"),
    ("payload_change", "torque_gain_mismatch"),
)
# Sizes of effects against the usual, reach of the first motion, rad, its largest speed, rad/s, and lengths, s.
FACTORS, REACHES, SPEEDS = (0.15, 1.5), (0.1, 0.3), (0.4, 1.0)
FIRST, ASKED, SAMPLED = 8.0, 15.0, 500.0
EFFORT, PLAIN = Effort(starts=1, rounds=2, processes=1), Effort(starts=2, rounds=0, processes=1)
WAYS = ("tell", "random", "logdet")
# A tight cell: to either side of the place of the first motion, rad, the speed in it, rad/s, and sizes of effects that can
# show there at all.
ROOM, REDUCED, LARGER = 0.5, 1.0, (0.5, 3.0)
# Recordings of the asked motion, of other noise each, by which what was promised is seen.
DRAWS = 5


def poor_motion(arm: VirtualArm, rng: np.random.Generator, reaches: tuple[float, float] = REACHES) -> ReferenceMotion:
    """Return two slow sines of each joint about a random place, faded in and out."""
    robot = arm.robot
    low, high = ranges(robot)
    place = (low + rng.uniform(0.3, 0.7, robot.n) * (high - low))[:, None]
    reach, speed = np.exp(rng.uniform(*np.log(reaches))), rng.uniform(*SPEEDS)
    fast = speed / reach * rng.uniform(0.7, 1.3, (robot.n, 1))
    phase = rng.uniform(0.0, 2.0 * np.pi, (2, robot.n, 1))
    t = np.arange(round(FIRST * RATE) + 1) / RATE
    q, v, a = np.zeros((3, robot.n, len(t)))
    for share, w, angle in ((0.6, fast, phase[0]), (0.4, 0.31 * fast, phase[1])):
        q += share * np.sin(w * t + angle)
        v += share * w * np.cos(w * t + angle)
        a -= share * w**2 * np.sin(w * t + angle)
    (e, f), (de, df), (dde, ddf) = zip(_rise(t), _rise(FIRST - t), strict=True)
    fade, dfade, ddfade = e * f, de * f - e * df, dde * f - 2.0 * de * df + e * ddf
    signals = (place + reach * fade * q, reach * (dfade * q + fade * v))
    return ReferenceMotion("first", robot.joints, t, *signals, reach * (ddfade * q + 2.0 * dfade * v + fade * a))


def _rise(t: np.ndarray) -> tuple[np.ndarray, ...]:
    s = np.clip(t, 0.0, 1.0)
    return 10 * s**3 - 15 * s**4 + 6 * s**5, 30 * s**2 * (1 - s) ** 2, 60 * s * (1 - s) * (1 - 2 * s)


def right(found: Diagnosis, truth: Effect) -> bool:
    """Return whether the effect is named, alone and sure."""
    if len(found.effects) != 1 or found.effects[0].confounded_with:
        return False
    own = found.effects[0]
    return own.effect == truth.name and (truth.joint is None or own.joint in (None, truth.joint))


def seen(found: Diagnosis, first: Diagnosis, question: Question, runs: Sequence[Recording]) -> float:
    """Return how far apart the answers are on recordings, by the scatter of blocks.

    Beside the model that was asked. What was found by then is taken out of the torque, so that it is no noise.
    """
    inquiry, scene = inquire(first, [question]), found.search.scene
    data, _, _ = usable_in_bands(scene.model, runs, (), found.search.bands, alike=True)
    if (taken := found.search.correction) is not None:
        data = corrected(data, taken)
    columns = CandidateColumns(observe(scene.model, data))
    made = inquiry.rows(lambda wanted: columns.rows(scene, wanted))
    wide = {item.label: rows for item, rows in zip(inquiry.suspects, made, strict=True)}
    now = {item.label: item for item in suspects_in_model(found)}
    joints = list(columns.observations.joints)
    for item in now.values():
        (rows,) = columns.rows(scene, [item.candidate])
        for j, own in rows.items():
            table = joints[j].table.copy()
            table[-1] -= np.asarray(item.value) @ own
            joints[j] = replace(joints[j], table=table)
    left = replace(columns.observations, joints=tuple(joints))

    @cache
    def beside(kept: tuple[str, ...], other: str | None) -> FittedModel:
        rows = columns.rows(scene, [now[label].candidate for label in kept])
        return fitted_model(left, [*rows, *([] if other is None else [wide[other]])], found.after.weights, 4)

    def apart(one: Suspect, other: Suspect | None) -> float:
        gone = {one.label} if other is None else {item.label for item in question.suspects}
        kept = tuple(label for label in now if label in inquiry.labels_in_model and label not in gone)
        model = beside(kept, None if other is None else other.label)
        value = np.array(one.value)
        axes = inquiry.just_seen[one.label] if other is None else value[:, None]
        torque = {joint: axes.T @ rows[: len(value)] for joint, rows in wide[one.label].items()}
        spread = np.diag(examine(model, [torque])[0].covariance)
        return float(1.0 / np.sqrt(np.mean(spread))) if np.all(np.isfinite(spread) & (spread > 0.0)) else 1e-12

    if question.kind == "confounders":
        return min(apart(one, other) for one, other in permutations(question.suspects, 2))
    return float(np.median([apart(item, None) for item in question.suspects]))


def right_one(label: str, truth: Effect) -> bool:
    """Return whether a label is that of the effect."""
    places = () if truth.joint is None else (f"{truth.name} of {truth.joint}",)
    return label in (truth.name, *places) or (truth.joint is None and label.startswith(f"{truth.name} of "))


def question_of_truth(asked: Sequence[Question], truth: Effect) -> Question | None:
    """Return what is asked about the effect that is there: of rivals all, else that effect alone; None where nothing is."""
    for item in asked:
        own = [suspect for suspect in item.suspects if right_one(suspect.label, truth)]
        if own:
            return item if item.kind == "confounders" else replace(item, text=own[0].label, suspects=(own[0],))
    return None


def said(first: Diagnosis, design: Design, truth: Effect, quiet: Sequence[Recording]) -> bool | None:
    """Return whether the motion was said to tell the effect that is there; None where nothing was asked of it.

    Of what may be below the limit, by its true size, which recordings without noise have.
    """
    asked = [item for item in design.tells if any(right_one(own.label, truth) for own in item.question.suspects)]
    if not asked or asked[0].question.kind == "confounders":
        return asked[0].settled if asked else None
    inquiry = inquire(first)
    scene, suspects = inquiry.scene, asked[0].question.suspects
    own = next(item for item in suspects if right_one(item.label, truth))
    columns = CandidateColumns(observe(scene.model, usable_in_bands(scene.model, quiet, (), first.search.bands)[0]))
    model = fitted_model(columns.observations, [], first.after.weights, 4)
    (found,) = examine(model, columns.rows(scene, [own.candidate]))
    true = replace(own, value=tuple(float(x) for x in found.value))
    others = tuple(true if item is own else item for item in suspects)
    inquiry = knowing(
        replace(inquiry, questions=(replace(asked[0].question, suspects=others),)),
        first.search.step.columns,
        widening=True,
    )
    # Without what is known this size alone is asked for, not all that the first recordings would show as well.
    alone = replace(inquiry, known=None)
    return believed(alone, all_rows(alone, [design.motion()]))[own.label] >= 1.0


def record(arm: VirtualArm, motion: ReferenceMotion, truth: Effect, seed: int, repetition: int = 1) -> Recording:
    """Return a recording of the arm with the effect."""
    return simulate(arm, motion, effects=[truth], seed=seed, repetition=repetition, rate=SAMPLED).recording


def as_reference(design: Design) -> ReferenceMotion:
    """Return a designed motion to follow."""
    designed = design.trajectories[0]
    t = np.linspace(0.0, designed.duration, round(designed.duration * RATE) + 1)
    return ReferenceMotion("more", designed.joints, t, *designed.at(t))


@cache
def robot_named(name: str) -> Robot:
    """Return the robot of a name, read once."""
    return load_robot(None if name == "scara03" else name)


@cache
def _plain(robot: Robot, seconds: float) -> ReferenceMotion:
    """Return the motion of the largest log determinant, the same for every set of a robot with the same limits."""
    limits = limits_of(robot, clearance=None, share=1.0)
    return as_reference(design_excitation(build_model(robot), duration=seconds, limits=limits, effort=PLAIN))


def in_cell(robot: Robot, motion: ReferenceMotion) -> Robot:
    """Return a robot with the limits of a tight cell about a motion."""
    low, high = ranges(robot)
    place = 0.5 * (motion.position.min(axis=1) + motion.position.max(axis=1))
    speed = np.minimum(robot.velocity_limit, REDUCED)
    lower, upper = np.maximum(low, place - ROOM), np.minimum(high, place + ROOM)
    return replace(robot, lower=lower, upper=upper, velocity_limit=speed)


def one_set(
    robot: str, number: int, seed: int, tight: bool = False, quick: bool = False, seconds: float = ASKED
) -> dict[str, Any]:
    """Return what one set tells."""
    rng = np.random.default_rng([seed, number])
    arm = virtual_arm(robot_named(robot))
    pair = PAIRS[number % len(PAIRS)]
    name = pair[(number // len(PAIRS)) % 2]
    truth = random_effect(name, float(np.exp(rng.uniform(*np.log(LARGER if tight else FACTORS)))), arm, rng)
    motion = poor_motion(arm, rng)
    begun = [record(arm, motion, truth, number, run) for run in (1, 2)]
    first = diagnose(arm.robot, begun)
    result: dict[str, Any] = {"robot": robot, "seed": seed, "set": number, "tight": tight, "pair": list(pair)}
    result |= {"truth": name, "seconds": seconds}
    result |= {
        "joint": truth.joint,
        "before": right(first, truth),
        "verdict": first.verdict,
        "found": found_effects(first),
    }
    if result["before"]:
        return result
    model = first.before.model
    inquiry = inquire(first)
    asked = inquiry.questions
    result["asked"] = [item.text for item in asked]
    start = time.perf_counter()
    # All of the limits for each, as the random motion has them.
    within = in_cell(arm.robot, motion) if tight else arm.robot
    limits = limits_of(within, clearance=None, share=1.0)
    design = design_excitation(model, duration=seconds, tell=inquiry, limits=limits, effort=EFFORT)
    result["design_seconds"] = time.perf_counter() - start
    motions = {
        "tell": lambda: as_reference(design),
        "random": lambda: random_motion("more", replace(arm, robot=within), "fourier", seconds, rng),
        "logdet": lambda: _plain(within, seconds),
    }
    silent = replace(arm, torque_noise=np.zeros(arm.robot.n))
    quiet = [record(silent, followed, truth, number) for followed in (motion, as_reference(design))]
    result["said"] = said(first, design, truth, quiet)
    result["unshown"] = [label for item in design.tells for label in item.unshown]
    told = next((item for item in design.tells if item.question.suspects), None)
    if told is not None:
        result["kind"], result["promised"] = told.question.kind, [told.before, told.after]
    sought = question_of_truth(asked, truth)
    more, result["apart"] = {}, {}

    def follow(way: str, followed: ReferenceMotion) -> None:
        more[way] = record(arm, followed, truth, number, 3)
        found = diagnose(arm.robot, [*begun, more[way]])
        result[way] = right(found, truth)
        result[f"found_{way}"], result[f"why_{way}"] = found_effects(found), _why(found, truth)
        again = [record(arm, followed, truth, number, run) for run in range(4, 3 + DRAWS)]
        runs = [more[way], *(replace(run, name=more[way].name) for run in again)]
        if way == "tell" and told is not None:
            result["seen"] = [seen(found, first, told.question, [*begun, run]) for run in runs]
        if sought is not None:
            each = np.array([seen(found, first, sought, [*begun, run]) for run in runs])
            result["apart"][way] = float(np.mean(each**-2.0) ** -0.5)

    for way in WAYS:
        follow(way, motions[way]())
    if not quick:
        # Each as a trajectory of its own.
        runs = [replace(run, name=f"{way}_1") for way, run in more.items()]
        result["times"], motion = best(first, diagnose(arm.robot, [*begun, *runs]), limits, truth, seconds)
        if motion is None:
            result["best"] = False
        else:
            follow("best", motion)
    return result


def best(
    first: Diagnosis, whole: Diagnosis, limits: Limits, truth: Effect, seconds: float
) -> tuple[float, ReferenceMotion | None]:
    """Return the motion designed for the effect that is there alone, its size taken from all recordings; None where they show none.

    Before it, how many times as large as the diagnosis needs it the effect is then expected to be.
    """
    scene = whole.search.scene
    own = [
        item
        for item in whole.search.decisions
        if item.candidate.effect.name == truth.name
        and not item.candidate.effect.by_recording
        and truth.joint in (None, item.candidate.joint(scene))
    ]
    suspects = [item for item in suspects_in_model(whole) if item.candidate.effect.name == truth.name]
    if own and not suspects:
        held = max(own, key=lambda item: item.examination.gain)
        suspects = [Suspect(held.candidate, held.label, tuple(float(x) for x in held.examination.value))]
    if not suspects or not any(suspects[0].value):
        return 0.0, None
    question = Question("below_limit", suspects[0].label, (suspects[0],))
    inquiry = replace(inquire(first, [question]), noise=noise_density(whole), bands=whole.search.bands)
    inquiry = knowing(inquiry, first.search.step.columns, widening=True)
    design = design_excitation(first.before.model, duration=seconds, tell=inquiry, limits=limits, effort=EFFORT)
    (times,) = believed(inquiry, all_rows(inquiry, [design.motion()])).values()
    return times, as_reference(design)


def _why(diagnosis: Diagnosis, truth: Effect) -> str:
    """Say what became of the effect that is there where it was seen best: standard errors, and why in words."""
    scene, said = diagnosis.search.scene, [(0.0, "")]
    for item in diagnosis.search.decisions:
        if item.candidate.effect.name == truth.name and truth.joint in (None, item.candidate.joint(scene)):
            found = item.examination
            if np.all(np.isfinite(found.covariance)):
                wald = float(found.value @ np.linalg.pinv(found.covariance, rcond=1e-9, hermitian=True) @ found.value)
                errors = float(np.sqrt(max(wald, 0.0)))
                said.append((errors, f"{item.label}: {errors:.1f} standard errors; {item.why}"))
    return max(said)[1]


def found_effects(diagnosis: Diagnosis) -> list[str]:
    """Return the effects found, each with what it may be instead."""
    return [
        f"{item.effect} {item.joint or ''} ({', '.join(other.label for other in item.confounded_with)})"
        for item in diagnosis.effects
    ]
