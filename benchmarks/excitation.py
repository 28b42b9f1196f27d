"""Design excitation: log det and condition reached, seconds, and every limit on a finer grid.

Run ``python benchmarks/excitation.py [--only scara|arms|study]... [--case WORD] [--output FILE.json]``; without
``--only`` the first two. The study tells the effect of the number of harmonics, of splines, of multisines, of a
longer search and of wider limits; ``--case`` takes of these those that have a word in their name.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from importlib.metadata import distribution
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scara_ident.excitation import (
    Condition,
    Criterion,
    Design,
    Effort,
    Limits,
    Progress,
    design_excitation,
    excitation_dict,
    limits_of,
    nominal_parameters,
)
from scara_ident.identification.identify import identify
from scara_ident.model.model import TorqueModel, build_model
from scara_ident.model.terms.rigid_body import rigid_body
from scara_ident.paper import OJD, criteria, regressor, table5_parameters, tool_acceleration
from scara_ident.robot.description import JointDescription, RobotDescription
from scara_ident.robot.robot import Robot, build_robot, load_robot
from scara_ident.simulation import sampled, simulate, virtual_arm

Array = NDArray[np.float64]

REPETITIONS = 500
# Of the virtual arm in closed loop, 25 s each.
RUNS = 60
NOISE = 0.03


def example(name: str) -> Path:
    found = [file for file in distribution("example-robot-data").files or [] if str(file).endswith(f"/{name}")]
    return Path(str(found[0].locate()))


def arms() -> dict[str, Robot]:
    panda = example("panda.urdf")
    arm: dict[str, JointDescription | None] = {f"panda_joint{k}": JointDescription() for k in range(1, 8)}
    return {
        "UR5": load_robot(example("ur5_joint_limited_robot.urdf")),
        "Panda": build_robot(RobotDescription(urdf=panda, joints=arm), panda),
    }


def whole(robot: Robot) -> Limits:
    """All of the limits, as the paper has them, and no distances."""
    return limits_of(robot, clearance=None, share=1.0)


def told(design: Design) -> dict[str, Any]:
    content = excitation_dict(design)
    wanted = ("log_det", "condition_of_regressor", "condition_of_scaled_regressor", "limits", "active_limits", "search")
    return {key: content[key] for key in wanted} | {"seconds": design.seconds, "verified": design.verified}


def timed(make: Callable[[], Design]) -> tuple[Design, float, float]:
    """Return a design with its seconds by the clock and of all processors."""
    before, begun = os.times(), time.perf_counter()
    design = make()
    passed, after = time.perf_counter() - begun, os.times()
    return design, passed, sum(after[:4]) - sum(before[:4])


def scara() -> tuple[Design, dict[str, Any]]:
    design, wall, work = timed(lambda: design_excitation(build_model(load_robot()), limits=whole(load_robot())))
    trajectory = design.trajectories[0]
    log_det, condition = criteria(regressor(*trajectory.at(np.linspace(0.0, 25.0, 2500))))
    ojd, _ = criteria(regressor(*OJD.motion(OJD.times())))
    fine = np.linspace(0.0, 25.0, 10 * design.verified)
    q, v, a = trajectory.at(fine)
    print("\nSCARA03, 25 s, complete model, paper's definition (2500 samples, R_v = identity)")
    print(
        f"  J_d {log_det:.2f} in {wall:.1f} s, {work:.1f} s of computing (OJD {ojd:.2f}; wanted 92 in 60 s), "
        f"J_k {condition:.3g}"
    )
    print(f"  local searches: {', '.join(f'{-cost:.2f}' for cost in design.costs)}")
    print_limits(design)
    push = tool_acceleration(q, v, a).max()
    print(
        f"  by the paper's formulas on {len(fine)} samples: velocities {np.abs(v).max(axis=1).round(5).tolist()} rad/s,"
    )
    print(f"  tool acceleration {push:.5f} m/s^2 (OJD {tool_acceleration(*OJD.motion(fine)).max():.2f})")
    torque = np.einsum("ipN,p->iN", regressor(q, v, a), table5_parameters("OJD"))
    most = np.abs(torque).max(axis=1).round(4).tolist()
    print(f"  motor torque with every parameter of Table 5 (OJD), friction included: {most} N m of 2")
    result = {"J_d": log_det, "J_k": condition, "OJD": ojd, "wall": wall, "computing": work, "torque": most}
    return design, {**result, **told(design)}


def repetitions(design: Design) -> dict[str, float]:
    """Estimate from exact regressors with white noise, again and again, on OJD and on the design."""
    random = np.random.default_rng(0)
    trajectory = design.trajectories[0]
    spread, log_det, predicted = [], [], []
    for q, v, a in (OJD.motion(OJD.times()), trajectory.at(np.linspace(0.0, 25.0, 2500))):
        motion = replace(trajectory.motion(2500), q=q, v=v, a=a)
        h = design.model.regressor(motion).transpose(2, 0, 1).reshape(-1, len(design.model.names))
        estimates = np.linalg.lstsq(h, NOISE * random.standard_normal((len(h), REPETITIONS)), rcond=None)[0]
        spread.append(estimates.std(axis=1))
        predicted.append(NOISE * np.sqrt(np.diag(np.linalg.inv(h.T @ h))))
        log_det.append((np.linalg.slogdet(h.T @ h)[1], -np.linalg.slogdet(np.cov(estimates) / NOISE**2)[1]))
    p = len(design.model.names)
    promised = float(np.exp((log_det[0][0] - log_det[1][0]) / (2 * p)))
    seen = float(np.exp((log_det[0][1] - log_det[1][1]) / (2 * p)))
    worst = float(np.max(np.abs(np.array(spread) / np.array(predicted) - 1.0)))
    print(f"\nstd of {REPETITIONS} repetitions, design over OJD, geometric mean of the principal axes")
    print(f"  promised by the log dets {promised:.3f}, seen {seen:.3f} ({100 * (seen / promised - 1):+.1f} %)")
    print(f"  every parameter's std by itself: within {100 * worst:.0f} % of what is foreseen")
    ratio = spread[1] / spread[0]
    print("  " + ", ".join(f"{name} {x:.2f}" for name, x in zip(design.model.names, ratio, strict=True)))
    return {"promised": promised, "seen": seen, "worst": worst}


def virtual_repetitions(design: Design) -> dict[str, float]:
    """Estimate from recordings of the virtual arm in closed loop, with its own noise, on OJD and on the design."""
    arm = virtual_arm()
    found, promised = [], []
    for name, motion in (("OJD", OJD.motion), ("design", design.trajectories[0].at)):
        path = sampled(name, arm.robot, motion, 25.0)
        values = []
        for repetition in range(1, RUNS + 1):
            recording = simulate(arm, path, seed=5, repetition=repetition).recording
            result = identify(arm.robot, [recording])
            values.append(result.estimate.value)
            promised.append(result.log_det)
        found.append(np.array(values).T)
    p = len(design.model.names)
    promise = float(np.exp((np.mean(promised[:RUNS]) - np.mean(promised[RUNS:])) / (2 * p)))
    dets = [np.linalg.slogdet(np.cov(each))[1] for each in found]
    seen = float(np.exp((dets[1] - dets[0]) / (2 * p)))
    ratio = found[1].std(axis=1) / found[0].std(axis=1)
    print(f"\nstd of {RUNS} recordings of the virtual arm, design over OJD, geometric mean of the principal axes")
    print(f"  promised by the recordings' J_d {promise:.3f}, seen {seen:.3f} ({100 * (seen / promise - 1):+.1f} %)")
    print("  " + ", ".join(f"{name} {x:.2f}" for name, x in zip(design.model.names, ratio, strict=True)))
    return {"promised": promise, "seen": seen}


def condition_of(model: TorqueModel, criterion: Criterion) -> dict[str, Any]:
    robot = model.robot
    design, wall, work = timed(
        lambda: design_excitation(model, duration=20.0, limits=whole(model.robot), criterion=criterion)
    )
    content = {**told(design), "wall": wall, "computing": work}
    print(
        f"  {robot.name:6} {model.name:9} {len(model.names):3} {criterion.name:12} plain "
        f"{content['condition_of_regressor']:7.2f}, columns of unit length "
        f"{content['condition_of_scaled_regressor']:6.2f}; ln det {design.log_det:7.1f}; {wall:5.1f} s, {work:5.1f} s of "
        f"computing; limits {'kept' if all(r.kept for r in design.reached) else 'BROKEN'} "
        f"(largest share {max(r.share for r in design.reached):.5f})",
        flush=True,
    )
    return content


def print_limits(design: Design) -> None:
    print(f"  limits at {design.verified} samples, ten times the design's grid or more, and between them:")
    for each in design.reached:
        mark = "" if each.kept else "  BROKEN"
        active = "  active" if each.active else ""
        print(f"    {each.name:24} {each.reached:9.5f} of {each.bound:9.5f} {each.unit:6} {active}{mark}")


def bound_of_states(count: int = 100_000, rounds: int = 200) -> float:
    """Return what no motion exceeds: the best weights of states within the limits, whether or not a motion joins them.

    A multiplicative algorithm raises the weights of states that tell more (Silvey, Titterington and Torsney 1978); by
    the equivalence theorem of Kiefer and Wolfowitz, ln det + p ln(max d / p) bounds every weighting of these states.
    """
    random = np.random.default_rng(0)
    model, limits = build_model(load_robot()), whole(load_robot())
    nominal = nominal_parameters(model)
    q = random.uniform(limits.lower[:, None], limits.upper[:, None], (2, count))
    # A cubic in speed is told best at these speeds.
    levels = random.choice([1e-6, 0.276, 0.724, 1.0], (2, count)) * random.choice([-1.0, 1.0], (2, count))
    v = limits.velocity[:, None] * np.where(random.random((2, count)) < 0.6, levels, random.uniform(-1, 1, (2, count)))
    a = np.array([[25.0], [60.0]]) * random.uniform(-1.0, 1.0, (2, count))
    low, high = np.zeros(count), np.ones(count)
    for _ in range(30):
        share = 0.5 * (low + high)
        torque = np.abs(np.einsum("ipN,p->iN", regressor(q, v, share * a), nominal)) / limits.torque[:, None]
        kept = (tool_acceleration(q, v, share * a) <= limits.tool_acceleration) & np.all(torque <= 1.0, axis=0)
        low, high = np.where(kept, share, low), np.where(kept, high, share)
    possible = low > 0.0
    rows = regressor(q, v, low * a).transpose(2, 0, 1)[possible]
    weights = np.full(len(rows), 1.0 / len(rows))
    bound, p = np.inf, rows.shape[2]
    for _ in range(rounds):
        matrix = np.einsum("n,nip,niq->pq", weights, rows, rows, optimize=True)
        told_by = np.einsum("nip,pq,niq->n", rows, np.linalg.inv(matrix), rows, optimize=True)
        log_det = np.linalg.slogdet(matrix)[1] + p * np.log(2500)
        bound = min(bound, float(log_det + p * np.log(told_by.max() / p)))
        weights = weights * told_by / p
    return bound


def wider_limits() -> dict[str, Limits]:
    """Return the SCARA03's limits with one kind of them a tenth wider, by kind."""
    limits = whole(load_robot())
    half = 0.5 * (limits.upper - limits.lower)
    return {
        "ranges": replace(limits, lower=limits.centre - 1.1 * half, upper=limits.centre + 1.1 * half),
        "velocities": replace(limits, velocity=1.1 * limits.velocity),
        "torques": replace(limits, torque=1.1 * limits.torque),
        "tool acceleration": replace(limits, tool_acceleration=1.1 * limits.tool_acceleration),
    }


