"""Whether the effects that `diagnose` finds on measured arms hold on recordings that neither training nor validation saw.

The recordings of each arm, in the order of their names, are dealt out into two halves. One half is diagnosed; of the
other every second recording is held out by `diagnose`, and the rest is seen by nothing. Then the halves change places.
On the recordings not seen the squared error with all effects is compared with that without one of them, all other
parameters fitted again to the training recordings. With r removed on all joints, weighted as in the fit, and l left on
the effect's own joint, the ratio is sqrt(l / (l + r)): after over before, where an effect acts on its joint alone. It holds
below 0.97.

    python benchmarks/measured.py DATA --only ur10e --output benchmarks/results/measured.json

DATA holds a folder with robot.yaml and recordings for each arm.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from scara_ident import Recording, load_robot, read_recordings
from scara_ident.diagnosis import Diagnosis, diagnose
from scara_ident.diagnosis.candidates.candidates import CandidateColumns, columns_at_hand
from scara_ident.diagnosis.fitting.correction import corrected
from scara_ident.diagnosis.selection.search import Search
from scara_ident.diagnosis.testing.selection_step import SelectionStep, observed
from scara_ident.errors import RecordingError
from scara_ident.estimation.least_squares import value_and_weights
from scara_ident.estimation.observations import Observations, observe
from scara_ident.motion.prepared import PreparedData, prepare
from scara_ident.report.diagnosis_words import quantity, sentences

HOLDS = 0.97
ARMS = ("ur10e", "emps", "double_pendulum_c1", "double_pendulum_a0")


def halves(recordings: Sequence[Recording]) -> tuple[Sequence[Recording], Sequence[Recording]]:
    """Deal recordings out into two halves."""
    return recordings[::2], recordings[1::2]


def rows_on(step: SelectionStep, found: Search, data: PreparedData) -> Observations:
    """Return the rows of a step's model on other recordings, corrected as the training ones were."""
    rows = observe(found.base, data)
    if found.correction is not None:
        rows = rows.with_torque(corrected(rows.data, found.correction))
    scene = replace(step.scene, columns=columns_at_hand(rows))
    return observed(replace(step, scene=scene, columns=CandidateColumns(rows)))


def errors(step: SelectionStep, found: Search, each: Sequence[PreparedData]) -> np.ndarray:
    """Return the rms error of every joint on every recording, shape (recordings, n); NaN without rows."""
    value, _ = value_and_weights(observed(step))
    rows = [rows_on(step, found, data).by_joint for data in each]
    return np.array([[item.rms(value) if item.rows else np.nan for item in joints] for joints in rows])


def counts(found: Search, each: Sequence[PreparedData]) -> np.ndarray:
    """Return the rows of every joint on every recording, shape (recordings, n)."""
    return np.array([[item.rows for item in observe(found.base, data).by_joint] for data in each])


def says_something(found: Search, data: PreparedData) -> bool:
    """Return whether a recording has rows, as one has not whose joints all rest or are held."""
    try:
        observe(found.base, data)
    except RecordingError:
        return False
    return True


def direction(arm: Path, model: str, training: Sequence[Recording], others: Sequence[Recording]) -> dict[str, Any]:
    """Diagnose one half and judge what was found on recordings of the other that nothing saw."""
    unseen, validation = halves(others)
    robot = load_robot(arm / "robot.yaml")
    diagnosis = diagnose(robot, training, model=model, validation=validation)
    found = diagnosis.search
    prepared = ((item, prepare([item]).at(found.bands)) for item in unseen)
    unseen, each = zip(*(pair for pair in prepared if says_something(found, pair[1])), strict=True)
    whole, rows = errors(found.step, found, each), counts(found, each)
    base = errors(replace(found.step, chosen=()), found, each)
    joints = list(robot.joints)
    effects = []
    for place, candidate in enumerate(found.chosen):
        without = errors(found.step.without(place), found, each)
        joint = candidate.joint(found.scene)
        own = list(range(len(joints))) if joint is None else [joints.index(joint)]
        weights = found.step.weights**2 * rows
        after, before = (np.nan_to_num(weights * part**2) for part in (whole, without))
        removed, left = np.sum(before - after, axis=1), np.sum(after[:, own], axis=1)
        filled = left > 0.0
        effect = next(item for item in diagnosis.effects if (item.effect, item.joint) == (candidate.effect.name, joint))
        effects.append(
            {
                "effect": effect.effect,
                "joint": joint,
                "parameters": {name: quantity(name, item) for name, item in effect.parameters.items()},
                "ratio": _ratio(float(np.sum(left)), float(np.sum(removed))),
                "by_recording": {
                    item.name: _ratio(kept, gone)
                    for item, kept, gone, ok in zip(unseen, left.tolist(), removed.tolist(), filled, strict=True)
                    if ok
                },
            }
        )
    return {
        "training": [item.name for item in training],
        "validation": [item.name for item in validation],
        "unseen": [item.name for item in unseen],
        "verdict": diagnosis.verdict,
        "band_hz": found.bands[0],
        "summary": list(sentences(diagnosis)),
        "effects": effects,
        "tentative": [f"{item.effect} on {item.joint}" if item.joint else item.effect for item in diagnosis.tentative],
        "evidence": _evidence(diagnosis),
        "unseen_rms": {
            joint: [_pooled(part[:, j], rows[:, j]) for part in (base, whole)] for j, joint in enumerate(joints)
        },
    }


