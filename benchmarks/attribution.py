"""Recordings with an undeclared effect: what the diagnosis names, how often it is wrong, how small it can see.

Every set is a random arm in closed loop, with none, one, two or three effects or one outside the catalogue, at random
sizes and under random conditions: see `virtual_sets`, `virtual_conditions` and `virtual_motions` for all that is drawn.
The identifier is told nothing. Each set runs in a process of its own, and its result is written as it ends: the same
command again goes on where it was stopped. Tables are printed at the end.

    python benchmarks/attribution.py --robot ur5 --sets 300 --seed 5
    python benchmarks/attribution.py --tables output/attribution/ur5_5_1a2b3c4d5e6f output/attribution/panda_5_1a2b3c4d5e6f
"""

from __future__ import annotations

import argparse
import itertools
import json
import sys
from collections.abc import Callable, Sequence
from concurrent.futures.process import BrokenProcessPool
from dataclasses import asdict
from pathlib import Path

from attribution_tables import describe, report
from attribution_truth import Item, set_alone
from compare_commits import sources
from virtual_conditions import Asked
from virtual_sets import KINDS, WHERE_ASKED, add_conditions, asked_for, tasks

import scara_ident
from scara_ident.fleet.engine import run_all

# The package that runs, which need not be that beside this file.
CHECKOUT = Path(scara_ident.__file__).resolve().parent.parent


def results(folder: Path) -> list[Item]:
    """Return all that a folder holds, by seed."""
    items = [json.loads(path.read_text(encoding="utf-8")) for path in folder.glob("set_*.json")]
    return sorted(items, key=lambda item: item["seed"])


def run(
    folder: Path,
    wanted: Sequence[tuple[str, int]],
    robot: str,
    asked: Asked,
    limit: int,
    scheduler: str | None,
    jobs: int,
    ended: Callable[[Item], None],
) -> None:
    """Run the sets that the folder lacks, and write each as it ends."""
    folder.mkdir(parents=True, exist_ok=True)
    left = [(kind, seed) for kind, seed in wanted if not _place(folder, kind, seed).exists()]

    def write(place: int, item: Item | str) -> None:
        if isinstance(item, str):
            kind, seed = left[place]
            print(f"set {seed} ({kind}) was not simulated: {item}", file=sys.stderr, flush=True)
            return
        path = _place(folder, *left[place])
        part = path.with_suffix(".part")
        part.write_text(json.dumps(item) + "\n", encoding="utf-8")
        part.replace(path)
        ended(item)

    work = [(kind, seed, robot, asked, limit) for kind, seed in left]
    run_all(set_alone, work, scheduler, workers=jobs, ended=write)


def _place(folder: Path, kind: str, seed: int) -> Path:
    return folder / f"set_{seed}_{kind}.json"


def _check_asked(folder: Path, asked: Asked, robot: str) -> None:
    """Refuse to mix sets under other conditions into a folder."""
    path = folder / "asked.json"
    now = {"robot": robot} | asdict(asked)
    if path.exists() and json.loads(path.read_text(encoding="utf-8")) != json.loads(json.dumps(now)):
        raise SystemExit(f"{folder}: holds sets under other conditions ({path.name}); name another folder by --output")
    folder.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(now) + "\n", encoding="utf-8")


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robot", default="scara03", help="scara03, a robot of example-robot-data or a URDF")
    parser.add_argument("--sets", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", nargs="*", choices=sorted({*KINDS, *WHERE_ASKED}), help="kinds to draw")
    parser.add_argument("--jobs", type=int, default=2, help="sets side by side on this machine")
    parser.add_argument("--scheduler", help="address of a Dask scheduler, whose workers have this folder in their path")
    parser.add_argument("--limit", type=int, default=900, help="seconds after which a diagnosis is given up")
    parser.add_argument("--output", type=Path, help="folder of the results; default: by robot, seed and sources")
    parser.add_argument("--merged", type=Path, help="JSON of all results")
    parser.add_argument("--tables", type=Path, nargs="+", help="print the tables of these folders, and stop")
    add_conditions(parser)
    options = parser.parse_args()
    if options.tables:
        report([item for folder in options.tables for item in results(folder)])
        return
    asked = asked_for(options)
    name = f"{Path(options.robot).stem}_{options.seed}_{sources(CHECKOUT)}"
    folder = options.output or Path("output/attribution") / name
    _check_asked(folder, asked, options.robot)
    wanted = tasks(options.sets, options.seed, options.only or KINDS)
    done = sum(_place(folder, *task).exists() for task in wanted)
    print(f"{folder}: {done} of {len(wanted)} sets are there", file=sys.stderr, flush=True)
    count = itertools.count(done + 1)

    def ended(item: Item) -> None:
        print(f"{next(count):4d} {describe(item)}", flush=True)

    try:
        run(folder, wanted, options.robot, asked, options.limit, options.scheduler, options.jobs, ended)
    except BrokenProcessPool:
        raise SystemExit(
            f"{folder}: a process ended before its set was done (out of memory?); run again to go on"
        ) from None
    seeds = {seed for _, seed in wanted}
    found = [item for item in results(folder) if item["seed"] in seeds]
    report(found)
    if options.merged:
        options.merged.parent.mkdir(parents=True, exist_ok=True)
        options.merged.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
