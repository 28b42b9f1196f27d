"""False alarms and smallest force of an observer on a virtual arm whose effort errs as that of a measured one.

A model of the measured arm is identified from two recordings; what an observer of 20 Hz makes of the others is what their effort
has and the model has not. This residual is added to the effort of a virtual arm of the same URDF: for each run of 20 s a stretch
of it, all joints together, from any place of a recording that is continued by its mirror image, with a sign and a size (log-normal,
by 0.2) drawn for each joint. Each measured recording counts in as large a share of the runs as it is long, with thresholds from
other motions with the residuals of all other recordings; runs a fifth apart in the list have the same recordings, as leaving out
fifths tells how sure the rate is. Residuals repeat, 0.12 h of them in hours of motion, so that Poisson's interval is too narrow:
the table has the one of two standard errors by leaving out each measured recording.

    python benchmarks/contact_residuals.py DATA/ur10e --fit ident_50s_12harm ident_50s_14harm_noload --seed 41
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from contact import APART, KINDS, PUSH_RATE, RATES, SECONDS, Try, alarms, drawn, looked_for, smallest, table
from numpy.typing import NDArray
from scipy.signal import lfilter
from virtual_motions import random_motion

from scara_ident import Recording, identify, load_robot, read_recordings, simulate, virtual_arm
from scara_ident.export.identified_model import identified_model
from scara_ident.simulation.arm import VirtualArm
from scara_ident.simulation.effects.contact import Push
from scara_ident.use.external_torque import FEATURES, Observed
from scara_ident.use.observer import ContactObserver, calibrated, contact_observer

Array = NDArray[np.float64]
# The residual's band, Hz; recorded samples per second, and periods of the controller in each.
BAND, RATE, TICKS = 20.0, 125.0, 2
SIZE = 0.2
FORCES = (2.0, 150.0)


def main() -> None:
    """Print and write what was counted."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("measured", type=Path, help="folder with robot.yaml and recordings")
    parser.add_argument("--fit", nargs="+", required=True, help="recordings of it to identify from")
    parser.add_argument("--recordings", type=int, default=370, help="without contact, of 20 s")
    parser.add_argument("--pushed", type=int, default=40, help="recordings with pushes, of four or five each")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--rates", type=float, nargs="+", default=RATES, help="stated per hour")
    parser.add_argument("--output", type=Path)
    given = parser.parse_args()
    found = counted(given.measured, given.fit, given.recordings, given.pushed, given.seed, given.rates)
    print("\n".join(table(found)))
    for row in found["false_alarms"]:
        print(
            f"at {row['stated']:g} an hour: {', '.join(f'{name} {count}' for name, count in row['by_recording'].items())}"
        )
    if given.output:
        given.output.parent.mkdir(parents=True, exist_ok=True)
        given.output.write_text(json.dumps(found, indent=1) + "\n")


def counted(
    folder: Path, fit: Sequence[str], count: int, pushed: int, seed: int, rates: Sequence[float]
) -> dict[str, Any]:
    """Count on the virtual arm of a measured one."""
    residuals = measured_residuals(folder, fit)
    names = list(residuals)
    arm = virtual_arm(load_robot(folder / "robot.yaml"))
    made = [record(arm, seed, k) for k in range(6 + count)]
    known = identified_model(identify(arm.robot, made[:6]))
    observer = contact_observer(known, made[6:], rate=PUSH_RATE)
    clean = [(item, observer.observe(item)) for item in made[6:]]
    compare(observer, *clean[0], drawn_stretch(list(residuals.values()), clean[0][0].time, np.random.default_rng(seed)))
    # Where each recording's share of the runs ends.
    order = np.random.default_rng([seed, 30_000]).permutation(count)
    ends = np.round(count * np.cumsum([np.ptp(time) for time, _ in residuals.values()]) / sum(np.ptp(time) for time, _ in residuals.values())).astype(int)  # fmt: skip
    rows: list[list[dict[str, Any]]] = []
    tries: list[Try] = []
    for which, name in enumerate(names):
        rng = np.random.default_rng([seed, 40_000, which])
        own = order[(ends[which - 1] if which else 0) : ends[which]]
        others = [residuals[each] for each in rng.permutation([each for each in names if each != name])]
        rest = [clean[k] for k in np.setdiff1d(order, own)[::2]]
        # Runs that have the same remainder by five have the same recordings.
        free = [
            disturbed(observer, *one, drawn_stretch(others[k % 5 :: 5], one[0].time, rng)) for k, one in enumerate(rest)
        ]
        quiet = [disturbed(observer, *clean[k], drawn_stretch([residuals[name]], clean[k][0].time, rng)) for k in own]
        rows.append([alarms(observer, rate, [(free, quiet)]) for rate in rates])
        told = calibrated(known, observer.settings, free, rate=PUSH_RATE, velocity=True)
        for k in range(which, pushed, len(names)):
            tries += push(told, arm, seed, k, residuals[name])
    return {"arm": f"virtual {arm.robot.name}, measured residuals", "false_alarms": [pooled(each, names) for each in zip(*rows, strict=True)], **smallest(tries)}  # fmt: skip


