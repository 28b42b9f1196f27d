"""Pushes found, and how often noise or a missing effect is called one: `find_events` on made recordings of a random arm.

Sets of 3 to 6 recordings of 15 to 25 s on random motions (see `virtual_motions`), a third of the sets with repetitions. The
torque is that of the rigid arm with friction; noise of 0.5 to 5 % of each joint's torque is white, coloured or heavy-tailed
(Student's t, 3 degrees of freedom); runs differ in half of the sets; in half of them the arm has an effect that the model
lacks. A push is a force on the tool of 5 to 30 N for 0.3 to 2 s in one of the recordings; what it adds to the torque along
the motion is exact for a stiff position controller. Its size is the largest rms on any joint, over that joint's noise: the rms
that the model leaves of the same recordings without the push, as recorded, which has runs that differ and what is missing in it.

    python benchmarks/events.py --robot ur5 --recordings 100 --seed 1           # pushes
    python benchmarks/events.py --robot scara03 --recordings 30 --seed 1 --named 10   # is an effect named for one?
    python benchmarks/events.py --robot ur5 --recordings 1800 --seed 2 --quiet   # 10 h without one
    python benchmarks/events.py --robot ur5 --recordings 1800 --seed 2 --quiet --troubled

With `--troubled` an arm has one of `TROUBLES` besides: a coarse encoder, friction that falls while it warms up over all
recordings, or a torque that vibrates in bursts.
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
from scipy.signal import lfilter, welch
from scipy.stats import chi2, norm
from virtual_conditions import Noise
from virtual_motions import KINDS, random_motion

from scara_ident.diagnosis.diagnose import diagnose
from scara_ident.errors import ScaraIdentError
from scara_ident.estimation.least_squares import weighted_value
from scara_ident.estimation.observations import Observations, observe
from scara_ident.estimation.robust import robust_fit
from scara_ident.identification.binned_residual import MIN_SPEED_SHARE
from scara_ident.identification.event_search import FALSE_EVERY
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
TROUBLES = ("encoder", "warm-up", "vibration")
# Steps of a coarse encoder in a turn of the joint, as powers of 2; by what share friction is larger when cold, and how long that
# lasts, s; frequency of vibrations, Hz, their size over the noise, and how long a burst is, s.
COARSE = (11, 15)
COLD, WARMING = (0.1, 0.4), (10.0, 100.0)
SHAKING, SHAKEN, BURST = (5.0, 40.0), (0.5, 3.0), 0.5
MISSING = ("none", "none", "none", "none", "none", "stribeck", "loss", "ripple", "spring", "all")
FORCE, LASTING = (5.0, 30.0), (0.3, 2.0)
# Rise and fall of a push, s.
RAMP = 0.03
# Found: it overlaps. Timely: both ends within this, s.
TIMELY = 0.1
CLEAR = 3.0
# Length of the pieces that a spectrum is the mean of, s.
PIECE = 2.0


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
    sigma: Array
    keep: float
    trouble: str


def made_set(robot: Robot, arm: VirtualArm, seed: list[int], pushed: bool, troubled: bool) -> Set:
    """Draw recordings, and a push in one of them."""
    # Apart from the rest, which is then the same without trouble.
    rng, own = np.random.default_rng(seed), np.random.default_rng([*seed, 1])
    trouble = str(own.choice(TROUBLES)) if troubled else "none"
    cold, warming, shaken = own.uniform(*COLD), own.uniform(*WARMING), own.uniform(*SHAKEN)
    omega = 2.0 * np.pi * own.uniform(*SHAKING)
    count, rate = int(rng.integers(3, 7)), float(rng.choice(RATES))
    missing, kind = str(rng.choice(MISSING)), NOISES[int(rng.choice(len(NOISES)))]
    differ, repeated = bool(rng.random() < 0.5), bool(rng.random() < 0.33)
    level = float(np.exp(rng.uniform(np.log(0.005), np.log(0.05))))
    noise = TorqueNoise(kind, float(np.exp(rng.uniform(np.log(0.005), np.log(0.1)))))
    bits = int(rng.integers(16, 22))
    bits = int(own.integers(*COARSE)) if trouble == "encoder" else bits
    scale = np.abs(robot.row_scale)[:, None]
    place = int(rng.integers(count))
    motions = [
        random_motion(f"m{k}", arm, KINDS[int(rng.integers(len(KINDS)))], float(rng.uniform(15.0, 25.0)), rng)
        for k in range((count + 1) // 2 if repeated else count)
    ]
    recordings, push, added = [], None, None
    reference, began = None, 0.0
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
        if trouble == "warm-up":
            a0, a1, a2, a3 = (run.friction[:, i, None] for i in range(4))
            friction = a0 * np.sign(v) + a1 * v + a2 * np.sign(v) * v**2 + a3 * v**3
            torque = torque + cold * np.exp(-(began + at) / warming) * friction
        if trouble == "vibration":
            bursts = TorqueNoise("coloured", BURST).draw(own, (robot.n, len(at)), rate)
            torque = torque + shaken * sigma[:, None] * np.abs(bursts) * np.sin(omega * at)
        began += at[-1]
        step = 2.0 * np.pi / 2**bits
        seen = np.round(q / step) * step
        recordings.append(Recording(f"r{k}", f"r{k}", 1, robot.joints, at, seen, torque))
    keep = float(np.exp(-1.0 / (rate * noise.correlation_time))) if kind == "coloured" else 0.0
    return Set(recordings, added, push, missing, kind, differ, sigma, keep, trouble)


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


@dataclass(frozen=True)
class Possible:
    """What can be known of a push.

    Attributes
    ----------
    size : float
        How large it is, over what the model leaves without it.
    power : tuple of float
        Of the best tests: that of the noise's law, and that of the spectrum of what the model leaves.
    timely : tuple of float
        With what probability both ends are within `TIMELY` if their errors are no smaller than Cramer and Rao's bound, of each.
    hidden : bool
        Whether all joints are slow where it begins or where it ends.
    """

    size: float
    power: tuple[float, float]
    timely: tuple[float, float]
    hidden: bool


def possible(robot: Robot, made: Set) -> Possible:
    """Return what can be known of a push."""
    assert made.push is not None and made.added is not None
    push, added = made.push, made.added
    plain = [
        replace(item, effort=item.effort - added) if item.name == push.recording else item for item in made.recordings
    ]
    observations = observed(robot, plain)
    value = weighted_value(observations.by_joint)
    (run,) = (item for item in made.recordings if item.name == push.recording)
    place = next(k for k, item in enumerate(observations.data.recordings) if item.name == push.recording)
    parts = [k for k, item in enumerate(observations.data.recordings) for _ in item.stretches]
    stretches = zip(parts, observations.data.stretches, observations.predicted(value), strict=True)
    part, left = max(
        ((part, part.torque - predicted) for k, part, predicted in stretches if k == place),
        key=lambda item: item[1].shape[1],
    )
    speed = np.abs(part.motion.v)
    slow = np.all(speed < MIN_SPEED_SHARE * np.max(speed, axis=1, keepdims=True), axis=0)
    ends = np.searchsorted(part.stretch.time - run.time[0], (push.start, push.stop))
    hidden = bool(np.any(slow[np.minimum(ends, len(slow) - 1)]))
    inside = (run.time >= push.start) & (run.time <= push.stop)
    size = float(np.max(np.sqrt(np.mean(added[:, inside] ** 2, axis=1)) / observations.unfiltered_rms(value)))
    rate = 1.0 / float(np.median(np.diff(run.time)))
    # One false event an interval as long as push and event, which overlap.
    level = norm.isf(2.0 * (push.stop - push.start) / FALSE_EVERY)
    slope = np.gradient(added, axis=1) * rate
    middle = 0.5 * (push.start + push.stop)
    ramps = [np.where(chosen, slope, 0.0) for chosen in (run.time < middle, run.time >= middle)]
    power, timely = [], []
    for deflection in (lambda signal: by_law(made, signal), lambda signal: by_spectrum(left, signal, rate)):
        power.append(float(norm.cdf(deflection(added) - level)))
        timely.append(float(np.prod([1.0 - 2.0 * norm.sf(TIMELY * deflection(ramp)) for ramp in ramps])))
    return Possible(size, (power[0], power[1]), (timely[0], timely[1]), hidden)


def by_law(made: Set, signal: Array) -> float:
    """Return the deflection of the matched filter for a signal (n, N) in the noise alone, as normal."""
    whitened = lfilter([1.0, -made.keep], [1.0], signal, axis=1) / np.sqrt(1.0 - made.keep**2)
    return float(np.sqrt(np.sum((whitened / made.sigma[:, None]) ** 2)))


def by_spectrum(left: Array, signal: Array, rate: float) -> float:
    """Return the deflection of the matched filter for a signal (n, N) in stationary noise with the spectrum of a residual."""
    count = signal.shape[1]
    at, density = welch(left, rate, nperseg=min(round(PIECE * rate), left.shape[1]), detrend=False, axis=1)
    frequency, power = np.fft.rfftfreq(count, 1.0 / rate), np.abs(np.fft.rfft(signal, axis=1)) ** 2
    noise = np.array([np.interp(frequency, at, row) for row in density])
    return float(np.sqrt(4.0 / (rate * count) * np.sum(power / noise)))


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
    parser.add_argument("--troubled", action="store_true", help="each arm has one of the troubles")
    parser.add_argument(
        "--named", type=int, default=0, help="so many sets, complete but for a clear push, are diagnosed"
    )
    parser.add_argument("--minutes", type=float, default=np.inf, help="no further set after so long")
    parser.add_argument("--verbose", action="store_true")
    given = parser.parse_args()
    assert set(get_args(TorqueNoise.__annotations__["kind"]) or ("white", "coloured", "heavy"))
    robot = load_robot(None if given.robot == "scara03" else given.robot)
    arm = virtual_arm(robot)
    seconds: Counter[str] = Counter()
    done, k = 0, 0
    cost: list[float] = []
    false: Counter[str] = Counter()
    rows: list[dict[str, Any]] = []
    named: list[str] = []
    until = time.monotonic() + 60.0 * given.minutes
    while done < given.recordings and time.monotonic() < until:
        made = made_set(robot, arm, [given.seed, k], not given.quiet, given.troubled)
        k += 1
        done += len(made.recordings) if given.quiet else 1
        conditions = (
            f"missing: {made.missing}",
            made.noise,
            f"trouble: {made.trouble}",
            "runs differ" if made.differ else "alike",
        )
        lasting = sum(item.time[-1] for item in made.recordings)
        seconds.update(dict.fromkeys(("in all", *conditions), lasting))
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
                false.update(("in all", *conditions))
                print(f"false, set {k} ({', '.join(conditions)}): {event}", flush=True)
        if made.push is not None:
            push = made.push
            ends = (min(e.start for e in own) - push.start, max(e.stop for e in own) - push.stop) if own else None
            can = possible(robot, made)
            size = can.size
            rows.append(
                {
                    "size": size,
                    "power": can.power,
                    "timely": can.timely,
                    "hidden": can.hidden,
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
            if size > CLEAR and made.missing == "none" and len(named) < given.named:
                named.append(", ".join(item.label for item in diagnose(robot, made.recordings).effects))
            if given.verbose or (size > CLEAR and (ends is None or max(map(abs, ends)) > TIMELY)):
                print(f"set {k}: {push} {rows[-1]}", flush=True)
    print(f"{k} sets; {np.median(cost):.3f} s a set to look (median); false events, by what is there:")
    for what, lasting in sorted(seconds.items()):
        count, hours = false[what], lasting / 3600.0
        least, most = (10.0 / hours * chi2.ppf((0.025, 0.975), (2.0 * count, 2.0 * count + 2.0)) / 2.0).tolist()
        print(
            f"  {what}: {count} in {hours:.2f} h, {10.0 * count / hours:.2f} in 10 h (95 %: {np.nan_to_num(least):.2f} to {most:.2f})"
        )
    if named:
        print(
            f"sets that lack nothing, with a push: {len(named)}; an effect named in {sum(map(bool, named))}: {set(filter(bool, named))}"
        )
    clear = [row for row in rows if row["size"] > CLEAR]
    if clear:
        got = [row for row in clear if row["found"]]
        timely = [row for row in got if max(map(abs, row["ends"])) <= TIMELY]
        contact = [row for row in got if "contact" in row["kinds"]]
        print(f"pushes above {CLEAR:g} times the noise: {len(clear)} of {len(rows)}; found {len(got)} ({len(got) / len(clear):.0%}), "
              f"both ends within {TIMELY:g} s {len(timely)}, called contact {len(contact)}")  # fmt: skip
        for k, known in enumerate(("the noise", "the spectrum of what the model leaves")):
            could = [sum(row[name][k] for row in clear) for name in ("power", "timely")]
            least = min(row["power"][k] for row in clear)
            print(f"  the best test that knows push and {known} finds {could[0]:.1f} (the least likely with {least:.0%}), "
                  f"both ends within {TIMELY:g} s of {could[1]:.1f}")  # fmt: skip
        seen = [row for row in got if not row["hidden"]]
        print(
            f"  no end hidden by friction: {len(seen)}, both ends within {TIMELY:g} s {sum(row in timely for row in seen)}"
        )
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
