"""How often an observer calls contact where there is none, beside what it states, and how small a force it finds.

On virtual arms: six recordings are identified from. The others are without contact, two hours in all: one half gives thresholds
and the other counts false alarms, then the halves change places; and again with thresholds from ten minutes each, which is
what a user may have, counted in the ten minutes after. Pushes on the tool, in the closed loop, of random directions that the
arm can feel and of random size, are then looked for at thresholds from all of them; found is what begins during a push and is
not in the same run without. The force that a contact states is compared with the push. On measured recordings: two are identified from; each of the others counts with thresholds from
the rest, and pushes ``-J^T f`` are added to its effort. The interval is Poisson's exact one of 95 %; the force found in 90 %
of pushes is by logistic regression on its logarithm. The table says of each rate whether it was within 1.5 of the stated:
``yes`` and ``no`` where the whole interval is, ``seen`` and ``open`` where only what was counted is, or is not.

    python benchmarks/contact.py --robot ur5 --seed 11 --output benchmarks/results/contact_ur5.json
    python benchmarks/contact.py --robot ur5 --effects transmission_loss:elbow_joint:loss_coefficient=0.1
    python benchmarks/contact.py --measured DATA/ur10e --fit ident_50s_12harm ident_50s_14harm_noload --rates 300 500
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.stats import chi2
from virtual_motions import KINDS, random_motion

from scara_ident import Recording, diagnose, identify, load_robot, read_recordings, simulate, virtual_arm
from scara_ident.effects.catalogue import effects_named
from scara_ident.export.identified_model import IdentifiedModel, identified_model
from scara_ident.robot.kinematics import tool_frame
from scara_ident.simulation import Effect, parse_effect
from scara_ident.simulation.arm import VirtualArm
from scara_ident.simulation.effects.contact import Push
from scara_ident.use.alarm import step_of
from scara_ident.use.contact import Contact, find_contacts
from scara_ident.use.external_torque import Observed
from scara_ident.use.observer import ContactObserver, calibrated, contact_observer

Array = NDArray[np.float64]
RATES = (10.0, 30.0, 60.0, 120.0)
# Stated false alarms per hour at which pushes are looked for.
PUSH_RATE = 10.0
SECONDS, RATE = 20.0, 250.0
# Pushes last so long, begin so far apart, and count as found up to so long after, s.
LASTING, APART, AFTER = 0.6, 3.5, 0.3
FORCES = {"scara03": (3.0, 150.0), "ur5": (0.02, 5.0), "panda": (0.02, 5.0), "measured": (2.0, 150.0)}
# Thresholds are from a half of the quiet motion, and from recordings of so many seconds in all.
SHORT = 600.0
# Samples between those at which usual thresholds are taken.
EVERY = 100
# By how much a rate may be wrong.
FACTOR = 1.5


class Rig(NamedTuple):
    """A virtual arm, what it has that its URDF has not, and whether the model that is watched by does not know it."""

    arm: VirtualArm
    seed: int
    effects: tuple[Effect, ...] = ()
    unaware: bool = False

    def record(self, k: int, pushes: Sequence[Push] = ()) -> Recording:
        """Record a random motion, with the velocity that the controller saw."""
        motion = random_motion(f"m{k}", self.arm, KINDS[k % len(KINDS)], SECONDS, np.random.default_rng([self.seed, k]))
        # Other noise with every seed.
        acting, seed = (*self.effects, *pushes), 1_000_000 * self.seed + k
        return simulate(self.arm, motion, effects=acting, seed=seed, rate=RATE, record_velocity=True).recording

    def known(self, recordings: list[Recording]) -> IdentifiedModel:
        """Identify the arm, or diagnose it for what it has."""
        if self.unaware or not self.effects:
            return identified_model(identify(self.arm.robot, recordings))
        families = effects_named(*sorted({effect.name for effect in self.effects}))
        return identified_model(diagnose(self.arm.robot, recordings, catalogue=families))


class Aim(NamedTuple):
    """What is pushed: a link, or the tool, and how far from its origin, m."""

    link: str | None = None
    beside: float = 0.0


AT_TOOL = Aim()


class Try(NamedTuple):
    """A push, its size in N, whether it was found, and at the tool, and how far off the stated force is, in std."""

    force: float
    found: bool
    at_tool: bool
    off: float | None


def main() -> None:
    """Print and write what was counted."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robot", choices=("scara03", "ur5", "panda"), default="scara03")
    parser.add_argument("--recordings", type=int, default=370, help="without contact, of 20 s")
    parser.add_argument("--pushed", type=int, default=40, help="recordings with pushes, of four or five each")
    parser.add_argument(
        "--beside", type=float, default=0.0, help="how far from the tool, or a link's origin, pushes act, m"
    )
    parser.add_argument("--effects", nargs="+", type=parse_effect, default=[], help="what the arm has, as `simulate` takes it; its model is then a diagnosis' for these families")  # fmt: skip
    parser.add_argument("--unaware", action="store_true", help="take the model of `identify` all the same")
    parser.add_argument("--link", help="link that is pushed, by default the tool's")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--measured", type=Path, help="folder with robot.yaml and recordings")
    parser.add_argument("--fit", nargs="+", default=[], help="recordings of it to identify from")
    parser.add_argument("--rates", type=float, nargs="+", default=RATES, help="stated per hour")
    parser.add_argument("--output", type=Path)
    given = parser.parse_args()
    if given.measured:
        found = measured(given.measured, given.fit, given.seed, given.rates)
    else:
        aim = Aim(given.link, given.beside)
        arm = virtual_arm(load_robot(None if given.robot == "scara03" else given.robot))
        rig = Rig(arm, given.seed, tuple(given.effects), given.unaware)
        found = virtual(rig, given.recordings, given.pushed, given.rates, aim)
    print("\n".join(table(found)))
    if given.output:
        given.output.parent.mkdir(parents=True, exist_ok=True)
        given.output.write_text(json.dumps(found, indent=1) + "\n")


