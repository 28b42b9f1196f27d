"""The tables of the attribution benchmark: how often it is right, what is taken for what, and how well it predicts."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Sequence

import numpy as np
from attribution_right import Item, hits, not_there, right, wrong

from scara_ident.diagnosis.held_out.gain import HeldOutGain

NOT_SINGLE = ("none", "pair", "triple", "unlisted")
SEVERAL = ("pair", "triple")
# Of the true model's held-out error, by which another's may be larger.
CLOSE_TO = 1.05
# Ways to part the sets: a heading, and the class of a set.
SPLITS: tuple[tuple[str, Callable[[Item], str]], ...] = (
    ("robot", lambda item: item["robot"]),
    ("effects", lambda item: item["kind"] if item["kind"] in NOT_SINGLE else "one"),
    ("recordings", lambda item: _class(item["conditions"]["recordings"], (1, 2, 4, 6, 9))),
    ("length of all, s", lambda item: _class(item["conditions"]["length"], (0, 20, 50, 100, 300))),
    ("shortest recording, s", lambda item: _class(_shortest(item), (0, 10, 15, 20, 31))),
    ("encoder, bits a turn", lambda item: _class(item["conditions"]["bits"], (0, 12, 15, 18, 21, 24))),
    ("rate, Hz", lambda item: f"{item['conditions']['rate']:g}"),
    ("noise, %", lambda item: _class(100.0 * item["conditions"]["noise"], (0, 0.5, 1, 2, 6))),
    ("noise", lambda item: item["conditions"]["noise_kind"]),
    ("runs differ in", lambda item: varies(item)),
    ("rotor inertia", lambda item: "stated" if item["conditions"]["stated"] else "not stated"),
    ("recorded torque", lambda item: _recorded(item)),
    ("recordings begin", lambda item: item["conditions"]["start"]),
    ("repetitions", lambda item: "some" if _repeated(item) else "none"),
    ("names of files", lambda item: "numbered" if item["conditions"]["numbered"] else "by motion"),
)


def detection_limit(items: Sequence[Item]) -> float:
    """Return the strength that splits found from missed with the fewest misjudged; NaN where none has one."""
    known = [item for item in items if _sizes(item)[0] is not None]
    if not known:
        return np.nan
    sizes = np.array([_sizes(item)[0] for item in known])
    found = np.array([all(hits(item)) for item in known])
    cuts = np.concatenate([[0.0], np.sort(sizes)])
    errors = [np.sum(found[sizes <= cut]) + np.sum(~found[sizes > cut]) for cut in cuts]
    return float(cuts[int(np.argmin(errors))])


def describe(item: Item) -> str:
    """Return one line of a set."""
    found = ", ".join(f"{each['effect']}/{each['joint']}" for each in item["found"])
    true = ", ".join(
        f"{each['effect']}/{each['joint']} x {factor:.2g}"
        for each, factor in zip(item["true"], item["factors"], strict=True)
    )
    conditions = item["conditions"]
    ratio = item.get("to_true_model")
    return (
        f"{item['seed']} {conditions['recordings']} x {conditions['rate']:g} Hz {conditions['length']:.0f} s "
        f"{conditions['bits']} bits {100 * conditions['noise']:.1f} % {conditions['noise_kind']}, {varies(item)}: "
        f"{true or '-'} -> {item['verdict']} {found or '-'} {'WRONG ' if wrong(item) else ''}"
        f"{'' if ratio is None else f'held out {ratio:.3f} '}{item['seconds']:.1f} s {item['memory']:.0f} MB"
        f"{' ' + item['said'] if item.get('said') else ''}"
    )


def report(items: Sequence[Item]) -> None:
    """Print all tables."""
    by_kind: dict[str, list[Item]] = defaultdict(list)
    for item in items:
        by_kind[item["kind"]].append(item)
    limits = {kind: detection_limit(each) for kind, each in by_kind.items() if kind not in NOT_SINGLE}
    _by_effect(by_kind, limits)
    for heading, split in SPLITS:
        _by_condition(heading, split, items, limits)
    confusion(items)
    _summary(items, limits)


def above_limit(item: Item, limits: dict[str, float]) -> bool:
    """Return whether every effect of a set is stronger than what its kind can be seen at, by single ones."""
    names, sizes = [each["effect"] for each in item["true"]], _sizes(item)
    return 0 < len(names) == len(sizes) and all(
        size is not None and size > limits.get(name, np.inf) for name, size in zip(names, sizes, strict=True)
    )


def above_published(item: Item) -> bool:
    """Return whether every effect of a set would remove more of its joint's square than the diagnosis says that it must.

    That limit is in the diagnosis, without knowledge of the truth: as short, as noisy and as often repeated as these
    recordings are, less than that would not be significant on the joint, whatever it is.
    """
    joints, sizes = item.get("strongest", []), _sizes(item)
    return 0 < len(item["true"]) == len(joints) == len(sizes) and all(
        size is not None and (limit := item["limits"].get(joint)) is not None and size**2 / (1.0 + size**2) > limit
        for joint, size in zip(joints, sizes, strict=True)
    )


def _sizes(item: Item) -> list[float | None]:
    """Return the strength of each effect beside the others; of one alone, what the base model lacks where that is unknown."""
    return item.get("strengths") or [item.get("strength")]


def _by_effect(by_kind: dict[str, list[Item]], limits: dict[str, float]) -> None:
    print(
        "\nstrength: rms of what the effect adds to the true model without it, over that of what the true model leaves"
    )
    print(f"{'effect':28} sets right miss wrong tentative  limit  parameters, |error| in std: median, over 2")
    for kind, items in sorted(by_kind.items()):
        errors = [error for item in items if right(item) for error in effect_errors(item)]
        told = f"{np.median(errors):.2f}, {np.mean(np.array(errors) > 2.0):.0%} of {len(errors)}" if errors else "-"
        print(
            f"{kind:28} {len(items):4d} {sum(map(right, items)):5d} {sum(not all(hits(i)) for i in items):4d} "
            f"{sum(bool(wrong(i)) for i in items):5d} {sum(bool(i['tentative']) for i in items):9d} "
            f"{limits.get(kind, np.nan):6.2f}  {told}"
        )


def effect_errors(item: Item) -> list[float]:
    """Return the errors of the parameters of true effects that were found, in standard deviations.

    How late recordings are is what their runs are late by too.
    """
    errors = []
    for true in item["true"]:
        for found in item["found"]:
            if (found["effect"], found["joint"]) != (true["effect"], true["joint"]):
                continue
            for name, (value, std) in found["parameters"].items():
                exact = item["late"] if name == "delay" and "late" in item else true["parameters"].get(name)
                if exact is None or value is None or not std or not np.isfinite(std):
                    continue
                error = float(np.angle(np.exp(1j * (value - exact)))) if name == "phase" else value - exact
                errors.append(abs(error) / std)
    return errors


def _by_condition(heading: str, split: Callable[[Item], str], items: Sequence[Item], limits: dict[str, float]) -> None:
    parts: dict[str, list[Item]] = defaultdict(list)
    for item in items:
        parts[split(item)].append(item)
    if len(parts) < 2:
        return
    print(
        f"\n{heading:24} sets  false  none: false unexpl.  above limit: right  held out <=1.05, all fitted  within 2 std"
        "     s    MB  verdicts"
    )
    for name, each in sorted(parts.items(), key=lambda part: _number_of(part[0])):
        none = [item for item in each if item["kind"] == "none"]
        above = [item for item in each if above_limit(item, limits)]
        ratios = [item["to_true_model"] for item in each if item.get("to_true_model") is not None]
        verdicts = Counter(item["verdict"] for item in each)
        print(
            f"{name:24} {len(each):4d} {_rate([bool(wrong(i)) for i in each])}  {_of(none, lambda i: bool(wrong(i)))} "
            f"{_of(none, lambda i: i['verdict'] == 'unexplained')}  {_of(above, right):>18} "
            f"{_rate([ratio <= CLOSE_TO for ratio in ratios]):>16} {_rate(_fitted(each)):>11} {covered(each):>13} "
            f"{np.median([i['seconds'] for i in each]):5.1f} {np.median([i['memory'] for i in each]):5.0f}  "
            + ", ".join(f"{verdict} {count}" for verdict, count in verdicts.most_common())
        )


def covered(items: Sequence[Item]) -> str:
    """Return the share of inertial and friction parameters within two std of the truth, where the model is right."""
    errors = [error for kind in ("inertial", "friction") for error in _errors(items, kind)]
    return f"{np.mean(np.abs(errors) <= 2.0):.1%}" if errors else "-"


def _errors(items: Sequence[Item], kind: str) -> list[float]:
    """Return the errors of parameters of a kind, in std, where the model is right and the recordings can know the truth."""
    chosen = [item for item in items if right(item) and item.get("coverage") and knowable(item)]
    return [error for item in chosen for error in item["coverage"][kind]]


def knowable(item: Item) -> bool:
    """Return whether recordings tell the arm's mean: not where all have one day's torque scale, or the only one its friction.

    Nothing in them differs by it, and every parameter is as much off. Of an offset the truth is that of the day.
    """
    variation = item["conditions"]["variation"]
    recorded = [run["day"] for run in item["conditions"]["runs"] if not run["held_out"]]
    return not (variation["scale"] and len(set(recorded)) == 1) and not (variation["friction"] and len(recorded) == 1)


def confusion(items: Sequence[Item]) -> None:
    """Print what is taken for what: one line per true effect with all that was named, but for its own name."""
    table: dict[str, Counter[str]] = defaultdict(Counter)
    for item in items:
        names = " + ".join(sorted(each["effect"] for each in item["true"])) if item["true"] else "nothing missing"
        if item["kind"] in SEVERAL:
            names = f"a {item['kind']}"
        own = {(each["effect"], each["joint"]) for each in item["true"]}
        for each in item["found"]:
            exact = (each["effect"], each["joint"]) in own
            table[names]["itself" if exact else f"{each['effect']} on {each['joint']}"] += 1
        if not item["found"]:
            table[names][f"nothing ({item['verdict']})"] += 1
    print("\nnamed, for each true effect")
    for names, counts in sorted(table.items()):
        print(f"  {names:28} " + ", ".join(f"{name} {count}" for name, count in counts.most_common()))


def _borne_out(items: Sequence[Item]) -> None:
    """Tell which of the believed effects the recordings held out speak against."""
    false = [found for item in items for found in not_there(item)]
    true = [found for item in items for found in item["found"] if found not in false]
    for words, found in (("there", true), ("not there", false)):
        gains = [HeldOutGain.of_entry(each["held_out"]) for each in found if each.get("held_out")]
        _share(
            f"believed effects that are {words}: borne out by the recordings held out", [x.borne_out() for x in gains]
        )
        _share(f"believed effects that are {words}: these speak against it", [x.against() for x in gains])


def _summary(items: Sequence[Item], limits: dict[str, float]) -> None:
    none = [item for item in items if item["kind"] == "none"]
    single = [item for item in items if item["kind"] not in NOT_SINGLE]
    above = [item for item in single if above_limit(item, limits)]
    print()
    _share("a believed effect that is not there, all sets", [bool(wrong(item)) for item in items])
    _borne_out(items)
    _share("with nothing missing: a believed effect", [bool(wrong(item)) for item in none])
    _share("with nothing missing: `unexplained`", [item["verdict"] == "unexplained" for item in none])
    _share("right effect and joint, above the detection limit", [right(item) for item in above])
    told = "above that which the diagnosis publishes for the joint"
    _share(f"the same, and {told}", [right(item) for item in above if above_published(item)])
    _share(f"right effect and joint, {told} alone", [right(item) for item in single if above_published(item)])
    _share("the same counting what no limit excuses: all single effects", [right(item) for item in single])
    for kind, words in (("pair", "both of a pair"), ("triple", "all of a triple")):
        each = [item for item in items if item["kind"] == kind]
        _share(words, [right(item) for item in each])
        high = [item for item in each if above_limit(item, limits)]
        _share(f"{words}, each above the limit of single ones", [right(i) for i in high])
        _share(f"{words}, each {told} too", [right(i) for i in high if above_published(i)])
    unlisted = [item for item in items if item["kind"] == "unlisted"]
    _share("outside the catalogue: nothing believed that is not there", [not item["found"] for item in unlisted])
    _share("outside the catalogue: `complete`", [item["verdict"] == "complete" for item in unlisted])
    ratios = [item["to_true_model"] for item in items if item.get("to_true_model") is not None]
    _share(
        "held-out error of the worst joint at most 1.05 of the true model's", [ratio <= CLOSE_TO for ratio in ratios]
    )
    _share("the same of the true structure with all parameters fitted to the same recordings", _fitted(items))
    for why, count in Counter(_missing(item, limits) for item in items if _far(item)).most_common():
        print(f"  more than that: {count:4d} {why}")
    if ratios:
        print(
            f"that ratio: median {np.median(ratios):.3f}, 95 % {np.quantile(ratios, 0.95):.3f}, largest {max(ratios):.3g}"
        )
    for words, chosen in (
        ("runs the same", [i for i in items if varies(i) == "nothing"]),
        ("runs differ", [i for i in items if varies(i) != "nothing"]),
    ):
        for kind in ("inertial", "friction", "offset"):
            within = [abs(error) <= 2.0 for error in _errors(chosen, kind)]
            low, high = _interval([_errors([item], kind) for item in chosen])
            told = f"{words}, model right: {kind} parameters within 2 std, 95 % by set {low:.1%} to {high:.1%}"
            _share(told, within)
    for name, unit in (("seconds", "s"), ("memory", "MB")):
        values = [item[name] for item in items if item.get(name) is not None]
        if values:
            print(f"{name} of a diagnosis: median {np.median(values):.1f}, largest {max(values):.1f} {unit}")


def _interval(errors: Sequence[Sequence[float]]) -> tuple[float, float]:
    """Return between what the share within two std lies were other sets drawn: those of one set are off together."""
    counts = np.array([(np.sum(np.abs(each) <= 2.0), len(each)) for each in errors if each])
    if not len(counts):
        return np.nan, np.nan
    drawn = np.random.default_rng(0).integers(len(counts), size=(2000, len(counts)))
    inside, total = counts[drawn].sum(axis=1).T
    low, high = np.quantile(inside / total, (0.025, 0.975))
    return float(low), float(high)


def _fitted(items: Sequence[Item]) -> list[bool]:
    """Return for each set whether the true structure, fitted to the same recordings, predicts as well as the true model."""
    ratios = [item.get("fitted_to_true_model") for item in items if item.get("to_true_model") is not None]
    return [ratio <= CLOSE_TO for ratio in ratios if ratio is not None]


def _far(item: Item) -> bool:
    return (item.get("to_true_model") or 0.0) > CLOSE_TO


def _missing(item: Item, limits: dict[str, float]) -> str:
    """Return why a set's held-out error is larger than the true model's."""
    if (item.get("fitted_to_true_model") or 0.0) > CLOSE_TO:
        return "what these recordings know of the parameters: the true structure does no better"
    if wrong(item):
        return "an effect believed that is not there"
    if all(hits(item)):
        return "all found, parameters worse than those of the true structure"
    if item["kind"] in SEVERAL:
        return "several effects, not all of them found"
    return (
        "an effect above its limit, not found" if above_limit(item, limits) else "an effect below its limit, not found"
    )


def varies(item: Item) -> str:
    """Return in what the runs of a set differ."""
    variation = item["conditions"]["variation"]
    return ", ".join(key for key in ("friction", "scale", "offset", "delay") if variation[key]) or "nothing"


def _recorded(item: Item) -> str:
    if item["conditions"]["rate"] >= 500.0:
        return "at the controller's rate"
    return "averaged" if item["conditions"]["averaged"] else "sampled"


def _repeated(item: Item) -> bool:
    return bool(item["conditions"]["motions"] < item["conditions"]["recordings"])


def _shortest(item: Item) -> float:
    return min(run["duration"] for run in item["conditions"]["runs"] if not run["held_out"])


def _class(value: float, edges: Sequence[float]) -> str:
    for low, high in zip(edges, edges[1:], strict=False):
        if low <= value < high:
            return f"{low:g} to under {high:g}"
    return f"{edges[-1]:g} and more"


def _number_of(name: str) -> tuple[float, str]:
    try:
        return float(name.split()[0]), name
    except ValueError:
        return np.inf, name


def _rate(flags: Sequence[bool]) -> str:
    return f"{np.mean(flags):6.1%}" if flags else "     -"


def _of(items: Sequence[Item], test: Callable[[Item], bool]) -> str:
    return f"{sum(map(test, items))}/{len(items)}"


def _share(words: str, flags: Sequence[bool]) -> None:
    if flags:
        print(f"{words}: {sum(flags)} of {len(flags)}, {np.mean(flags):.1%}")
