"""What two commits compute from the same recordings, and every figure in which they differ.

Both are run through the command line alone: `identify` by every method and model, and `diagnose`, on measured arms, on
the shared cases and on sets of `virtual_sets.py`. A parameter differs where it moved by more than 1e-8 of the larger of
its value and its standard deviation, any other figure by more than 1e-8 of itself. Results are kept by what the sources
of a checkout are, so that each commit runs once.

    git worktree add ../old a6cf3ca
    python benchmarks/virtual_sets.py ../sets --count 60
    python benchmarks/compare_commits.py ../old . --sets ../sets --output comparison.json
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import re
import sys
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from checkouts import METHODS, MODELS, cases, measured, run

TOLERANCE = 1e-8
# What is compared of a result; the rest is prose, or a view of these.
IDENTIFIED = ("samples", "band_hz", "parameters", "links", "log_det", "condition", "physically_consistent", "errors")
DIAGNOSED = (
    *("verdict", "effects", "tentative", "unexplained", "not_identifiable", "events"),
    *("band_hz", "noise_floor", "parameters", "training", "validation"),
)
# Keys that are prose, or outside of the contract.
LEFT_OUT = ("meaning", "description", "why", "settled_by", "summary", "notes", "alternatives")


def commands(shared: Path, sets: Path | None) -> dict[str, list[str]]:
    """Return the words of every command by a name."""
    found: dict[str, list[str]] = {}
    for name, (to_identify, to_diagnose) in measured(shared / "data").items():
        found[f"data/{name}/diagnose"] = ["diagnose", *to_diagnose, "--model", "basic"]
        found |= _identify(f"data/{name}", to_identify)
    for kind, folder in (("case", shared / "cases"), ("set", sets)):
        by_name = {} if folder is None else cases(folder)
        found |= {f"{kind}/{name}/diagnose": ["diagnose", *words] for name, words in by_name.items()}
        for name, words in by_name.items():
            found |= _identify(f"{kind}/{name}", words)
    return found


def _identify(name: str, words: list[str]) -> dict[str, list[str]]:
    return {
        f"{name}/identify/{model}/{method}": ["identify", *words, "--model", model, "--method", method]
        for model in MODELS
        for method in METHODS
    }


def sources(checkout: Path) -> str:
    """Return a short hash of the package of a checkout."""
    digest = hashlib.sha256()
    files = [path for path in (checkout / "scara_ident").rglob("*") if path.is_file() and path.suffix != ".pyc"]
    for path in sorted(path for path in files if "__pycache__" not in path.parts):
        digest.update(str(path.relative_to(checkout)).encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:12]


def result_of(checkout: Path, name: str, words: list[str], kept: Path) -> dict[str, Any]:
    """Return a command's run and result, from what was kept where it ran before."""
    place = kept / f"{name.replace('/', '.')}.json"
    if place.exists():
        before: dict[str, Any] = json.loads(place.read_text(encoding="utf-8"))
        if before["words"] == words:
            return before
    done = run(checkout, [*words, "--json"])
    now = {"words": words} | asdict(done) | {"output": json.loads(done.output) if done.status == 0 else None}
    if done.status == 0:
        kept.mkdir(parents=True, exist_ok=True)
        place.write_text(json.dumps(now) + "\n", encoding="utf-8")
    return now


def figures(result: Mapping[str, Any]) -> dict[str, tuple[Any, float]]:
    """Return every compared figure of a result by its path, with what its change is measured by where it is small."""
    keys = DIAGNOSED if "verdict" in result else IDENTIFIED
    return {path: leaf for key in keys if key in result for path, leaf in _leaves(result[key], key, 0.0)}


def _leaves(value: Any, path: str, scale: float) -> Iterator[tuple[str, tuple[Any, float]]]:
    if isinstance(value, Mapping):
        std = value.get("std") or 0.0
        for key, item in value.items():
            if key not in LEFT_OUT:
                yield from _leaves(item, f"{path}.{key}", std if key == "value" else 0.0)
    elif isinstance(value, list) and value and isinstance(value[0], Mapping):
        seen: dict[str, int] = {}
        for item in value:
            key = "/".join(str(item[k]) for k in ("name", "effect", "recording", "joint") if item.get(k) is not None)
            seen[key] = seen.get(key, 0) + 1
            label = key if seen[key] == 1 else f"{key}#{seen[key]}"
            # That it is there is a figure itself.
            yield f"{path}[{label}]", (True, 0.0)
            yield from _leaves(item, f"{path}[{label}]", 0.0)
    elif isinstance(value, list) and any(isinstance(item, float) for item in value):
        # Entries of one vector are measured by the largest.
        largest = max(abs(item) for item in value)
        for k, item in enumerate(value):
            yield f"{path}[{k}]", (item, largest)
    elif isinstance(value, float) and path.endswith("p_value"):
        # What is compared is how sure, not the last digits of a number like 1e-285.
        yield f"{path} (log10)", (math.log10(max(value, 1e-300)), 1.0)
    else:
        yield path, (value, scale)


def relative_change(old: tuple[Any, float], new: tuple[Any, float]) -> float:
    """Return by how much a figure moved: 0 where it is the same, infinity where it is no number or another kind."""
    (before, old_scale), (after, new_scale) = old, new
    if before == after:
        return 0.0
    plain = all(isinstance(value, int | float) and not isinstance(value, bool) for value in (before, after))
    if not plain:
        return math.inf
    if math.isnan(before) or math.isnan(after):
        return 0.0 if math.isnan(before) and math.isnan(after) else math.inf
    return abs(after - before) / max(abs(before), abs(after), old_scale, new_scale)


