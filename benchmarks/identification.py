"""Microseconds a sample from recordings in memory to parameters, their standard deviations and errors.

`identify` against the plain way: zero-phase filter, central differences, a Python loop over Pinocchio's regressor into one
stacked regressor with friction columns, QR of all rows; and against the same with friction's columns made outside of the
loop. All run in one process with one BLAS thread, in turn within each repeat, from the same recordings; `identify` works in two
Python threads, as it does for its user, and beyond the plain way chooses bands and base columns, weighs what noise of the
positions does, tests runs and clocks, and gives a covariance that correlation does not spoil. Loading the robot
is not timed, nor, for the plain ways alone, choosing base columns. All must predict the torque of another motion alike,
else their times mean nothing.

    python benchmarks/identification.py [--repeats 5] [--output benchmarks/results/identification.json]
    python benchmarks/identification.py --profile UR5
"""

from __future__ import annotations

import argparse
import cProfile
import json
import os
import pstats
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.metadata import distribution
from pathlib import Path
from statistics import median
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.linalg import qr as pivoted_qr
from scipy.signal import butter, filtfilt

from scara_ident import Motion, Recording, Robot, identify, load_robot

Array = NDArray[np.float64]
Stack = Callable[[Robot, Array, Array, Array, Array], None]
ROBOTS = Path(str(distribution("example-robot-data").locate_file("cmeel.prefix/share/example-robot-data/robots")))
RATE = 1000.0
# Of the plain way: Hz, and the order of its Butterworth filter.
CUT_OFF, ORDER = 20.0, 4
# Samples at either end that the filter spoils.
END = 250
# Standard deviation of the position, rad, and of the torque as a share of each joint's.
POSITION_NOISE, TORQUE_NOISE = 2e-6, 0.02
AGREEMENT = 0.05


@dataclass(frozen=True)
class Arm:
    """A robot, how it is recorded, and how much faster than the plain way `identify` is to be."""

    urdf: str | None
    joints: tuple[str, ...]
    trajectories: int
    seconds: float
    target: float


ARMS = {
    "SCARA03": Arm(None, (), 5, 25.0, 10.0),
    "UR5": Arm("ur_description/urdf/ur5_robot.urdf", (), 2, 20.0, 8.0),
    "Panda": Arm("panda_description/urdf/panda.urdf", tuple(f"panda_joint{k}" for k in range(1, 8)), 2, 20.0, 6.0),
}
REPETITIONS = 2


def robot_of(arm: Arm) -> Robot:
    """Load a robot; where joints are named every other one is locked."""
    if arm.urdf is None:
        return load_robot()
    if not arm.joints:
        return load_robot(ROBOTS / arm.urdf)
    with tempfile.TemporaryDirectory() as folder:
        description = Path(folder) / "robot.yaml"
        content = {"urdf": str(ROBOTS / arm.urdf), "effort_side": "joint", "joints": {name: {} for name in arm.joints}}
        description.write_text(json.dumps(content), encoding="utf-8")
        return load_robot(description)


def multisine(robot: Robot, seed: int, time_: Array) -> tuple[Array, Array, Array]:
    """Return position, velocity and acceleration of ten harmonics of 0.1 Hz within the limits, shapes (n, N)."""
    random = np.random.default_rng(seed)
    order = np.arange(1, 11)
    omega = 2.0 * np.pi * 0.1 * order
    amplitude = random.normal(size=(robot.n, 10)) / order
    angle = omega[:, None] * time_ + random.uniform(0.0, 2.0 * np.pi, (robot.n, 10, 1))
    q, v, a = (
        np.einsum("jk,jkt->jt", amplitude * omega**power, wave)
        for power, wave in ((0, np.sin(angle)), (1, np.cos(angle)), (2, -np.sin(angle)))
    )
    lower, upper = np.maximum(robot.lower, -2.0), np.minimum(robot.upper, 2.0)
    reach = np.minimum(0.45 * (upper - lower) / np.abs(q).max(axis=1), 2.0 / np.abs(v).max(axis=1))[:, None]
    return 0.5 * (lower + upper)[:, None] + reach * q, reach * v, reach * a


