"""How often an effort is said to be in another unit than the others', where none is, and where one is.

Each virtual set is looked at as drawn (see `virtual_sets`), with whatever effect it has, and once more with the effort of one joint
times a factor.

    python benchmarks/effort_units.py --robot ur5 --sets 20 --seed 771
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from virtual_sets import simulate_set, tasks

from scara_ident.errors import ScaraIdentError
from scara_ident.estimation.observations import observe
from scara_ident.identification.gain_check import gain_said
from scara_ident.identification.usable import usable_in_bands
from scara_ident.model.model import build_model
from scara_ident.recording.recording import Recording
from scara_ident.robot.robot import Robot

# Current in place of torque, N m in place of N mm, and gears that were forgotten.
FACTORS = (0.1, 0.2, 5.0, 10.0, 100.0, 1000.0)


def said_of(robot: Robot, recordings: Sequence[Recording]) -> str | None:
    """Return what is said of the units of efforts; None where nothing is."""
    model = build_model(robot)
    try:
        data, *_ = usable_in_bands(model, recordings, (), None, alike=True, held=True)
        return gain_said(observe(model, data))
    except ScaraIdentError:
        return None


def scaled(recordings: Sequence[Recording], joint: int, factor: float) -> list[Recording]:
    """Return recordings with the effort of one joint times a factor."""
    n = len(recordings[0].joints)
    scale = np.where(np.arange(n) == joint, factor, 1.0)[:, None]
    return [replace(item, effort=None if item.effort is None else scale * item.effort) for item in recordings]


def outcome(said: str | None, joint: str, others: Sequence[str]) -> str:
    """Return what was said of a set in which the effort of one joint is in another unit."""
    if said is None:
        return "nothing said"
    named = said.partition(" than on ")[0]
    return "named" if joint in named and not any(other in named for other in others) else "another joint named"


def main() -> None:
    """Print how often what was said of every set."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robot", default="ur5")
    parser.add_argument("--sets", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    drawn, wrong = Counter[str](), Counter[str]()
    for kind, seed in tasks(given.sets, given.seed):
        with TemporaryDirectory() as folder:
            made = simulate_set(kind, seed, given.robot, Path(folder))
            robot, recordings = made.robot, made.training
            drawn["named" if said_of(robot, recordings) else "nothing said"] += 1
            rng = np.random.default_rng([seed, 5])
            joint, factor = int(rng.integers(robot.n)), float(rng.choice(FACTORS))
            said = said_of(robot, scaled(recordings, joint, factor))
            own = robot.joints[joint]
            wrong[outcome(said, own, [name for name in robot.joints if name != own])] += 1
    print(f"{given.robot}, {given.sets} sets of seed {given.seed}")
    print(f"as drawn: {dict(drawn)}")
    print(f"one effort times {', '.join(f'{x:g}' for x in FACTORS)}: {dict(wrong)}")


if __name__ == "__main__":
    main()
