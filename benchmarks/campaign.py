"""Run the paper's campaign on the virtual SCARA03 and ask which of its conclusions hold, and what its arm hid.

Run ``python benchmarks/campaign.py [--effect NAME:JOINT:KEY=VALUE ...] [--output FILE.json]``; the figures of the
JSON are made by ``campaign_figures.py``.

1. Scan: one noise-free repetition of the five trajectories for every effect of the catalogue at three sizes on every
   joint that can have it. Tables 2, 4 and 5 follow as the paper made them, least squares on 2500 unfiltered samples,
   with noise of Table 1's size drawn on top: on the parameters, where white noise ends up by
   ``A^-1 sum_j sigma_j W_j' e_j``, and on the torque that is predicted. All scenes share the same draws. Their distance
   from the printed tables is the rms of log10(virtual / printed) over the error cells.
2. Campaign: six noisy repetitions, without an effect and with the one that came nearest (or those given), through
   `compare` for OLS complete, OLS reduced and consistent. Errors are those of the unfiltered torque, as the paper's.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scara_ident.comparison import Comparison, compare
from scara_ident.evidence import Evidence, gather_all
from scara_ident.indri2002 import REDUCED, TABLE_1, TABLE_2, TABLE_4, TABLE_5, TORQUE_RMS, TRAJECTORIES
from scara_ident.information import merge
from scara_ident.model import build_model
from scara_ident.recording import Recording
from scara_ident.virtual import CATALOGUE, Effect, VirtualArm, parse_effect, simulate, virtual_arm
from scara_ident.virtual.named import named_motion

Array = NDArray[np.float64]

METHODS = (("complete", "ols"), ("reduced", "ols"), ("complete", "consistent"))
PAPER_SAMPLES = 2500
DRAWS = 200
SIGNIFICANT = 0.05
# How often each default size; a negative factor where the effect's sign matters.
FACTORS = (0.5, 1.0, 3.0)
SIGNED_FACTORS = (-1.0, 1.0, 3.0)
FINER = (0.6, 1.7)
REFINED = 3
SIGNED = (
    "asymmetric_friction",
    "base_tilt",
    "friction_coupling",
    "offset_drift",
    "spring",
    "time_delay",
    "torque_gain_mismatch",
    "torque_sensor_nonlinearity",
    "warm_up",
)
SIZE: dict[str, tuple[str, ...]] = {
    "asymmetric_friction": ("viscous_difference",),
    "backlash": ("width",),
    "base_tilt": ("tilt_x", "tilt_y"),
    "encoder_eccentricity": ("amplitude",),
    "friction_coupling": ("viscous", "coulomb"),
    "joint_elasticity": ("stiffness",),
    "offset_drift": ("rate",),
    "payload_change": ("mass",),
    "position_dependent_friction": ("share",),
    "presliding": ("presliding_distance",),
    "spring": ("stiffness",),
    "stribeck": ("amplitude",),
    "time_delay": ("delay",),
    "torque_gain_mismatch": ("ratio",),
    "torque_ripple": ("amplitude",),
    "torque_sensor_nonlinearity": ("cubic",),
    "transmission_loss": ("loss_coefficient",),
    "vibration": ("amplitude",),
    "warm_up": ("share",),
}


@dataclass(frozen=True, eq=False)
class Tables:
    """What the paper prints of a campaign; trajectories in the order they were given.

    Attributes
    ----------
    log_det, condition : ndarray, shape (t,)
        J_d and J_k of the complete model.
    torque_rms : ndarray, shape (t, n)
    complete, reduced : ndarray, shape (t, t, n)
        ``[i, k, j]``: rms error on trajectory i, joint j, of the parameters from trajectory k (Tables 2 and 4).
    parameters : ndarray, shape (10, t)
        Of the reduced model (Table 5).
    """

    log_det: Array
    condition: Array
    torque_rms: Array
    complete: Array
    reduced: Array
    parameters: Array

    def as_dict(self) -> dict[str, Any]:
        return {name: np.asarray(getattr(self, name)).tolist() for name in self.__dataclass_fields__}


def printed(names: Sequence[str] = TRAJECTORIES) -> Tables:
    """Return the printed tables for some of the trajectories."""
    t = [TRAJECTORIES.index(name) for name in names]
    cells = [np.moveaxis(np.array(table.errors), 0, -1)[np.ix_(t, t)] for table in (TABLE_2, TABLE_4)]
    return Tables(
        np.array(TABLE_1.log_det)[t],
        np.array(TABLE_1.condition)[t],
        np.array(TORQUE_RMS).T[t],
        cells[0],
        cells[1],
        np.array(TABLE_5)[:, t],
    )


def sigma_of(names: Sequence[str]) -> Array:
    """Return Table 1's noise, shape (t, n)."""
    return np.array(TABLE_1.sigma).T[[TRAJECTORIES.index(name) for name in names]]


