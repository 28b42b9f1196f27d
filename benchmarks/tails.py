"""How often a score whose law is known exceeds the level that is stated for a rate.

White scores at 20 Hz, twelve recordings of equal length. What they truly exceed a level at is known exactly: with a share p of
the samples above it, clusters parted by more than 0.5 s begin with the probability p (1 - p)^10 at any sample. With ``--varied``
each recording has a size of its own, log-normal, and the true rate is the mean over these. The table has the mean of true over
stated, and the share of the repetitions in which it is within 1.5.

    python benchmarks/tails.py --hours 1 --repeats 100
"""

from __future__ import annotations

import argparse
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from scara_ident.estimation.tail import fit_tail
from scara_ident.use.alarm import stated_level

Array = NDArray[np.float64]
RATE, APART, RECORDINGS = 20.0, 10, 12
STATED = (10.0, 30.0, 60.0, 120.0)
# Laws of the score's size, by inverse and share above, with the shape of the tail.
LAWS = {
    "uniform (-1)": stats.uniform(),
    "Pareto, -0.5": stats.genpareto(-0.5),
    "Pareto, -0.2": stats.genpareto(-0.2),
    "half-normal": stats.halfnorm(),
    "Laplace (0)": stats.expon(),
    "t, 10 degrees (0.1)": stats.t(10.0),
    "t, 5 degrees (0.2)": stats.t(5.0),
    "t, 3 degrees (0.33)": stats.t(3.0),
}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--hours", type=float, default=1.0)
    parser.add_argument("--repeats", type=int, default=100)
    parser.add_argument("--varied", type=float, default=0.0, help="standard deviation of the logarithm of their sizes")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    print(f"| law | {' | '.join(f'{rate:g} an hour' for rate in STATED)} |\n|{'---|' * (len(STATED) + 1)}")
    for number, (name, law) in enumerate(LAWS.items()):
        ratios = np.array(
            [
                ratio(law, given.hours, given.varied, np.random.default_rng([given.seed, number, k]))
                for k in range(given.repeats)
            ]
        )
        near = np.mean((ratios > 1.0 / 1.5) & (ratios < 1.5), axis=0)
        cells = (f"{mean:.2f}, {share:.0%}" for mean, share in zip(np.mean(ratios, axis=0), near, strict=True))
        print(f"| {name} | {' | '.join(cells)} |", flush=True)


def ratio(law: stats.rv_continuous, hours: float, varied: float, rng: np.random.Generator) -> Array:
    """Return true over stated at every stated rate, of thresholds from so many hours."""
    count = round(3600.0 * hours * RATE / RECORDINGS)
    # The size of a t law.
    size: Callable[[Array], Array] = np.abs
    above = law.sf if law.support()[0] == 0.0 else lambda level: 2.0 * law.sf(level)
    times = [np.arange(count) / RATE] * RECORDINGS
    scores = [np.exp(varied * rng.normal()) * size(law.rvs(count, random_state=rng)) for _ in times]
    seconds = np.full(RECORDINGS, count / RATE)
    sizes = np.exp(varied * stats.norm.ppf((np.arange(200) + 0.5) / 200))
    found = []
    for rate in STATED:
        level, _ = stated_level(fit_tail(times, scores, float(np.sum(seconds)), rate), times, scores, seconds, rate)
        p = above(level / sizes)
        found.append(float(np.mean(p * (1.0 - p) ** APART)) * RATE * 3600.0 / rate)
    return np.array(found)


if __name__ == "__main__":
    main()