def _ratio(left: float, removed: float) -> float | None:
    """Return the root of what is left as a share of that and what was removed; None where more came than is left."""
    return float(np.sqrt(left / (left + removed))) if left + removed > 0.0 else None


def _number(ratio: float | None) -> str:
    return "worse" if ratio is None else f"{ratio:.3f}"


def _evidence(diagnosis: Diagnosis) -> dict[str, str]:
    return {item.joint: f"{'noise, ' if item.shown else 'not shown, '}{item.why}" for item in diagnosis.evidence}


def _pooled(rms: np.ndarray, rows: np.ndarray) -> float | None:
    """Return the rms over recordings of so many rows each."""
    total = float(np.sum(rows))
    return float(np.sqrt(np.nansum(rms**2 * rows) / total)) if total else None


def told(arm: str, both: list[dict[str, Any]]) -> str:
    """Return what holds as a table in Markdown."""
    named = [{(item["effect"], item["joint"]) for item in one["effects"]} for one in both]
    lines = [
        f"### {arm}",
        "",
        "| trained on | verdict | effect | parameters | ratio, unseen | below 0.97 in | other half |",
        "|---|---|---|---|---|---|---|",
    ]
    for place, one in enumerate(both):
        half = "second half" if place else "first half"
        if not one["effects"]:
            lines.append(f"| {half} | {one['verdict']} | none | | | | |")
        for item in one["effects"]:
            label = f"{item['effect']} on {item['joint']}" if item["joint"] else item["effect"]
            ratios = list(item["by_recording"].values())
            other = "found" if (item["effect"], item["joint"]) in named[1 - place] else "not found"
            if other == "not found" and label in both[1 - place]["tentative"]:
                other = "tentative"
            below = f"{sum(ratio is not None and ratio < HOLDS for ratio in ratios)} of {len(ratios)}"
            words = ", ".join(item["parameters"].values())
            lines.append(
                f"| {half} | {one['verdict']} | {label} | {words} | {_number(item['ratio'])} | {below} | {other} |"
            )
    lines += ["", "| joint | unseen error, first half | second half |", "|---|---|---|"]
    for joint in both[0]["unseen_rms"]:
        cells = [
            " to ".join("-" if value is None else f"{value:.3g}" for value in one["unseen_rms"][joint]) for one in both
        ]
        lines.append(f"| {joint} | {' | '.join(cells)} |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path, help="folder with a folder for each arm")
    parser.add_argument("--only", choices=ARMS, action="append", help="these arms; by default all")
    parser.add_argument("--model", default="basic")
    parser.add_argument("--output", type=Path, help="JSON of the figures")
    options = parser.parse_args()
    results = {}
    for name in options.only or ARMS:
        arm = options.data / name
        robot = load_robot(arm / "robot.yaml")
        one, other = halves(read_recordings([arm], robot))
        both = [direction(arm, options.model, training, others) for training, others in ((one, other), (other, one))]
        results[name] = both
        print(told(name, both), end="\n\n", flush=True)
    if options.output:
        options.output.parent.mkdir(parents=True, exist_ok=True)
        options.output.write_text(json.dumps(results, indent=2, allow_nan=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
