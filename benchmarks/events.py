"""Pushes found, and how often noise or a missing effect is called one: `find_events` on made recordings of a random arm.

Sets of 3 to 6 recordings of 15 to 25 s on random motions (see `virtual_motions`), a third of the sets with repetitions. The
torque is that of the rigid arm with friction; noise of 0.5 to 5 % of each joint's torque is white, coloured or heavy-tailed
(Student's t, 3 degrees of freedom); runs differ in half of the sets; in half of them the arm has an effect that the model
lacks. A push is a force on the tool of 5 to 30 N for 0.3 to 2 s in one of the recordings; what it adds to the torque along
the motion is exact for a stiff position controller. Its size is the largest rms on any joint, over that joint's noise: the rms
that the model leaves of the same recordings without the push, as recorded, which has runs that differ and what is missing in it.

    python benchmarks/events.py --robot ur5 --recordings 100 --seed 1           # pushes
    python benchmarks/events.py --robot ur5 --recordings 1800 --seed 2 --quiet   # 10 h without one
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from dataclasses import dataclass, replace
from typing import Any, get_args

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from virtual_conditions import Noise
from virtual_motions import KINDS, random_motion

from scara_ident.errors import ScaraIdentError
from scara_ident.estimation.least_squares import weighted_value
from scara_ident.estimation.observations import Observations, observe
from scara_ident.estimation.robust import robust_fit
from scara_ident.identification.events import Event, find_events
from scara_ident.identification.usable import usable_in_bands
from scara_ident.model.model import build_model
from scara_ident.recording.recording import Recording
from scara_ident.robot.kinematics import tool_frame
from scara_ident.robot.robot import Robot, load_robot
from scara_ident.simulation import TorqueNoise, VirtualArm, virtual_arm
from scara_ident.simulation.inverse_dynamics import inverse_dynamics
from scara_ident.simulation.spatial import configuration

Array = NDArray[np.float64]
RATES = (125.0, 250.0)
NOISES: tuple[Noise, ...] = get_args(Noise)
MISSING = ("none", "none", "none", "none", "none", "stribeck", "loss", "ripple", "spring", "all")
FORCE, LASTING = (5.0, 30.0), (0.3, 2.0)
# Rise and fall of a push, s.
RAMP = 0.03
# Found: it overlaps. Timely: both ends within this, s.
TIMELY = 0.1
CLEAR = 3.0


@dataclass(frozen=True)
class Push:
    """What was done to the arm."""

    recording: str
    start: float
    stop: float


@dataclass(frozen=True)
class Set:
    """Recordings with what is true of them."""

    recordings: list[Recording]
    added: Array | None
    push: Push | None
    missing: str
    noise: str
    differ: bool


def made_set(robot: Robot, arm: VirtualArm, rng: np.random.Generator, pushed: bool) -> Set:
    """Draw recordings, and a push in one of them."""
    count, rate = int(rng.integers(3, 7)), float(rng.choice(RATES))
    missing, kind = str(rng.choice(MISSING)), NOISES[int(rng.choice(len(NOISES)))]
    differ, repeated = bool(rng.random() < 0.5), bool(rng.random() < 0.33)
    level = float(np.exp(rng.uniform(np.log(0.005), np.log(0.05))))
    noise = TorqueNoise(kind, float(np.exp(rng.uniform(np.log(0.005), np.log(0.1)))))
    bits = int(rng.integers(16, 22))
    scale = np.abs(robot.row_scale)[:, None]
    place = int(rng.integers(count))
    motions = [
        random_motion(f"m{k}", arm, KINDS[int(rng.integers(len(KINDS)))], float(rng.uniform(15.0, 25.0)), rng)
        for k in range((count + 1) // 2 if repeated else count)
    ]
    recordings, push, added = [], None, None
    reference = None
    for k in range(count):
        motion = motions[k // 2 if repeated else k]
        at = np.arange(0.0, motion.time[-1], 1.0 / rate)
        q, v, a = (
            np.array([np.interp(at, motion.time, row) for row in rows])
            for rows in (motion.position, motion.velocity, motion.acceleration)
        )
        run = arm
        if differ:
            run = replace(
                arm,
                friction=arm.friction * (1.0 + 0.05 * rng.standard_normal((robot.n, 1))),
                torque_offset=0.02 * arm.torque_scale * rng.standard_normal(robot.n),
            )
        torque = robot.row_scale[:, None] * inverse_dynamics(run, arm.bodies, q, v, a)
        torque = torque + lacking(missing, arm, q, v, torque)
        if reference is None:
            reference = np.sqrt(np.mean(torque**2, axis=1))
        sigma = level * reference
        if pushed and k == place:
            force = rng.normal(size=3)
            force *= rng.uniform(*FORCE) / np.linalg.norm(force)
            length = rng.uniform(*LASTING)
            start = rng.uniform(1.5, at[-1] - 1.5 - length)
            more = scale * pushed_torque(robot, at, q, force, start, start + length)
            torque, added = torque + more, more
            push = Push(f"r{k}", start, start + length)
        torque = torque + sigma[:, None] * noise.draw(rng, (robot.n, len(at)), rate)
        step = 2.0 * np.pi / 2**bits
        seen = np.round(q / step) * step
        recordings.append(Recording(f"r{k}", f"r{k}", 1, robot.joints, at, seen, torque))
    return Set(recordings, added, push, missing, kind, differ)


def lacking(missing: str, arm: VirtualArm, q: Array, v: Array, torque: Array) -> Array:
    """Return the torque of what the model lacks, on the recorded side."""
    found = np.zeros_like(q)
    coulomb = arm.friction[:, :1]
    if missing in ("stribeck", "all"):
        found += 0.4 * coulomb * np.sign(v) * np.exp(-np.abs(v) / 0.08)
    if missing in ("loss", "all"):
        found += 0.08 * np.abs(torque) * np.sign(v)
    if missing in ("ripple", "all"):
        found += 0.15 * coulomb * np.sin(50.0 * q)
    if missing in ("spring", "all"):
        found[0] += 0.2 * coulomb[0] * q[0]
    return found


def pushed_torque(robot: Robot, at: Array, q: Array, force: Array, start: float, stop: float) -> Array:
    """Return what a force on the tool, base frame, takes from the torque of the drives at the joints, shape (n, N)."""
    frame = robot.model.getFrameId(tool_frame(robot).name, pin.FrameType.BODY)
    data, back = robot.model.createData(), np.argsort(robot.order)
    found = np.zeros_like(q)
    for k in np.flatnonzero((at >= start) & (at <= stop)):
        full = configuration(robot.model, q[back, k])
        jacobian = pin.computeFrameJacobian(robot.model, data, full, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        rise = np.clip(min(at[k] - start, stop - at[k]) / RAMP, 0.0, 1.0)
        found[:, k] = -rise * (jacobian[:3].T @ force)[robot.order]
    return found


def observed(robot: Robot, recordings: list[Recording]) -> Observations:
    """Return the rows of the usual model."""
    model = build_model(robot, "complete")
    return observe(model, usable_in_bands(model, recordings)[0])


def size_of(robot: Robot, made: Set) -> float:
    """Return how large a push is, over what the model leaves without it."""
    assert made.push is not None and made.added is not None
    plain = [
        replace(item, effort=item.effort - made.added) if item.name == made.push.recording else item
        for item in made.recordings
    ]
    observations = observed(robot, plain)
    left = observations.unfiltered_rms(weighted_value(observations.by_joint))
    (run,) = (item for item in made.recordings if item.name == made.push.recording)
    inside = (run.time >= made.push.start) & (run.time <= made.push.stop)
    return float(np.max(np.sqrt(np.mean(made.added[:, inside] ** 2, axis=1)) / left))


def matches(event: Event, push: Push) -> bool:
    """Whether an event is of the push."""
    return event.recording == push.recording and min(event.stop, push.stop) > max(event.start, push.start)


def _held(own: list[Event], push: Push) -> tuple[bool, bool] | None:
    """Whether what is stated of the ends holds them; None where nothing is stated."""
    first, last = min(own, key=lambda e: e.start, default=None), max(own, key=lambda e: e.stop, default=None)
    if first is None or last is None or first.begins is None or last.ends is None:
        return None
    return first.begins[0] <= push.start <= first.begins[1], last.ends[0] <= push.stop <= last.ends[1]


def main() -> None:
    """Print how many pushes are found, when, and what is called an event and is none."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robot", choices=("ur5", "scara03", "panda"), default="ur5")
    parser.add_argument("--recordings", type=int, default=100, help="with a push each; without, in all")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--quiet", action="store_true", help="no pushes: false events an hour")
    parser.add_argument("--minutes", type=float, default=np.inf, help="no further set after so long")
    parser.add_argument("--verbose", action="store_true")
    given = parser.parse_args()
    assert set(get_args(TorqueNoise.__annotations__["kind"]) or ("white", "coloured", "heavy"))
    robot = load_robot(None if given.robot == "scara03" else given.robot)
    arm = virtual_arm(robot)
    seconds, done, k = 0.0, 0, 0
    cost: list[float] = []
    false: Counter[str] = Counter()
    rows: list[dict[str, Any]] = []
    until = time.monotonic() + 60.0 * given.minutes
    while done < given.recordings and time.monotonic() < until:
        made = made_set(robot, arm, np.random.default_rng([given.seed, k]), not given.quiet)
        k += 1
        done += len(made.recordings) if given.quiet else 1
        seconds += sum(item.time[-1] for item in made.recordings)
        try:
            observations = observed(robot, made.recordings)
            begin = time.perf_counter()
            found = find_events(observations, robust_fit(observations).value)
            cost.append(time.perf_counter() - begin)
        except ScaraIdentError as error:
            print(f"set {k}: {error}")
            continue
        own = [event for event in found if made.push and matches(event, made.push)]
        for event in found:
            if event not in own:
                false[made.missing] += 1
                print(f"false, set {k} ({made.missing}, {made.noise}, runs differ: {made.differ}): {event}", flush=True)
        if made.push is not None:
            push = made.push
            ends = (min(e.start for e in own) - push.start, max(e.stop for e in own) - push.stop) if own else None
            size = size_of(robot, made)
            rows.append(
                {
                    "size": size,
                    "found": bool(own),
                    "ends": ends,
                    "held": _held(own, push),
                    "unsure": [item[1] - item[0] for event in own for item in (event.begins, event.ends) if item],
                    "noise": made.noise,
                    "missing": made.missing,
                    "differ": made.differ,
                }
            )
            rows[-1] |= {
                "kinds": {event.kind for event in own},
                "score": max((event.score for event in own), default=0.0),
            }
            if given.verbose or (size > CLEAR and (ends is None or max(map(abs, ends)) > TIMELY)):
                print(f"set {k}: {push} {rows[-1]}", flush=True)
    print(f"{k} sets, {seconds / 3600.0:.2f} h; {np.median(cost):.3f} s a set to look (median)")
    print(
        f"false events: {sum(false.values())}, {sum(false.values()) / seconds * 36000.0:.2f} in 10 h; by effect missing: {dict(false)}"
    )
    clear = [row for row in rows if row["size"] > CLEAR]
    if clear:
        got = [row for row in clear if row["found"]]
        timely = [row for row in got if max(map(abs, row["ends"])) <= TIMELY]
        contact = [row for row in got if "contact" in row["kinds"]]
        print(f"pushes above {CLEAR:g} times the noise: {len(clear)} of {len(rows)}; found {len(got)} ({len(got) / len(clear):.0%}), "
              f"both ends within {TIMELY:g} s {len(timely)}, called contact {len(contact)}")  # fmt: skip
        stated = [held for row in got if row["held"] for held in row["held"]]
        widths = np.quantile([width for row in got for width in row["unsure"]] or [np.nan], (0.5, 0.95))
        print(f"  ends within what is stated of them: {sum(stated)} of {len(stated)}, which is {widths[0]:.2f} s wide (95 %: {widths[1]:.2f} s)")  # fmt: skip
        late = [row for row in got if row not in timely]
        print(f"  both of those late: {sum(all(row['held'] or (False,)) for row in late)} of {len(late)}")
        for kind in ("white", "coloured", "heavy"):
            part = [row for row in clear if row["noise"] == kind]
            print(f"  {kind}: {sum(row['found'] for row in part)} of {len(part)}")
        low = [row for row in rows if row["size"] <= CLEAR]
        scores = np.quantile([row["score"] for row in clear], (0.0, 0.02, 0.05, 0.1, 0.25, 0.5))
        print(f"  by how much they stand out, least, 2, 5, 10, 25 and 50 %: {', '.join(f'{x:.1f}' for x in scores)}")
        print(f"  below: {sum(row['found'] for row in low)} of {len(low)}")


if __name__ == "__main__":
    main()
