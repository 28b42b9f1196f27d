"""Efforts that are late on all joints, or on one, beside effects that hide it on a joint: whose delay is named, and what is right.

Every set is a random arm under the random conditions of `virtual_sets`, with three to five short recordings. The effort is late
by two to five samples, and at least by 3 ms. The other effects are all on the same joint. With ``--joint`` the effort of one joint
alone is late; with ``--varied`` runs differ.

    python benchmarks/late_efforts.py --sets 20 --seed 8871
    python benchmarks/late_efforts.py --sets 20 --seed 8871 --joint
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from virtual_conditions import Asked
from virtual_sets import random_arm, random_effect, simulate_set

from scara_ident import diagnose
from scara_ident.errors import ScaraIdentError
from scara_ident.simulation.effects import Effect, TimeDelay

# At slow rates delays of a few milliseconds are less than a sample, and not counted.
RATES = (200.0, 250.0, 500.0, 1000.0)
# How late, in samples; and at least, s.
SAMPLES, LEAST = (2.0, 5.0), 0.003
# Of the usual sizes: large ones hide a delay.
FACTOR = 3.0
# Encoders as most industrial arms have at the joint, for the arm by whose friction the effects are sized.
BITS = 20
# Effects of a joint whose fits are quick.
HIDING = (
    "transmission_loss", "stribeck", "asymmetric_friction", "warm_up", "torque_ripple", "position_dependent_friction",
    "spring", "offset_drift", "vibration",
)  # fmt: skip
# Of a recording, least and most, s.
DURATION = (5.0, 12.0)
Found = set[tuple[str, str | None]]


@dataclass(frozen=True)
class Asking:
    """What the sets are of."""

    robot: str
    joint: bool
    varied: bool
    others: int


def main() -> None:
    """Print what was found of every set, and the numbers."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robot", default="scara03")
    parser.add_argument("--sets", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--joint", action="store_true", help="one joint alone is late")
    parser.add_argument("--varied", action="store_true", help="runs differ")
    parser.add_argument("--others", type=int, default=1, help="other effects")
    given = parser.parse_args()
    asking = Asking(given.robot, given.joint, given.varied, given.others)
    made = named = wrong = right = 0
    for seed in range(given.seed * 100000, given.seed * 100000 + given.sets):
        try:
            true, found, verdict = found_of(seed, asking)
        except ScaraIdentError as error:
            print(f"{seed}: {error}", flush=True)
            continue
        late = {item for item in found if item[0] == TimeDelay.name}
        made, named, wrong = made + 1, named + (late <= true and bool(late)), wrong + bool(late - true)
        right += true == found
        print(f"{seed}: {_words(true)} -> {verdict} {_words(found)}", flush=True)
    print(f"{made} sets: the right delay alone in {named}, another one in {wrong}; all effects and no other in {right}")


def found_of(seed: int, asking: Asking) -> tuple[Found, Found, str]:
    """Record and diagnose a set; return what it has, what was found and the verdict."""
    rng = np.random.default_rng(seed)
    rate = float(rng.choice(RATES))
    delay = max(LEAST, float(rng.uniform(*SAMPLES)) / rate)
    names = rng.choice(HIDING, asking.others, replace=False)
    with tempfile.TemporaryDirectory() as place:
        arm, _ = random_arm(asking.robot, stated=True, bits=BITS, folder=Path(place), rng=rng)
        joint, other = (str(rng.choice(arm.robot.joints)) for _ in range(2))
        effects: list[Effect] = [TimeDelay(joint if asking.joint else None, delay=delay)]
        effects += [replace(random_effect(str(name), FACTOR, arm, rng), joint=other) for name in names]
        asked = Asked(varied=asking.varied, rate=rate, recordings=int(rng.integers(3, 6)), duration=DURATION)
        made = simulate_set("pair", seed, asking.robot, Path(place) / "set", asked, effects)
        result = diagnose(made.robot, made.training, validation=made.held_out)
    true = {(item.name, item.joint) for item in effects}
    return true, {(item.effect, item.joint) for item in result.effects}, result.verdict


def _words(effects: Found) -> str:
    return ", ".join(sorted(f"{name} on {joint or 'all joints'}" for name, joint in effects)) or "-"


if __name__ == "__main__":
    main()
