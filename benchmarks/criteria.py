"""What every criterion of the diagnosis does: each is halved and doubled, and the verdicts on virtual recordings compared.

The recordings (see `virtual_sets`) are made once and kept in a folder. A set is diagnosed as it is, then once for every
other value of every criterion that this diagnosis read: one that it did not read cannot change it. The JSON is written
after each diagnosis, and a run that is started again goes on from there.

    python benchmarks/criteria.py --sets 24 --seed 11 --output benchmarks/results/criteria.json
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any, ClassVar

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from attribution_right import hits, right, wrong
from virtual_sets import simulate_set, tasks, write_set

from scara_ident.diagnosis import diagnose
from scara_ident.diagnosis.criteria import CRITERIA, SelectionCriteria
from scara_ident.fleet.engine import run_all
from scara_ident.recording.recording import Recording, read_recordings
from scara_ident.robot.robot import load_robot

# The kinds of sets in rotation: nothing, one effect, something outside the catalogue, two effects.
KINDS = (
    *("none", "transmission_loss", "unlisted", "torque_ripple", "pair", "spring", "none", "joint_elasticity"),
    *("unlisted", "time_delay", "pair", "vibration", "none", "stribeck", "unlisted", "payload_change"),
    *("pair", "backlash", "none", "torque_sensor_nonlinearity", "unlisted", "friction_coupling", "pair", "base_tilt"),
)
NAMES = tuple(name for name, *_ in CRITERIA.documented())
UNITS = {name: unit for name, _, unit, *_ in CRITERIA.documented()}
FACTORS = (0.5, 2.0)
AS_IT_IS = "as it is"
COUNTS = ("right", "wrong", "false", "missed", "unexplained")
Item = dict[str, Any]


def scaled(name: str, factor: float) -> Any:
    """Return another value of a criterion: ratios of bands by their logarithm, shares up to 1, counts from 1."""
    value = getattr(CRITERIA, name)
    if UNITS[name] == "of the band":
        return tuple(x**factor for x in value) if isinstance(value, tuple) else value**factor
    if isinstance(value, int):
        return max(1, round(factor * value))
    # A share or a probability.
    most = 1.0 if value < 1.0 and UNITS[name] != "1 / motor turn" else float("inf")
    return min(factor * value, most)


class NotedCriteria(SelectionCriteria):
    """Criteria that note which of them are read."""

    read: ClassVar[set[str]] = set()

    def __getattribute__(self, name: str) -> Any:
        # What is copied with another value is read where that copy is.
        if name in NAMES and sys._getframe(1).f_globals["__name__"] != "dataclasses":
            NotedCriteria.read.add(name)
        return super().__getattribute__(name)


def folder_of(folder: Path, task: tuple[str, int]) -> Path:
    """Return the folder of a set, and make its recordings where they are not there yet."""
    kind, seed = task
    own = folder / f"{seed}_{kind}"
    if not (own / "truth.json").exists():
        write_set(simulate_set(kind, seed), own)
    return own


@lru_cache(maxsize=1)
def recordings_of(folder: Path) -> tuple[tuple[Recording, ...], tuple[Recording, ...]]:
    """Return the recordings of a set to train on, and those held out."""
    robot = load_robot()
    return read_recordings([folder / "train"], robot), read_recordings([folder / "test"], robot)


def one_diagnosis(job: tuple[Path, tuple[str, int], str, float]) -> Item:
    """Diagnose a set by criteria of which one is another, and note which were read."""
    folder, task, name, factor = job
    own = folder_of(folder, task)
    recordings, held_out = recordings_of(own)
    criteria = NotedCriteria() if name == AS_IT_IS else replace(CRITERIA, **{name: scaled(name, factor)})
    NotedCriteria.read.clear()
    began = time.perf_counter()
    result = diagnose(load_robot(), recordings, validation=held_out, criteria=criteria)
    seconds = time.perf_counter() - began
    found = [
        {
            "effect": e.effect,
            "joint": e.joint,
            "group": [other.effect for other in e.confounded_with],
            "parameters": {name: [each.value, each.std] for name, each in e.parameters.items()},
        }
        for e in result.effects
    ]
    left = None if result.unexplained is None else result.unexplained.joint
    read = sorted(NotedCriteria.read)
    item = {"verdict": result.verdict, "found": found, "unexplained": left, "seconds": seconds}
    if name != AS_IT_IS:
        return item
    was = json.loads((own / "truth.json").read_text(encoding="utf-8"))
    return item | {"read": read, "kind": was["kind"], "true": was["effects"], "conditions": was["conditions"]}


def run(
    folder: Path,
    sets: Sequence[tuple[str, int]],
    names: Sequence[str],
    output: Path,
    processes: int,
    scheduler: str | None,
) -> Item:
    """Diagnose what is not in the output yet, and return all of it."""
    results: Item = json.loads(output.read_text(encoding="utf-8")) if output.exists() else {}

    def add(jobs: Sequence[tuple[str, int, str, float]]) -> None:
        missing = [job for job in jobs if _key(*job[2:]) not in results.get(_set(*job[:2]), {})]

        def ended(place: int, item: Item) -> None:
            job = missing[place]
            results.setdefault(_set(*job[:2]), {})[_key(*job[2:])] = item
            output.parent.mkdir(parents=True, exist_ok=True)
            output.write_text(json.dumps(results) + "\n", encoding="utf-8")
            print(_set(*job[:2]), _key(*job[2:]), item["verdict"], f"{item['seconds']:.1f} s", flush=True)

        work = [((folder, job[:2], *job[2:]),) for job in missing]
        run_all(one_diagnosis, work, scheduler, workers=processes, ended=ended)

    # What was read says which criteria are worth changing.
    add([(*task, AS_IT_IS, 1.0) for task in sets])
    read = {task: results[_set(*task)][AS_IT_IS]["read"] for task in sets}
    add([(*task, name, factor) for task in sets for name in names if name in read[task] for factor in FACTORS])
    return results


def _set(kind: str, seed: int) -> str:
    return f"{seed}_{kind}"


def _key(name: str, factor: float) -> str:
    return name if name == AS_IT_IS else f"{name} x {factor:g}"


def judged(as_it_is: Item, item: Item) -> dict[str, bool]:
    """Judge a diagnosis; an effect named where none of the catalogue is there is a false find."""
    whole = item | {name: as_it_is[name] for name in ("true", "conditions")}
    unlisted = as_it_is["kind"] == "unlisted"
    listed = bool(whole["true"]) and not unlisted
    left = item["verdict"] == "unexplained"
    return {
        "right": left and not item["found"] if unlisted else right(whole),
        "wrong": listed and bool(wrong(whole)),
        "false": not listed and bool(item["found"]),
        "missed": listed and not all(hits(whole)),
        "unexplained": left,
    }


def table(results: Item, names: Sequence[str]) -> list[str]:
    """Return a Markdown table; a set counts for a criterion that it did not read, or was diagnosed by both values of."""
    rows = [
        "| criterion | value | unit | sets | of them read | x 0.5 | x 1 | x 2 | other findings |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for name in names:
        usual, halved, doubled = [], [], []
        for items in results.values():
            keys = [_key(name, factor) for factor in FACTORS]
            if name not in items[AS_IT_IS]["read"]:
                keys = [AS_IT_IS, AS_IT_IS]
            if all(key in items for key in keys):
                usual.append(items[AS_IT_IS])
                halved.append(items[keys[0]])
                doubled.append(items[keys[1]])
        cells = [
            " ".join(
                str(sum(judged(own, item)[count] for own, item in zip(usual, found, strict=True))) for count in COUNTS
            )
            for found in (halved, usual, doubled)
        ]
        moved = [
            str(sum(_finding(own) != _finding(item) for own, item in zip(usual, found, strict=True)))
            for found in (halved, doubled)
        ]
        read = sum(name in item["read"] for item in usual)
        columns = [f"`{name}`", getattr(CRITERIA, name), UNITS[name], len(usual), read, *cells, ", ".join(moved)]
        rows.append("| " + " | ".join(str(column) for column in columns) + " |")
    return rows


def _finding(item: Item) -> Any:
    named = [(each["effect"], each["joint"], each["group"]) for each in item["found"]]
    return item["verdict"], named, item["unexplained"]


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sets", type=int, default=len(KINDS))
    parser.add_argument("--seed", type=int, default=11)
    parser.add_argument("--only", nargs="*", choices=NAMES, default=NAMES, metavar="NAME", help="criteria to change")
    parser.add_argument("--processes", type=int, default=2, help="of this machine")
    parser.add_argument(
        "--scheduler", help="address of a Dask scheduler whose workers share the folders, in place of these"
    )
    parser.add_argument("--recordings", type=Path, default=Path("build/criteria"), help="folder that keeps them")
    parser.add_argument("--output", type=Path, default=Path("benchmarks/results/criteria.json"))
    parser.add_argument("--table", action="store_true", help="print the table of what the output holds, and stop")
    arguments = parser.parse_args()
    if arguments.table:
        print("\n".join(table(json.loads(arguments.output.read_text(encoding="utf-8")), arguments.only)))
        return
    sets = tasks(arguments.sets, arguments.seed, KINDS)
    results = run(
        arguments.recordings, sets, arguments.only, arguments.output, arguments.processes, arguments.scheduler
    )
    print("\n".join(table(results, arguments.only)))


if __name__ == "__main__":
    main()