def sized(arm: VirtualArm, kind: type[Effect], factor: float) -> tuple[Effect, ...]:
    """Return an effect at a multiple of its default size, on every joint that can have it."""
    joints: Sequence[str | None] = arm.robot.joints
    if kind.whole_arm != "never":
        joints = (None,)
    elif kind.name == "torque_gain_mismatch":
        joints = arm.robot.joints[1:]
    effects = []
    for joint in joints:
        effect = kind(joint=joint).resolve(arm)
        values = {key: float(getattr(effect, key)) for key in SIZE[kind.name]}
        if kind.name == "joint_elasticity":  # The softer the larger.
            values = {key: value / factor for key, value in values.items()}
        elif kind.name == "torque_gain_mismatch":
            values = {key: 1.0 + factor * (value - 1.0) for key, value in values.items()}
        else:
            values = {key: factor * value for key, value in values.items()}
            if kind.name == "position_dependent_friction":
                values["share"] = min(values["share"], kind.bounds["share"][1])
        effects.append(replace(effect, **values))
    return tuple(effects)


def repetitions(
    arm: VirtualArm, names: Sequence[str], effects: Sequence[Effect], count: int, *, noisy: bool, seed: int = 0
) -> list[Recording]:
    """Simulate repetitions of trajectories, with Table 1's noise on each or with none."""
    noise = sigma_of(names) if noisy else np.zeros((len(names), arm.robot.n))
    return [
        simulate(
            replace(arm, torque_noise=noise[k]),
            named_motion(name, arm.robot),
            effects=effects,
            seed=seed + k,
            repetition=repetition,
        ).recording
        for k, name in enumerate(names)
        for repetition in range(1, count + 1)
    ]


def drawn_tables(evidence: Sequence[Evidence], sigma: Array, draws: Array) -> Tables:
    """Make Tables 2, 4 and 5 as the paper did, once per draw of the noise.

    Parameters
    ----------
    evidence : sequence of Evidence
        One noise-free recording per trajectory, complete model.
    sigma : ndarray, shape (t, n)
        Standard deviation of the torque, white.
    draws : ndarray, shape (d, t, n, p)
        Standard normal numbers.

    Returns
    -------
    Tables
        With the draws as first axis of the errors and the parameters.
    """
    joints, size = sigma.shape[1], draws.shape[-1]
    names = build_model(virtual_arm().robot, "complete").names
    kept = [names.index(name) for name in REDUCED]
    errors, values = {}, {}
    for model, columns in (("complete", list(range(size))), ("reduced", kept)):
        mean = np.zeros((len(evidence), size))
        noise = np.zeros((len(draws), len(evidence), size))
        for k, item in enumerate(evidence):
            parts = [part.select(columns) for part in item.unfiltered]
            pooled = merge(parts)
            mean[k, columns] = pooled.solve().value
            for j, part in enumerate(parts):
                # White noise of the paper's 2500 samples does more than that of all N.
                scale = sigma[k, j] * np.sqrt(part.rows / PAPER_SAMPLES)
                rows = part.regressor_factor
                noise[:, k, columns] += scale * draws[:, k, j, : len(rows)] @ rows @ pooled.inverse()
        values[model] = mean + noise
        errors[model] = np.zeros((len(draws), len(evidence), len(evidence), joints))
        for i, item in enumerate(evidence):
            # On its own rows least squares does not err by what noise did to it: it fits that noise.
            used = values[model].copy()
            used[:, i] = mean[i]
            for j, part in enumerate(item.unfiltered):
                left = used @ part.factor[:, :-1].T - part.factor[:, -1]
                errors[model][:, i, :, j] = np.sqrt(np.sum(left**2, axis=-1) / part.rows + sigma[i, j] ** 2)
    pooled = [merge(item.unfiltered) for item in evidence]
    return Tables(
        np.array([item.log_det() + size * np.log(PAPER_SAMPLES * joints / item.rows) for item in pooled]),
        np.array([item.condition() for item in pooled]),
        np.hypot([[part.torque_rms for part in item.unfiltered] for item in evidence], sigma),
        errors["complete"],
        errors["reduced"],
        np.swapaxes(values["reduced"][:, :, kept], 1, 2),
    )


