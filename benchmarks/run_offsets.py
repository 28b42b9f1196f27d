"""Which differences of runs least squares should take for noise, on measured arms.

Of each arm every trajectory is left out in turn. The rest is fitted by least squares with weights per joint, and by
generalised least squares with what runs are found to differ by in one kind, or in all kinds, as noise. The table has the
error on the trajectory left out, over that of plain least squares: the geometric mean over recordings and joints, the mean
torque of each recording taken off, as nobody can foretell its offset; and the share of them with the smaller error.

    python benchmarks/run_offsets.py DATA --model basic

DATA holds a folder with robot.yaml and recordings for each arm.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scara_ident import build_model, load_robot, observe, prepare, read_recordings
from scara_ident.estimation.least_squares import determined_value_and_weights
from scara_ident.estimation.observations import Observations
from scara_ident.estimation.run_variation import KINDS, OFFSET, RunVariation
from scara_ident.estimation.variation_between import run_variation

Array = NDArray[np.float64]
ARMS = ("double_pendulum_a0", "double_pendulum_c1", "ur10e")
CASES = {**{kind: (k,) for k, kind in enumerate(KINDS)}, "all": tuple(range(len(KINDS)))}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path)
    parser.add_argument("--model", default="basic")
    parser.add_argument("--only", nargs="*", default=ARMS)
    given = parser.parse_args()
    print(f"| as noise | {' | '.join(given.only)} |\n|{'---|' * (len(given.only) + 1)}")
    ratios = [ratios_of(given.data / arm, given.model) for arm in given.only]
    for case in CASES:
        cells = (f"{np.exp(np.nanmean(own[case])):.3f}, {np.nanmean(own[case] < 0.0):.0%}" for own in ratios)
        print(f"| {case} | {' | '.join(cells)} |")


def ratios_of(arm: Path, model: str) -> dict[str, Array]:
    """Return the logarithm of the errors' ratio of every case, shape (recordings, n)."""
    robot = load_robot(arm / "robot.yaml")
    recordings = read_recordings(sorted(arm.glob("*.parquet")), robot)
    whole = observe(build_model(robot, model), prepare(recordings))
    found: dict[str, list[Array]] = {case: [] for case in CASES}
    for label in dict.fromkeys(whole.data.labels):
        left_out = [k for k, name in enumerate(whole.data.labels) if name == label]
        training = whole.of([k for k in range(len(recordings)) if k not in left_out])
        plain, _ = determined_value_and_weights(training)
        variation = run_variation(training, training.joints, plain)
        for case, kinds in CASES.items():
            value, _ = determined_value_and_weights(training, alone(variation, kinds))
            found[case] += [np.log(errors(whole.of([k]), value) / errors(whole.of([k]), plain)) for k in left_out]
    return {case: np.array(rows) for case, rows in found.items()}


def alone(variation: RunVariation, kinds: tuple[int, ...]) -> RunVariation | None:
    """Return differences of some kinds; None where there are none."""
    if kinds == (OFFSET,):
        return variation.offsets
    of_kinds = np.isin(np.arange(len(KINDS)), kinds)
    joints = [None if item is None else replace(item, std=item.std * of_kinds) for item in variation.joints]
    told = [None if item is None or not np.any(item.std) else item for item in joints]
    return RunVariation(tuple(told)) if any(told) else None


def errors(observations: Observations, value: Array) -> Array:
    """Return each joint's rms error about its mean, shape (n,); NaN without rows."""
    left = [rows.left(value) for rows in observations.joints]
    return np.array([np.std(own) if len(own) else np.nan for own in left])


if __name__ == "__main__":
    main()
