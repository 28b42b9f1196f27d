"""How often the diagnosis' tests call noise an effect: the false-alarm rate of stated p-values, with coloured noise.

Rows as a diagnosis has them: columns of a model, a candidate that is not there, and noise, in blocks of time within
recordings. Noise is white, remembers a tenth of a block or half of it, or has heavy tails (Student's t of three degrees).
The candidate moves in all blocks alike, in three of them only, in all with four fifths of its square in one, or unevenly. A
rate between a third of and three times the nominal one is what is asked for (`--check` fails otherwise); a test that cannot
be made with so little, and says p = 1, is counted beside it.

With `--power S` the candidate is there, at S standard errors of the best test, which knows the noise to be white and how
strong it is: how often each is beyond one in a hundred thousand.

    python benchmarks/calibration.py --draws 4000
    python benchmarks/calibration.py --draws 400 --power 12
"""

from __future__ import annotations

import argparse
import json
import os
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter
from scipy.stats import beta, norm

from scara_ident.diagnosis.testing.candidate_tests import examine
from scara_ident.diagnosis.testing.fitted_model import FittedModel
from scara_ident.estimation.joint_rows import JointRows
from scara_ident.fleet.engine import run_all

Array = NDArray[np.float64]
BLOCKS = (6, 12, 50, 300)
# Rows of a block, and columns of the model; a regressor of a joint of a six-axis arm has about as many that matter.
ROWS, COLUMNS = 40, 12
# Blocks of a recording: each recording starts its noise anew.
OF_A_RECORDING = 6
# Share of a block after which noise has forgotten to 1/e; of heavy tails, in place of it, the degrees of freedom below zero.
MEMORIES = (0.0, 0.1, 0.5, -3.0)
# Of a candidate's square that is in one block, and how far blocks of an uneven one spread, in its logarithm.
IN_ONE, SPREAD = 0.8, 1.2
NOMINAL = 0.01
# What one of some two hundred candidates is asked for.
ASKED = 1e-5
ALLOWED = (0.3, 3.0)


@dataclass(frozen=True)
class Case:
    """One line of the table: number of blocks, memory of the noise, columns of the candidate, and where it lives."""

    blocks: int
    memory: float
    width: int
    lives: str


CASES = [
    Case(blocks, memory, width, lives)
    for blocks in BLOCKS
    for memory in MEMORIES
    for width, lives in ((1, "all blocks"), (2, "all blocks"), (1, "3 blocks"), (1, "mostly one"), (2, "unevenly"))
]


def smooth(rng: np.random.Generator, count: int, rows: int) -> Array:
    """Return columns that move as regressors do, shape (count, rows): sums of sines, some slower than a block."""
    t = np.arange(rows)
    rate = 2.0 * np.pi * np.exp(rng.uniform(np.log(0.1), np.log(2.0), (count, 3, 1))) / ROWS
    return np.sum(rng.normal(size=(count, 3, 1)) * np.sin(rate * t + rng.uniform(0.0, 6.3, (count, 3, 1))), axis=1)


def noise(rng: np.random.Generator, rows: int, memory: float) -> Array:
    """Return stationary noise of unit variance, shape (rows,)."""
    if memory < 0.0:
        return rng.standard_t(-memory, rows) / np.sqrt(memory / (memory + 2.0))
    white = rng.normal(size=rows)
    if memory == 0.0:
        return white
    keep = float(np.exp(-1.0 / (memory * ROWS)))
    drive = np.sqrt(1.0 - keep**2) * white
    drive[0] = white[0]
    return np.asarray(lfilter([1.0], [1.0, -keep], drive))


def living(case: Case, rng: np.random.Generator) -> Array:
    """Return how large a candidate is in each block."""
    if case.lives == "3 blocks":
        return np.isin(np.arange(case.blocks), rng.choice(case.blocks, 3, replace=False)).astype(float)
    if case.lives == "mostly one":
        most = np.sqrt(IN_ONE / (1.0 - IN_ONE) * (case.blocks - 1))
        return np.where(np.arange(case.blocks) == rng.integers(case.blocks), most, 1.0)
    return np.exp(SPREAD * rng.normal(size=case.blocks)) if case.lives == "unevenly" else np.ones(case.blocks)


