"""The least that `diagnose` can take as it is, and how many times as fast as another checkout that would be.

Of each command of `diagnosis.py` the parts that no diagnosis goes without are timed where the command does them, each once:

- start: from the start of the process until the recordings are in memory;
- base: bands, motion, the base model's rows and its first fit;
- columns: the columns of every candidate, once;
- look: one examination of every candidate beside the base model;
- page: drawing and writing report.html.

What is left out of their sum: choosing among candidates, refining and fitting one, a second round, what the first effect hides, the
audit, what is left over, recordings held out, uncertainties, what to do next, pictures. So a diagnosis that finds anything takes
longer; where the bound is below a target, that cannot be met by leaving out work that is done twice.

    git worktree add ../old a6cf3ca
    python benchmarks/floor.py ../old . --output benchmarks/results/floor.json
"""

from __future__ import annotations

import importlib
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from statistics import median
from typing import Any

from diagnosis import CASES_TARGET, UR10E_TARGET, asked, timed, write

PARTS = ("start", "base", "columns", "look", "page")
# Module, what holds the function, its name, and the part that its first call is.
PLACES = (
    ("scara_ident.diagnosis.diagnose", None, "usable_in_bands", "base"),
    ("scara_ident.diagnosis.diagnose", None, "observe", "base"),
    ("scara_ident.diagnosis.selection.search", None, "wls", "base"),
    ("scara_ident.diagnosis.candidates.candidates", "CandidateColumns", "rows", "columns"),
    ("scara_ident.diagnosis.testing.selection_step", "SelectionStep", "judge", "look"),
    ("scara_ident.report.html.diagnosis", None, "diagnosis_report", "page"),
)


def inside(began: float, output: str, words: Sequence[str]) -> None:
    """Run a command in this process, and write how long the first call of each part took."""
    from scara_ident.cli import main

    took = dict.fromkeys(PARTS, 0.0)
    for name, owner, function, part in PLACES:
        module = importlib.import_module(name)
        holder = module if owner is None else getattr(module, owner)
        setattr(holder, function, _first_call(getattr(holder, function), took, part))
    # What the patches loaded is loaded by the command too; it is ready where it calls `diagnose` with what was read.
    module = importlib.import_module("scara_ident.diagnosis")
    diagnose = module.diagnose

    def ready(*arguments: Any, **options: Any) -> Any:
        took["start"] = time.time() - began
        return diagnose(*arguments, **options)

    vars(module)["diagnose"] = ready
    sys.argv[1:] = words
    try:
        main()
    finally:
        Path(output).write_text(json.dumps(took), encoding="utf-8")


def _first_call(function: Callable[..., Any], took: dict[str, float], part: str) -> Callable[..., Any]:
    calls = list[float]()

    def timed_once(*arguments: Any, **options: Any) -> Any:
        before = time.perf_counter()
        try:
            return function(*arguments, **options)
        finally:
            if not calls:
                calls.append(time.perf_counter() - before)
                took[part] += calls[0]

    return timed_once


def parts_of(checkout: Path, words: Sequence[str]) -> dict[str, float]:
    """Return the seconds of each part of a command of a checkout."""
    environment = os.environ | {"PYTHONPATH": str(checkout.resolve())}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    with tempfile.TemporaryDirectory() as folder:
        told = Path(folder) / "parts.json"
        code = f"import sys; sys.path.insert(0, {str(Path(__file__).parent)!r}); import floor; floor.inside({time.time()!r}, {str(told)!r}, sys.argv[1:])"
        command = [sys.executable, "-P", "-c", code, *words, "--output", str(Path(folder) / "out")]
        subprocess.run(command, env=environment, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        found: dict[str, float] = json.loads(told.read_text(encoding="utf-8"))
        return found


def main() -> None:
    options, chosen = asked(__doc__, repeats=3)
    for checkout in (options.old, options.new):
        timed(checkout, next(iter(chosen.values())))
    print(
        f"{'seconds':24}{'old':>7}{'new':>7}" + "".join(f"{part:>9}" for part in (*PARTS, "sum", "at most", "target"))
    )
    results = {}
    for name, words in chosen.items():
        old, new, each = list[float](), list[float](), list[dict[str, float]]()
        for _ in range(options.repeats):
            old.append(timed(options.old, words).seconds)
            new.append(timed(options.new, words).seconds)
            each.append(parts_of(options.new, words))
        parts = {part: median(item[part] for item in each) for part in PARTS}
        least = median(sum(item.values()) for item in each)
        target = UR10E_TARGET if name == "ur10e" else CASES_TARGET
        bound = median(slow / sum(item.values()) for slow, item in zip(old, each, strict=True))
        results[name] = {
            "old": median(old),
            "new": median(new),
            "parts": parts,
            "least": least,
            "at_most": bound,
            "target": target,
        }
        columns = "".join(f"{parts[part]:9.2f}" for part in PARTS)
        print(
            f"{name:24}{median(old):7.2f}{median(new):7.2f}{columns}{least:9.2f}{bound:9.2f}{target:9.0f}", flush=True
        )
    print(f"medians of {options.repeats} repeats in turn; at most: old over the sum; {os.cpu_count()} cores")
    write(options.output, results, options.repeats)


if __name__ == "__main__":
    main()
