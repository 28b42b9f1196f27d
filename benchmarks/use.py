"""Whether feeding forward what `diagnose` found helps: virtual arms with one effect, unknown to the model.

Random arms as in `virtual_sets`, with one effect of the drives or the structure. Where `diagnose` believes it, the same
arm then follows a motion that no one has seen: by the PID alone, and with the torque fed forward by the URDF, by the model
without and with the effect; and simulations go on beside a held-out recording. Sets in which nothing is found count as such.

    python benchmarks/use.py --arms 10 --seed 1 [--robots scara03 ur5 panda] [--output benchmarks/results/use.json]
"""

from __future__ import annotations

import argparse
import json
import os
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from virtual_conditions import Asked
from virtual_sets import simulate_set

from scara_ident import diagnose
from scara_ident.errors import ScaraIdentError
from scara_ident.export.identified_model import identified_model
from scara_ident.motion.prepared import prepare
from scara_ident.report.use import total
from scara_ident.use.identified_arm import arms_of, simulated
from scara_ident.use.rollout import HORIZONS, rollout_errors, virtual_free
from scara_ident.use.tracking import at_ticks, tracked
from scara_ident.use.trial_motion import trial_motion
from scara_ident.use.use import fed_forward

# Effects that a drive can act against; those of sensors alone are none.
KINDS = (
    "transmission_loss", "stribeck", "asymmetric_friction", "presliding", "torque_ripple", "position_dependent_friction",
    "spring", "base_tilt", "friction_coupling",
)  # fmt: skip
ROBOTS = {"scara03": "scara03", "ur5": "ur5", "panda": "panda"}
# Sets that are drawn for one arm with a found effect, at the most.
TRIES = 4
ASKED = Asked(
    rate=500.0,
    bits=20,
    noise=0.01,
    noise_kind="white",
    recordings=4,
    motions=2,
    duration=(12.0, 15.0),
    varied=False,
    averaged=True,
    stated=True,
)
HORIZON = 0.2


def on_one_arm(robot: str, kind: str, seed: int, folder: Path) -> dict[str, Any] | None:
    """Return what every feed-forward leaves on one arm; None where the effect was not found."""
    made = simulate_set(kind, seed, robot, folder / f"{robot}_{seed}", ASKED)
    told = diagnose(made.robot, made.training)
    model = identified_model(told)
    pairs, missing = simulated(model.found)
    if not pairs:
        return None
    bare, whole = arms_of(model)
    found = tuple(effect.resolve(whole) for effect, _ in pairs)
    motion = at_ticks(trial_motion(whole, seed))
    feeds = {"pid": None, **fed_forward(model, motion, bare, whole, found)}
    errors = {item.name: item.rms for item in tracked(made.arm, made.effects, motion, feeds, seed)}
    held = made.held_out[0]
    (part, *_) = prepare([held], model.bands).stretches
    place = HORIZONS.index(HORIZON)
    drift = {
        "identified": rollout_errors(virtual_free(bare, ()), part)[place],
        "effects": rollout_errors(virtual_free(whole, found), part)[place],
    }
    return {
        "robot": robot, "kind": kind, "seed": seed, "verdict": told.verdict, "missing": list(missing),
        "found": [f"{item['effect']} {item['joint'] or ''}".strip() for item in model.found],
        "tracking": {name: total(value, errors["pid"]) for name, value in errors.items()},
        "rms": {name: value.tolist() for name, value in errors.items()},
        "rollout": {name: value.tolist() for name, value in drift.items()},
        "rollout_share": total(drift["effects"], drift["identified"]),
    }  # fmt: skip


def campaign(robots: Sequence[str], arms: int, seed: int, folder: Path) -> list[dict[str, Any]]:
    """Return the results of so many arms of each robot on which an effect was found, and of those on which none was."""
    rows: list[dict[str, Any]] = []
    for robot in robots:
        for k in range(arms):
            kind = KINDS[k % len(KINDS)]
            for attempt in range(TRIES):
                own = seed * 100_000 + 100 * k + attempt
                try:
                    row = on_one_arm(ROBOTS[robot], kind, own, folder)
                except ScaraIdentError as error:
                    row = {"robot": robot, "kind": kind, "seed": own, "error": str(error)}
                if row is None:
                    row = {"robot": robot, "kind": kind, "seed": own, "error": "nothing was found"}
                rows.append(row)
                print(_line(row), flush=True)
                if "error" not in row:
                    break
    return rows


def _line(row: dict[str, Any]) -> str:
    head = f"{row['robot']:8s} {row['kind']:28s} {row['seed']:9d}"
    if "error" in row:
        return f"{head}  {row['error']}"
    shares = "  ".join(f"{name} {value:6.1%}" for name, value in row["tracking"].items() if name != "pid")
    return f"{head}  {shares}  rollout {row['rollout_share']:.2f}  {', '.join(row['found'])}"


def main() -> None:
    """Run the campaign and print its table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", nargs="*", choices=list(ROBOTS), default=list(ROBOTS))
    parser.add_argument("--arms", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--output", type=Path)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        rows = campaign(options.robots, options.arms, options.seed, Path(folder))
    print(
        f"\n{'robot':8s} arms  better with the effect  rollout better  PID's error left, median: URDF, model, with effects"
    )
    for robot in options.robots:
        done = [row for row in rows if row["robot"] == robot and "error" not in row]
        if not done:
            continue
        better = sum(row["tracking"]["effects"] < row["tracking"]["identified"] for row in done)
        nearer = sum(row["rollout_share"] < 1.0 for row in done)
        medians = [
            float(np.median([row["tracking"][name] for row in done])) for name in ("urdf", "identified", "effects")
        ]
        print(
            f"{robot:8s} {len(done):4d}  {better:22d}  {nearer:14d}  " + ", ".join(f"{value:.1%}" for value in medians)
        )
    if options.output is not None:
        options.output.parent.mkdir(parents=True, exist_ok=True)
        options.output.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