def rigid_torque(robot: Robot, q: Array, v: Array, a: Array) -> Array:
    """Return the torque of bodies and armatures on the recorded side, shape (n, N)."""
    data = robot.model.createData()
    states = zip(*(np.ascontiguousarray(signal.T) for signal in (q, v, a)), strict=True)
    torque = np.array([pin.rnea(robot.model, data, *state) for state in states]).T
    return robot.row_scale[:, None] * (torque + (robot.reduction**2 * robot.rotor_inertia)[:, None] * a)


def friction_size(robot: Robot) -> Array:
    """Return what friction is a share of, shape (n, 1): a light wrist has more of it than its share of the load."""
    size = np.sqrt(np.mean(rigid_torque(robot, *multisine(robot, 0, np.arange(1000) / 100.0)) ** 2, axis=1))
    return np.maximum(size, 0.05 * size.max())[:, None]


def true_torque(robot: Robot, q: Array, v: Array, a: Array) -> Array:
    """Return the torque with Coulomb and viscous friction and offset."""
    return rigid_torque(robot, q, v, a) + friction_size(robot) * (0.2 * np.sign(v) + 0.1 * v + 0.02)


def recordings_of(robot: Robot, arm: Arm) -> list[Recording]:
    """Return recordings with noise, every trajectory repeated."""
    random = np.random.default_rng(1)
    time_ = np.arange(round(arm.seconds * RATE)) / RATE
    made = []
    for k in range(arm.trajectories):
        q, v, a = multisine(robot, k, time_)
        torque = true_torque(robot, q, v, a)
        noise = TORQUE_NOISE * torque.std(axis=1, keepdims=True)
        for repetition in range(1, REPETITIONS + 1):
            made.append(
                Recording(
                    name=f"M{k}_{repetition}",
                    trajectory=f"M{k}",
                    repetition=repetition,
                    joints=robot.joints,
                    time=time_,
                    position=q + POSITION_NOISE * random.normal(size=q.shape),
                    effort=torque + noise * random.normal(size=q.shape),
                )
            )
    return made


def sample_by_sample(robot: Robot, q: Array, v: Array, a: Array, rows: Array) -> None:
    """Fill the rows of bodies, armatures, friction and offset (as in the model `complete`) in one loop."""
    model, n, scale = robot.model, robot.n, robot.row_scale
    data = model.createData()
    states = zip(*(np.ascontiguousarray(signal.T) for signal in (q, v, a)), strict=True)
    for k, (position, velocity, acceleration) in enumerate(states):
        block = rows[k * n : (k + 1) * n]
        block[:, : 10 * n] = pin.computeJointTorqueRegressor(model, data, position, velocity, acceleration)
        sign = np.sign(velocity)
        for j in range(n):
            first = 11 * n + 5 * j
            speed = velocity[j]
            block[j, : 10 * n] *= scale[j]
            block[j, 10 * n + j] = scale[j] * acceleration[j]
            block[j, first : first + 5] = sign[j], speed, sign[j] * speed**2, speed**3, 1.0


def friction_at_once(robot: Robot, q: Array, v: Array, a: Array, rows: Array) -> None:
    """Fill the same rows with only Pinocchio's regressor in the loop."""
    model, n = robot.model, robot.n
    data = model.createData()
    states = zip(*(np.ascontiguousarray(signal.T) for signal in (q, v, a)), strict=True)
    for k, state in enumerate(states):
        rows[k * n : (k + 1) * n, : 10 * n] = pin.computeJointTorqueRegressor(model, data, *state)
    by_joint = rows.reshape(-1, n, 16 * n)
    for j, speed in enumerate(v):
        first = 11 * n + 5 * j
        sign = np.sign(speed)
        by_joint[:, j, 10 * n + j] = a[j]
        by_joint[:, j, : 11 * n] *= robot.row_scale[j]
        by_joint[:, j, first : first + 5] = np.stack([sign, speed, sign * speed**2, speed**3, speed**0], axis=1)


