"""Positions, or efforts, that were logged behind a mean of the last samples, of arms with one elastic gear or none: what is believed.

Every set is a random arm under the random conditions of `virtual_sets`, with three to five short recordings, whose positions are
replaced by their mean over 20 to 80 ms; with ``--efforts`` those of the efforts are. A gear is right if it is on its joint and its
stiffness within three standard deviations; a delay and the filter's own effect are there; all else is false.

    python benchmarks/filtered_signals.py --sets 20 --seed 9400
    python benchmarks/filtered_signals.py --sets 20 --seed 9400 --efforts
"""

from __future__ import annotations

import argparse
import tempfile
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from virtual_conditions import Asked
from virtual_sets import simulate_set

from scara_ident import Diagnosis, Recording, diagnose
from scara_ident.arrays import Array
from scara_ident.errors import ScaraIdentError
from scara_ident.simulation.effects import JointElasticity

GEAR = "joint_elasticity"
# What a filter of all joints' signals is.
OF_FILTERS = ("time_delay", "position_filter", "torque_filter")
RATES = (200.0, 250.0, 500.0, 1000.0)
# Length of the mean, s.
MEAN = (0.02, 0.08)
# Two of three arms have a gear.
KINDS = ("none", GEAR, GEAR)
# Encoder steps of a joint's turn, as a power of 2.
BITS = 20
# Of a recording, least and most, s.
DURATION = (5.0, 12.0)
# Standard deviations within which a stiffness is right.
WITHIN = 3.0


@dataclass(frozen=True)
class Made:
    """A set's mean, s, its gear if it has one, and what was found."""

    mean: float
    gear: JointElasticity | None
    found: Diagnosis

    def judged(self) -> list[str]:
        """Say of each effect believed, and of a gear that is missed, what is right."""
        said = []
        told = [item for item in self.found.effects if item.effect == GEAR]
        others = [item for item in self.found.effects if item.effect not in (GEAR, *OF_FILTERS)]
        said += ["false effect"] * len(others)
        for item in told:
            if self.gear is None or item.joint != self.gear.joint:
                said.append("false gear")
                continue
            size = item.parameters["stiffness"]
            near = abs(size.value - self.gear.stiffness) <= WITHIN * size.std
            said.append("right gear" if near else "gear of a wrong size")
        missed = self.gear is not None and all(item.joint != self.gear.joint for item in told)
        said += ["missed gear"] * missed
        if self.found.verdict in ("explained", "complete") and any("false" in each for each in said):
            said.append(f"{self.found.verdict} though something is false")
        return said


def main() -> None:
    """Print what was found of every set, and the numbers."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robot", default="scara03")
    parser.add_argument("--sets", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--efforts", action="store_true", help="the efforts are means")
    given = parser.parse_args()
    numbers, made = Counter[str](), 0
    for seed in range(given.seed * 100000, given.seed * 100000 + given.sets):
        try:
            item = made_of(seed, given.robot, efforts=given.efforts)
        except ScaraIdentError as error:
            print(f"{seed}: {error}", flush=True)
            continue
        made += 1
        said = item.judged()
        numbers.update(said)
        true = "rigid" if item.gear is None else f"{item.gear.joint} {item.gear.stiffness:.3g}"
        told = "; ".join(_words(item.found)) or "-"
        print(
            f"{seed}: {true}, {1e3 * item.mean:.0f} ms -> {item.found.verdict}: {told} ({', '.join(said)})", flush=True
        )
    counted = ", ".join(f"{number} {name}" for name, number in sorted(numbers.items()))
    print(f"{made} sets: {counted}")


def made_of(seed: int, robot: str, *, efforts: bool) -> Made:
    """Record and diagnose a set."""
    rng = np.random.default_rng(seed)
    rate, mean = float(rng.choice(RATES)), float(rng.uniform(*MEAN))
    asked = Asked(varied=False, rate=rate, bits=BITS, recordings=int(rng.integers(3, 6)), duration=DURATION)
    kind = str(rng.choice(KINDS))
    with tempfile.TemporaryDirectory() as place:
        made = simulate_set(kind, seed, robot, Path(place), asked)
        count = max(2, round(mean * rate))
        training, held_out = (averaged(each, count, efforts=efforts) for each in (made.training, made.held_out))
        found = diagnose(made.robot, training, validation=held_out)
    gear = next((item for item in made.effects if isinstance(item, JointElasticity)), None)
    return Made(count / rate, gear, found)


def averaged(recordings: Sequence[Recording], count: int, *, efforts: bool) -> list[Recording]:
    """Return recordings whose positions, or efforts, are the mean of the last so many."""

    def mean(signal: Array) -> Array:
        before = np.repeat(signal[:, :1], count - 1, axis=1)
        return np.asarray(
            np.mean(np.lib.stride_tricks.sliding_window_view(np.hstack([before, signal]), count, axis=1), axis=-1)
        )

    if efforts:
        return [replace(item, effort=None if item.effort is None else mean(item.effort)) for item in recordings]
    return [replace(item, position=mean(item.position)) for item in recordings]


def _words(found: Diagnosis) -> list[str]:
    return [
        f"{item.label} " + ", ".join(f"{value.value:.4g} +- {value.std:.2g}" for value in item.parameters.values())
        for item in found.effects
    ]


if __name__ == "__main__":
    main()
