"""Physical consistency: how often estimates are impossible, and what it costs and buys to keep them possible.

Random arms that can exist, excited richly, less and less, and at last by a single slow stroke, with noise from none
to 30 % of each joint's torque. Ordinary least squares and the consistent estimate (joints weighted by their residual,
friction that takes energy out) see the same rows; both predict the torque of another, rich trajectory. Then the same problem is given with all rows instead of their triangular factor.
Prints tables and writes JSON.

    python benchmarks/consistency.py --draws 50 --output benchmarks/results/consistency.json
"""

from __future__ import annotations

import argparse
import json
import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib.metadata import distribution
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from numpy.typing import NDArray

from scara_ident.estimation.consistent.bodies import pack
from scara_ident.estimation.consistent.friction import friction_faults
from scara_ident.estimation.consistent.prior import prior_rows
from scara_ident.estimation.consistent.problem import Problem, constraints_on
from scara_ident.estimation.consistent.solution import least_squares_arm, nearest_arm, solve_consistent, solve_joints
from scara_ident.estimation.information import Information, merge
from scara_ident.fleet.engine import run_all
from scara_ident.model.base_parameters import pseudo_inertia
from scara_ident.model.model import TorqueModel, build_model
from scara_ident.motion.motion import Motion
from scara_ident.robot.description import JointDescription, RobotDescription
from scara_ident.robot.robot import Robot, build_robot, load_robot

Array = NDArray[np.float64]

# The arm of the paper with its whole model; the others with bodies, rotors, Coulomb and viscous friction, offset.
MODELS = {"scara03": "complete", "ur5": "basic", "ur10": "basic", "panda": "basic"}
FILES = {"ur5": "ur5_robot.urdf", "ur10": "ur10_robot.urdf", "panda": "panda.urdf"}
NOISE = (0.0, 0.05, 0.3)
RATE = 200.0
# A body of the truth differs from the URDF's by factors of about exp(+-SPREAD) in every direction.
SPREAD = 0.4
SLOW_SPEED = 0.2
TIMED_SAMPLES = 10_000


@cache
def arm(name: str) -> Robot:
    if name == "scara03":
        return load_robot()
    files = [f for f in distribution("example-robot-data").files or [] if str(f).endswith(f"/{FILES[name]}")]
    urdf = Path(str(files[0].locate()))
    joints = {f"panda_joint{i}": JointDescription() for i in range(1, 8)} if name == "panda" else None
    return build_robot(RobotDescription(urdf=urdf, joints=joints), urdf)


@cache
def problem(name: str) -> Problem:
    return Problem(build_model(arm(name), MODELS[name]))


def smallest_eigenvalue_share(parameters: Array) -> float:
    """Return the smallest eigenvalue of a body's pseudo-inertia as a share of its trace; below 0 it cannot exist."""
    matrix = pseudo_inertia(parameters)
    trace = float(np.trace(matrix))
    smallest = float(np.linalg.eigvalsh(matrix)[0])
    return smallest / trace if trace > 0.0 else (0.0 if not np.any(matrix) else -np.inf)


def sines(robot: Robot, rng: np.random.Generator, seconds: float, harmonics: int, speed: float) -> Motion:
    """Sums of sines of 0.1 Hz and its multiples; every joint's peak speed is a share of its velocity limit."""
    time_ = np.arange(int(seconds * RATE)) / RATE
    q, v, a = (np.zeros((robot.n, len(time_))) for _ in range(3))
    for j in range(robot.n):
        for k in range(1, harmonics + 1):
            w = 0.2 * np.pi * k
            sine, cosine = rng.standard_normal(2) / k
            q[j] += sine * np.sin(w * time_) + cosine * np.cos(w * time_)
            v[j] += w * (sine * np.cos(w * time_) - cosine * np.sin(w * time_))
            a[j] -= w**2 * (sine * np.sin(w * time_) + cosine * np.cos(w * time_))
        size = min(speed * robot.velocity_limit[j] / np.max(np.abs(v[j])), 2.5 / np.max(np.abs(q[j])))
        q[j], v[j], a[j] = size * q[j], size * v[j], size * a[j]
    return Motion("sines", "sines", time_, q, v, a, None, RATE)


