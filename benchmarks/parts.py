"""How far parts of one recording lie apart, in the standard deviations that `identify` gives each.

Every recording is cut into halves, thirds and quarters, each identified for itself, its bands included. Of every
parameter that two parts tell, ``z = (a - b) / sqrt(std_a^2 + std_b^2)``; its root mean square over parameters and pairs is 1
where standard deviations are true and the arm stays what it is.

    python benchmarks/parts.py ROBOT RECORDING... [--model complete] [--parts 2 3 4]
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scara_ident import Recording, identify, load_robot, read_recordings
from scara_ident.errors import ScaraIdentError
from scara_ident.estimation.estimate import Estimate

Array = NDArray[np.float64]
SIGNALS = ("position", "effort", "velocity", "acceleration", "temperature", "link_position")
# A deviation that one of twenty exceeds.
BEYOND = 2.0


def parts_of(recording: Recording, count: int) -> list[Recording]:
    """Cut a recording into as many parts of as many samples."""
    bounds = np.linspace(0, len(recording.time), count + 1).astype(int)
    found = []
    for k, (first, stop) in enumerate(zip(bounds[:-1], bounds[1:], strict=True), 1):
        signals = {name: getattr(recording, name) for name in SIGNALS}
        own = {name: None if value is None else value[:, first:stop].copy() for name, value in signals.items()}
        name = f"{recording.name}_part_{k}"
        time = recording.time[first:stop].copy()
        found.append(replace(recording, name=name, trajectory=name, time=time, path=None, cuts=(), **own))
    return found


def deviations(estimates: Sequence[Estimate]) -> Array:
    """Return z of every parameter that both of a pair tell, of all pairs."""
    found = []
    for one, other in combinations(estimates, 2):
        std = np.hypot(one.std, other.std)
        told = ~(one.undetermined | other.undetermined) & np.isfinite(std) & (std > 0.0)
        found.append((one.value - other.value)[told] / std[told])
    return np.concatenate(found) if found else np.zeros(0)


def main() -> None:
    """Print a line for each recording and number of parts, and one for all recordings."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("robot", help="robot.yaml, a URDF or a robot of example-robot-data")
    parser.add_argument("recordings", nargs="+", type=Path)
    parser.add_argument("--model", default="complete")
    parser.add_argument("--parts", nargs="+", type=int, default=[2, 3, 4])
    options = parser.parse_args()
    robot = load_robot(options.robot)
    recordings = read_recordings(options.recordings, robot)
    print("recording                       parts   rms z  beyond 2")
    for count in options.parts:
        sizes = []
        for recording in recordings:
            try:
                each = [identify(robot, [part], model=options.model).estimate for part in parts_of(recording, count)]
            except ScaraIdentError as error:
                print(f"{recording.name:32}{count:5d}   {error}")
                continue
            z = deviations(each)
            sizes.append(float(np.sqrt(np.mean(z**2))))
            print(f"{recording.name:32}{count:5d}{sizes[-1]:8.2f}{np.mean(np.abs(z) > BEYOND):10.1%}", flush=True)
        if len(sizes) > 1:
            print(f"{'median':32}{count:5d}{np.median(sizes):8.2f}")


if __name__ == "__main__":
    main()
