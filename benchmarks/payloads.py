"""Payloads, mounted anyhow, in recordings that nobody names: the group, mass and first moments, and errors held out.

Random arms in closed loop with random motions (see `rigid_runs`). In some of 4 to 7 recordings the last link carries a box
of 2 to 15 % of the arm's mass, within 0.1 m of the tool in any direction and turned anyhow; its torque is Pinocchio's.
Names say nothing. In every fifth set no recording has a payload. One of the one or two held out is loaded; its state is for
the diagnosis to find. The true model knows which recordings are loaded, and no more.

    python benchmarks/payloads.py --robot ur5 --sets 40 --seed 1
    python benchmarks/payloads.py --measured DATA/ur10e --sets 3 --seed 1

With `--measured` the recordings are those of a folder with robot.yaml, of an arm without load: `ident*` to train on, and the
first `val_ptp*` held out. The payload's torque along their filtered motion is added.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from rigid_runs import RigidRuns, rigid_runs
from virtual_conditions import Asked

from scara_ident import Recording, load_robot, read_recordings
from scara_ident.diagnosis import Diagnosis, diagnose
from scara_ident.diagnosis.candidates.candidates import Candidate
from scara_ident.diagnosis.testing.selection_step import model_with
from scara_ident.effects import Member, effects_named
from scara_ident.effects.links import tool_of
from scara_ident.estimation.estimate import joint_errors
from scara_ident.estimation.least_squares import wls
from scara_ident.estimation.observations import observe
from scara_ident.motion.motion import Motion
from scara_ident.motion.prepared import prepare
from scara_ident.robot.robot import Robot

Array = NDArray[np.float64]
NAME = "payload_change"
SHARES = (0.02, 0.15)
MOUNTING = 0.1
SIDES = (0.05, 0.2)
EMPTY_EVERY = 5
# Of measured motion, Hz: above the band of any diagnosis of it.
MOTION_BAND = 15.0


@dataclass(frozen=True, eq=False)
class MeasuredRuns:
    """Measured recordings of an arm without load, the last held out, and their filtered motion at their own times."""

    robot: Robot
    recordings: tuple[Recording, ...]
    true: tuple[Motion, ...]

    def with_torque(self, added: Callable[[int, Motion], Array]) -> tuple[list[Recording], list[Recording]]:
        """Add ``added(k, motion)``, (n, N) on the recorded side, to run k; return training and held-out recordings."""
        made = [
            replace(item, effort=item.effort + added(k, motion))
            for k, (item, motion) in enumerate(zip(self.recordings, self.true, strict=True))
        ]
        return made[:-1], made[-1:]


def measured_runs(folder: Path) -> MeasuredRuns:
    """Read the recordings of a folder."""
    robot = load_robot(folder / "robot.yaml")
    paths = [*sorted(folder.glob("ident*.parquet")), *sorted(folder.glob("val_ptp*.parquet"))[:1]]
    recordings = [
        replace(item, name=f"run_{k + 1:02d}", trajectory=f"run_{k + 1:02d}", repetition=1)
        for k, item in enumerate(read_recordings(paths, robot))
    ]
    return MeasuredRuns(robot, tuple(recordings), tuple(_motion(robot, item) for item in recordings))


def _motion(robot: Robot, recording: Recording) -> Motion:
    (item,) = prepare([recording], (MOTION_BAND,) * robot.n).recordings
    motion = item.longest.motion
    q, v, a = (
        np.array([np.interp(recording.time, motion.time, row) for row in part])
        for part in (motion.q, motion.v, motion.a)
    )
    return Motion(recording.name, recording.name, recording.time, q, v, a, None, motion.rate)


def random_payload(robot: Robot, arm_mass: float, rng: np.random.Generator) -> pin.Inertia:
    """Draw a box of a share of the arm's mass near the tool, in the frame of the last joint."""
    mass = arm_mass * float(rng.uniform(*SHARES))
    away = rng.normal(size=3)
    point = tool_of(robot).point + MOUNTING * rng.uniform() * away / np.linalg.norm(away)
    box = pin.Inertia.FromBox(mass, *rng.uniform(*SIDES, 3))
    turned = pin.Quaternion(*(lambda x: x / np.linalg.norm(x))(rng.normal(size=4))).toRotationMatrix()
    return pin.Inertia(mass, point, turned @ box.inertia @ turned.T)