def stroke(robot: Robot, rng: np.random.Generator) -> Motion:
    """One slow stroke of all joints in 2.5 s."""
    seconds = 2.5
    time_ = np.arange(int(seconds * RATE)) / RATE
    s = time_ / seconds
    path = 10 * s**3 - 15 * s**4 + 6 * s**5
    rise = (30 * s**2 - 60 * s**3 + 30 * s**4) / seconds
    bend = (60 * s - 180 * s**2 + 120 * s**3) / seconds**2
    # The path's peak slope is 1.875 over its duration.
    length = SLOW_SPEED * robot.velocity_limit * seconds / 1.875 * rng.uniform(0.6, 1.0, robot.n)
    length = (length * rng.choice([-1.0, 1.0], robot.n))[:, None]
    start = rng.uniform(-1.0, 1.0, robot.n)[:, None]
    return Motion("stroke", "stroke", time_, start + length * path, length * rise, length * bend, None, RATE)


EXCITATION: dict[str, Callable[[Robot, np.random.Generator], Motion]] = {
    "rich": lambda robot, rng: sines(robot, rng, 10.0, 5, 0.6),
    "moderate": lambda robot, rng: sines(robot, rng, 5.0, 5, 0.2),
    "poor": lambda robot, rng: sines(robot, rng, 5.0, 2, 0.1),
    "stroke": stroke,
}


def truth(name: str, rng: np.random.Generator) -> Array:
    """Parameters of a random arm that can exist."""
    u = problem(name).unknowns
    x = np.zeros(u.size)
    for i in range(u.n):
        noise = SPREAD * rng.standard_normal((4, 4))
        values, vectors = np.linalg.eigh(0.5 * (noise + noise.T))
        x[10 * i : 10 * i + 10] = pack(vectors * np.exp(2.0 * values) @ vectors.T)
    x[10 * u.n : 11 * u.n] = np.exp(2.0 * SPREAD * rng.standard_normal(u.n))
    value = u.parameters(x)
    for polynomial in u.polynomials:
        coulomb, viscous, thinning = rng.uniform(0.03, 0.1), rng.uniform(0.05, 0.2), rng.uniform(0.0, 0.4)
        shape = np.array([coulomb, viscous, -thinning * viscous, 0.1 * thinning * viscous])
        powers = np.array(polynomial.powers)
        value[list(polynomial.columns)] = polynomial.limit * shape[powers] / polynomial.speed**powers
    return value


def torque(model: TorqueModel, motion: Motion, value: Array) -> tuple[Array, Array]:
    regressor = model.regressor(motion)
    return regressor, np.einsum("jpn,p->jn", regressor, value)


def factors(regressor: Array, measured: Array) -> list[Information]:
    empty = Information.empty(regressor.shape[1])
    return [empty.absorb_columns(np.vstack([regressor[j], measured[j : j + 1]])) for j in range(len(measured))]


@dataclass(frozen=True)
class Draw:
    """One random arm: what both methods made of it."""

    ols_impossible: bool
    consistent_impossible: bool
    smallest_share: float
    ols_parameters: float
    consistent_parameters: float
    ols_torque: float
    consistent_torque: float
    difference: float | None
    ols_ms: float
    consistent_ms: float
    fill_ms: float


def draw(name: str, excitation: str, noise: float, seed: int) -> Draw:
    rng = np.random.default_rng([seed, *map(ord, name + excitation)])
    robot, solver = arm(name), problem(name)
    model, u = solver.unknowns.model, solver.unknowns
    value = truth(name, rng)
    regressor, exact = torque(model, EXCITATION[excitation](robot, rng), value)
    sigma = noise * np.sqrt(np.mean(exact**2, axis=1, keepdims=True))
    joints = factors(regressor, exact + sigma * rng.standard_normal(exact.shape))
    held_out, clean = torque(model, sines(robot, rng, 10.0, 5, 0.6), value)

    start = time.perf_counter()
    information = merge(joints)
    ols = information.solve()
    middle = time.perf_counter()
    found, used, _ = solve_joints(solver, joints)
    end = time.perf_counter()
    x = nearest_arm(solver, used, found.x)
    filled = time.perf_counter()
    estimate, standard = u.parameters(x), u.standard(x)
    shares = [smallest_eigenvalue_share(body) for body in standard[: 10 * u.n].reshape(u.n, 10)]
    braking = not any(friction_faults(p, estimate[list(p.columns)]) for p in u.polynomials)
    possible = least_squares_arm(solver, information) is not None
    determined, weighted = ols.null.shape[1] == 0, used.solve().value
    size = np.linalg.norm(u.to_parameters, axis=1)
    return Draw(
        ols_impossible=not possible,
        consistent_impossible=min(shares) < -1e-9 or bool(np.any(standard[10 * u.n :] < 0.0)) or not braking,
        smallest_share=min(shares),
        ols_parameters=rms((ols.value - value)[u.place] / size[u.place]),
        consistent_parameters=rms((estimate - value)[u.place] / size[u.place]),
        ols_torque=torque_error(held_out, ols.value, clean),
        consistent_torque=torque_error(held_out, estimate, clean),
        difference=largest_share(estimate - weighted, weighted) if found.was_possible and determined else None,
        ols_ms=1e3 * (middle - start),
        consistent_ms=1e3 * (end - middle),
        fill_ms=1e3 * (filled - end),
    )


def rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def largest_share(difference: Array, value: Array) -> float:
    told = value != 0.0
    return float(np.max(np.abs(difference[told] / value[told])))


def torque_error(regressor: Array, value: Array, clean: Array) -> float:
    """Error as a share of each joint's torque, rms over the joints."""
    error = np.einsum("jpn,p->jn", regressor, value) - clean
    return rms(np.sqrt(np.mean(error**2, axis=1) / np.mean(clean**2, axis=1)))


def summary(name: str, excitation: str, noise: float, draws: list[Draw]) -> dict[str, object]:
    def median(attribute: str) -> float:
        return float(np.median([getattr(d, attribute) for d in draws]))

    differences = [d.difference for d in draws if d.difference is not None]
    ratios = [d.consistent_torque / d.ols_torque for d in draws if d.ols_torque > 0.0]
    return {
        "robot": name,
        "model": MODELS[name],
        "excitation": excitation,
        "noise": noise,
        "draws": len(draws),
        "impossible": {
            "ols": float(np.mean([d.ols_impossible for d in draws])),
            "consistent": float(np.mean([d.consistent_impossible for d in draws])),
        },
        "smallest_eigenvalue_share": min(d.smallest_share for d in draws),
        "parameter_error": {"ols": median("ols_parameters"), "consistent": median("consistent_parameters")},
        "torque_error": {"ols": median("ols_torque"), "consistent": median("consistent_torque")},
        "torque_error_ratio": float(np.median(ratios)) if ratios else None,
        "difference_where_wls_is_possible": max(differences, default=None),
        "milliseconds": {"ols": median("ols_ms"), "consistent": median("consistent_ms"), "fill": median("fill_ms")},
    }


def all_rows(solver: Problem, rows: Array, measured: Array, noise: float, prior: Array) -> Array:
    """Solve the same problem with every row in its cost; nothing of it is compiled before."""
    import cvxpy as cp

    u = solver.unknowns
    x, auxiliary = cp.Variable(u.size), cp.Variable(u.auxiliary)
    cost = cp.sum_squares(rows @ u.to_parameters / noise @ x - measured / noise)
    cost += cp.sum_squares(prior @ (x - u.reference))
    statement, held = constraints_on(u, x, auxiliary)
    cp.Problem(cp.Minimize(cost), statement.constraints + held).solve(cp.CLARABEL)
    return u.parameters(np.asarray(x.value))


