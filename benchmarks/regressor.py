"""Microseconds a sample of the joint-torque regressor of a whole recording, by several ways, side by side.

All ways run in one process and one after the other within each repeat, so that they see the same machine; the table
gives medians over the repeats. Before anything is timed, the ways must agree with the loop to 1e-10 on the first
samples.

    python benchmarks/regressor.py [--samples 100000] [--repeats 5] [--output benchmarks/results/regressor.json]
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import time
from collections.abc import Callable
from importlib.metadata import distribution, version
from importlib.util import find_spec
from pathlib import Path
from statistics import median
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from scara_ident.model.regressor.kernel import build_kernel

Array = NDArray[np.float64]
ROOT = Path(__file__).resolve().parents[1]
WAYS = {
    "loop_vstack": "loop + vstack",
    "loop_preallocated": "loop, preallocated",
    "figaroh": "figaroh",
    "kernel": "kernel, new array",
    "kernel_out": "kernel, out=",
}
TARGETS = {"SCARA03": 20.0, "UR5": 5.0}


def scara03() -> pin.Model:
    model = pin.buildModelFromUrdf(str(ROOT / "urdf" / "scara03.urdf"))
    slides = [k for k in range(1, model.njoints) if model.joints[k].shortname().startswith("JointModelP")]
    return pin.buildReducedModel(model, slides, pin.neutral(model))


def example(path: str) -> pin.Model:
    robots = distribution("example-robot-data").locate_file("cmeel.prefix/share/example-robot-data/robots")
    return pin.buildModelFromUrdf(str(Path(str(robots)) / path))


ROBOTS: dict[str, Callable[[], pin.Model]] = {
    "SCARA03": scara03,
    "UR5": lambda: example("ur_description/urdf/ur5_robot.urdf"),
    "Panda": lambda: example("panda_description/urdf/panda.urdf"),
}


def ways(model: pin.Model, q: Array, v: Array, a: Array) -> dict[str, Callable[[], Array]]:
    """Return the ways to compute; each gives an array that `by_sample` understands."""
    samples = q.shape[1]
    data = model.createData()
    rows = [np.ascontiguousarray(part.T) for part in (q, v, a)]
    shape = (model.nv, 10 * (model.njoints - 1))
    # Filled, so that a given array is really in memory before the first repeat.
    stacked, batch = np.full((samples * shape[0], shape[1]), np.nan), np.full((*shape, samples), np.nan)
    kernel = build_kernel(model)
    compute = pin.computeJointTorqueRegressor

    def loop_vstack() -> Array:
        return np.vstack([compute(model, data, *state) for state in zip(*rows, strict=True)])

    def loop_preallocated() -> Array:
        for k, state in enumerate(zip(*rows, strict=True)):
            stacked[k * shape[0] : (k + 1) * shape[0]] = compute(model, data, *state)
        return stacked

    result: dict[str, Callable[[], Array]] = {
        "loop_vstack": loop_vstack,
        "loop_preallocated": loop_preallocated,
        "kernel": lambda: kernel(q, v, a),
        "kernel_out": lambda: kernel(q, v, a, out=batch),
    }
    if find_spec("figaroh"):
        from figaroh.tools.regressor import build_regressor_basic

        robot = SimpleNamespace(model=model, data=data)
        settings = {"act_idxv": list(range(model.nv))}
        result["figaroh"] = lambda: build_regressor_basic(robot, *rows, settings)
    return result


def by_sample(way: str, result: Array, nv: int) -> Array:
    """Bring a result to (samples, nv, columns); figaroh stacks joint after joint, in an order of its own."""
    if way.startswith("kernel"):
        return np.moveaxis(result, -1, 0)
    if way == "figaroh":
        return np.moveaxis(result.reshape(nv, -1, result.shape[1]), 0, 1)
    return result.reshape(-1, nv, result.shape[1])


def disagreement(model: pin.Model, q: Array, v: Array, a: Array) -> float:
    """Largest difference from the loop, relative to the largest entry, over all ways and the first samples."""
    results = {
        way: by_sample(way, compute(), model.nv)
        for way, compute in ways(model, q[:, :200], v[:, :200], a[:, :200]).items()
    }
    truth = results["loop_vstack"]
    return max(float(np.abs(result - truth).max() / np.abs(truth).max()) for result in results.values())


def measure(name: str, samples: int, repeats: int) -> dict[str, Any]:
    model = ROBOTS[name]()
    generator = np.random.default_rng(0)
    q, v, a = (generator.uniform(-bound, bound, (model.nv, samples)) for bound in (3.0, 3.0, 10.0))
    building = []
    for _ in range(5):
        start = time.perf_counter()
        build_kernel(model)
        building.append(1e3 * (time.perf_counter() - start))
    times: dict[str, list[float]] = {}
    computations = ways(model, q, v, a)
    difference = disagreement(model, q, v, a)
    if not difference <= 1e-10:
        raise SystemExit(f"{name}: the ways differ by {difference:.1e} relative, so their times mean nothing")
    for _ in range(repeats):
        for way, compute in computations.items():
            start = time.perf_counter()
            compute()
            times.setdefault(way, []).append(1e6 * (time.perf_counter() - start) / samples)
    micro = {way: median(values) for way, values in times.items()}
    ratios = [slow / fast for slow, fast in zip(times["loop_vstack"], times["kernel_out"], strict=True)]
    return {
        "joints": model.nv,
        "columns": 10 * (model.njoints - 1),
        "microseconds_per_sample": micro,
        "ratio_to_loop_vstack": {
            "kernel_out": median(ratios),
            "kernel_out_worst_repeat": min(ratios),
            "kernel": micro["loop_vstack"] / micro["kernel"],
        },
        "target_ratio": TARGETS.get(name),
        "build_ms": median(building),
        "largest_relative_difference": difference,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--samples", type=int, default=100_000)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--output", type=Path, default=ROOT / "benchmarks" / "results" / "regressor.json")
    options = parser.parse_args()
    robots = {name: measure(name, options.samples, options.repeats) for name in ROBOTS}
    present = [way for way in WAYS if way in robots["SCARA03"]["microseconds_per_sample"]]
    print(f"us a sample at {options.samples} samples, medians of {options.repeats} repeats, one process, one thread")
    print(f"{'':10}" + "".join(f"{WAYS[way]:>20}" for way in present) + f"{'ratio':>9}{'target':>8}{'build ms':>10}")
    for name, result in robots.items():
        figures = "".join(f"{result['microseconds_per_sample'][way]:20.3f}" for way in present)
        target = f"{result['target_ratio']:.0f}" if result["target_ratio"] else "-"
        ratio = result["ratio_to_loop_vstack"]["kernel_out"]
        print(f"{name:10}{figures}{ratio:9.1f}{target:>8}{result['build_ms']:10.1f}")
    print("ratio: loop + vstack over kernel into a given array, median over the repeats")
    if "figaroh" not in present:
        print("figaroh is not installed: no column for it")
    report = {
        "samples": options.samples,
        "repeats": options.repeats,
        "threads": 1,
        "machine": {"processor": platform.processor() or platform.machine(), "cores": os.cpu_count()},
        "versions": {name: version(name) for name in ("pin", "numpy", *(["figaroh"] if "figaroh" in present else []))},
        "robots": robots,
    }
    options.output.parent.mkdir(parents=True, exist_ok=True)
    options.output.write_text(json.dumps(report, indent=2) + "\n")
    print(f"written to {options.output}")


if __name__ == "__main__":
    main()
