"""Positions, or efforts, behind a filter, of arms with one elastic gear or none: which gears are believed.

Every set is a random arm under the random conditions of `virtual_sets`, with three to five short recordings at 500 Hz. Two of three
arms have a gear; all else that is named, but a delay and the filter's own effect, is false. A gear is right on its joint, with its
stiffness within three standard deviations. The filter is a mean over 20 to 80 ms, or one without a delay: with ``--there-and-back`` a
Butterworth filter of second order at 2.5 to 10 Hz that runs forwards and backwards, with ``--polynomial`` a cubic over 40 to 160 ms about
each sample, with ``--centred-mean`` a mean over 20 to 80 ms about it.

    python benchmarks/filtered_gears.py --sets 20 --seed 9400
    python benchmarks/filtered_gears.py --sets 20 --seed 9400 --of effort
    python benchmarks/filtered_gears.py --sets 20 --seed 9400 --there-and-back
    python benchmarks/filtered_gears.py --sets 20 --seed 9400 --polynomial
"""

from __future__ import annotations

import argparse
import tempfile
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from filters import RATE, filtered
from scipy.signal import butter, filtfilt, savgol_filter
from virtual_conditions import Asked
from virtual_sets import simulate_set

from scara_ident import Diagnosis, Recording, diagnose
from scara_ident.arrays import Array
from scara_ident.effects import Parameter
from scara_ident.errors import ScaraIdentError
from scara_ident.simulation.effects import JointElasticity

KINDS = ("none", "joint_elasticity", "joint_elasticity")
# What a filter of all joints' signals is.
OF_FILTERS = ("time_delay", "position_filter", "torque_filter")
# Delay of the mean, half of its length, s; and of the other filter its frequency, Hz, times that.
DELAY, OF_FREQUENCY = (0.01, 0.04), 0.1
# Filters without a delay: half their length over the delay of the mean, and the order of their polynomial.
WITHOUT_DELAY = {"there-and-back": (0.0, 0), "polynomial": (2.0, 3), "centred-mean": (1.0, 1)}
# Of a recording, least and most, s.
DURATION = (5.0, 12.0)
# Standard deviations within which a stiffness is right.
WITHIN = 3.0


@dataclass(frozen=True)
class Made:
    """The delay of a set, s, its gear if it has one, and what was found."""

    delay: float
    gear: JointElasticity | None
    found: Diagnosis

    def judged(self) -> list[str]:
        """Say of each effect believed, and of a gear that is missed, what is right."""
        told = [item for item in self.found.effects if item.effect not in OF_FILTERS]
        said = [self._judged(item.effect, item.joint, item.parameters.get("stiffness")) for item in told]
        if self.found.verdict in ("explained", "complete") and any("false" in each for each in said):
            said.append(f"{self.found.verdict} though something is false")
        missed = self.gear is not None and all(item.joint != self.gear.joint for item in told)
        return [*said, *["missed gear"] * missed]

    def _judged(self, effect: str, joint: str | None, stiffness: Parameter | None) -> str:
        if effect != JointElasticity.name or stiffness is None:
            return "false effect"
        if self.gear is None or joint != self.gear.joint:
            return "false gear"
        near = abs(stiffness.value - self.gear.stiffness) <= WITHIN * stiffness.std
        return "right gear" if near else "gear of a wrong size"


def main() -> None:
    """Print what was found of every set, and the numbers."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robot", default="scara03")
    parser.add_argument("--sets", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--of", choices=("effort", "position"), default="position", help="what is a mean")
    for name in WITHOUT_DELAY:
        parser.add_argument(
            f"--{name}", dest="passed", action="store_const", const=name, help="a filter without a delay"
        )
    given = parser.parse_args()
    numbers, made = Counter[str](), 0
    for seed in range(given.seed * 100000, given.seed * 100000 + given.sets):
        try:
            item = made_of(seed, given.robot, given.of, given.passed)
        except ScaraIdentError as error:
            print(f"{seed}: {error}", flush=True)
            continue
        made += 1
        said = item.judged()
        numbers.update(said)
        true = "rigid" if item.gear is None else f"{item.gear.joint} {item.gear.stiffness:.3g}"
        told = "; ".join(
            f"{each.label} " + ", ".join(f"{value.value:.4g} +- {value.std:.2g}" for value in each.parameters.values())
            for each in item.found.effects
        )
        print(
            f"{seed}: {true}, {1e3 * item.delay:.0f} ms -> {item.found.verdict}: {told} ({', '.join(said)})", flush=True
        )
    print(f"{made} sets: " + ", ".join(f"{number} {name}" for name, number in sorted(numbers.items())))


def made_of(seed: int, robot: str, of: str, passed: str | None) -> Made:
    """Record and diagnose a set behind a filter, the mean with a delay if none is named."""
    rng = np.random.default_rng(seed)
    delay, kind = float(rng.uniform(*DELAY)), str(rng.choice(KINDS))
    asked = Asked(varied=False, rate=RATE, bits=20, recordings=int(rng.integers(3, 6)), duration=DURATION)
    with tempfile.TemporaryDirectory() as place:
        made = simulate_set(kind, seed, robot, Path(place), asked)
        through = partial(filtered, kind="mean") if passed is None else partial(without_delay, passed=passed)
        training, held_out = (through(each, delay=delay, of=of) for each in (made.training, made.held_out))
        found = diagnose(made.robot, training, validation=held_out)
    return Made(delay, next((item for item in made.effects if isinstance(item, JointElasticity)), None), found)


def without_delay(recordings: Sequence[Recording], delay: float, of: str, passed: str) -> list[Recording]:
    """Return recordings whose efforts or positions went through a filter without a delay, see `WITHOUT_DELAY`."""

    def through(signal: Array) -> Array:
        if passed == "there-and-back":
            up, down = butter(2, OF_FREQUENCY / delay, fs=RATE)
            return np.asarray(filtfilt(up, down, signal, axis=1))
        halves, order = WITHOUT_DELAY[passed]
        # An odd number of samples, so that it is centred.
        return np.asarray(savgol_filter(signal, 2 * round(halves * delay * RATE) + 1, order, axis=1))

    return [replace(item, velocity=None, **{of: through(getattr(item, of))}) for item in recordings]


if __name__ == "__main__":
    main()
