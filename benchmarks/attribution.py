"""Recordings with an undeclared effect: what the diagnosis names, how often it is wrong, how small it can see.

Every set is a random arm like the SCARA03 in closed loop, with none, one or two effects or one outside the
catalogue, at a random size. The identifier is told nothing. Prints tables and writes JSON.

    python benchmarks/attribution.py --sets 300 --output benchmarks/results/attribution.json
"""

from __future__ import annotations

import argparse
import json
import os
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from attribution_tables import report
from virtual_sets import KINDS, simulate_set, tasks

from scara_ident.diagnosis import diagnose
from scara_ident.diagnosis.candidates import Candidate
from scara_ident.diagnosis.selection_step import model_with
from scara_ident.effects import CATALOGUE, Member
from scara_ident.effects.measurement import shifted
from scara_ident.estimation.estimate import joint_errors
from scara_ident.estimation.least_squares import wls
from scara_ident.estimation.observations import observe
from scara_ident.motion.prepared import prepare


def one_set(task: tuple[str, int]) -> dict:
    """Simulate a set, diagnose it, and compare with what the arm was."""
    kind, seed = task
    made = simulate_set(kind, seed)
    robot, effects, training, held_out = made.arm.robot, made.effects, made.training, made.held_out
    began = time.perf_counter()
    result = diagnose(robot, training, validation=held_out)
    seconds = time.perf_counter() - began
    before = [error.rms for error in joint_errors(result.before.value, result.validation_before)]
    after = [error.rms for error in joint_errors(result.after.value, result.validation_after)]
    return {
        "kind": kind,
        "seed": seed,
        "factors": made.factors,
        "true": [{"effect": e.name, "joint": e.joint, "parameters": e.as_dict()["parameters"]} for e in effects],
        "verdict": result.verdict,
        "found": [
            {
                "effect": e.effect,
                "joint": e.joint,
                "group": [confounder.effect for confounder in e.confounded_with],
                "parameters": {k: [p.value, p.std] for k, p in e.parameters.items()},
                "gain": e.gain,
            }
            for e in result.effects
        ],
        "unexplained": None if result.unexplained is None else result.unexplained.joint,
        "before": before,
        "after": after,
        "noise": {fit.joint: fit.noise for fit in result.fit_after},
        "missing": {fit.joint: fit.missing for fit in result.fit_after},
        "true_model": true_model_error(result, training, held_out, effects),
        "seconds": seconds,
    }


def true_model_error(result, training, held_out, effects) -> list[float] | None:
    """Held-out error of the same recordings fitted with the true model and its true nonlinear parameters."""
    scene, bands = result.search.scene, result.search.bands
    chosen, delay = [], 0.0
    for effect in effects:
        values = effect.as_dict()["parameters"]
        if effect.name == "time_delay":
            delay = values["delay"]
            continue
        # The family whose nonlinear parameters are those that the effect has.
        family = next(
            (
                f
                for f in CATALOGUE
                if f.name == effect.name and all(parameter.name in values for parameter in f.nonlinear)
            ),
            None,
        )
        if family is None:
            return None
        joint = None if effect.joint is None else scene.robot.joints.index(effect.joint)
        nonlinear = tuple(float(values[parameter.name]) for parameter in family.nonlinear if parameter.name in values)
        if len(nonlinear) != len(family.nonlinear):
            return None
        partner = None
        if effect.name == "friction_coupling":
            partner = 1 - joint
        chosen.append(Candidate(family, Member(joint, nonlinear, partner)))
    model = model_with(scene, chosen)
    fitted, tested = (
        observe(model, prepare([shifted(item, delay) for item in items], bands)) for items in (training, held_out)
    )
    return [error.rms for error in joint_errors(wls(fitted).value, tested)]


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sets", type=int, default=300)
    parser.add_argument("--only", nargs="*", default=None, help="kinds to run")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--output", type=Path, default=Path("benchmarks/results/attribution.json"))
    parser.add_argument("--tables", type=Path, help="print the tables of an earlier run's JSON and stop")
    arguments = parser.parse_args()
    if arguments.tables:
        report(json.loads(arguments.tables.read_text(encoding="utf-8")))
        return
    with ProcessPoolExecutor(max_workers=2) as pool:
        results = []
        for k, item in enumerate(pool.map(one_set, tasks(arguments.sets, arguments.seed, arguments.only or KINDS))):
            results.append(item)
            found = ", ".join(f"{f['effect']}/{f['joint']}" for f in item["found"])
            true = ", ".join(f"{t['effect']}/{t['joint']}" for t in item["true"])
            factors = np.round(item["factors"], 2)
            print(
                f"{k + 1:4d} {true or '-'} {factors} -> {item['verdict']} {found or '-'} {item['seconds']:.1f} s",
                flush=True,
            )
    report(results)
    arguments.output.parent.mkdir(parents=True, exist_ok=True)
    arguments.output.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
