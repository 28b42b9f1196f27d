"""Whether a shaft that turns with two neighbouring wrist joints is named, alone, with its three parameters.

Random arms in closed loop with random motions (see `rigid_runs`); the torque of a shaft on the sum or the difference of the
last two joints' motions is added. Its inertia, viscous and Coulomb friction are half those of the first of the two joints
times factors of 0.03 to 3. In every fourth set it has friction on one joint alone, and no shaft may be named. How well the
recordings can tell a shaft is the least of its three parameters over its standard deviation in the fit of the true model,
in the same bands: the detection limit is where that is `LIMIT`. How many sets have all three parameters within 5 % by
these standard deviations alone, as no unbiased estimate can do better, stands beside how many do.

    python benchmarks/coupled_wrists.py --robot ur5 --sets 40 --seed 1
"""

from __future__ import annotations

import argparse
import json
import math
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rigid_runs import RigidRuns, rigid_runs
from virtual_conditions import Asked

from scara_ident.diagnosis import Diagnosis, diagnose
from scara_ident.diagnosis.candidates.candidates import Candidate
from scara_ident.diagnosis.testing.selection_step import model_with
from scara_ident.effects import Member, effects_named
from scara_ident.estimation.least_squares import wls
from scara_ident.estimation.observations import observe
from scara_ident.motion.prepared import prepare

PARTS = ("inertia", "viscous", "coulomb")
FACTORS = (0.03, 3.0)
# Standard deviations that a shaft's least seen part has at the detection limit: what the search asks of it and a margin.
LIMIT = 6.0
STRENGTHS = (0.0, 3.0, LIMIT, 20.0, 60.0, np.inf)
ASKED = Asked(rate=200.0, recordings=4, motions=4, duration=(10.0, 15.0), varied=False)
NAME = "coupled_shaft"


def one_set(robot: str, seed: int, alone: bool) -> dict[str, Any]:
    """Make a set with a shaft, or with friction of one joint by the other alone, and diagnose it."""
    rng = np.random.default_rng([seed, 7])
    with tempfile.TemporaryDirectory() as place:
        runs = rigid_runs(robot, seed, Path(place) / "set", ASKED)
    shaft, side = _shaft(runs, rng), float(rng.choice([-1.0, 1.0]))
    j, k = runs.robot.n - 2, runs.robot.n - 1
    scale = runs.robot.row_scale

    def added(_: int, motion: Any) -> np.ndarray:
        turn, speed_up = (part[j] + side * part[k] for part in (motion.velocity, motion.acceleration))
        # Rounding of a joint at rest is no direction.
        friction = shaft["viscous"] * turn + shaft["coulomb"] * np.sign(np.where(np.abs(turn) > 1e-9, turn, 0.0))
        torque = np.zeros_like(motion.velocity)
        torque[j] = scale[j] * (friction if alone else friction + shaft["inertia"] * speed_up)
        torque[k] = 0.0 if alone else side * scale[k] * (friction + shaft["inertia"] * speed_up)
        return torque

    training, held_out = runs.with_torque(added)
    began = time.perf_counter()
    found = diagnose(runs.robot, training, validation=held_out)
    item: dict[str, Any] = {"seed": seed, "alone": alone, "side": side, "true": shaft, "verdict": found.verdict}
    item |= {"seconds": time.perf_counter() - began, "noise": runs.conditions.noise, "bits": runs.conditions.bits}
    item["found"] = [
        {"effect": e.effect, "joint": e.joint, "words": e.description, "values": {n: p.value for n, p in e.parameters.items()}}
        for e in found.effects
    ]  # fmt: skip
    return item if alone else item | {"seen": _seen(found, training, shaft, side)}


def _shaft(runs: RigidRuns, rng: np.random.Generator) -> dict[str, float]:
    arm, j = runs.arm, runs.robot.n - 2
    sizes = 0.5 * np.array([arm.rotor_inertia[j] * arm.robot.reduction[j] ** 2, arm.friction[j, 1], arm.friction[j, 0]])
    factors = np.exp(rng.uniform(*np.log(FACTORS), 3))
    return dict(zip(PARTS, (factors * np.abs(sizes)).tolist(), strict=True))


def _seen(found: Diagnosis, training: Sequence[Any], shaft: dict[str, float], side: float) -> list[float]:
    """Return the standard deviations of each true parameter in the fit of the true model."""
    n = found.robot.n
    family = effects_named(NAME)[0 if side > 0.0 else 1]
    model = model_with(found.search.scene, [Candidate(family, Member(n - 2, (), n - 1))])
    fitted = wls(observe(model, prepare(training, found.search.bands)))
    std = np.sqrt(np.diag(np.asarray(fitted.covariance)))[-3:]
    return [float(shaft[name] / spread) for name, spread in zip(PARTS, std, strict=True)]


def errors(item: dict[str, Any]) -> list[float] | None:
    """Return the relative errors of the three parameters; None where the shaft was not found as it is."""
    own = [e for e in item["found"] if e["effect"] == NAME and ("difference" in e["words"]) == (item["side"] < 0.0)]
    if not own:
        return None
    return [abs(own[0]["values"][name] / item["true"][name] - 1.0) for name in PARTS]


def best(item: dict[str, Any]) -> float:
    """Return the probability that all three parts of an estimate with the true model's deviations are within 5 %."""
    return math.prod(math.erf(0.05 * seen / math.sqrt(2.0)) for seen in item["seen"])


def report(items: Sequence[dict[str, Any]]) -> None:
    """Print the tables."""
    shafts, alone = ([item for item in items if item["alone"] == flag] for flag in (False, True))
    print("\n| least part, std | sets | found | nothing else | within 5 % | at best | inertia | viscous | coulomb |")
    print("|---|---|---|---|---|---|---|---|---|")
    rows = [*zip(STRENGTHS, STRENGTHS[1:], strict=False), (LIMIT, np.inf)]
    for low, high in rows:
        own = [item for item in shafts if low <= min(item["seen"]) < high]
        hits = [error for item in own if (error := errors(item)) is not None]
        only = sum(errors(item) is not None and len(item["found"]) == 1 for item in own)
        middle = np.median(hits, axis=0) if hits else [np.nan] * 3
        within = sum(max(error) < 0.05 for error in hits)
        words = " | ".join(f"{100.0 * x:.1f} %" for x in middle)
        print(
            f"| {low:g} to {high:g} | {len(own)} | {len(hits)} | {only} | {within} | {sum(map(best, own)):.1f} | {words} |"
        )
    named = sum(any(e["effect"] == NAME for e in item["found"]) for item in alone)
    coupled = sum(any(e["effect"] == "friction_coupling" for e in item["found"]) for item in alone)
    print(f"\nfriction on one joint alone: {len(alone)} sets, friction_coupling named in {coupled}, a shaft in {named}")


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robot", default="ur5", help="a robot of example-robot-data or a URDF")
    parser.add_argument("--sets", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--output", type=Path, help="JSON of all results")
    options = parser.parse_args()
    items = []
    for k in range(options.sets):
        items.append(one_set(options.robot, 100_000 * options.seed + k, k % 4 == 3))
        item = items[-1]
        names = ", ".join(f"{e['effect']} of {e['joint']}" for e in item["found"]) or "nothing"
        least = f"least part {min(item['seen']):.1f} std" if "seen" in item else "friction on one joint"
        print(f"{k:3d} {least}: {names} ({item['verdict']}, {item['seconds']:.0f} s)", flush=True)
    report(items)
    if options.output:
        options.output.parent.mkdir(parents=True, exist_ok=True)
        options.output.write_text(json.dumps(items, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
