"""The page of figures that `bench.py` measured: every number on it is one of `benchmarks/results/bench.json`."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "benchmarks" / "results" / "bench.json"
PAGE = ROOT / "docs" / "benchmarks.md"
# Of arrays to parameters at a million samples: how many times faster than the loop it is to be, and in how much memory.
TARGETS = {"SCARA03": 25, "UR5": 10, "Panda": 6}
MAX_MB, AGREEMENT = 30, 1e-8
FLEET_RATE, FLEET_RATIO = 15, 1.6
MILLION = 1_000_000


def number(value: float) -> str:
    """Return a number with three digits."""
    return f"{value:.3g}" if abs(value) < 1000 else f"{value:,.0f}"


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Return the lines of a table, the first column to the left."""
    return ["| " + " | ".join(line) + " |" for line in (head, ["---", *["---:"] * (len(head) - 1)], *rows)]


def cost(row: dict[str, Any], rows: Sequence[dict[str, Any]], way: str) -> tuple[dict[str, float], str]:
    """Return seconds, CPU seconds and MB of a way, and a mark where they are scaled from fewer samples."""
    if way in row["ways"]:
        return row["ways"][way], ""
    other = max(
        (each for each in rows if each["arm"] == row["arm"] and way in each["ways"]), key=lambda x: x["samples"]
    )
    times = row["samples"] / other["samples"]
    return {key: times * value for key, value in other["ways"][way].items()}, "\\*"


def arrays(rows: list[dict[str, Any]]) -> list[str]:
    lines = []
    for row in rows:
        own = row["ways"]["scara_ident"]
        line = [row["arm"], f"{row['samples']:,}", number(1e6 * own["seconds"] / row["samples"])]
        for way in ("loop", "figaroh"):
            other, mark = cost(row, rows, way)
            line += [
                number(1e6 * other["seconds"] / row["samples"]) + mark,
                number(other["seconds"] / own["seconds"]) + mark,
                number(other["cpu_seconds"] / own["cpu_seconds"]) + mark,
            ]
        line.append(number(own["extra_mb"]))
        line += [number(other["extra_mb"]) + mark for other, mark in (cost(row, rows, w) for w in ("loop", "figaroh"))]
        lines.append(line)
    head = ["arm", "samples", "µs a sample", "loop, µs", "ratio", "of CPU time", "figaroh, µs", "ratio", "of CPU time"]
    found = table([*head, "MB", "loop, MB", "figaroh, MB"], lines)
    found += [
        "",
        "\\* scaled from the largest number of samples that was measured: more takes too much memory or time.",
        "",
        *table(
            ["arm, a million samples", "faster than the loop", "asked", "extra MB", "at most"],
            [
                [
                    row["arm"],
                    ratio,
                    str(TARGETS[row["arm"]]),
                    number(row["ways"]["scara_ident"]["extra_mb"]),
                    str(MAX_MB),
                ]
                for row, ratio in (
                    (row, number(other["seconds"] / row["ways"]["scara_ident"]["seconds"]) + mark)
                    for row in rows
                    if row["samples"] == MILLION
                    for other, mark in [cost(row, rows, "loop")]
                )
            ],
        ),
        "",
        "How far apart the torques are that each way's base parameters predict for another motion, over the largest torque "
        f"of the joint (asked of figaroh: {AGREEMENT:g}):",
        "",
        *table(
            ["arm", "samples", "loop", "figaroh"],
            [
                [
                    row["arm"],
                    f"{row['samples']:,}",
                    *(number(row["apart"][way]) if way in row["apart"] else "" for way in ("loop", "figaroh")),
                ]
                for row in rows
                if row["apart"]
            ],
        ),
    ]
    return found


def recursion(rows: list[dict[str, Any]]) -> list[str]:
    return table(
        [
            "arm",
            "parameters",
            "covariance form, rows/s",
            "torque error",
            "variance error",
            "factor, rows/s",
            "torque error",
            "variance error",
            "ratio",
        ],
        [
            [
                row["arm"],
                str(row["parameters"]),
                *(
                    number(row[way][key])
                    for way in ("covariance", "factor")
                    for key in ("rows_per_second", "error", "covariance_error")
                ),
                number(row["factor"]["rows_per_second"] / row["covariance"]["rows_per_second"]),
            ]
            for row in rows
        ],
    )


def consistent(rows: list[dict[str, Any]]) -> list[str]:
    return table(
        ["arm", "here, ms", "figaroh, ms", "ratio", "of CPU time", "error here", "error of figaroh's"],
        [
            [
                row["arm"],
                number(1e3 * own["seconds"]),
                number(1e3 * other["seconds"]),
                number(other["seconds"] / own["seconds"]),
                number(other["cpu_seconds"] / own["cpu_seconds"]),
                f"{own['error']:.2%}",
                f"{other['error']:.2%}",
            ]
            for row in rows
            for own, other in [(row["ways"]["scara_ident_consistent"], row["ways"]["figaroh_consistent"])]
        ],
    )