def study(word: str = "") -> list[dict[str, Any]]:
    model, limits = build_model(load_robot()), whole(load_robot())
    print("\nwhat limits J_d of the SCARA03 in 25 s")
    if not word:
        print(
            f"  no choice of states within the limits exceeds about {bound_of_states():.1f}, joined by a motion or not"
        )
    found = []
    cases: list[tuple[str, Callable[[], Design]]] = [
        (f"{k} harmonics", partial(design_excitation, model, harmonics=k, limits=limits))
        for k in (5, 10, 20, 40, 60, 80, 120)
    ]
    odd = tuple(range(1, 80, 2))
    spread = tuple(sorted({round(1.6 * 1.12**k) for k in range(36)}))
    cases += [
        (f"{len(odd)} odd harmonics to 79", lambda: design_excitation(model, harmonics=odd, limits=limits)),
        (
            f"{len(spread)} spread harmonics to {spread[-1]}",
            lambda: design_excitation(model, harmonics=spread, limits=limits),
        ),
        ("splines, 80 intervals", lambda: design_excitation(model, harmonics=40, family="spline", limits=limits)),
        ("splines, 160 intervals", lambda: design_excitation(model, harmonics=80, family="spline", limits=limits)),
        (
            "40, long search",
            lambda: design_excitation(model, limits=limits, effort=Effort(starts=16, rounds=3, seed=1), progress=dot),
        ),
    ]
    for what, wider in wider_limits().items():
        cases.append((f"{what} by 10 % wider", partial(design_excitation, model, limits=wider)))
    for name, make in cases:
        if word not in name:
            continue
        design, wall, work = timed(make)
        found.append({"name": name, "wall": wall, "computing": work, **told(design)})
        active = ", ".join(each.name for each in design.reached if each.active)
        line = f"{name:28} {design.log_det:6.2f} in {wall:6.1f} s, {work:6.1f} s of computing; active: {active}"
        print(f"  {line}", flush=True)
    return found