def virtual(rig: Rig, count: int, pushed_count: int, rates: Sequence[float], aim: Aim = AT_TOOL) -> dict[str, Any]:
    """Count on a virtual arm."""
    arm, seed, name = rig.arm, rig.seed, rig.arm.robot.name
    made = [rig.record(k) for k in range(6 + count)]
    known = rig.known(made[:6])
    observer = contact_observer(known, made[6:], rate=PUSH_RATE)
    runs = [observer.observe(item) for item in made[6:]]
    few = max(1, round(SHORT / SECONDS))
    parts = [runs[k : k + few] for k in range(0, max(1, len(runs) - few + 1), few)]
    halves = [runs[::2], runs[1::2]]
    splits = [(halves[0], halves[1]), (halves[1], halves[0])], list(zip(parts, parts[1:] + parts[:1], strict=True))
    rows = [alarms(observer, rate, each) for each in splits for rate in rates if len(each) > 1]
    tries: list[Try] = []
    for k in range(pushed_count):
        rng = np.random.default_rng([seed, 10_000 + k])
        pushes = [
            aimed(drawn(arm, rng, start, FORCES[name]), arm, aim, rng) for start in np.arange(2.0, SECONDS - 2.0, APART)
        ]
        pushed, without = (observer.observe(rig.record(20_000 + k, with_)) for with_ in (pushes, ()))
        tries += looked_for(observer, pushed, without, pushes)
    return {"arm": name, "false_alarms": rows, "thresholds": thresholds(observer, runs), **smallest(tries)}


def thresholds(observer: ContactObserver, runs: Sequence[Observed]) -> dict[str, float]:
    """Return the usual threshold of each joint at `PUSH_RATE`, N m or N: the median over the time."""
    every = [
        observer.alarm.threshold(run.features[:, :, k]) for run in runs for k in np.flatnonzero(run.settled)[::EVERY]
    ]
    return dict(zip(observer.known.robot.joints, np.median(every, axis=0).tolist(), strict=True))


def drawn(arm: VirtualArm, rng: np.random.Generator, start: float, forces: tuple[float, float]) -> Push:
    """Draw a push on the tool, horizontal where all axes are vertical."""
    direction = rng.normal(size=3)
    if arm.robot.name == "scara03":
        direction[2] = 0.0
    x, y, z = direction / np.linalg.norm(direction)
    return Push(
        force=float(np.exp(rng.uniform(*np.log(forces)))), time=float(start), duration=LASTING, direction=(x, y, z)
    )