def timings(name: str) -> dict[str, object]:
    """Time one estimate from 1e4 samples: from all rows, from their factor with a new problem, and again."""
    rng = np.random.default_rng(1)
    robot, solver = arm(name), problem(name)
    model, u = solver.unknowns.model, solver.unknowns
    motion = sines(robot, rng, TIMED_SAMPLES / RATE, 5, 0.6)
    regressor, exact = torque(model, motion, truth(name, rng))
    measured = exact + 0.05 * np.sqrt(np.mean(exact**2, axis=1, keepdims=True)) * rng.standard_normal(exact.shape)
    rows = regressor.transpose(0, 2, 1).reshape(-1, regressor.shape[1])
    prior = prior_rows(u, rows @ u.to_parameters, measured.ravel(), 0.01)

    information = merge(factors(regressor, measured))
    noise = information.rms()
    factor, target = information.regressor_factor @ u.to_parameters / noise, information.projected_torque / noise
    everything, of_all = best(3, lambda: all_rows(solver, rows, measured.ravel(), noise, prior))

    def first_time() -> Array:
        compressed = merge(factors(regressor, measured)).scaled(1.0 / noise)
        fresh = Problem(model)
        point = fresh.solve(compressed.regressor_factor @ u.to_parameters, compressed.projected_torque, prior)
        return u.parameters(point.x)

    found, first = best(3, first_time)
    _, compressing = best(15, lambda: merge(factors(regressor, measured)))
    _, solving = best(15, lambda: solver.solve(factor, target, prior))
    _, estimating = best(15, lambda: solve_consistent(solver, information))
    return {
        "robot": name,
        "samples": TIMED_SAMPLES,
        "all_rows_ms": 1e3 * of_all,
        "compressed_first_ms": 1e3 * first,
        "compressed_ms": 1e3 * (compressing + solving),
        "repeated_solve_ms": 1e3 * solving,
        "repeated_estimate_ms": 1e3 * estimating,
        "times_faster_first": of_all / first,
        "times_faster": of_all / (compressing + solving),
        "difference_in_std": float(np.linalg.norm(information.regressor_factor @ (everything - found)) / noise),
    }


def best(times: int, function: Callable[[], Any]) -> tuple[Any, float]:
    """Run a function a few times; its last result and its shortest time, which other programs disturb least."""
    found, shortest = None, np.inf
    for _ in range(times):
        start = time.perf_counter()
        found = function()
        shortest = min(shortest, time.perf_counter() - start)
    return found, shortest


def print_tables(cases: list[dict[str, object]], times: list[dict[str, object]]) -> None:
    print("| arm | excitation | noise | impossible: OLS | consistent | parameter error: OLS | consistent ", end="")
    print("| torque error: OLS | consistent | ratio | ms: OLS | consistent | fill |")
    print("|---|---|---|---|---|---|---|---|---|---|---|---|---|")
    for c in cases:
        i, p, t, ms = (c[k] for k in ("impossible", "parameter_error", "torque_error", "milliseconds"))
        ratio = "" if c["torque_error_ratio"] is None else f"{c['torque_error_ratio']:.2f}"
        print(
            f"| {c['robot']} | {c['excitation']} | {c['noise']:.0%} | {i['ols']:.0%} | {i['consistent']:.0%} "
            f"| {p['ols']:.2g} | {p['consistent']:.2g} | {t['ols']:.2g} | {t['consistent']:.2g} | {ratio} "
            f"| {ms['ols']:.1f} | {ms['consistent']:.1f} | {ms['fill']:.1f} |"
        )
    print()
    print(
        "| arm, 10,000 samples | all rows, ms | factor, first time | again | repeated solve | times faster: first | again |"
    )
    print("|---|---|---|---|---|---|---|")
    for t in times:
        print(
            f"| {t['robot']} | {t['all_rows_ms']:.0f} | {t['compressed_first_ms']:.0f} | {t['compressed_ms']:.0f} "
            f"| {t['repeated_solve_ms']:.1f} | {t['times_faster_first']:.0f} | {t['times_faster']:.0f} |"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--draws", type=int, default=50, help="random arms per case")
    parser.add_argument("--robots", nargs="+", choices=MODELS, default=list(MODELS))
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1, help="processes of this machine")
    parser.add_argument("--scheduler", help="address of a Dask scheduler, in place of these")
    parser.add_argument("--quick", action="store_true", help="four draws, two arms, no timing against all rows")
    parser.add_argument("--output", type=Path, default=Path("benchmarks/results/consistency.json"))
    arguments = parser.parse_args()
    draws = 4 if arguments.quick else arguments.draws
    robots = arguments.robots[:2] if arguments.quick else arguments.robots

    times = [] if arguments.quick else [timings(name) for name in robots]
    each = [(name, excitation, noise) for name in robots for excitation in EXCITATION for noise in NOISE]
    jobs = [(*case, seed) for case in each for seed in range(draws)]
    found = run_all(draw, jobs, arguments.scheduler, workers=arguments.workers)
    cases = [summary(*case, found[k * draws : (k + 1) * draws]) for k, case in enumerate(each)]
    print_tables(cases, times)
    arguments.output.parent.mkdir(parents=True, exist_ok=True)
    arguments.output.write_text(json.dumps({"cases": cases, "timings": times}, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
