"""Joints with more friction at low speed that builds up over a distance (presliding): how often both are found, and what else.

Every set is a SCARA03 under the random conditions of `virtual_sets`, runs that differ and four recordings. Its friction at low
speed is one to three times the virtual arm's own, which is half of the Coulomb friction. With ``--alone stribeck`` or ``--alone
presliding`` that one is there alone.

    python benchmarks/dry_friction.py --sets 20 --seed 8831
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from virtual_conditions import Asked
from virtual_sets import random_arm, simulate_set

from scara_ident import diagnose
from scara_ident.errors import ScaraIdentError
from scara_ident.simulation.effects import Presliding, Stribeck

# Of the virtual arm's own friction at low speed.
FACTORS = (1.0, 3.0)
# Encoders as most industrial arms have at the joint, for the arm by whose friction the effects are sized.
BITS = 20


def main() -> None:
    """Print what was found of every set, and the numbers."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sets", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--alone", choices=("stribeck", "presliding"))
    given = parser.parse_args()
    made = right = wrong = 0
    for seed in range(given.seed * 100000, given.seed * 100000 + given.sets):
        try:
            true, found, verdict = found_of(seed, given.alone)
        except ScaraIdentError as error:
            print(f"{seed}: {error}", flush=True)
            continue
        # Runs differ in how late they are.
        others = found - true - {("time_delay", None)}
        made, right, wrong = made + 1, right + (true <= found), wrong + bool(others)
        print(f"{seed}: {_words(true)} -> {verdict} {_words(found)}", flush=True)
    print(f"all found in {right} of {made} sets, something else in {wrong}")


def found_of(seed: int, alone: str | None) -> tuple[set[tuple[str, str | None]], set[tuple[str, str | None]], str]:
    """Record and diagnose a set; return what it has, what was found and the verdict."""
    rng = np.random.default_rng(seed)
    joint, factor = f"joint{rng.integers(2) + 1}", float(rng.uniform(*FACTORS))
    with tempfile.TemporaryDirectory() as place:
        arms = np.random.default_rng(np.random.SeedSequence(seed).spawn(1)[0])
        arm, _ = random_arm("scara03", stated=True, bits=BITS, folder=Path(place), rng=arms)
        slow, builds = Stribeck(joint).resolve(arm), Presliding(joint).resolve(arm)
        both = (replace(slow, amplitude=factor * slow.amplitude), builds)
        effects = [item for item in both if alone in (None, item.name)]
        asked = Asked(varied=True, recordings=4)
        made = simulate_set("pair", seed, folder=Path(place), asked=asked, given=effects)
        result = diagnose(made.robot, made.training, validation=made.held_out)
    true = {(item.name, item.joint) for item in effects}
    return true, {(item.effect, item.joint) for item in result.effects}, result.verdict


def _words(effects: set[tuple[str, str | None]]) -> str:
    return ", ".join(sorted(f"{name} on {joint}" for name, joint in effects)) or "-"


if __name__ == "__main__":
    main()