def differences(name: str, old: Mapping[str, Any], new: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return what differs between two runs of one command; keys that only the new result has are no difference."""
    if old["status"] != new["status"]:
        said = [(item["errors"].strip().splitlines() or [""])[-1] for item in (old, new)]
        return [
            _difference(name, "exit status", *(f"{r['status']} {s}" for r, s in zip((old, new), said, strict=True)))
        ]
    if old["status"]:
        return []
    before, after = figures(old["output"]), figures(new["output"])
    gone = (None, 0.0)
    # What an item that is not in the other result holds is not listed again.
    items = {
        path for path, (value, _) in (before | after).items() if value is True and (path in before) != (path in after)
    }
    paths = [*before, *(path for path in items if path in after)]
    found = []
    for path in paths:
        if any(path != item and path.startswith(item) for item in items):
            continue
        change = relative_change(before.get(path, gone), after.get(path, gone))
        if change > TOLERANCE:
            found.append(_difference(name, path, before.get(path, gone)[0], after.get(path, gone)[0], change))
    return found


def _difference(name: str, what: str, old: Any, new: Any, relative: float = math.inf) -> dict[str, Any]:
    return {"command": name, "what": what, "old": old, "new": new, "relative": relative}


def held_out_ratios(old: Mapping[str, Any], new: Mapping[str, Any]) -> list[float]:
    """Return the new error over the old one of every joint and held-out recording; none where a run failed."""
    if old["status"] or new["status"]:
        return []
    before, after = figures(old["output"]), figures(new["output"])
    paths = [
        path
        for path in before
        if (path.startswith("errors.validation.") and path.endswith(".rms")) or path.startswith("validation.after.")
    ]
    pairs = [(before[path][0], after[path][0]) for path in paths if path in after]
    return [float(error / other) for other, error in pairs if error and other]


def report(found: list[dict[str, Any]], ratios: Mapping[str, list[float]], most: int) -> None:
    """Print a table of the differences, the largest of each command first."""
    shown: dict[str, list[dict[str, Any]]] = {}
    for item in found:
        shown.setdefault(item["command"], []).append(item)
    print(f"{len(ratios)} commands, {len(ratios) - len(shown)} of them the same, {len(found)} differences")
    for name, items in shown.items():
        held_out = "no figure is held out"
        if ratios[name]:
            mean = math.exp(sum(map(math.log, ratios[name])) / len(ratios[name]))
            held_out = (
                f"error held out, new / old: {mean:.4f} (from {min(ratios[name]):.4f} to {max(ratios[name]):.4f})"
            )
        print(f"\n{name}: {len(items)}; {held_out}")
        print(f"  {'what':70}{'old':>24}{'new':>24}{'relative':>10}")
        for item in sorted(items, key=lambda item: -item["relative"])[:most]:
            print(f"  {item['what']:70}{item['old']!s:>24}{item['new']!s:>24}{item['relative']:10.1e}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("old", type=Path, help="checkout whose results are the reference")
    parser.add_argument(
        "new", type=Path, nargs="?", help="checkout to compare; without it the old one's results are made"
    )
    parser.add_argument("--shared", type=Path, default=Path("../shared"), help="folder with data and cases")
    parser.add_argument("--sets", type=Path, help="folder that virtual_sets.py wrote")
    parser.add_argument("--only", default="", help="regular expression that names of commands must hold")
    parser.add_argument("--kept", type=Path, default=Path("output/compared"), help="folder that results are kept in")
    parser.add_argument("--most", type=int, default=30, help="differences printed of one command; the JSON has all")
    parser.add_argument("--output", type=Path, help="JSON of all differences")
    options = parser.parse_args()
    chosen = {
        name: words
        for name, words in commands(options.shared.resolve(), options.sets and options.sets.resolve()).items()
        if re.search(options.only, name)
    }
    checkouts = [options.old] if options.new is None else [options.old, options.new]
    kept = [options.kept / sources(checkout) for checkout in checkouts]
    found, seconds = [], [0.0] * len(checkouts)
    ratios: dict[str, list[float]] = {}
    for k, (name, words) in enumerate(chosen.items(), 1):
        results = [result_of(checkout, name, words, place) for checkout, place in zip(checkouts, kept, strict=True)]
        seconds = [total + result["seconds"] for total, result in zip(seconds, results, strict=True)]
        times = ", ".join(f"{result['seconds']:.1f} s" for result in results)
        now = differences(name, *results) if options.new else []
        found += now
        ratios[name] = held_out_ratios(results[0], results[-1])
        print(f"{k}/{len(chosen)} {name}: {times}; {len(now)} differences", file=sys.stderr, flush=True)
    if options.new is None:
        return
    report(found, ratios, options.most)
    if options.output:
        content = {
            "commands": len(chosen),
            "tolerance": TOLERANCE,
            "seconds": seconds,
            "held_out_new_over_old": ratios,
            "differences": found,
        }
        options.output.parent.mkdir(parents=True, exist_ok=True)
        options.output.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    raise SystemExit(1 if found else 0)


if __name__ == "__main__":
    main()
