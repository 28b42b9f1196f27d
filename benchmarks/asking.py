"""Whether one asked motion settles what poor first recordings left open.

A virtual arm has one effect of a pair that is easily taken for the other. It is first recorded on one motion, twice, in a
small part of its workspace and at one speed; sets in which the effect is named then and nothing beside it are counted and
left. The others get one more recording: of the motion of ``design_excitation(tell=...)``, of a random motion within the
same limits, and of the motion of the largest log determinant. An effect is named right where it is the only one found, on
its joint, and nothing is confounded with it. Beside that the separation that was promised of the first question and that
which recordings show, by the scatter of blocks of time: in one recording of the motion, and by the mean variance of five with
other noise, as one variance of a dozen blocks is itself a fifth to a third off; beside the model that was asked, with what was
found by then taken out of the torque. Beside these, where the effect that is there is asked for, the separation of it alone
after each of the three motions (``apart``). And whether it was said before that the motion would tell the effect that is there: whether
the motion was said to find one of its size. And a fourth motion is designed for the effect that is there alone, of the size
that all recordings together show, which nobody could ask for: ``best``. How many times as large as the diagnosis needs it the
effect is then expected to be is ``times``. What no motion names, and is not expected to be after that one, is not to be settled.

With ``--tight`` all three motions keep to a cell about the place of the first, at a reduced speed, of which most of what
any motion tells is cut off.

    python benchmarks/asking.py OUTPUT.jsonl --robot scara03 --sets 24 --seed 1 [--tight]
    python benchmarks/asking.py OUTPUT.jsonl --show
    python benchmarks/asking.py OUTPUT.jsonl --bump --sets 12
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from asking_bumps import one_bump
from asking_sets import ASKED, DRAWS, PAIRS, WAYS, one_set

from scara_ident.errors import ScaraIdentError

KINDS = ("confounders", "below_limit")


def show(rows: Sequence[dict[str, Any]]) -> None:
    """Print the shares, in all and of every pair."""
    for robot in dict.fromkeys(row["robot"] for row in rows):
        own = [row for row in rows if row["robot"] == robot]
        opened = [row for row in own if not row["before"] and "tell" in row]
        print(f"{robot}: {len(own)} sets, {sum(row['before'] for row in own)} named right at once, {len(opened)} open")
        print("| pair | open | after --tell | after a random motion | after logdet |\n|---|---|---|---|---|")
        pairs = [("all", opened)]
        pairs += [("some motion names it", [row for row in opened if _named(row)])]
        pairs += [
            ("expected of the best motion", [row for row in opened if _named(row) or row.get("times", 0.0) >= 1.0])
        ]
        pairs += [
            (f"said before to {words} it", [row for row in opened if row.get("said") is answer])
            for words, answer in (("tell", True), ("not tell", False), ("have nothing to ask of", None))
        ]
        pairs += [("a random motion does not name it", [row for row in opened if not row["random"]])]
        pairs += [(f"first question {kind}", [row for row in opened if row.get("kind") == kind]) for kind in KINDS]
        pairs += [(" / ".join(pair), [row for row in opened if row["pair"] == list(pair)]) for pair in PAIRS]
        for name, some in pairs:
            print(f"| {name} | {len(some)} | " + " | ".join(str(sum(row[way] for row in some)) for way in WAYS) + " |")
        none = [row for row in opened if not _named(row)]
        print(
            f"{len(none)} sets that no motion settles; of these said before: {sum(row.get('said') is False for row in none)}"
        )
        for way in WAYS[1:]:
            ahead, behind = (sum(row[a] and not row[b] for row in opened) for a, b in (("tell", way), (way, "tell")))
            times = [row["apart"]["tell"] / row["apart"][way] for row in opened if row.get("apart")]
            farther = f"; {np.median(times):.2f} times as far from none in the median of {len(times)}" if times else ""
            print(f"named after --tell and not after {way}: {ahead}, the other way round {behind}{farther}")
        whole = [row for row in opened if "best" in row]
        if whole:
            print(f"of {len(whole)} with a motion for the effect that is there alone:", end=" ")
            print(", ".join(f"{sum(row[way] for row in whole)} after {way}" for way in ("best", *WAYS)))
        for way in WAYS:
            times = [row["apart"]["best"] / row["apart"][way] for row in whole if "best" in row.get("apart", {})]
            if times:
                print(f"best {np.median(times):.2f} times as far from none as {way} in the median of {len(times)}")
        known = [row for row in opened if row.get("promised", (0.0, 0.0))[1] > 0.0]
        if known:
            each = np.array([row["seen"] for row in known]) / np.array([row["promised"][1:] for row in known])
            for words, ratio in (
                ("in one recording", each[:, 0]),
                (f"in {DRAWS}", np.mean(each**-2.0, axis=1) ** -0.5),
            ):
                near, sure = np.mean(np.abs(ratio - 1.0) <= 0.3), np.round(np.quantile(ratio, (0.1, 0.5, 0.9)), 2)
                print(f"seen {words} over promised: {near:.0%} within 30 % of {len(ratio)}; 10, 50 and 90 % of {sure}")


def _named(row: dict[str, Any]) -> bool:
    return any(row[way] for way in WAYS) or row.get("best", False)


def show_bumps(rows: Sequence[dict[str, Any]]) -> None:
    """Print how well bumps are recovered."""
    for robot in dict.fromkeys(row["robot"] for row in rows):
        own = [row for row in rows if row["robot"] == robot]
        error = np.array([row["error"] for row in own if "error" in row])
        print(f"{robot}: {len(own)} bumps, {len(error)} left unexplained at first and asked for")
        if len(error):
            print(f"shape: rms error {np.median(error):.1%} in the median, {np.mean(error <= 0.15):.0%} within 15 %")


def main() -> None:
    """Run the sets that are not there yet, or show what there is."""
    words = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    words.add_argument("output", type=Path)
    words.add_argument("--robot", default="scara03")
    words.add_argument("--sets", type=int, default=24)
    words.add_argument("--seed", type=int, default=1)
    words.add_argument("--bump", action="store_true", help="torques that no catalogue lists, instead of pairs")
    words.add_argument("--tight", action="store_true", help="the asked motion keeps to a cell at a reduced speed")
    words.add_argument("--seconds", type=float, default=ASKED, help="of the motion of a set")
    words.add_argument("--quick", action="store_true", help="without what a motion for the effect alone would tell")
    words.add_argument("--show", action="store_true")
    given = words.parse_args()
    lines = given.output.read_text(encoding="utf-8").splitlines() if given.output.is_file() else []
    sets = partial(one_set, tight=given.tight, quick=given.quick, seconds=given.seconds)
    what, run, tell = ("bump", one_bump, show_bumps) if given.bump else ("set", sets, show)
    rows = [row for row in map(json.loads, lines) if what in row]
    done = {(row["robot"], row["seed"], row[what]) for row in rows}
    for number in range(0 if given.show else given.sets):
        if (given.robot, given.seed, number) in done:
            continue
        try:
            rows.append(run(given.robot, number, given.seed))
        except ScaraIdentError as error:
            print(f"{what} {number}: {error}", flush=True)
            continue
        with given.output.open("a", encoding="utf-8") as file:
            file.write(json.dumps(rows[-1]) + "\n")
    tell(rows)


if __name__ == "__main__":
    main()