def base_columns(robot: Robot) -> Array:
    """Return which columns are independent, by a pivoted QR of random states."""
    random = np.random.default_rng(0)
    rows = np.zeros((200 * robot.n, 16 * robot.n))
    friction_at_once(robot, *random.uniform(-2.0, 2.0, (3, robot.n, 200)), rows)
    rigid = rows[:, : 11 * robot.n]
    _, r, order = pivoted_qr(rigid, mode="economic", pivoting=True)
    size = np.abs(np.diag(r))
    return np.concatenate([np.sort(order[size > 1e-5 * size[0]]), np.arange(11 * robot.n, 16 * robot.n)])


def plain(
    robot: Robot, recordings: Sequence[Recording], kept: Array, stack: Stack
) -> tuple[Array, Array, dict[str, Array]]:
    """Identify the plain way: parameters, standard deviations, and each recording's rms error per joint."""
    numerator, denominator = butter(ORDER, 2.0 * CUT_OFF / RATE)
    n = robot.n
    lengths = [n * (len(recording.time) - 2 * END) for recording in recordings]
    ends = np.cumsum(lengths)
    places = [slice(end - length, end) for end, length in zip(ends, lengths, strict=True)]
    rows, torque = np.zeros((ends[-1], 16 * n)), np.empty(ends[-1])
    inside = slice(END, -END)
    for recording, place in zip(recordings, places, strict=True):
        q = filtfilt(numerator, denominator, recording.position)
        v = np.gradient(q, recording.time, axis=1)
        a = np.gradient(v, recording.time, axis=1)
        stack(robot, q[:, inside], v[:, inside], a[:, inside], rows[place])
        torque[place] = filtfilt(numerator, denominator, recording.effort)[:, inside].T.ravel()
    # The torque as one more column: no orthogonal factor has to be formed.
    rows = np.column_stack([rows[:, kept], torque])
    triangle = np.linalg.qr(rows, mode="r")
    inverse = np.linalg.inv(triangle[:-1, :-1])
    value = inverse @ triangle[:-1, -1]
    residual = rows @ np.append(-value, 1.0)
    std = np.sqrt(residual @ residual / (len(torque) - len(value)) * np.sum(inverse**2, axis=1))
    errors = [np.sqrt(np.mean(residual[place].reshape(-1, n) ** 2, axis=0)) for place in places]
    return value, std, dict(zip([recording.name for recording in recordings], errors, strict=True))


def by_identify(robot: Robot, recordings: Sequence[Recording], method: str) -> tuple[Any, Array, Any]:
    """Identify with the package: the same three results, the first with the model that they belong to."""
    result = identify(robot, recordings, model="complete", method=method)
    return result, result.estimate.std, result.training_errors()


def disagreement(robot: Robot, result: Any, value: Array, kept: Array) -> tuple[float, float, float]:
    """Return how far the torques of a motion that neither saw lie apart, and each from the truth, relative rms."""
    time_ = np.arange(2000) / 200.0
    q, v, a = multisine(robot, 99, time_)
    motion = Motion(name="M", trajectory="M", time=time_, q=q, v=v, a=a, torque=None, rate=200.0)
    ours = np.einsum("jpt,p->jt", result.model.regressor(motion), result.estimate.value)
    rows = np.zeros((q.size, 16 * robot.n))
    friction_at_once(robot, q, v, a, rows)
    theirs = (rows[:, kept] @ value).reshape(-1, robot.n).T
    truth = true_torque(robot, q, v, a)
    size = np.sqrt(np.mean(truth**2, axis=1))
    first, second, third = (
        float(np.max(np.sqrt(np.mean((x - y) ** 2, axis=1)) / size))
        for x, y in ((ours, theirs), (ours, truth), (theirs, truth))
    )
    return first, second, third


