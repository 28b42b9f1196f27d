"""What the diagnosis makes of torque, or positions, that were logged behind a filter, by arms and filters.

Four recordings of two motions (500 Hz, 22 bits, white noise of 1 % of the torque) of a random arm that lacks nothing. The efforts or positions of all
joints then go through a filter of SciPy whose delay at rest is given. The table has what was found, the errors of the
inertial base parameters in standard deviations (root mean square, largest), and the verdict; a row each set of recordings.

    python benchmarks/filters.py --robot scara03 --seeds 1 2 3 4
"""

from __future__ import annotations

import argparse
import os
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from attribution_truth import coverage, true_parameters
from numpy.typing import NDArray
from scipy.signal import bilinear, butter, lfilter
from virtual_conditions import Asked
from virtual_sets import simulate_set

from scara_ident.diagnosis import diagnose
from scara_ident.recording.recording import Recording
from scara_ident.report.diagnosis import diagnosis_dict

Array = NDArray[np.float64]
RATE = 500.0
ASKED = Asked(
    rate=RATE, bits=22, noise=0.01, noise_kind="white", varied=False, recordings=4, motions=2, duration=(10.0, 20.0)
)
FILTERS = ("delay:0.01", "lag:0.004", "lag:0.01", "lag:0.02", "butterworth:0.01", "mean:0.01")


def coefficients(kind: str, delay: float) -> tuple[Array, Array]:
    """Return numerator and denominator of a filter with such a delay, s."""
    if kind == "lag":
        return bilinear([1.0], [delay, 1.0], RATE)
    if kind == "butterworth":
        return butter(2, np.sqrt(2.0) / (2.0 * np.pi * delay), fs=RATE)
    steps = round(delay * RATE)
    taps = np.full(2 * steps + 1, 1.0 / (2 * steps + 1)) if kind == "mean" else np.eye(steps + 1)[steps]
    return taps, np.array([1.0])


def filtered(recordings: Sequence[Recording], kind: str, delay: float, of: str) -> list[Recording]:
    """Return recordings whose efforts or positions went through a filter that ran before, at the first effort or speed."""
    up, down = coefficients(kind, delay)
    found = []
    for item in recordings:
        signal = getattr(item, of)
        speed = 0.0 if of == "effort" else (signal[:, 5:6] - signal[:, :1]) * RATE / 5.0
        line = signal[:, :1] + speed * (item.time - item.time[0])
        late = line - delay * speed + lfilter(up, down, signal - line, axis=1)
        found.append(replace(item, velocity=None, **{of: late}))
    return found


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robot", default="scara03", help="scara03, a robot of example-robot-data or a URDF")
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3, 4])
    parser.add_argument(
        "--filters", nargs="+", default=FILTERS, help="kind:delay in s; lag, butterworth, mean or delay"
    )
    parser.add_argument("--of", choices=("effort", "position"), default="effort", help="what goes through the filter")
    given = parser.parse_args()
    print("| arm | filter | found | inertial errors, std: rms, largest | verdict |\n|---|---|---|---|---|")
    for seed in given.seeds:
        with tempfile.TemporaryDirectory() as place:
            made = simulate_set("none", seed, given.robot, Path(place) / "set", ASKED)
            for text in given.filters:
                kind, delay = text.split(":")
                training, held_out = (
                    filtered(items, kind, float(delay), given.of) for items in (made.training, made.held_out)
                )
                result = diagnose(made.robot, training, validation=held_out)
                said = "; ".join(
                    f"{item.label} " + ", ".join(f"{k} {p.value:.4g} ± {p.std:.1g}" for k, p in item.parameters.items())
                    for item in result.effects
                )
                told = diagnosis_dict(result)["parameters"]
                errors = np.array(coverage(told, true_parameters(made, made.truth()), [])["inertial"])
                sizes = f"{np.sqrt(np.mean(errors**2)):.1f}, {np.max(np.abs(errors)):.1f}"
                print(f"| {given.robot} {seed} | {kind} {delay} s | {said} | {sizes} | {result.verdict} |", flush=True)


if __name__ == "__main__":
    main()