def payload_torque(robot: Robot, payload: pin.Inertia, position: Array, velocity: Array, acceleration: Array) -> Array:
    """Return the torque of a payload along a motion, on the recorded side, shape (n, N)."""
    with_it = robot.model.copy()
    with_it.appendBodyToJoint(int(robot.order[tool_of(robot).joint]) + 1, payload, pin.SE3.Identity())
    data = [(model, model.createData()) for model in (with_it, robot.model)]
    back = np.argsort(robot.order)
    state = [np.ascontiguousarray(part[back].T) for part in (position, velocity, acceleration)]
    zero = pin.neutral(robot.model)
    found = np.array(
        [
            np.subtract(*(pin.rnea(model, own, pin.integrate(robot.model, zero, q), v, a) for model, own in data))
            for q, v, a in zip(*state, strict=True)
        ]
    )
    return found.T[robot.order] * robot.row_scale[:, None]


def one_set(robot: str, seed: int, empty: bool, varied: bool) -> dict[str, Any]:
    """Make a set and diagnose it."""
    rng = np.random.default_rng([seed, 8])
    count = int(rng.integers(4, 8))
    asked = Asked(rate=200.0, recordings=count, motions=count, duration=(10.0, 15.0), varied=varied)
    with tempfile.TemporaryDirectory() as place:
        runs = rigid_runs(robot, seed, Path(place) / "set", asked)
    item = {"seed": seed, "noise": runs.conditions.noise}
    return item | _diagnosed(runs, count, float(np.sum(runs.arm.bodies[:, 0])), rng, empty)


def measured_set(runs: MeasuredRuns, seed: int, empty: bool) -> dict[str, Any]:
    """Add a payload to measured recordings and diagnose them."""
    mass = sum(body.mass for body in list(runs.robot.model.inertias)[1:])
    count = len(runs.recordings) - 1
    return {"seed": seed, "noise": np.nan} | _diagnosed(runs, count, mass, np.random.default_rng([seed, 9]), empty)


def _diagnosed(
    runs: RigidRuns | MeasuredRuns, count: int, arm_mass: float, rng: np.random.Generator, empty: bool
) -> dict[str, Any]:
    """Load the last recording, which is held out, and some of the first ``count``, which are trained on; diagnose."""
    last = len(runs.recordings) - 1
    payload = random_payload(runs.robot, arm_mass, rng)
    places = rng.permutation(count)[: int(rng.integers(1, count))]
    loaded = frozenset() if empty else frozenset([*places.tolist(), last])

    def added(k: int, motion: Any) -> Array:
        signals = (
            (motion.q, motion.v, motion.a)
            if isinstance(motion, Motion)
            else (motion.position, motion.velocity, motion.acceleration)
        )
        return payload_torque(runs.robot, payload, *signals) if k in loaded else np.zeros_like(signals[1])

    training, held_out = runs.with_torque(added)
    began = time.perf_counter()
    found = diagnose(runs.robot, training, validation=held_out)
    item: dict[str, Any] = {"empty": empty, "verdict": found.verdict}
    item |= {"seconds": time.perf_counter() - began, "recordings": count, "loaded": sorted(loaded)}
    item |= {"share": payload.mass / arm_mass}
    names = [recording.name for recording in runs.recordings]
    group = {names[k] for k in loaded if k < count}
    first = payload.mass * np.asarray(payload.lever)
    item["others"] = [f"{e.effect} of {e.joint}" for e in found.effects if e.effect != NAME]
    item["payloads"] = [e.description for e in found.effects if e.effect == NAME]
    own = [e for e in found.effects if e.effect == NAME and _named(e.description) == group]
    item["group"] = bool(own)
    if own:
        values = own[0].parameters
        moments = np.array([values[name].value for name in ("mx", "my", "mz")])
        item["mass_error"] = abs(values["mass"].value / payload.mass - 1.0)
        item["moment_error"] = float(np.linalg.norm(moments - first) / np.linalg.norm(first))
        item["mass_std"] = values["mass"].std / payload.mass
        item["moment_std"] = float(np.linalg.norm([values[n].std for n in ("mx", "my", "mz")]) / np.linalg.norm(first))
    if not empty:
        item["ratio"], item["ratio_before"] = _to_true_model(found, training, {names[k] for k in loaded}, names[last])
    return item


def _named(words: str) -> set[str]:
    return set(words.removeprefix("a payload in ").removesuffix(", not in the others").split(", "))