def plain(keys: dict[str, str]) -> Callable[[list[dict[str, Any]]], list[str]]:
    """Return what makes a table of some keys of each row, with their heads."""

    def made(rows: list[dict[str, Any]]) -> list[str]:
        shown = [[value if isinstance(value := row[key], str) else number(value) for key in keys] for row in rows]
        return table(list(keys.values()), shown)

    return made


def bandwidth(rows: list[dict[str, Any]]) -> list[str]:
    names = {"arm": "arm", "entries": "entries a sample", "microseconds": "µs a sample", "floor": "filled only, µs"}
    rates = {
        "regressor": "regressor, GB/s",
        "fill_cache": "fill of the cache, GB/s",
        "fill_memory": "fill of memory, GB/s",
    }
    return plain(names | rates)(rows)


def fleet(row: dict[str, Any]) -> list[str]:
    return table(
        ["arms", "recordings", "one worker, recordings/s", "two", "asked", "ratio", "asked"],
        [
            [
                *(str(row[key]) for key in ("arms", "recordings")),
                *(number(row[key]) for key in ("one", "two")),
                str(FLEET_RATE),
                f"{row['ratio']:.2f}",
                str(FLEET_RATIO),
            ]
        ],
    )


TABLES: dict[str, tuple[str, str, Callable[[Any], list[str]]]] = {
    "arrays": (
        "Arrays to parameters",
        "From positions, velocities, accelerations and torques in memory to base parameters with rotor inertia, Coulomb and "
        "viscous friction and offset of every joint. The loop calls `pin.computeJointTorqueRegressor` for every sample, keeps "
        "all rows, and calls `numpy.linalg.qr` on the base columns, which it is given; figaroh uses its own regressor, choice "
        "of columns and double QR. Each is given one or two BLAS threads, whichever is faster, and its arrays as it likes "
        "them. Memory is what the peak lies above that before the call.",
        arrays,
    ),
    "recursion": (
        "Recursion",
        "The covariance form of recursive least squares, row by row in NumPy from 1e8 times the identity, beside "
        "triangular factors of blocks of 512 rows. Torque error: of the predicted torque from the dense solution's, over the "
        "torque; variance error: the largest relative error of a parameter's variance.",
        recursion,
    ),
    "consistent": (
        "Parameters that an arm can have",
        "From 10,000 samples: here the programme on the triangular factor, set up anew; there figaroh's `build_problem` and "
        "`solve_direct_effort_fit` on all rows. Both hold each link's pseudo-inertia matrix; priors and weights are each one's "
        "own, and friction that brakes is asked only here. Not like for like: where least squares is itself possible, which "
        "rich motion makes likely, no programme is solved here, and figaroh always solves one. Error: of the torque of another motion, which has 2 % of noise.",
        consistent,
    ),
    "joints": (
        "Growth with joints",
        "Arrays to triangular factors at 100,000 samples: the Panda's first joints, the others locked.",
        plain({"joints": "joints", "parameters": "parameters", "microseconds": "µs a sample"}),
    ),
    "recordings": (
        "Growth with recordings",
        "`identify` on the SCARA03, recordings of 25 s at 1 kHz.",
        plain({"recordings": "recordings", "seconds": "s", "extra_mb": "extra MB"}),
    ),
    "candidates": (
        "Growth with candidates",
        "Columns of effects on one recording of 25 s at 1 kHz of the SCARA03.",
        plain({"candidates": "candidates", "milliseconds": "ms"}),
    ),
    "bandwidth": (
        "Memory as the limit",
        "The regressor of 4,096 samples written into arrays that are there, beside arrays that are only filled.",
        bandwidth,
    ),
    "fleet": (
        "A fleet by workers",
        "Files to table, arms of the SCARA03 with four recordings of 25 s at 1 kHz each, start of the workers included.",
        fleet,
    ),
}


def page(held: dict[str, Any]) -> str:
    """Return the page of all tables that there are."""
    lines = [
        "# Speed",
        "",
        "How fast this is, beside what else there is. `make bench` measures all of it anew in half an hour or more, with figaroh in an "
        "environment of its own, and writes this page from `benchmarks/results/bench.json`; `python benchmarks/bench.py --full` "
        "repeats more often. Figures are medians; what is compared ran in turn on one machine. Where the load before "
        "was above its number of cores, other programs ran too: times are then too long, and ratios of CPU time tell more.",
    ]
    for name, (title, text, body) in TABLES.items():
        if name not in held:
            continue
        own = held[name]
        machine, versions = own["machine"], dict(own["machine"]["versions"])
        if name in ("arrays", "consistent"):
            versions["figaroh"] = machine["figaroh"]
        said = ", ".join(f"{package} {value}" for package, value in versions.items())
        lines += ["", f"## {title}", "", text, "", *body(own["rows"]), ""]
        lines.append(
            f"{own['date']}, `{own['command']}`: {machine['processor']}, {machine['cores']} cores, load before "
            f"{own['load_before']:g}; Python {machine['python']}, {said}; medians of {own['repeats']}."
        )
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(json.loads(RESULTS.read_text(encoding="utf-8"))), encoding="utf-8")
