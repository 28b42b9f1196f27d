"""A fleet from files to its table: how fast, and which slow faults are found when.

Run ``python benchmarks/fleet.py speed`` and ``python benchmarks/fleet.py faults [--seed N]``; with ``--folder DIR`` the
recordings are kept and used again.
"""

from __future__ import annotations

import argparse
import os
import platform
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from shutil import rmtree
from typing import Any

import numpy as np

from scara_ident.fleet import Fleet, Settings, watch_fleet
from scara_ident.fleet.changes import Change
from scara_ident.fleet.fleet import changes_of
from scara_ident.fleet.history import History
from scara_ident.fleet.table import Quantity
from scara_ident.paper import OJD
from scara_ident.recording.recording import Recording, write_recording
from scara_ident.robot.robot import load_robot
from scara_ident.simulation import Effect, parse_effect, sampled, simulate, virtual_arm
from scara_ident.simulation.runs import RunState

ARMS, DATES = 200, 4
# Simulated runs that the speed test's recordings are made of, each with torque noise of its own.
RUNS = 8
FLEET, MONTHS = 30, 12
# Standard deviations from date to date: friction and torque scale as shares, offset as a share of the noise, delay in s.
DAILY = (0.02, 0.005, 0.1, 0.0002)
# Spread of friction over the arms.
OWN_FRICTION = 0.1
SECONDS = 12.0
FIRST_LOOK = 3


@dataclass(frozen=True)
class SlowFault:
    """A fault that grows evenly from a date on to ``size`` on the last."""

    effect: str
    joint: str | None
    size: float
    start: int
    quantity: str

    def at(self, date: int) -> float:
        """Return its size on a date."""
        return self.size * max(0.0, date - self.start + 1) / (MONTHS - self.start)

    def effects(self, date: int) -> tuple[Effect, ...]:
        """Return it as the virtual arm has it; nothing for what differs by run."""
        texts = {
            "transmission_loss": "transmission_loss:{0}:loss_coefficient={1}",
            "base_tilt": "base_tilt:tilt_x={1},tilt_y=0",
            "torque_ripple": "torque_ripple:{0}:order=2,amplitude={1}",
        }
        size = self.at(date)
        if self.effect not in texts or size == 0.0:
            return ()
        return (parse_effect(texts[self.effect].format(self.joint, size)),)


FAULTS = {
    2: SlowFault("friction", "joint1", 0.25, 3, "friction of joint1"),
    5: SlowFault("friction", "joint2", 0.25, 4, "friction of joint2"),
    9: SlowFault("transmission_loss", "joint1", 0.06, 3, "loss_coefficient: transmission_loss of joint1"),
    12: SlowFault("transmission_loss", "joint2", 0.12, 5, "loss_coefficient: transmission_loss of joint2"),
    15: SlowFault("base_tilt", None, 0.008, 4, "tilt_x: base_tilt of the arm"),
    19: SlowFault("torque_scale", "joint1", 0.06, 3, "torque scale of joint1"),
    23: SlowFault("torque_ripple", "joint1", 0.025, 4, "amplitude: torque_ripple of joint1 (2)"),
    27: SlowFault("torque_scale", "joint2", 0.06, 5, "torque scale of joint2"),
}


def date_name(month: int) -> str:
    return f"2025-{month + 1:02d}-01"


def run_of_fleet(place: tuple[int, int, int]) -> tuple[int, int, Recording]:
    """Simulate one arm on one date."""
    seed, arm_number, month = place
    arm = virtual_arm()
    own = np.random.default_rng([seed, arm_number])
    arm = replace(arm, friction=arm.friction * (1.0 + OWN_FRICTION * own.standard_normal((2, 1))))
    daily = np.random.default_rng([seed, arm_number, month])
    friction, scale = 1.0 + np.array(DAILY[:2])[:, None] * daily.standard_normal((2, 2))
    offset = DAILY[2] * arm.torque_noise * daily.standard_normal(2)
    fault = FAULTS.get(arm_number)
    effects: tuple[Effect, ...] = ()
    if fault is not None:
        joint = None if fault.joint is None else arm.robot.joints.index(fault.joint)
        if fault.effect == "friction":
            friction[joint] *= 1.0 + fault.at(month)
        elif fault.effect == "torque_scale":
            # A falling torque constant: the same torque takes more current, which is what is recorded.
            scale[joint] *= 1.0 + fault.at(month)
        effects = fault.effects(month)
    state = RunState(friction, scale, offset, float(DAILY[3] * daily.standard_normal()))
    motion = sampled("OJD", arm.robot, OJD.motion, SECONDS)
    noise = 1000 * arm_number + month + 10**6 * seed
    result = simulate(arm, motion, effects=effects, seed=noise, run=state)
    return arm_number, month, result.recording


def make_faulty_fleet(folder: Path, seed: int) -> None:
    places = [(seed, arm, month) for arm in range(FLEET) for month in range(MONTHS)]
    missing = [place for place in places if not _file(folder, place[1], place[2]).is_file()]
    with ProcessPoolExecutor(2) as pool:
        for arm, month, recording in pool.map(run_of_fleet, missing, chunksize=4):
            path = _file(folder, arm, month)
            path.parent.mkdir(parents=True, exist_ok=True)
            write_recording(recording, path)


def _file(folder: Path, arm: int, month: int) -> Path:
    return folder / f"arm{arm:03d}" / date_name(month) / "OJD_1.parquet"


def with_dates(history: History, count: int) -> History:
    """Return the history as it was after so many dates."""
    return replace(history, dates=history.dates[:count], visits=history.visits[:count])