def _to_true_model(found: Diagnosis, training: Sequence[Any], loaded: set[str], held: str) -> tuple[float, float]:
    """Return errors on the loaded held-out recording over those of the true model, after and before, where it is worst."""
    family = next(item for item in effects_named(NAME) if item.by_recording)
    rest = next(item for item in found.validation_before.data.recordings if item.name == held)
    scene = found.search.scene
    scene = replace(scene, start={**scene.start, held: 0.0})
    model = model_with(scene, [Candidate(family, family.in_recordings(scene, Member(None), frozenset(loaded)))])
    value = wls(observe(model, prepare(training, found.search.bands))).value
    true = joint_errors(value, observe(model, prepare([rest.recording], found.search.bands)))
    place = [item.name for item in found.validation_before.each].index(held)
    ratios = []
    for observations, estimate in ((found.validation_after, found.after), (found.validation_before, found.before)):
        errors = joint_errors(estimate.value, observations.each[place])
        ratios.append(max(a.rms / b.rms for a, b in zip(errors, true, strict=True) if a and b))
    return ratios[0], ratios[1]


def report(items: Sequence[dict[str, Any]]) -> None:
    """Print the tables."""
    print("\n| payload, of the arm | sets | group found | mass, median (95 %) | within 3 % | first moments | within 5 % "
          "| held out, of the true model's: median (95 %) | within 1.1 | before |")  # fmt: skip
    print("|---|---|---|---|---|---|---|---|---|---|")
    full = [item for item in items if not item["empty"]]
    for low, high in ((0.02, 0.05), (0.05, 0.10), (0.10, 0.15), (0.02, 0.15)):
        own = [item for item in full if low <= item["share"] <= high]
        hits = [item for item in own if item["group"]]
        cells = [f"{low:.0%} to {high:.0%}", len(own), len(hits)]
        for name, limit in (("mass_error", 0.03), ("moment_error", 0.05)):
            errors = np.array([item[name] for item in hits] or [np.nan])
            cells += [f"{_two(100.0 * errors)} %", int(np.sum(errors < limit))]
        ratios = np.array([item["ratio"] for item in own] or [np.nan])
        before = np.median([item["ratio_before"] for item in own] or [np.nan])
        print("| " + " | ".join(str(cell) for cell in (*cells, _two(ratios), int(np.sum(ratios < 1.1)), f"{before:.1f}")) + " |")  # fmt: skip
    none = [item for item in items if item["empty"]]
    wrong = sum(bool(item["payloads"]) for item in none)
    beside = sum(bool(item["others"]) for item in items)
    print(
        f"\nwithout payload: {len(none)} sets, one named in {wrong}; other effects named in {beside} of all {len(items)}"
    )


def _two(values: Array) -> str:
    return f"{np.median(values):.3g} ({np.quantile(values, 0.95):.3g})"


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robot", default="ur5", help="a robot of example-robot-data or a URDF")
    parser.add_argument("--measured", type=Path, help="folder of measured recordings without load")
    parser.add_argument("--sets", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--empty", action="store_true", help="no recording of any set has a payload")
    parser.add_argument("--varied", action="store_true", help="runs differ in friction, torque scale or offset, delay")
    parser.add_argument("--output", type=Path, help="JSON of all results")
    options = parser.parse_args()
    measured = None if options.measured is None else measured_runs(options.measured)
    items = []
    for k in range(options.sets):
        empty = options.empty or k % EMPTY_EVERY == EMPTY_EVERY - 1
        seed = 100_000 * options.seed + k
        items.append(
            one_set(options.robot, seed, empty, options.varied)
            if measured is None
            else measured_set(measured, seed, empty)
        )
        item = items[-1]
        said = f"mass {item['mass_error']:.1%}, moments {item['moment_error']:.1%}" if item["group"] else ""
        ratio = "" if item["empty"] else f"held out {item['ratio']:.2f} ({item['ratio_before']:.1f} before)"
        print(
            f"{k:3d} {item['share']:.1%} in {item['loaded']} of {item['recordings']}, noise {item['noise']:.1%}: "
            f"{item['payloads']} {said} {ratio} {item['others']} ({item['verdict']}, {item['seconds']:.0f} s)",
            flush=True,
        )
    report(items)
    if options.output:
        options.output.parent.mkdir(parents=True, exist_ok=True)
        options.output.write_text(json.dumps(items, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
