"""Recordings made for tests: a two-joint arm on quantised encoders with noisy efforts, as columns of a file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import polars as pl
from numpy.typing import NDArray

COUNT = 2 * np.pi / (4096 * 100)


def columns(
    samples: int = 4000, interval: float = 1e-3, seed: int = 0, time: NDArray[np.float64] | None = None
) -> dict[str, NDArray[np.float64]]:
    """Return the columns of a faultless recording within the SCARA03's limits, sampled at times that may be given."""
    random = np.random.default_rng(seed)
    time = interval * np.arange(samples) if time is None else time
    samples = len(time)
    made = {"time": time}
    for joint, (middle, amplitude, frequency) in {"joint1": (1.5, 1.2, 0.35), "joint2": (0.1, 1.0, 0.45)}.items():
        phase = 2 * np.pi * frequency * time
        made[f"{joint}.position"] = COUNT * np.rint((middle + amplitude * np.sin(phase)) / COUNT)
        made[f"{joint}.effort"] = 0.4 * np.cos(phase) + 0.02 * random.standard_normal(samples)
    return made


def save(path: Path, made: dict[str, NDArray[np.float64]]) -> Path:
    """Write columns to a file by another way than the package's."""
    frame = pl.DataFrame(made)
    if path.suffix == ".csv":
        frame.write_csv(path)
    else:
        frame.write_parquet(path)
    return path