def distances(tables: Tables, paper: Tables) -> dict[str, Array]:
    """Return how far tables are from the printed ones, per draw.

    ``table2``, ``table4`` and both together: rms of log10(virtual / printed) over the cells; ``joint1``, ``joint2``
    likewise. ``table5``: rms of the difference in what trajectories disagree about, each parameter's departure from
    its OJD value, as a share of the printed departure: 0 is the same, 1 is what no disagreement at all would give.
    """
    logs = np.stack([np.log10(tables.complete / paper.complete), np.log10(tables.reduced / paper.reduced)], axis=-1)

    def rms(values: Array) -> Array:
        return np.asarray(np.sqrt(np.mean(values**2, axis=(-4, -3, -2, -1))))

    apart = [t.parameters[..., :-1] - t.parameters[..., -1:] for t in (tables, paper)]
    scale = np.sqrt(np.mean(apart[1] ** 2, axis=-1, keepdims=True))
    return {
        "both": rms(logs),
        "table2": rms(logs[..., :1]),
        "table4": rms(logs[..., 1:]),
        "joint1": rms(logs[..., :1, :]),
        "joint2": rms(logs[..., 1:, :]),
        "table5": np.sqrt(np.mean(((apart[0] - apart[1]) / scale) ** 2, axis=(-2, -1))),
    }


def scene(task: tuple[str, float], names: Sequence[str], bands: Sequence[float | None], seed: int) -> dict[str, Any]:
    """Simulate one scene of the scan and compare it with the printed tables; ``task`` is an effect and its factor."""
    name, factor = task
    arm = virtual_arm()
    kinds = {kind.name: kind for kind in CATALOGUE}
    effects = () if name == "none" else sized(arm, kinds[name], factor)
    recordings = repetitions(arm, names, effects, 1, noisy=False, seed=seed)
    model = build_model(arm.robot, "complete")
    evidence = gather_all(model, recordings, bands)
    shape = (DRAWS, len(names), arm.robot.n, len(model.columns))
    draws = np.random.default_rng(seed).standard_normal(shape)
    found: dict[str, Any] = {"name": name, "factor": factor, "effects": [effect.as_dict() for effect in effects]}
    # Table 1's sigma is the scatter between runs; whether the tables use one run or the mean of six is not said.
    for reading, share in (("one_run", 1.0), ("mean_of_six", 1.0 / np.sqrt(6.0))):
        tables = drawn_tables(evidence, share * sigma_of(names), draws)
        apart = distances(tables, printed(names))
        found[reading] = {
            "distance": {key: float(np.median(value)) for key, value in apart.items()},
            "range": np.quantile(apart["both"], [0.05, 0.95]).tolist(),
            "draws": apart["both"].tolist(),
            "tables": replace(
                tables,
                complete=np.median(tables.complete, axis=0),
                reduced=np.median(tables.reduced, axis=0),
                parameters=np.median(tables.parameters, axis=0),
            ).as_dict(),
        }
    return found