def measure(name: str, repeats: int, method: str) -> dict[str, Any]:
    """Time both ways in turn."""
    arm = ARMS[name]
    robot = robot_of(arm)
    recordings = recordings_of(robot, arm)
    samples = sum(len(recording.time) for recording in recordings)
    kept = base_columns(robot)
    ways: dict[str, Callable[[], Any]] = {
        "identify": lambda: by_identify(robot, recordings, method),
        "plain": lambda: plain(robot, recordings, kept, sample_by_sample),
        "plain_friction_at_once": lambda: plain(robot, recordings, kept, friction_at_once),
    }
    result, *others = (compute()[0] for compute in ways.values())
    if not np.allclose(*others, rtol=1e-6):
        raise SystemExit(f"{name}: the two plain ways differ")
    apart, ours, theirs = disagreement(robot, result, others[0], kept)
    if not apart <= AGREEMENT:
        raise SystemExit(f"{name}: predicted torques differ by {apart:.1%}, so their times mean nothing")
    times: dict[str, list[float]] = {way: [] for way in ways}
    for _ in range(repeats):
        for way, compute in ways.items():
            began = time.perf_counter()
            compute()
            times[way].append(1e6 * (time.perf_counter() - began) / samples)
    ratios = {
        way: [slow / fast for slow, fast in zip(times[way], times["identify"], strict=True)]
        for way in ways
        if way != "identify"
    }
    return {
        "joints": robot.n,
        "recordings": len(recordings),
        "samples": samples,
        "microseconds_per_sample": {way: median(values) for way, values in times.items()},
        "ratio": {way: median(values) for way, values in ratios.items()},
        "worst_ratio": {way: min(values) for way, values in ratios.items()},
        "target": arm.target,
        "relative_difference": {"between": apart, "identify_to_truth": ours, "plain_to_truth": theirs},
    }


def profile(name: str, method: str) -> None:
    """Print where `identify` spends its time, after a first run that compiles and imports."""
    robot = robot_of(ARMS[name])
    recordings = recordings_of(robot, ARMS[name])
    by_identify(robot, recordings, method)
    profiler = cProfile.Profile()
    profiler.runcall(by_identify, robot, recordings, method)
    for key in ("cumulative", "tottime"):
        pstats.Stats(profiler).strip_dirs().sort_stats(key).print_stats(30)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", nargs="*", choices=list(ARMS), default=list(ARMS))
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--method", default="ols", help="of identify; the plain way is unweighted least squares")
    parser.add_argument("--profile", choices=list(ARMS), help="print a profile of identify for this robot and stop")
    parser.add_argument("--output", type=Path, help="JSON of the figures")
    options = parser.parse_args()
    if options.profile:
        profile(options.profile, options.method)
        return
    robots = {name: measure(name, options.repeats, options.method) for name in options.robots}
    print(f"us a sample, medians of {options.repeats} repeats, one process, one BLAS thread, method {options.method}")
    print(
        f"{'':10}{'samples':>9}{'identify':>10}{'plain':>9}{'at once':>9}{'ratio':>8}{'at once':>9}{'target':>8}{'apart':>8}"
    )
    for name, result in robots.items():
        times = "".join(f"{value:9.2f}" for value in result["microseconds_per_sample"].values())
        ratio, at_once = result["ratio"].values()
        apart = result["relative_difference"]["between"]
        print(f"{name:10}{result['samples']:9d} {times}{ratio:8.2f}{at_once:9.2f}{result['target']:8.0f}{apart:8.2%}")
    print(
        "ratio: plain over identify, median over the repeats; at once: friction columns made outside of the plain loop;"
    )
    print("apart: predicted torques of both, worst joint, rms over rms")
    if options.output:
        options.output.parent.mkdir(parents=True, exist_ok=True)
        content = {"repeats": options.repeats, "method": options.method, "cores": os.cpu_count(), "robots": robots}
        options.output.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
