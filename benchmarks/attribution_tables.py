"""The tables of the attribution benchmark: how often it is right, what is taken for what, and how well it predicts."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence
from typing import Any

import numpy as np

NOT_SINGLE = ("none", "pair", "unlisted")
# Angles are compared on the circle, and tilt and delay by their size and not as a share.
ANGLES = ("phase",)
ABSOLUTE = ("tilt_x", "tilt_y", "delay", "ratio")
Item = dict[str, Any]


def hits(item: Item) -> list[bool]:
    """Return for each true effect whether it was found, by its name or in a group that is said to hold it."""
    return [
        any(
            (found["effect"] == true["effect"] and found["joint"] == true["joint"]) or true["effect"] in found["group"]
            for found in item["found"]
        )
        for true in item["true"]
    ]


def right(item: Item) -> bool:
    """Return whether all that is there was found and nothing else."""
    return all(hits(item)) and len(item["found"]) == len(item["true"])


def wrong(item: Item) -> list[str]:
    """Return the effects named that are not there, nor in a group with one that is."""
    true = {(each["effect"], each["joint"]) for each in item["true"]}
    names = {each["effect"] for each in item["true"]}
    return [
        found["effect"]
        for found in item["found"]
        if (found["effect"], found["joint"]) not in true and not names & set(found["group"])
    ]


def detection_limit(items: Sequence[Item]) -> float:
    """Return the size, in multiples of the default, that splits found from missed with the fewest misjudged."""
    sizes = np.array([item["factors"][0] for item in items])
    found = np.array([all(hits(item)) for item in items])
    cuts = np.concatenate([[0.0], np.sort(sizes)])
    errors = [np.sum(found[sizes <= cut]) + np.sum(~found[sizes > cut]) for cut in cuts]
    return float(cuts[int(np.argmin(errors))])


def parameter_errors(items: Sequence[Item]) -> dict[str, list[float]]:
    """Return the errors of the parameters of effects that were found, as shares but for angles, tilt and delay."""
    errors: dict[str, list[float]] = defaultdict(list)
    for item in items:
        for true in item["true"]:
            for found in item["found"]:
                if (found["effect"], found["joint"]) != (true["effect"], true["joint"]):
                    continue
                for name, (value, std) in found["parameters"].items():
                    exact = true["parameters"].get(name)
                    if exact is None or std is None or not np.isfinite(std):
                        continue
                    if name in ANGLES:
                        errors[name].append(abs(float(np.angle(np.exp(1j * (value - exact))))))
                    elif name in ABSOLUTE:
                        errors[name].append(abs(value - exact))
                    elif exact:
                        errors[name].append(abs(value / exact - 1.0))
    return errors


def ratios_to(items: Sequence[Item], key: str) -> list[float]:
    """Return the worst joint's held-out error after, over that of the true model or over the noise, set by set."""
    found = []
    for item in items:
        reference = list(item[key].values()) if isinstance(item.get(key), dict) else item.get(key)
        if reference:
            found.append(max(a / b for a, b in zip(item["after"], reference, strict=True)))
    return found


def report(results: Sequence[Item]) -> None:
    """Print all tables."""
    by_kind: dict[str, list[Item]] = defaultdict(list)
    for item in results:
        by_kind[item["kind"]].append(item)
    print(
        f"\n{'effect':28} sets right miss wrong  limit  after/true   after/noise  s   errors of parameters, median (95 %)"
    )
    for kind, items in by_kind.items():
        limit = detection_limit(items) if kind not in NOT_SINGLE else np.nan
        good = [item for item in items if right(item)]
        errors = parameter_errors(good)
        told = ", ".join(
            f"{name} {np.median(values):.2g} ({np.quantile(values, 0.95):.2g})" for name, values in errors.items()
        )
        print(
            f"{kind:28} {len(items):4d} {len(good):5d} {sum(not all(hits(i)) for i in items):4d} "
            f"{sum(bool(wrong(i)) for i in items):5d} {limit:6.2f} {_median(ratios_to(good, 'true_model')):11.3f} "
            f"{_median(ratios_to(good, 'noise')):13.2f} {np.median([i['seconds'] for i in items]):4.1f}  {told}"
        )
    confusion(results)
    single = [item for item in results if item["kind"] not in NOT_SINGLE]
    limits = {kind: detection_limit(items) for kind, items in by_kind.items() if kind not in NOT_SINGLE}
    above = [item for item in single if item["factors"][0] > limits[item["kind"]]]
    _share("right effect and joint, above the detection limit", [right(item) for item in above])
    _share("the same counting what no limit excuses: all single effects", [right(item) for item in single])
    _share("both of a pair", [right(item) for item in by_kind.get("pair", [])])
    _share("a wrong effect named, all sets", [bool(wrong(item)) for item in results])
    _share("false alarm on sets with nothing missing", [i["verdict"] != "complete" for i in by_kind.get("none", [])])
    _share(
        "effects outside the catalogue called unexplained",
        [i["verdict"] == "unexplained" and not i["found"] for i in by_kind.get("unlisted", [])],
    )
    for key, words in (("true_model", "that of the true model"), ("noise", "the noise between repetitions")):
        ratios = ratios_to([item for item in above if right(item)], key)
        if ratios:
            print(
                f"held-out error after, worst joint, over {words}: median {np.median(ratios):.3f}, "
                f"95 % {np.quantile(ratios, 0.95):.3f}, largest {max(ratios):.3f}"
            )
    seconds = [item["seconds"] for item in results]
    print(f"seconds for one diagnosis: median {np.median(seconds):.1f}, largest {max(seconds):.1f}")


def confusion(results: Sequence[Item]) -> None:
    """Print what is taken for what: one line per true effect with all that was named, but for its own name."""
    table: dict[str, Counter[str]] = defaultdict(Counter)
    for item in results:
        names = " + ".join(sorted(each["effect"] for each in item["true"])) if item["true"] else "nothing missing"
        if item["kind"] == "pair":
            names = "a pair"
        found = [each["effect"] for each in item["found"]]
        own = {(each["effect"], each["joint"]) for each in item["true"]}
        for each in item["found"]:
            exact = (each["effect"], each["joint"]) in own
            table[names]["itself" if exact else f"{each['effect']} on {each['joint']}"] += 1
        if not found:
            table[names][f"nothing ({item['verdict']})"] += 1
    print("\nnamed, for each true effect")
    for names, counts in table.items():
        print(f"  {names:28} " + ", ".join(f"{name} {count}" for name, count in counts.most_common()))
    print()


def _median(values: Sequence[float]) -> float:
    return float(np.median(values)) if values else float("nan")


def _share(words: str, flags: Sequence[bool]) -> None:
    if flags:
        print(f"{words}: {sum(flags)} of {len(flags)}, {np.mean(flags):.1%}")
