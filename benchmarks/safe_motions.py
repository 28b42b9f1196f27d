"""Safe motions: random designs for a Panda over a floor beside a box, every limit and distance on a ten times finer grid.

Run ``python benchmarks/safe_motions.py [--designs 200] [--seed 0] [--starts 2] [--rounds 0] [--minutes M] OUT.jsonl``. A
line a design: seconds by the clock and of computing, the distances stated, and what a grid ten times finer than that of
the verification shows by Pinocchio's own inverse dynamics and Coal's collision test with the margin as security. Lengths,
heights of the floor, places of the box, shares and seeds are drawn; accelerations and jerks are the maker's.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from scara_ident.excitation import Design, Effort, InfeasibleLimits, design_excitation, limits_of
from scara_ident.model.model import build_model
from scara_ident.robot.robot import Robot, load_robot

Array = NDArray[np.float64]

# Of the maker's limits, rad/s^2 and rad/s^3.
ACCELERATION = (15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0)
JERK = (7500.0, 3750.0, 5000.0, 6250.0, 7500.0, 10000.0, 10000.0)
CLEARANCE = 0.02
FINER = 10


def drawn(robot: Robot, random: np.random.Generator) -> tuple[float, dict[str, Any]]:
    """Draw a length and limits: a box stands somewhere around the arm, its top below 0.5 m."""
    angle, away, height = random.uniform(-np.pi, np.pi), random.uniform(0.55, 0.8), random.uniform(0.1, 0.5)
    edges = (*random.uniform(0.1, 0.4, 2), height)
    return random.uniform(5.0, 12.0), {
        "accelerations": dict(zip(robot.joints, ACCELERATION, strict=True)),
        "jerks": dict(zip(robot.joints, JERK, strict=True)),
        "floor": float(random.uniform(-0.1, 0.05)),
        "boxes": [((away * np.cos(angle), away * np.sin(angle), 0.5 * height), edges)],
        "share": float(random.uniform(0.5, 0.9)),
        "clearance": CLEARANCE,
    }


def shares(robot: Robot, design: Design) -> dict[str, float]:
    """Return the largest share of each kind of limit on the finer grid, and how many postures are too near."""
    limits, (trajectory,) = design.limits, design.trajectories
    time_ = np.linspace(0.0, trajectory.duration, FINER * design.verified)
    q, v, a = trajectory.at(time_)
    jerk = trajectory.coefficients @ trajectory.basis.rows(time_, 3).T
    data, back = robot.model.createData(), np.argsort(robot.order)
    clearance = limits.clearance
    assert clearance is not None
    shapes = clearance.shapes
    measured = shapes.createData()
    for request in measured.collisionRequests:
        request.security_margin = CLEARANCE
    torque, near = np.zeros(robot.n), 0
    for k in range(len(time_)):
        posture, speed, push = q[back, k], v[back, k], a[back, k]
        needed = pin.rnea(robot.model, data, posture, speed, push)[robot.order]
        needed += robot.reduction**2 * robot.rotor_inertia * a[:, k]
        torque = np.maximum(torque, np.abs(needed * robot.row_scale))
        near += pin.computeCollisions(robot.model, data, shapes, measured, posture, True)
    half = 0.5 * (limits.upper - limits.lower)
    kinds: dict[str, Array] = {
        "position": np.abs(q - limits.centre[:, None]).max(axis=1) / half,
        "velocity": np.abs(v).max(axis=1) / limits.velocity,
        "acceleration": np.abs(a).max(axis=1) / limits.acceleration,
        "jerk": np.abs(jerk).max(axis=1) / limits.jerk,
        "torque": torque / limits.torque,
    }
    return {kind: float(np.max(each)) for kind, each in kinds.items()} | {"too_near": float(near)}


def one(robot: Robot, seed: int, starts: int, rounds: int) -> dict[str, Any]:
    random = np.random.default_rng(seed)
    duration, given = drawn(robot, random)
    before, begun = os.times(), time.perf_counter()
    try:
        limits = limits_of(robot, **given)
        effort = Effort(starts=starts, rounds=rounds, seed=seed)
        design = design_excitation(build_model(robot, "basic"), duration=duration, limits=limits, effort=effort)
    except InfeasibleLimits as error:
        return {"seed": seed, "said": str(error)}
    wall, after = time.perf_counter() - begun, os.times()
    seen = shares(robot, design)
    return {
        "seed": seed,
        "duration": duration,
        "floor": given["floor"],
        "share": given["share"],
        "seconds": wall,
        "computing": sum(after[:4]) - sum(before[:4]),
        "log_det": design.log_det,
        "distances": {each.name: each.reached for each in design.reached if each.name.startswith("distance")},
        "stated": all(each.kept for each in design.reached),
        "finer_samples": FINER * design.verified,
        "finer": seen,
        "kept": max(seen[kind] for kind in seen if kind != "too_near") <= 1.0 and seen["too_near"] == 0.0,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--designs", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--starts", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=0)
    parser.add_argument("--minutes", type=float, default=np.inf, help="begin no design after so many")
    words = parser.parse_args()
    robot, begun = load_robot("panda"), time.perf_counter()
    done = []
    with words.out.open("a", encoding="utf-8") as file:
        for seed in range(words.seed, words.seed + words.designs):
            if time.perf_counter() - begun > 60.0 * words.minutes:
                break
            done.append(one(robot, seed, words.starts, words.rounds))
            file.write(json.dumps(done[-1]) + "\n")
            file.flush()
            print(json.dumps(done[-1]), flush=True)
    made = [each for each in done if "kept" in each]
    print(
        f"{len(made)} designs of {len(done)}, all limits and distances kept on the finer grid in {sum(e['kept'] for e in made)}"
    )
    if made:
        print(f"computing {np.median([e['computing'] for e in made]):.0f} s in the median")


if __name__ == "__main__":
    main()