def pooled(rows: Sequence[dict[str, Any]], names: Sequence[str]) -> dict[str, Any]:
    """Return one row of those of all measured recordings at the same stated rate."""
    count, hours = (np.array([row[key] for row in rows]) for key in ("count", "hours"))
    seen, stated = float(np.sum(count) / np.sum(hours)), rows[0]["stated"]
    # Jackknife.
    each = (np.sum(count) - count) / (np.sum(hours) - hours)
    error = 2.0 * float(np.sqrt((len(rows) - 1) * np.var(each)))
    return {
        "stated": stated,
        "thresholds_from_hours": float(np.mean([row["thresholds_from_hours"] for row in rows])),
        "seen": seen,
        "interval": [max(0.0, seen - error), seen + error],
        "count": int(np.sum(count)),
        "hours": float(np.sum(hours)),
        "ratio": seen / stated,
        "by_recording": dict(zip(names, count.tolist(), strict=True)),
    }


def measured_residuals(folder: Path, fit: Sequence[str]) -> dict[str, tuple[Array, Array]]:
    """Return time and residual of the effort, shape (n, N), of all measured recordings that the model is not identified from."""
    robot = load_robot(folder / "robot.yaml")
    recordings = read_recordings([folder], robot)
    known = identified_model(identify(robot, [item for item in recordings if item.name in fit]))
    others = [item for item in recordings if item.name not in fit]
    wide = contact_observer(known, others, bandwidth=BAND)
    runs = [wide.observe(item) for item in others]
    # What acts from outside is minus what the effort has too much.
    return {run.name: (run.time[run.settled], -run.torque[:, run.settled]) for run in runs}


def drawn_stretch(residuals: Sequence[tuple[Array, Array]], time: Array, rng: np.random.Generator) -> Array:
    """Draw a stretch of the residuals for a run, shape (n, N), with signs and sizes of its own."""
    long = np.array([float(np.ptp(own)) for own, _ in residuals])
    own, residual = residuals[int(rng.choice(len(long), p=long / np.sum(long)))]
    own, span = own - own[0], float(np.ptp(own))
    # There and back again, so that it does not jump.
    at = np.mod(rng.uniform(0.0, 2.0 * span) + time - time[0], 2.0 * span)
    at = np.minimum(at, 2.0 * span - at)
    size = rng.choice([-1.0, 1.0], size=len(residual)) * np.exp(SIZE * rng.normal(size=len(residual)))
    return np.array([one * np.interp(at, own, row) for one, row in zip(size, residual, strict=True)])


def disturbed(observer: ContactObserver, item: Recording, run: Observed, extra: Array) -> Observed:
    """Return what an observer makes of a run with more effort; it is a first-order low-pass, compared with the whole of it."""
    share = -np.expm1(-2.0 * np.pi * observer.settings.bandwidth / RATE)
    between = 0.5 * (extra + np.roll(extra, 1, axis=1))
    between[:, 0] = 0.0
    torque = run.torque - lfilter([share], [1.0, share - 1.0], between, axis=1)
    assert item.effort is not None
    features, size = run.features.copy(), np.abs(item.effort + extra)
    features[:, FEATURES.index("effort")] = lfilter([share], [1.0, share - 1.0], size, axis=1, zi=(1.0 - share) * size[:, :1])[0]  # fmt: skip
    return replace(run, torque=torque, features=features)


def compare(observer: ContactObserver, item: Recording, run: Observed, extra: Array) -> None:
    """Fail where `disturbed` is not what the observer itself makes of it."""
    assert item.effort is not None
    whole, added = observer.observe(replace(item, effort=item.effort + extra)), disturbed(observer, item, run, extra)
    np.testing.assert_allclose(added.torque, whole.torque, atol=1e-9)
    np.testing.assert_allclose(added.features, whole.features, atol=1e-9)


def record(arm: VirtualArm, seed: int, k: int, pushes: Sequence[Push] = ()) -> Recording:
    """Record a random motion, with the velocity that the controller saw."""
    motion = random_motion(f"m{k}", arm, KINDS[k % len(KINDS)], SECONDS, np.random.default_rng([seed, k]))
    return simulate(arm, motion, effects=pushes, seed=1_000_000 * seed + k, rate=RATE, ticks=TICKS, record_velocity=True).recording  # fmt: skip


def push(observer: ContactObserver, arm: VirtualArm, seed: int, k: int, residual: tuple[Array, Array]) -> list[Try]:  # fmt: skip
    """Look for pushes in one run, with a residual that the thresholds are not from."""
    rng = np.random.default_rng([seed, 10_000 + k])
    pushes = [drawn(arm, rng, start, FORCES) for start in np.arange(2.0, SECONDS - 2.0, APART)]
    touched, without = (record(arm, seed, 20_000 + k, with_) for with_ in (pushes, ()))
    assert touched.effort is not None and without.effort is not None
    extra = drawn_stretch([residual], without.time, rng)
    runs = [observer.observe(replace(item, effort=item.effort + extra)) for item in (touched, without)]
    return looked_for(observer, runs[0], runs[1], pushes)


if __name__ == "__main__":
    main()