def dot(progress: Progress) -> None:
    if progress.done % 16 == 0:
        print(f"    {progress.done} of {progress.total}: {-progress.cost:.2f}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", action="append", choices=("scara", "arms", "study"))
    parser.add_argument("--case", default="", metavar="WORD")
    parser.add_argument("--output", type=Path)
    arguments = parser.parse_args()
    parts = arguments.only or ["scara", "arms"]
    content: dict[str, Any] = {}
    if "scara" in parts:
        design, content["scara03"] = scara()
        content["repetitions"] = repetitions(design)
        content["virtual_repetitions"] = virtual_repetitions(design)
    if "arms" in parts:
        print(
            "\ncondition of the regressor H as it is (plain) and with columns of unit length, 20 s (wanted: 100 in 300 s)"
        )
        print("  rigid: base parameters of bodies and rotors; complete: friction and offset of every joint too")
        for name, robot in arms().items():
            rigid = TorqueModel("rigid", robot, (rigid_body(robot),))
            content[name] = [condition_of(rigid, c) for c in (Condition(), Condition(scaled=True))]
            content[name].append(condition_of(build_model(robot), Condition()))
    if "study" in parts:
        content["study"] = study(arguments.case)
    if arguments.output:
        arguments.output.write_text(json.dumps(content, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
