"""One way from arrays to parameters, in a process of its own: its time, its memory and what it predicts, as JSON.

`figaroh` runs where figaroh is installed, which need not be where this package is: for it and for the plain loop this file
needs no more than numpy, scipy and pinocchio. `benchmarks/bench.py` calls it.

    python benchmarks/ways.py --way loop --urdf arm.urdf --joints joint1 joint2 --samples 100000 --predicted out.npy
"""

from __future__ import annotations

import argparse
import json
import logging
import re
import time
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin

Array = np.ndarray
RATE, PERIOD = 1000.0, 10_000
TORQUE_NOISE = 0.02
# Samples of the motion on which predictions are compared, and of the first call, which imports and compiles.
HELD_OUT, FIRST = 2000, 64
BLOCKS = ("has_friction", "has_actuator_inertia", "has_joint_offset")


def model_of(urdf: str, joints: Sequence[str]) -> pin.Model:
    """Load a URDF with all other joints locked at zero."""
    model = pin.buildModelFromUrdf(urdf)
    return pin.buildReducedModel(
        model, [k for k in range(1, model.njoints) if model.names[k] not in joints], pin.neutral(model)
    )


def arrays_of(model: pin.Model, samples: int, seed: int) -> tuple[Array, Array, Array, Array]:
    """Return position, velocity, acceleration and torque, shape (n, N): ten sines of 0.1 Hz and its multiples, over and over."""
    random = np.random.default_rng(seed)
    order = np.arange(1, 11)
    omega = 0.2 * np.pi * order
    angle = omega[:, None] * np.arange(PERIOD) / RATE + random.uniform(0.0, 2.0 * np.pi, (model.nv, 10, 1))
    size = random.normal(size=(model.nv, 10)) / order
    q, v, a = (
        np.einsum("jk,jkt->jt", size * omega**power, wave)
        for power, wave in ((0, np.sin(angle)), (1, np.cos(angle)), (2, -np.sin(angle)))
    )
    reach = np.minimum(2.0 / np.abs(q).max(axis=1), 2.0 / np.abs(v).max(axis=1))[:, None]
    q, v, a = reach * q, reach * v, reach * a
    data = model.createData()
    states = zip(*(np.ascontiguousarray(signal.T) for signal in (q, v, a)), strict=True)
    torque = np.array([pin.rnea(model, data, *state) for state in states]).T
    load = np.maximum(torque.std(axis=1), 0.05 * torque.std(axis=1).max())[:, None]
    torque = torque + load * (0.2 * np.sign(v) + 0.1 * v + 0.02) + 0.05 * a
    times = -(-samples // PERIOD)
    q, v, a, torque = (np.tile(signal, times)[:, :samples].copy() for signal in (q, v, a, torque))
    for row, sigma in zip(torque, TORQUE_NOISE * load[:, 0], strict=True):
        row += sigma * random.standard_normal(samples)
    return q, v, a, torque


def prepared_loop(model: pin.Model) -> Callable[..., Any]:
    """Return the plain way: Pinocchio's regressor state by state into one array, friction beside it, `numpy.linalg.qr`.

    Which columns are independent is found before, from random states. States come as rows.
    """
    from scipy.linalg import qr

    n = model.nv
    data = model.createData()

    def stacked(q: Array, v: Array, a: Array) -> Array:
        rows = np.zeros((len(q), n, 14 * n))
        for k in range(len(q)):
            rows[k, :, : 10 * n] = pin.computeJointTorqueRegressor(model, data, q[k], v[k], a[k])
        for j in range(n):
            for k, column in enumerate((a, v, np.sign(v))):
                rows[:, j, (10 + k) * n + j] = column[:, j]
            rows[:, j, 13 * n + j] = 1.0
        return rows.reshape(-1, 14 * n)

    random = np.random.default_rng(0).uniform(-2.0, 2.0, (3, 300, n))
    triangle, order = qr(stacked(*random), mode="r", pivoting=True)
    size = np.abs(np.diag(triangle))
    kept = np.sort(order[: len(size)][size > 1e-8 * size[0]])

    def identified(q: Array, v: Array, a: Array, torque: Array) -> Any:
        rows = stacked(q, v, a)
        table = np.empty((len(rows), len(kept) + 1))
        table[:, :-1], table[:, -1] = rows[:, kept], torque.ravel()
        del rows
        triangle = np.linalg.qr(table, mode="r")
        value = np.linalg.solve(triangle[:-1, :-1], triangle[:-1, -1])
        return lambda *states: (stacked(*states)[:, kept] @ value).reshape(-1, n)

    return identified


def figaroh_columns(model: pin.Model) -> tuple[Callable[..., Array], dict[str, float]]:
    """Return figaroh's regressor of states, and its standard parameters with their values."""
    from figaroh.identification.parameter import add_standard_additional_parameters, get_standard_parameters
    from figaroh.tools.regressor import build_regressor_basic

    settings = {"act_idxv": list(range(model.nv))} | dict.fromkeys(BLOCKS, True)
    robot = SimpleNamespace(model=model, data=model.createData())
    standard = get_standard_parameters(model, settings) | add_standard_additional_parameters(model, settings)
    return lambda q, v, a: build_regressor_basic(robot, q, v, a, settings), standard


def prepared_figaroh(model: pin.Model) -> Callable[..., Any]:
    """Return figaroh's way: its regressor, its choice of columns, its double QR."""
    from figaroh.tools.qrdecomposition import QRDecomposer
    from figaroh.tools.regressor import build_regressor_reduced, get_index_eliminate

    columns, standard = figaroh_columns(model)

    def identified(q: Array, v: Array, a: Array, torque: Array) -> Any:
        rows = columns(q, v, a)
        left_out, active = get_index_eliminate(rows, standard, 1e-6)
        reduced = build_regressor_reduced(rows, left_out)
        decomposer = QRDecomposer(tolerance=1e-6)
        *_, value = decomposer.double_decomposition(torque.T.ravel(), reduced, active)
        base = decomposer.get_base_indices()

        def predict(*states: Array) -> Array:
            found = build_regressor_reduced(columns(*states), left_out)[:, base] @ value
            return np.asarray(found.reshape(model.nv, -1).T)

        return predict

    return identified


def prepared_figaroh_consistent(model: pin.Model) -> Callable[..., Any]:
    """Return figaroh's fit of effort under a pseudo-inertia matrix for each link (`solve_direct_effort_fit`)."""
    from figaroh.identification.physical_fit import build_problem, solve_direct_effort_fit

    columns, standard = figaroh_columns(model)
    prior = np.array(list(standard.values()), dtype=float)

    def identified(q: Array, v: Array, a: Array, torque: Array) -> Any:
        rows = columns(q, v, a)
        problem = build_problem(rows, torque.T.ravel(), list(standard), list(model.names)[1:], prior=prior)
        record = solve_direct_effort_fit(problem)
        if record.theta is None:
            raise SystemExit(f"figaroh: {record.solver_status}: {record.exception}")
        return lambda *states: (columns(*states) @ record.theta).reshape(model.nv, -1).T

    return identified


def robot_of(urdf: str, joints: Sequence[str]) -> Any:
    """Return the package's robot: the same joints, torque on their side."""
    import tempfile

    from scara_ident import load_robot

    with tempfile.TemporaryDirectory() as folder:
        description = Path(folder) / "robot.yaml"
        content = {"urdf": urdf, "effort_side": "joint", "joints": {name: {} for name in joints}}
        description.write_text(json.dumps(content), encoding="utf-8")
        return load_robot(description)


def prepared_package(urdf: str, joints: Sequence[str], consistent: bool) -> Callable[..., Any]:
    """Return this package's way: columns made, absorbed and forgotten; or the consistent programme on their factor."""
    from scara_ident import Motion, build_model
    from scara_ident.estimation.consistent.problem import Problem
    from scara_ident.estimation.consistent.solution import solve_consistent
    from scara_ident.estimation.from_motion import information_of
    from scara_ident.estimation.information import merge
    from scara_ident.threads import one_blas_thread

    model = build_model(robot_of(urdf, joints), "basic")

    def motion_of(q: Array, v: Array, a: Array, torque: Array | None) -> Motion:
        return Motion("arrays", "arrays", np.arange(q.shape[1]) / RATE, q, v, a, torque, RATE)

    def identified(q: Array, v: Array, a: Array, torque: Array) -> Any:
        with one_blas_thread():
            information = merge(information_of(model, motion_of(q, v, a, torque)))
            if consistent:
                solver = Problem(model)
                value = solver.unknowns.parameters(solve_consistent(solver, information).x)
            else:
                value = information.solve().value
        return lambda *states: np.einsum("jpt,p->tj", model.regressor(motion_of(*states, None)), value)

    return identified


def high_water(path: Path = Path("/proc/self/status")) -> tuple[float, float]:
    """Return the memory in use and the most since it was reset, MB."""
    found = dict(re.findall(r"(VmHWM|VmRSS):\s+(\d+) kB", path.read_text(encoding="utf-8")))
    return int(found["VmRSS"]) / 1024.0, int(found["VmHWM"]) / 1024.0


def main() -> None:
    """Run one way once."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    ways = ("scara_ident", "scara_ident_consistent", "loop", "figaroh", "figaroh_consistent")
    parser.add_argument("--way", choices=ways, required=True)
    parser.add_argument("--urdf", type=lambda text: str(Path(text).resolve()), required=True)
    parser.add_argument("--joints", nargs="+", required=True)
    parser.add_argument("--samples", type=int, required=True)
    parser.add_argument("--predicted", type=Path, required=True)
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    logging.disable(logging.CRITICAL)
    model = model_of(options.urdf, options.joints)
    arrays, held_out = arrays_of(model, options.samples, 0), arrays_of(model, HELD_OUT, 1)
    by_column = options.way.startswith("scara_ident")
    if by_column:
        identified = prepared_package(options.urdf, options.joints, options.way.endswith("consistent"))
    else:
        prepare = {
            "loop": prepared_loop,
            "figaroh": prepared_figaroh,
            "figaroh_consistent": prepared_figaroh_consistent,
        }
        identified = prepare[options.way](model)
        arrays, held_out = (tuple(np.ascontiguousarray(x.T) for x in each) for each in (arrays, held_out))
    first = slice(0, FIRST)
    identified(*(np.ascontiguousarray(x[:, first] if by_column else x[first]) for x in arrays))
    Path("/proc/self/clear_refs").write_text("5", encoding="utf-8")
    before, _ = high_water()
    start = time.perf_counter(), time.process_time()
    predict = identified(*arrays)
    seconds, cpu = time.perf_counter() - start[0], time.process_time() - start[1]
    _, most = high_water()
    np.save(options.predicted, predict(*held_out[:3]))
    truth = held_out[3] if not by_column else held_out[3].T
    np.save(options.predicted.with_suffix(".truth.npy"), truth)
    print(json.dumps({"seconds": seconds, "cpu_seconds": cpu, "extra_mb": most - before}))


if __name__ == "__main__":
    main()