def aimed(push: Push, arm: VirtualArm, aim: Aim, rng: np.random.Generator) -> Push:
    """Return a push on a point beside where it was, in a random direction, or on a link."""
    if aim == AT_TOOL:
        return push
    direction = rng.normal(size=3)
    x, y, z = (arm.tool if aim.link is None else np.zeros(3)) + aim.beside * direction / np.linalg.norm(direction)
    return replace(push, link=aim.link, point=(x, y, z))


def alarms(observer: ContactObserver, rate: float, splits: Sequence[tuple[list[Observed], list[Observed]]]) -> dict[str, Any]:  # fmt: skip
    """Count false alarms in the second part of each split with thresholds from the first."""
    count, hours, rested = 0, 0.0, 0.0
    for free, others in splits:
        own = calibrated(observer.known, observer.settings, free, rate=rate, velocity=observer.velocity)
        count += sum(len(find_contacts(own, run)) for run in others)
        hours += sum(float(np.sum(step_of(run)[run.settled])) for run in others) / 3600.0
        rested += own.alarm.hours / len(splits)
    low = 0.5 * chi2.ppf(0.025, 2 * count) if count else 0.0
    high = 0.5 * chi2.ppf(0.975, 2 * count + 2)
    return {"stated": rate, "thresholds_from_hours": rested, "seen": count / hours, "interval": [low / hours, high / hours], "count": count, "hours": hours, "ratio": count / hours / rate}  # fmt: skip


def table(found: dict[str, Any]) -> list[str]:
    """Return rows as in the documentation."""
    force = f"{found['force_found_in_90_percent']:.3g} N of {found['pushes']} pushes"
    lines = ["| arm | thresholds from | stated per hour | seen per hour | over stated | counted | within 1.5 | 90 % found from |"]  # fmt: skip
    lines.append("|" + "---|" * (lines[0].count("|") - 1))
    for row in found["false_alarms"]:
        low, high = (end / row["stated"] for end in row["interval"])
        near = 1.0 / FACTOR <= row["ratio"] <= FACTOR
        said = "yes" if low > 1.0 / FACTOR and high < FACTOR else "seen" if near else "no" if high < 1.0 / FACTOR or low > FACTOR else "open"  # fmt: skip
        rested = f"{row['thresholds_from_hours']:.2f} h"
        seen = f"{row['seen']:.0f} ({row['interval'][0]:.0f} to {row['interval'][1]:.0f})"
        count = f"{row['count']} in {row['hours']:.2f} h"
        cells = (found["arm"], rested, f"{row['stated']:.0f}", seen, f"{row['ratio']:.2f}", count, said, force)
        lines.append(f"| {' | '.join(cells)} |")
        force = ""
    if "thresholds" in found:
        each = ", ".join(f"{name} {value:.3g}" for name, value in found["thresholds"].items())
        lines.append(f"{found['arm']}: thresholds at {PUSH_RATE:g} an hour: {each}")
    if found["placed_at_tool"] is not None:
        lines.append(f"{found['arm']}: {found['placed_at_tool']:.0%} of the pushes found were placed at the tool")
    if found["forces"]:
        within = (found["within_two_std"], found["within_three_std"])
        lines.append(
            f"{found['arm']}: of {found['forces']} stated forces {within[0]:.0%} are within two standard deviations of the push "
            f"along every axis, {within[1]:.0%} within three"
        )
    return lines


def looked_for(observer: ContactObserver, run: Observed, without: Observed, pushes: Sequence[Push]) -> list[Try]:
    """Return what became of every push.

    Found is a push by an alarm that begins while it lasts, or just after, and that the same run without pushes has not.
    """
    false = find_contacts(observer, without)
    found = [
        each
        for each in find_contacts(observer, run)
        if not any(other.stop >= each.start and other.start <= each.stop for other in false)
    ]
    tries = []
    for push in pushes:
        hits = [each for each in found if push.time <= each.start <= push.time + push.duration + AFTER]
        told = next((each for each in hits if each.force is not None), None)
        at_tool = any(each.place == "tool" for each in hits)
        tries.append(Try(push.force, bool(hits), at_tool, None if told is None else _off(told, push)))
    return tries


def _off(found: Contact, push: Push) -> float:
    """Return how far a stated force is from a push, in standard deviations along the axis where that is most."""
    assert found.force is not None
    assert found.force_covariance is not None
    direction = np.array(push.direction)
    off = found.force - push.force * direction / np.linalg.norm(direction)
    return float(np.nanmax(np.abs(off) / np.sqrt(np.diag(found.force_covariance))))