def p_value(case: Case, rng: np.random.Generator, size: float) -> float:
    """Draw rows in which a candidate has a size in standard errors, and test it."""
    rows = case.blocks * ROWS
    starts = np.arange(0, rows + 1, ROWS)
    owner = np.arange(case.blocks) // OF_A_RECORDING
    lengths = [int(np.sum(owner == k)) * ROWS for k in range(owner[-1] + 1)]
    torque = np.concatenate([noise(rng, length, case.memory) for length in lengths])
    columns, candidate = smooth(rng, COLUMNS, rows), smooth(rng, case.width, rows)
    candidate *= np.repeat(living(case, rng), ROWS)
    if size > 0.0:
        outside = candidate[0] - np.linalg.lstsq(columns.T, candidate[0], rcond=None)[0] @ columns
        torque = torque + size / np.linalg.norm(outside) * candidate[0]
    table = np.concatenate([columns, (torque + columns.sum(axis=0))[None]])
    joint = JointRows(np.arange(COLUMNS), table, starts, np.full(case.blocks, float(ROWS)))
    folds = owner if owner[-1] > 0 else np.arange(case.blocks) % 2
    model = FittedModel((joint,), COLUMNS, owner, folds, np.ones(1))
    return examine(model, [{0: candidate}])[0].p_value


def rates(task: tuple[Case, int, int, float]) -> dict[str, float]:
    """Return how often the test of one case is beyond some levels: number of draws, seed and size beside it."""
    case, draws, seed, size = task
    rng = np.random.default_rng([seed, CASES.index(case)])
    began = time.perf_counter()
    p = np.array([p_value(case, rng, size) for _ in range(draws)])
    return asdict(case) | {
        "draws": draws,
        "at_asked": float(np.mean(p < ASKED)),
        "at_1_percent": float(np.mean(p < NOMINAL)),
        "at_5_percent": float(np.mean(p < 0.05)),
        "at_0_1_percent": float(np.mean(p < 0.001)),
        "not_testable": float(np.mean(p >= 1.0)),
        "seconds": time.perf_counter() - began,
    }


def report_power(found: Sequence[dict[str, float]], size: float) -> None:
    """Print how often a candidate that is there is found."""
    best = norm.sf(norm.isf(0.5 * ASKED) - size)
    print(f"p < {ASKED:g} of a candidate at {size:g} standard errors; of one column the best test: {best:.0%}")
    for item in found:
        print(f"{item['blocks']:6} {item['memory']:7.1f} {item['width']:8} {item['lives']:>12} {item['at_asked']:8.1%}")


def report(found: Sequence[dict[str, float]]) -> bool:
    """Print the table and return whether all rates at the nominal level are allowed."""
    low, high = (factor * NOMINAL for factor in ALLOWED)
    print(
        f"{'blocks':>6} {'memory':>7} {'columns':>8} {'lives in':>12} {'p<.001':>8} {'p<.01':>8} {'p<.05':>8} {'no test':>8}"
    )
    right = True
    for item in found:
        rate, draws = item["at_1_percent"], item["draws"]
        # Clopper and Pearson's interval of 95 %: what so few draws leave open does not speak against a rate.
        hits = round(rate * draws)
        least = beta.ppf(0.025, hits, draws - hits + 1) if hits else 0.0
        most = beta.ppf(0.975, hits + 1, draws - hits) if hits < draws else 1.0
        good = item["not_testable"] > 0.5 or (least <= high and most >= low)
        right &= good
        print(
            f"{item['blocks']:6} {item['memory']:7.1f} {item['width']:8} "
            f"{item['lives']:>12} {item['at_0_1_percent']:8.2%} {rate:8.2%} "
            f"{item['at_5_percent']:8.2%} {item['not_testable']:8.0%}{'' if good else '  <- outside'}"
        )
    return right


def main() -> None:
    """Run all cases."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draws", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2, help="processes of this machine")
    parser.add_argument("--scheduler", help="address of a Dask scheduler, in place of these")
    parser.add_argument("--blocks", type=int, nargs="+", choices=BLOCKS, default=list(BLOCKS))
    parser.add_argument("--power", type=float, default=0.0, metavar="S", help="standard errors that the candidate has")
    parser.add_argument("--check", action="store_true", help="exit with 1 where a rate is outside of what is allowed")
    parser.add_argument("--output", type=Path, help="JSON of the rates")
    options = parser.parse_args()
    # Processes are many and matrices small.
    for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
        os.environ.setdefault(variable, "1")
    chosen = [(case, options.draws, options.seed, options.power) for case in CASES if case.blocks in options.blocks]
    found = run_all(rates, [(each,) for each in chosen], options.scheduler, workers=options.jobs)
    if options.power:
        report_power(found, options.power)
    right = bool(options.power) or report(found)
    if options.output:
        options.output.parent.mkdir(parents=True, exist_ok=True)
        options.output.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    raise SystemExit(1 if options.check and not right else 0)


if __name__ == "__main__":
    main()
