"""The recursion in square-root form beside the covariance form of the textbooks: rows a second, and digits."""

from __future__ import annotations

import time
from statistics import median
from typing import Any

import numpy as np
from identification import ARMS, multisine, robot_of

from scara_ident import Motion, build_model
from scara_ident.estimation.information import Information
from scara_ident.threads import one_blas_thread

Array = np.ndarray
SAMPLES, BLOCK = 4000, 512
# Of the covariance form: the identity times this before the first row.
FIRST_COVARIANCE = 1e8


def by_covariance(rows: Array, torque: Array) -> tuple[Array, Array]:
    """Return parameters and their covariance by recursive least squares, row by row."""
    value, covariance = np.zeros(rows.shape[1]), FIRST_COVARIANCE * np.eye(rows.shape[1])
    for row, measured in zip(rows, torque, strict=True):
        seen = covariance @ row
        gain = seen / (1.0 + row @ seen)
        value = value + gain * (measured - row @ value)
        covariance = covariance - np.outer(gain, seen)
    return value, covariance


def by_factor(rows: Array, torque: Array) -> tuple[Array, Array]:
    """Return the same by triangular factors of blocks of rows."""
    known = Information.empty(rows.shape[1])
    for start in range(0, len(rows), BLOCK):
        known = known.absorb(rows[start : start + BLOCK], torque[start : start + BLOCK])
    return known.solve().value, known.inverse()


def recursion(repeats: int) -> list[dict[str, Any]]:
    """Measure both on each arm."""
    found = []
    for name, arm in ARMS.items():
        model = build_model(robot_of(arm), "complete")
        time_ = np.arange(SAMPLES) / 100.0
        motion = Motion("sines", "sines", time_, *multisine(model.robot, 0, time_), None, 100.0)
        rows = np.concatenate(list(model.regressor(motion)), axis=1).T.copy()
        random = np.random.default_rng(0)
        rows = random.permutation(rows)
        torque = rows @ random.standard_normal(rows.shape[1])
        torque += 0.02 * torque.std() * random.standard_normal(len(torque))
        size = np.linalg.norm(rows, axis=0)
        exact = np.linalg.lstsq(rows / size, torque, rcond=None)[0] / size
        inverse = np.linalg.pinv(rows / size) / size[:, None]
        spread = np.einsum("pn,pn->p", inverse, inverse)
        row: dict[str, Any] = {"arm": name, "parameters": rows.shape[1], "rows": len(rows)}
        times: dict[str, list[float]] = {"covariance": [], "factor": []}
        with one_blas_thread():
            for _ in range(repeats):
                for way, function in (("covariance", by_covariance), ("factor", by_factor)):
                    start = time.perf_counter()
                    value, covariance = function(rows, torque)
                    times[way].append(time.perf_counter() - start)
                    # Parameters in units of their standard deviation times the root of rows: of the torque's size.
                    row[way] = {
                        "error": float(np.linalg.norm(rows @ (value - exact)) / np.linalg.norm(torque)),
                        "covariance_error": float(np.max(np.abs(np.diag(covariance) / spread - 1.0))),
                    }
        for way, each in times.items():
            row[way]["rows_per_second"] = len(rows) / median(each)
        found.append(row)
    return found