def smallest(tries: Sequence[Try]) -> dict[str, Any]:
    """Return the force that is found in 90 % of pushes, N, and the shares by size of force."""
    force, hit = np.log([each.force for each in tries]), np.array([each.found for each in tries], dtype=float)

    def loss(x: Array) -> float:
        z = np.exp(x[1]) * (force - x[0])
        return float(np.sum(np.logaddexp(0.0, z) - hit * z)) + 0.01 * x[1] ** 2

    middle, steep = minimize(loss, np.array([float(np.median(force)), 0.5]), method="Nelder-Mead").x
    edges = np.quantile(force, np.linspace(0.0, 1.0, 7))
    bins = [
        {
            "from": float(np.exp(a)),
            "to": float(np.exp(b)),
            "pushes": int(inside.sum()),
            "found": float(hit[inside].mean()),
        }
        for a, b in zip(edges[:-1], edges[1:], strict=True)
        if (inside := (force >= a) & (force <= b)).any()
    ]
    named = [each.at_tool for each in tries if each.found]
    off = np.array([each.off for each in tries if each.off is not None])
    return {
        "pushes": len(tries),
        "stated_at_pushes": PUSH_RATE,
        # Where every push is found, that or less.
        "force_found_in_90_percent": float(np.exp(max(force.min(), middle + np.log(9.0) / np.exp(steep)))),
        "found_by_force": bins,
        "placed_at_tool": float(np.mean(named)) if named else None,
        "forces": len(off),
        "within_two_std": float(np.mean(off < 2.0)) if len(off) else None,
        "within_three_std": float(np.mean(off < 3.0)) if len(off) else None,
    }


def measured(folder: Path, fit: Sequence[str], seed: int, rates: Sequence[float]) -> dict[str, Any]:
    """Count on measured recordings: each with thresholds from all others that were not fitted."""
    robot = load_robot(folder / "robot.yaml")
    recordings = read_recordings([folder], robot)
    known = identified_model(identify(robot, [item for item in recordings if item.name in fit]))
    others = [item for item in recordings if item.name not in fit]
    observer = contact_observer(known, others, rate=PUSH_RATE)
    runs = [observer.observe(item) for item in others]
    splits = [(runs[:k] + runs[k + 1 :], [runs[k]]) for k in range(len(runs))]
    rows = [alarms(observer, rate, splits) for rate in rates]
    tries: list[Try] = []
    for k, (item, (free, _)) in enumerate(zip(others, splits, strict=True)):
        own = calibrated(known, observer.settings, free, rate=PUSH_RATE, velocity=observer.velocity)
        # Five times, with other pushes: the recordings are few.
        for again in range(5):
            pushed, pushes = added(known, item, np.random.default_rng([seed, k, again]))
            tries += looked_for(own, own.observe(pushed), runs[k], pushes)
    names = [item.name for item in others]
    return {"arm": folder.name, "counted": names, "velocity": observer.velocity, "false_alarms": rows, **smallest(tries)}  # fmt: skip


def added(known: IdentifiedModel, item: Recording, rng: np.random.Generator) -> tuple[Recording, list[Push]]:
    """Return a recording with pushes on the tool added to its effort."""
    robot = known.robot
    assert item.effort is not None
    effort, time = item.effort.copy(), item.time - item.time[0]
    frame, data = robot.model.getFrameId(tool_frame(robot).name, pin.FrameType.BODY), robot.model.createData()
    pushes = []
    for start in np.arange(rng.uniform(1.5, 3.0), time[-1] - 1.5, APART):
        direction = rng.normal(size=3)
        x, y, z = direction / np.linalg.norm(direction)
        push = Push(force=float(np.exp(rng.uniform(*np.log(FORCES["measured"])))), time=float(start), duration=LASTING, direction=(x, y, z))  # fmt: skip
        for k in np.flatnonzero((time >= start) & (time <= start + LASTING)):
            q = item.position[np.argsort(robot.order), k]
            jacobian = pin.computeFrameJacobian(robot.model, data, q, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
            rise = min(1.0, (time[k] - start) / 0.05, (start + LASTING - time[k]) / 0.05)
            force = push.force * rise * np.array(push.direction)
            effort[:, k] -= robot.row_scale * (jacobian[:3].T @ force)[robot.order]
        pushes.append(push)
    return replace(item, effort=effort), pushes


if __name__ == "__main__":
    main()
