"""Whether one asked motion settles what poor first recordings left open.

A virtual arm has one effect of a pair that is easily taken for the other. It is first recorded on one motion, twice, in a
small part of its workspace and at one speed; sets in which the effect is named then and nothing beside it are counted and
left. The others get one more recording: of the motion of ``design_excitation(tell=...)``, of a random motion within the
same limits, and of the motion of the largest log determinant. An effect is named right where it is the only one found, on
its joint, and nothing is confounded with it. Beside that the separation that was promised of the first question and that
which recordings show, by the scatter of blocks of time: in one recording of the motion, and by the mean variance of five with
other noise, as one variance of a dozen blocks is itself a fifth to a third off; beside the model that was asked, with what was
found by then taken out of the torque. And whether it was said before that the motion would tell the effect that is there: whether
the motion was said to find one of its size. Where no motion named the effect, one is designed for it alone,
of the size that all recordings together show: how many times as large as the diagnosis needs it is then expected
(``best``), and whether it is named after it (``best_right``). A set where neither comes about is not to be settled.

With ``--tight`` all three motions keep to a cell about the place of the first, at a reduced speed, of which most of what
any motion tells is cut off.

    python benchmarks/asking.py OUTPUT.jsonl --robot scara03 --sets 24 --seed 1 [--tight]
    python benchmarks/asking.py OUTPUT.jsonl --show
    python benchmarks/asking.py OUTPUT.jsonl --bump --sets 12
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Sequence
from dataclasses import replace
from functools import cache, partial
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np
from virtual_motions import RATE, random_motion, ranges
from virtual_sets import _random_effect

from scara_ident.diagnosis import Diagnosis, diagnose
from scara_ident.diagnosis.answerability import inquire, knowing, known_rows
from scara_ident.diagnosis.candidate_tests import examine
from scara_ident.diagnosis.candidates import CandidateColumns
from scara_ident.diagnosis.correction import corrected
from scara_ident.diagnosis.fitted_model import FittedModel
from scara_ident.diagnosis.questions import Question, Suspect, noise_density, suspects_in_model
from scara_ident.diagnosis.selection_step import fitted_model
from scara_ident.diagnosis.shape import KNOTS
from scara_ident.errors import ScaraIdentError
from scara_ident.estimation.observations import observe
from scara_ident.excitation import Design, Effort, Limits, design_excitation, limits_of
from scara_ident.excitation.promise import sure_of
from scara_ident.identification.usable import usable_in_bands
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
# Of a bump: standard deviation over the joint's range, and height over the standard deviation of the effort.
# The first motion passes all of a bump, or it could be anything: reach, rad.
WIDTHS, SIZES, PASSING = (0.09, 0.14), (0.2, 0.6), (0.8, 1.2)
KINDS = ("rivals", "below_limit")
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
        data = corrected(data, taken.candidate, taken.value)
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

    if question.kind == "rivals":
        return min(apart(one, other) for one, other in permutations(question.suspects, 2))
    return float(np.median([apart(item, None) for item in question.suspects]))


def said(first: Diagnosis, design: Design, truth: Effect, quiet: Sequence[Recording]) -> bool | None:
    """Return whether the motion was said to tell the effect that is there; None where nothing was asked of it.

    Of what may be below the limit, by its true size, which recordings without noise have.
    """
    places = () if truth.joint is None else (f"{truth.name} of {truth.joint}",)

    def right_one(label: str) -> bool:
        return label in (truth.name, *places) or (truth.joint is None and label.startswith(f"{truth.name} of "))

    asked = [item for item in design.tells if any(right_one(own.label) for own in item.question.suspects)]
    if not asked or asked[0].question.kind == "rivals":
        return asked[0].settled if asked else None
    inquiry = inquire(first)
    scene, suspects = inquiry.scene, asked[0].question.suspects
    own = next(item for item in suspects if right_one(item.label))
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
    return sure_of(replace(inquiry, known=None), [design.motion()])[own.label] >= 1.0


def record(arm: VirtualArm, motion: ReferenceMotion, truth: Effect, seed: int, repetition: int = 1) -> Recording:
    """Return a recording of the arm with the effect."""
    return simulate(arm, motion, effects=[truth], seed=seed, repetition=repetition, rate=SAMPLED).recording


def as_reference(design: Design) -> ReferenceMotion:
    """Return a designed motion to follow."""
    designed = design.trajectories[0]
    t = np.linspace(0.0, designed.duration, round(designed.duration * RATE) + 1)
    return ReferenceMotion("more", designed.joints, t, *designed.at(t))


@cache
def _robot(name: str) -> Robot:
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
    arm = virtual_arm(_robot(robot))
    pair = PAIRS[number % len(PAIRS)]
    name = pair[(number // len(PAIRS)) % 2]
    truth = _random_effect(name, float(np.exp(rng.uniform(*np.log(LARGER if tight else FACTORS)))), arm, rng)
    motion = poor_motion(arm, rng)
    begun = [record(arm, motion, truth, number, run) for run in (1, 2)]
    first = diagnose(arm.robot, begun)
    result: dict[str, Any] = {"robot": robot, "seed": seed, "set": number, "tight": tight, "pair": list(pair)}
    result |= {"truth": name, "seconds": seconds}
    result |= {"joint": truth.joint, "before": right(first, truth), "verdict": first.verdict, "found": _found(first)}
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
    more = {}
    for way in WAYS:
        followed = motions[way]()
        more[way] = record(arm, followed, truth, number, 3)
        found = diagnose(arm.robot, [*begun, more[way]])
        result[way] = right(found, truth)
        result[f"found_{way}"], result[f"why_{way}"] = _found(found), _why(found, truth)
        if way == "tell":
            told = next((item for item in design.tells if item.question.suspects), None)
            if told is not None:
                result["kind"], result["promised"] = told.question.kind, [told.before, told.after]
                again = [record(arm, followed, truth, number, run) for run in range(4, 3 + DRAWS)]
                again = [replace(run, name=more[way].name) for run in again]
                result["seen"] = [seen(found, first, told.question, [*begun, run]) for run in (more[way], *again)]
    if not quick and not any(result[way] for way in WAYS):
        # Each as a trajectory of its own.
        runs = [replace(run, name=f"{way}_1") for way, run in more.items()]
        result |= best(first, diagnose(arm.robot, [*begun, *runs]), arm, limits, begun, truth, number, seconds)
    return result


def best(
    first: Diagnosis,
    whole: Diagnosis,
    arm: VirtualArm,
    limits: Limits,
    begun: Sequence[Recording],
    truth: Effect,
    number: int,
    seconds: float,
) -> dict[str, Any]:
    """Return what a motion designed for the effect that is there alone tells of it, its size taken from all recordings."""
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
        return {"best": 0.0, "best_right": False}
    question = Question("below_limit", suspects[0].label, (suspects[0],))
    inquiry = replace(inquire(first, [question]), noise=noise_density(whole), bands=whole.search.bands)
    inquiry = knowing(inquiry, first.search.step.columns, widening=True)
    design = design_excitation(first.before.model, duration=seconds, tell=inquiry, limits=limits, effort=EFFORT)
    (times,) = sure_of(inquiry, [design.motion()]).values()
    found = diagnose(arm.robot, [*begun, record(arm, as_reference(design), truth, number, 3)])
    return {"best": times, "best_right": right(found, truth), "best_why": _why(found, truth)}


def one_bump(robot: str, number: int, seed: int) -> dict[str, Any]:
    """Return how well the shape of a torque that no catalogue lists is recovered by the motion asked for it.

    A bump over the position of a joint is added to its recorded effort, where the first motion comes by. The curve is
    that of the question, hats over the range, fitted together with the base model; what an offset takes of it is left out
    of both.
    """
    rng = np.random.default_rng([seed, number, 1])
    arm = virtual_arm(_robot(robot))
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
    result |= {"verdict": first.verdict, "found": _found(first)}
    inquiry = inquire(first)
    wanted = [item for item in inquiry.questions if item.kind == "unexplained" and item.joint == joint]
    result["asked"] = [item.text for item in inquiry.questions]
    if not wanted:
        return result
    limits = limits_of(arm.robot, clearance=None, share=1.0)
    design = design_excitation(first.before.model, duration=ASKED, tell=inquiry, limits=limits, effort=EFFORT)
    more = as_reference(design)
    found = diagnose(arm.robot, [*begun, bumped(more, 3)])
    result |= {"verdict_after": found.verdict, "found_after": _found(found)}
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
        pairs += [("some motion names it", [row for row in opened if _named(row)])]
        pairs += [
            ("expected of the best motion", [row for row in opened if _named(row) or row.get("best", 0.0) >= 1.0])
        ]
        pairs += [
            (f"said before to {words} it", [row for row in opened if row.get("said") is answer])
            for words, answer in (("tell", True), ("not tell", False), ("have nothing to ask of", None))
        ]
        pairs += [("a random motion does not name it", [row for row in opened if not row["random"]])]
        pairs += [(f"first question {kind}", [row for row in opened if row.get("kind") == kind]) for kind in KINDS]
        pairs += [(" / ".join(pair), [row for row in opened if row["pair"] == list(pair)]) for pair in PAIRS]
        for name, some in pairs:
            print(f"| {name} | {len(some)} | " + " | ".join(str(sum(row[way] for row in some)) for way in WAYS) + " |")
        none = [row for row in opened if not _named(row)]
        print(
            f"{len(none)} sets that no motion settles; of these said before: {sum(row.get('said') is False for row in none)}"
        )
        known = [row for row in opened if row.get("promised", (0.0, 0.0))[1] > 0.0]
        if known:
            each = np.array([row["seen"] for row in known]) / np.array([row["promised"][1:] for row in known])
            for words, ratio in (
                ("in one recording", each[:, 0]),
                (f"in {DRAWS}", np.mean(each**-2.0, axis=1) ** -0.5),
            ):
                near, sure = np.mean(np.abs(ratio - 1.0) <= 0.3), np.round(np.quantile(ratio, (0.1, 0.5, 0.9)), 2)
                print(f"seen {words} over promised: {near:.0%} within 30 % of {len(ratio)}; 10, 50 and 90 % of {sure}")


def _named(row: dict[str, Any]) -> bool:
    return any(row[way] for way in WAYS) or row.get("best_right", False)


def show_bumps(rows: Sequence[dict[str, Any]]) -> None:
    """Print how well bumps are recovered."""
    for robot in dict.fromkeys(row["robot"] for row in rows):
        own = [row for row in rows if row["robot"] == robot]
        error = np.array([row["error"] for row in own if "error" in row])
        print(f"{robot}: {len(own)} bumps, {len(error)} left unexplained at first and asked for")
        if len(error):
            print(f"shape: rms error {np.median(error):.1%} in the median, {np.mean(error <= 0.15):.0%} within 15 %")


def main() -> None:
    """Run the sets that are not there yet, or show what there is."""
    words = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    words.add_argument("output", type=Path)
    words.add_argument("--robot", default="scara03")
    words.add_argument("--sets", type=int, default=24)
    words.add_argument("--seed", type=int, default=1)
    words.add_argument("--bump", action="store_true", help="torques that no catalogue lists, instead of pairs")
    words.add_argument("--tight", action="store_true", help="the asked motion keeps to a cell at a reduced speed")
    words.add_argument("--seconds", type=float, default=ASKED, help="of the motion of a set")
    words.add_argument("--quick", action="store_true", help="without what a motion for the effect alone would tell")
    words.add_argument("--show", action="store_true")
    given = words.parse_args()
    lines = given.output.read_text(encoding="utf-8").splitlines() if given.output.is_file() else []
    sets = partial(one_set, tight=given.tight, quick=given.quick, seconds=given.seconds)
    what, run, tell = ("bump", one_bump, show_bumps) if given.bump else ("set", sets, show)
    rows = [row for row in map(json.loads, lines) if what in row]
    done = {(row["robot"], row["seed"], row[what]) for row in rows}
    for number in range(0 if given.show else given.sets):
        if (given.robot, given.seed, number) in done:
            continue
        try:
            rows.append(run(given.robot, number, given.seed))
        except ScaraIdentError as error:
            print(f"{what} {number}: {error}", flush=True)
            continue
        with given.output.open("a", encoding="utf-8") as file:
            file.write(json.dumps(rows[-1]) + "\n")
    tell(rows)


if __name__ == "__main__":
    main()