def found_when(fleet: Fleet) -> Iterator[tuple[int, dict[str, tuple[Change, ...]]]]:
    """Give the changes that each look found, as dates came in."""
    histories = [item.known for item in fleet.arms if item.history is not None]
    for count in range(FIRST_LOOK, MONTHS + 1):
        yield count, changes_of([with_dates(item, count) for item in histories])


def faults(folder: Path, seed: int) -> None:
    make_faulty_fleet(folder / f"faulty{seed}", seed)
    output = folder / f"results{seed}"
    fleet = watch_fleet(str(folder / f"faulty{seed}"), load_robot(), output, Settings(workers=2, diagnosed=False))
    looks = list(found_when(fleet))
    healthy = {f"arm{arm:03d}" for arm in range(FLEET)} - {f"arm{arm:03d}" for arm in FAULTS}
    wrong = {(count, arm) for count, found in looks for arm in healthy if found[arm]}
    print(f"seed {seed}: {FLEET} arms, {MONTHS} dates, one run of {SECONDS:g} s a date; runs differ by {DAILY}")
    print(f"{'arm':8}{'fault':28}{'began':>6}{'4 std':>7}{'named':>7}{'right':>7}  last report")
    missed = 0
    for arm, fault in FAULTS.items():
        name = f"arm{arm:03d}"
        due = first_at(fleet.quantities[name], fault, 4.0)
        named = next((count for count, found in looks if found[name]), None)
        right = next((count for count, found in looks if is_right(found[name], fault)), None)
        missed += right is None or (due is not None and right > due)
        said = next(item for item in fleet.arms if item.arm == name).sentences
        title = f"{fault.effect} {fault.joint or ''}"
        print(
            f"{name:8}{title:28}{fault.start + 1:6}{due or '-':>7}{named or '-':>7}{right or '-':>7}  {' | '.join(said)}"
        )
    print(
        f"late or missed: {missed} of {len(FAULTS)}; healthy arms named in any of {len(looks)} looks: {sorted(wrong)}"
    )


def is_right(changes: tuple[Change, ...], fault: SlowFault) -> bool:
    first = changes[0].cause if changes else None
    return first is not None and first.effect == fault.effect and first.joint == fault.joint


def first_at(dates: Sequence[Sequence[Quantity]], fault: SlowFault, stds: float) -> int | None:
    """Return after how many dates the true change is so many standard deviations of its quantity's change.

    That is of the difference between this date and the mean of those before the fault began; the standard deviation of one
    date is the table's, which holds what differs from date to date.
    """
    for month, each in enumerate(dates):
        std = next((item.std for item in each if item.name == fault.quantity), np.inf)
        if abs(fault.at(month)) >= stds * std * np.sqrt(1.0 + 1.0 / fault.start):
            return month + 1
    return None


def make_large_fleet(folder: Path, arms: int) -> int:
    """Write the recordings of the speed test; each is a simulated run of 25 s with torque noise of its own."""
    if folder.is_dir():
        return len(list(folder.rglob("*.parquet")))
    arm = virtual_arm()
    motion = sampled("OJD", arm.robot, OJD.motion, 25.0)
    runs = [simulate(arm, motion, seed=seed).recording for seed in range(RUNS)]
    random = np.random.default_rng(0)
    for number in range(arms):
        for month in range(DATES):
            run = runs[(number + month) % RUNS]
            noise = 0.3 * arm.torque_noise[:, None] * random.standard_normal(run.position.shape)
            path = _file(folder, number, month)
            path.parent.mkdir(parents=True)
            write_recording(replace(run, effort=run.effort + noise), path)
    return arms * DATES


def measured_speed(folder: Path, arms: int, rounds: int) -> dict[str, Any]:
    """Return recordings a second from files to the table with one and two workers, in turn."""
    count = make_large_fleet(folder / f"large{arms}", arms)
    seconds: dict[int, list[float]] = {1: [], 2: []}
    changed = 0
    for _ in range(rounds):
        for workers, times in seconds.items():
            output = folder / f"out{workers}"
            rmtree(output, ignore_errors=True)
            start = time.perf_counter()
            fleet = watch_fleet(str(folder / f"large{arms}"), load_robot(), output, Settings(workers=workers))
            times.append(time.perf_counter() - start)
            changed = sum(bool(item.changes) for item in fleet.arms)
            told = f"{workers} workers: {times[-1]:.1f} s, {count / times[-1]:.1f} recordings/s, {changed} changed"
            print(f"{told}, load {os.getloadavg()[0]:.1f}", file=sys.stderr, flush=True)
    one, two = (float(np.median(times)) for times in seconds.values())
    rates = {"one": count / one, "two": count / two, "ratio": one / two}
    return {"arms": arms, "recordings": count, "changed": changed} | rates


def speed(folder: Path, arms: int, rounds: int) -> None:
    print(f"{platform.processor() or platform.machine()}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
    found = measured_speed(folder, arms, rounds)
    print(
        f"medians of {found['recordings']} recordings: one {found['one']:.1f}, two {found['two']:.1f} a second; ",
        end="",
    )
    print(f"ratio {found['ratio']:.2f}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=("speed", "faults"))
    parser.add_argument("--folder", type=Path, help="where recordings are kept")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--arms", type=int, default=ARMS)
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.folder or Path(temporary)
        if options.what == "speed":
            speed(folder, options.arms, options.rounds)
        else:
            faults(folder, options.seed)


if __name__ == "__main__":
    main()
