"""Seconds and peak memory of `diagnose` with its report, of two checkouts side by side.

On the shared cases and on the UR10e of docs/measured.md. The checkouts take turns within each repeat, so that they see the
same machine; the table gives medians over the repeats, and the ratio that of the old one over the new one. A first run of
each, which compiles what is kept on disk, is not counted.

    git worktree add ../old a6cf3ca
    python benchmarks/diagnosis.py ../old . --output benchmarks/results/diagnosis.json
"""

from __future__ import annotations

import argparse
import json
import os
import re
import sys
import tempfile
from pathlib import Path
from statistics import median
from typing import Any

from checkouts import Run, cases, measured, run

# How many times as fast the new checkout is to be; the memory ratio is to be at least 1.
CASES_TARGET, UR10E_TARGET = 3.0, 15.0


def commands(shared: Path) -> dict[str, list[str]]:
    """Return the words of every command, without where it writes to."""
    found = {name: ["diagnose", *words] for name, words in cases(shared / "cases").items()}
    return found | {"ur10e": ["diagnose", *measured(shared / "data")["ur10e"][1], "--model", "basic"]}


def timed(checkout: Path, words: list[str]) -> Run:
    """Run a command that writes its results and report; it must end well."""
    with tempfile.TemporaryDirectory() as folder:
        done = run(checkout, [*words, "--output", folder])
        if done.status or not (Path(folder) / "diagnosis.json").exists() or not (Path(folder) / "report.html").exists():
            raise SystemExit(f"{checkout}: {' '.join(words)}: status {done.status}: {done.errors.strip()}")
    return done


def summary(runs: dict[str, list[Run]], target: float) -> dict[str, Any]:
    """Return medians and ratios of one command."""
    seconds = {side: median(item.seconds for item in done) for side, done in runs.items()}
    memory = {side: median(item.memory for item in done) for side, done in runs.items()}
    ratios = [old.seconds / new.seconds for old, new in zip(runs["old"], runs["new"], strict=True)]
    return {
        "seconds": seconds,
        "memory_mb": memory,
        "ratio": median(ratios),
        "worst_ratio": min(ratios),
        "target": target,
        "memory_ratio": memory["old"] / memory["new"],
    }


def asked(description: str | None, repeats: int) -> tuple[argparse.Namespace, dict[str, list[str]]]:
    """Return what was given on the command line, and the commands that it chooses."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("old", type=Path, help="checkout whose time is the reference")
    parser.add_argument("new", type=Path, help="checkout to compare")
    parser.add_argument("--shared", type=Path, default=Path("../shared"), help="folder with data and cases")
    parser.add_argument("--repeats", type=int, default=repeats)
    parser.add_argument("--only", default="", help="regular expression that names of commands must hold")
    parser.add_argument("--output", type=Path, help="JSON of the figures")
    options = parser.parse_args()
    chosen = {name: words for name, words in commands(options.shared).items() if re.search(options.only, name)}
    if not chosen:
        parser.error(f"no command holds {options.only!r}")
    return options, chosen


def write(output: Path | None, results: dict[str, Any], repeats: int) -> None:
    """Write the figures of the commands as JSON, if asked for."""
    if output is not None:
        output.parent.mkdir(parents=True, exist_ok=True)
        content = {"repeats": repeats, "cores": os.cpu_count(), "commands": results}
        output.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")


def main() -> None:
    options, chosen = asked(__doc__, repeats=5)
    sides = {"old": options.old, "new": options.new}
    shortest = next(iter(chosen.values()))
    for checkout in sides.values():
        timed(checkout, shortest)
    results = {}
    print(
        f"{'':24}{'old, s':>9}{'new, s':>9}{'ratio':>8}{'worst':>8}{'target':>8}{'old, MB':>9}{'new, MB':>9}{'ratio':>8}"
    )
    for name, words in chosen.items():
        runs: dict[str, list[Run]] = {side: [] for side in sides}
        for k in range(options.repeats):
            for side, checkout in sides.items():
                runs[side].append(timed(checkout, words))
            times = ", ".join(f"{side} {done[-1].seconds:.1f} s" for side, done in runs.items())
            print(f"{name} {k + 1}/{options.repeats}: {times}", file=sys.stderr, flush=True)
        result = results[name] = summary(runs, UR10E_TARGET if name == "ur10e" else CASES_TARGET)
        seconds, memory = result["seconds"], result["memory_mb"]
        print(
            f"{name:24}{seconds['old']:9.1f}{seconds['new']:9.1f}{result['ratio']:8.2f}{result['worst_ratio']:8.2f}"
            f"{result['target']:8.0f}{memory['old']:9.0f}{memory['new']:9.0f}{result['memory_ratio']:8.2f}",
            flush=True,
        )
    print(f"medians of {options.repeats} repeats in turn; with report; {os.cpu_count()} cores")
    write(options.output, results, options.repeats)


if __name__ == "__main__":
    main()
