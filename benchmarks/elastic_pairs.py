"""How stiff two elastic joints of one arm are said to be, beside how stiff they are.

Every set is a virtual SCARA03 with an elastic gear on each joint, of a stiffness drawn evenly in its logarithm, recorded five times
in a wandering motion of its own, of which the last is held out. With ``--single`` one joint alone is elastic.

    python benchmarks/elastic_pairs.py --sets 10 --first 400
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

import numpy as np
from virtual_motions import random_motion

from scara_ident import diagnose, parse_effect, simulate, virtual_arm
from scara_ident.effects import Parameter
from scara_ident.robot.robot import load_robot

STIFFNESS = (700.0, 20000.0)
RUNS, SECONDS, RATE = 5, 14.0, 500.0


def main() -> None:
    """Print and write what was found of every set."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sets", type=int, default=10)
    parser.add_argument("--first", type=int, default=1, help="seed of the first set")
    parser.add_argument("--single", action="store_true", help="one elastic joint, in turn the first and the second")
    parser.add_argument("--output", type=Path)
    given = parser.parse_args()
    rows = []
    for seed in range(given.first, given.first + given.sets):
        rng = np.random.default_rng([seed, 1])
        stiffness = np.exp(rng.uniform(*np.log(STIFFNESS), 2)).round(-2)
        true = {f"joint{j + 1}": float(k) for j, k in enumerate(stiffness) if not given.single or seed % 2 == j}
        row = found_of(true, seed)
        rows.append(row)
        said = ", ".join(
            f"{joint} {k:.0f} ± {std:.0f}, {low:.0f} to {high:.0f} ({true.get(joint, np.nan):.0f})"
            for joint, (k, std, low, high) in row["found"].items()
        )
        print(f"{seed}: {true} -> {row['verdict']}: {said or 'none'}; {row['seconds']:.1f} s", flush=True)
    named = [row for row in rows if row["found"].keys() == row["true"].keys()]
    each = [(row["true"][joint], *told) for row in named for joint, told in row["found"].items()]
    off = [abs(k - true) / std for true, k, std, _, _ in each]
    held = sum(low < true < high for true, _, _, low, high in each)
    print(f"{len(named)} of {len(rows)} sets with the joints that are elastic and no other; of their {len(off)} stiffnesses "
          f"{sum(item < 2.0 for item in off)} within two standard deviations, largest {max(off, default=0.0):.1f}; {held} in their intervals")  # fmt: skip
    if given.output:
        given.output.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")


def found_of(true: dict[str, float], seed: int) -> dict[str, object]:
    """Record a set, diagnose it, and return the elastic joints found with their standard deviations and intervals."""
    arm = virtual_arm()
    effects = [parse_effect(f"joint_elasticity:{joint}:stiffness={k}") for joint, k in true.items()]
    runs = []
    for k in range(RUNS):
        motion = random_motion(f"t{k}", arm, "fourier", SECONDS, np.random.default_rng([seed, 10 + k]))
        runs.append(simulate(arm, motion, effects=effects, seed=1000 * seed + k, rate=RATE).recording)
    began = time.process_time()
    result = diagnose(load_robot(), runs[:-1], validation=runs[-1:])
    found = {
        str(item.joint): told_of(item.parameters["stiffness"])
        for item in result.effects
        if item.effect == "joint_elasticity"
    }
    others = [item.label for item in result.effects if item.effect != "joint_elasticity"]
    took = time.process_time() - began
    return {"seed": seed, "true": true, "verdict": result.verdict, "found": found, "others": others, "seconds": took}


def told_of(item: Parameter) -> tuple[float, float, float, float]:
    """Return a parameter with its standard deviation and the ends of its interval of 95 %."""
    low, high = item.interval or (item.value - 2.0 * item.std, item.value + 2.0 * item.std)
    return item.value, item.std, low, high


if __name__ == "__main__":
    main()
