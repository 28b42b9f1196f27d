"""Whether one asked motion settles what poor first recordings left open.

A virtual arm has one effect of a pair that is easily taken for the other. It is first recorded on one motion, twice, in a
small part of its workspace and at one speed; sets in which the effect is named then and nothing beside it are counted and
left. The others get one more recording: of the motion of ``design_excitation(tell=...)``, of a random motion within the
same limits, and of the motion of the largest log determinant. An effect is named right where it is the only one found, on
its joint, and nothing is confounded with it. Beside that the separation that was promised of the first question and that
which the recordings show, by the scatter of blocks of time.

    python benchmarks/asking.py OUTPUT.jsonl --robot scara03 --sets 24 --seed 1
    python benchmarks/asking.py OUTPUT.jsonl --show
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Sequence
from functools import cache
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np
from virtual_motions import RATE, random_motion, ranges
from virtual_sets import _random_effect

from scara_ident.diagnosis import Diagnosis, diagnose
from scara_ident.diagnosis.answerability import inquire
from scara_ident.diagnosis.candidate_tests import examine
from scara_ident.diagnosis.candidates import CandidateColumns
from scara_ident.diagnosis.fitted_model import FittedModel
from scara_ident.diagnosis.questions import Question, Suspect
from scara_ident.diagnosis.selection_step import fitted_model
from scara_ident.errors import ScaraIdentError
from scara_ident.excitation import Design, Effort, design_excitation, limits_of
from scara_ident.recording.recording import Recording
from scara_ident.robot.robot import load_robot
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
EFFORT, PLAIN = Effort(starts=2, rounds=2, processes=1), Effort(starts=2, rounds=0, processes=1)
WAYS = ("tell", "random", "logdet")
KINDS = ("rivals", "below_limit")


def poor_motion(arm: VirtualArm, rng: np.random.Generator) -> ReferenceMotion:
    """Return two slow sines of each joint about a random place, faded in and out."""
    robot = arm.robot
    low, high = ranges(robot)
    place = (low + rng.uniform(0.3, 0.7, robot.n) * (high - low))[:, None]
    reach, speed = np.exp(rng.uniform(*np.log(REACHES))), rng.uniform(*SPEEDS)
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


def seen(found: Diagnosis, first: Diagnosis, question: Question) -> float:
    """Return how far apart the answers are on all recordings, by the scatter of blocks."""
    inquiry = inquire(first, [question])
    columns, scene = CandidateColumns(found.search.uncorrected), found.search.scene
    made = inquiry.rows(lambda wanted: columns.rows(scene, wanted))
    wide = {item.label: rows for item, rows in zip(inquiry.suspects, made, strict=True)}
    # What was found by then is no noise.
    now = {item.label(scene): item for item in found.search.chosen}

    @cache
    def beside(kept: tuple[str, ...], other: str | None) -> FittedModel:
        rows = [*columns.rows(scene, [now[label] for label in kept]), *([] if other is None else [wide[other]])]
        return fitted_model(columns.observations, rows, found.after.weights, 4)

    def apart(one: Suspect, other: Suspect | None) -> float:
        gone = {one.label} if other is None else {item.label for item in question.suspects}
        model = beside(tuple(label for label in now if label not in gone), None if other is None else other.label)
        value = np.array(one.value)
        torque = {joint: (value @ rows[: len(value)])[None] for joint, rows in wide[one.label].items()}
        spread = float(examine(model, [torque])[0].covariance[0, 0])
        return float(1.0 / np.sqrt(spread)) if np.isfinite(spread) and spread > 0.0 else 1e-12

    if question.kind == "rivals":
        return min(apart(one, other) for one, other in permutations(question.suspects, 2))
    return float(np.mean([apart(item, None) ** -2.0 for item in question.suspects]) ** -0.5)


def record(arm: VirtualArm, motion: ReferenceMotion, truth: Effect, seed: int, repetition: int = 1) -> Recording:
    """Return a recording of the arm with the effect."""
    return simulate(arm, motion, effects=[truth], seed=seed, repetition=repetition, rate=SAMPLED).recording


def as_reference(design: Design) -> ReferenceMotion:
    """Return a designed motion to follow."""
    designed = design.trajectories[0]
    t = np.linspace(0.0, designed.duration, round(designed.duration * RATE) + 1)
    return ReferenceMotion("more", designed.joints, t, *designed.at(t))


def one_set(robot: str, number: int, seed: int) -> dict[str, Any]:
    """Return what one set tells."""
    rng = np.random.default_rng([seed, number])
    arm = virtual_arm(load_robot(None if robot == "scara03" else robot))
    pair = PAIRS[number % len(PAIRS)]
    name = pair[(number // len(PAIRS)) % 2]
    truth = _random_effect(name, float(np.exp(rng.uniform(*np.log(FACTORS)))), arm, rng)
    motion = poor_motion(arm, rng)
    begun = [record(arm, motion, truth, number, run) for run in (1, 2)]
    first = diagnose(arm.robot, begun)
    result: dict[str, Any] = {"robot": robot, "seed": seed, "set": number, "pair": list(pair), "truth": name}
    result |= {"joint": truth.joint, "before": right(first, truth), "verdict": first.verdict, "found": _found(first)}
    if result["before"]:
        return result
    model = first.before.model
    inquiry = inquire(first)
    asked = inquiry.questions
    result["asked"] = [item.text for item in asked]
    start = time.perf_counter()
    # All of the limits for each, as the random motion has them.
    limits = limits_of(arm.robot, clearance=None, share=1.0)
    design = design_excitation(model, duration=ASKED, tell=inquiry, limits=limits, effort=EFFORT)
    result["design_seconds"] = time.perf_counter() - start
    motions = {
        "tell": lambda: as_reference(design),
        "random": lambda: random_motion("more", arm, "fourier", ASKED, rng),
        "logdet": lambda: as_reference(design_excitation(model, duration=ASKED, limits=limits, effort=PLAIN)),
    }
    for way in WAYS:
        found = diagnose(arm.robot, [*begun, record(arm, motions[way](), truth, number, 3)])
        result[way] = right(found, truth)
        result[f"found_{way}"] = _found(found)
        if way == "tell":
            told = next((item for item in design.tells if item.question.suspects), None)
            if told is not None:
                result["kind"], result["promised"] = told.question.kind, [told.before, told.after]
                result["seen"] = seen(found, first, told.question)
    return result


def _found(diagnosis: Diagnosis) -> list[str]:
    return [
        f"{item.effect} {item.joint or ''} ({', '.join(other.label for other in item.confounded_with)})"
        for item in diagnosis.effects
    ]


def show(rows: Sequence[dict[str, Any]]) -> None:
    """Print the shares, in all and of every pair."""
    for robot in dict.fromkeys(row["robot"] for row in rows):
        own = [row for row in rows if row["robot"] == robot]
        opened = [row for row in own if not row["before"] and "tell" in row]
        print(f"{robot}: {len(own)} sets, {sum(row['before'] for row in own)} named right at once, {len(opened)} open")
        print("| pair | open | after --tell | after a random motion | after logdet |\n|---|---|---|---|---|")
        pairs = [("all", opened)]
        pairs += [(f"first question {kind}", [row for row in opened if row.get("kind") == kind]) for kind in KINDS]
        pairs += [(" / ".join(pair), [row for row in opened if row["pair"] == list(pair)]) for pair in PAIRS]
        for name, some in pairs:
            print(f"| {name} | {len(some)} | " + " | ".join(str(sum(row[way] for row in some)) for way in WAYS) + " |")
        ratio = [row["seen"] / row["promised"][1] for row in opened if row.get("promised", (0.0, 0.0))[1] > 0.0]
        if ratio:
            near = np.mean(np.abs(np.array(ratio) - 1.0) <= 0.3)
            print(f"seen over promised: median {np.median(ratio):.2f}, {near:.0%} within 30 % of {len(ratio)}")


def main() -> None:
    """Run the sets that are not there yet, or show what there is."""
    words = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    words.add_argument("output", type=Path)
    words.add_argument("--robot", default="scara03")
    words.add_argument("--sets", type=int, default=24)
    words.add_argument("--seed", type=int, default=1)
    words.add_argument("--show", action="store_true")
    given = words.parse_args()
    lines = given.output.read_text(encoding="utf-8").splitlines() if given.output.is_file() else []
    rows = [json.loads(line) for line in lines]
    done = {(row["robot"], row["seed"], row["set"]) for row in rows}
    for number in range(0 if given.show else given.sets):
        if (given.robot, given.seed, number) in done:
            continue
        try:
            rows.append(one_set(given.robot, number, given.seed))
        except ScaraIdentError as error:
            print(f"set {number}: {error}", flush=True)
            continue
        with given.output.open("a", encoding="utf-8") as file:
            file.write(json.dumps(rows[-1]) + "\n")
    show(rows)


if __name__ == "__main__":
    main()