def scan(
    kinds: Sequence[type[Effect]],
    names: Sequence[str],
    bands: Sequence[float | None],
    *,
    seed: int = 0,
    processes: int = 1,
    sizes: int = 3,
    refined: int = REFINED,
) -> list[dict[str, Any]]:
    """Try every effect at its sizes, the best ones at sizes between; nearest to the printed tables first."""
    run = partial(scene, names=names, bands=bands, seed=seed)
    tasks = [("none", 0.0)]
    for kind in kinds:
        tasks += [(kind.name, factor) for factor in (SIGNED_FACTORS if kind.name in SIGNED else FACTORS)[:sizes]]
    results = _each(run, tasks, processes)
    results.sort(key=_distance)
    best = list(dict.fromkeys(item["name"] for item in results if item["name"] != "none"))[:refined]
    finer = []
    for name in best:
        first = next(item for item in results if item["name"] == name)
        finer += [(name, first["factor"] * step) for step in FINER]
    results += _each(run, finer, processes)
    results.sort(key=_distance)
    none = next(item for item in results if item["name"] == "none")
    for item in results:
        for reading in ("one_run", "mean_of_six"):
            item[reading]["share_nearer_than_none"] = float(
                np.mean(np.array(item[reading]["draws"]) < np.array(none[reading]["draws"]))
            )
    for item in results:
        for reading in ("one_run", "mean_of_six"):
            del item[reading]["draws"]
    return results


def _distance(item: dict[str, Any]) -> float:
    return float(item["one_run"]["distance"]["both"])


def _each(run: Any, tasks: Sequence[Any], processes: int) -> list[Any]:
    if processes <= 1:
        return [run(task) for task in tasks]
    with ProcessPoolExecutor(max_workers=processes) as pool:
        return list(pool.map(run, tasks))


def campaign(
    arm: VirtualArm,
    names: Sequence[str],
    effects: Sequence[Effect],
    count: int,
    *,
    bands: Sequence[float | None] | None = None,
    seed: int = 0,
) -> dict[str, Comparison | Array]:
    """Run `compare` on noisy repetitions; "complete ols" and so on, and ``... errors`` of the unfiltered torque."""
    recordings = repetitions(arm, names, effects, count, noisy=True, seed=seed)
    found: dict[str, Any] = {}
    for model, method in METHODS:
        result = compare(arm.robot, recordings, model=model, method=method, bands=bands)
        used = result.trajectories[0].estimate.method
        if used != method:
            raise RuntimeError(f"asked for {method}, compare used {used}")
        bands = result.bands
        evidence = gather_all(result.model, recordings, bands)
        found[f"{model} {method}"] = result
        found[f"{model} {method} errors"] = unfiltered_errors(result, evidence)
        if model == "complete":
            found["torque_rms"] = np.array(
                [
                    [merge(item.unfiltered[j] for item in evidence if item.trajectory == name).torque_rms for j in range(2)]
                    for name in names
                ]
            )
    return found


def unfiltered_errors(result: Comparison, evidence: Sequence[Evidence]) -> Array:
    """Return the errors of a comparison on the torque as recorded, shape (t, t, n)."""
    return np.array(
        [
            [
                [
                    merge(item.unfiltered[j] for item in evidence if item.trajectory == row.name).rms(column.estimate.value)
                    for j in range(result.model.robot.n)
                ]
                for column in result.trajectories
            ]
            for row in result.trajectories
        ]
    )


def campaign_tables(found: dict[str, Any]) -> Tables:
    """Return the campaign as the paper's tables."""
    complete, reduced = found["complete ols"], found["reduced ols"]
    kept = [reduced.model.names.index(name) for name in REDUCED]
    return Tables(
        np.array([item.log_det for item in complete.trajectories]),
        np.array([item.condition for item in complete.trajectories]),
        found["torque_rms"],
        found["complete ols errors"],
        found["reduced ols errors"],
        np.array([item.estimate.value[kept] for item in reduced.trajectories]).T,
    )
