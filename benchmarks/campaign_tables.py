"""The tables of a campaign as the paper prints them, their distance from the printed ones, and what follows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import permutations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scara_ident.estimation.information import Information, merge
from scara_ident.estimation.observations import Observations
from scara_ident.model.model import build_model
from scara_ident.paper import REDUCED, TABLE_1, TABLE_2, TABLE_4, TABLE_5, TORQUE_RMS, TRAJECTORIES
from scara_ident.simulation import virtual_arm

Array = NDArray[np.float64]

PAPER_SAMPLES = 2500
SIGNIFICANT = 0.05


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
        """Return all fields as lists."""
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


def unfiltered(observations: Observations) -> tuple[Information, ...]:
    """Return what each joint's equation says at every sample that is used, nothing of it filtered."""
    found = []
    for j, rows in enumerate(observations.joints):
        own = Information.empty(len(rows.columns))
        for item, raws in zip(observations.data.recordings, observations.raw, strict=True):
            for part, raw in zip(item.stretches, raws, strict=True):
                own = own.absorb_columns(np.vstack([raw[j], part.torque[j]])[:, part.used[j]])
        found.append(own.embed(rows.columns, observations.parameters))
    return tuple(found)


def drawn_tables(recorded: Sequence[Sequence[Information]], sigma: Array, draws: Array) -> Tables:
    """Make Tables 2, 4 and 5 as the paper did, once per draw of the noise.

    Parameters
    ----------
    recorded : sequence of sequence of Information
        By trajectory and joint, from one noise-free recording each, see `unfiltered`; complete model.
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
        mean = np.zeros((len(recorded), size))
        noise = np.zeros((len(draws), len(recorded), size))
        for k, item in enumerate(recorded):
            parts = [part.select(columns) for part in item]
            pooled = merge(parts)
            mean[k, columns] = pooled.solve().value
            for j, part in enumerate(parts):
                # White noise of the paper's 2500 samples does more than that of all N.
                scale = sigma[k, j] * np.sqrt(part.rows / PAPER_SAMPLES)
                rows = part.regressor_factor
                noise[:, k, columns] += scale * draws[:, k, j, : len(rows)] @ rows @ pooled.inverse()
        values[model] = mean + noise
        errors[model] = np.zeros((len(draws), len(recorded), len(recorded), joints))
        for i, item in enumerate(recorded):
            # On its own rows least squares does not err by what noise did to it: it fits that noise.
            used = values[model].copy()
            used[:, i] = mean[i]
            for j, part in enumerate(item):
                left = used @ part.factor[:, :-1].T - part.factor[:, -1]
                errors[model][:, i, :, j] = np.sqrt(np.sum(left**2, axis=-1) / part.rows + sigma[i, j] ** 2)
    pooled = [merge(item) for item in recorded]
    return Tables(
        np.array([item.log_det() + size * np.log(PAPER_SAMPLES * joints / item.rows) for item in pooled]),
        np.array([item.condition() for item in pooled]),
        np.hypot([[part.torque_rms for part in item] for item in recorded], sigma),
        errors["complete"],
        errors["reduced"],
        np.swapaxes(values["reduced"][:, :, kept], 1, 2),
    )


def distances(tables: Tables, paper: Tables) -> dict[str, Array]:
    """Return how far tables are from the printed ones, per draw.

    ``table2``, ``table4`` and both together: rms of log10(virtual / printed) over the cells; ``joint1``, ``joint2``,
    ``own`` (trajectories predicted with their own parameters) and ``others`` likewise. ``table5``: rms of the difference in what trajectories disagree about, each parameter's departure from
    its OJD value, as a share of the printed departure: 0 is the same, 1 is what no disagreement at all would give.
    """
    logs = np.stack([np.log10(tables.complete / paper.complete), np.log10(tables.reduced / paper.reduced)], axis=-1)

    def rms(values: Array) -> Array:
        return np.asarray(np.sqrt(np.mean(values**2, axis=(-4, -3, -2, -1))))

    own = np.eye(logs.shape[-3], dtype=bool)
    split = [np.sqrt(np.mean(logs[..., chosen, :, :] ** 2, axis=(-3, -2, -1))) for chosen in (own, ~own)]
    apart = [t.parameters[..., :-1] - t.parameters[..., -1:] for t in (tables, paper)]
    scale = np.sqrt(np.mean(apart[1] ** 2, axis=-1, keepdims=True))
    return {
        "both": rms(logs),
        "table2": rms(logs[..., :1]),
        "table4": rms(logs[..., 1:]),
        "joint1": rms(logs[..., :1, :]),
        "joint2": rms(logs[..., 1:, :]),
        "own": split[0],
        "others": split[1],
        "table5": np.sqrt(np.mean(((apart[0] - apart[1]) / scale) ** 2, axis=(-2, -1))),
    }


@dataclass(frozen=True)
class Conclusion:
    """A sentence of the paper, the figures that decide it, and whether it holds."""

    name: str
    holds: bool
    figures: str


def conclusions(tables: Tables, names: Sequence[str]) -> list[Conclusion]:
    """Decide the paper's conclusions from tables, printed or simulated."""
    average = {"complete": tables.complete.mean(axis=0), "reduced": tables.reduced.mean(axis=0)}
    found = []
    for index, values, expected in (("J_d", tables.log_det, -1.0), ("J_k", tables.condition, 1.0)):
        pairs = [rank_correlation(values, average["complete"][:, j], expected) for j in range(2)]
        ranks = [p <= SIGNIFICANT for _, p in pairs]
        found.append(
            Conclusion(
                f"{index} {'ranks' if index == 'J_d' else 'does not rank'} the trajectories",
                all(ranks) if index == "J_d" else not any(ranks),
                "rank correlation with the average error "
                + ", ".join(f"joint {j + 1} {rho:+.2f} (p {p:.3f})" for j, (rho, p) in enumerate(pairs)),
            )
        )
    best = [names[int(k)] for k in np.argmin(average["complete"], axis=0)]
    highest = names[int(np.argmax(tables.log_det))]
    found.append(
        Conclusion(
            "the highest J_d predicts best",
            all(name == highest for name in best),
            f"highest J_d {highest}; lowest average error joint 1 {best[0]}, joint 2 {best[1]}",
        )
    )
    off = ~np.eye(len(names), dtype=bool)
    ratio = tables.reduced[off] / tables.complete[off]
    mean = np.exp(np.mean(np.log(ratio), axis=0))
    found.append(
        Conclusion(
            "the reduced model extrapolates better",
            bool(np.all(mean < 1.0)),
            "reduced / complete on other trajectories, geometric mean "
            + ", ".join(f"joint {j + 1} {mean[j]:.2f}" for j in range(2))
            + f"; better in {np.count_nonzero(ratio < 1.0)}, worse in {np.count_nonzero(ratio > 1.0)} of {ratio.size} cells",
        )
    )
    own = np.array([tables.reduced[k, k] / tables.complete[k, k] for k in range(len(names))])
    found.append(
        Conclusion(
            "the reduced model fits its own trajectory slightly worse",
            # The paper prints three digits.
            bool(np.all(own > 0.99) and np.any(own > 1.0)),
            f"reduced / complete on the own trajectory {own.min():.3f} to {own.max():.3f}",
        )
    )
    if {"L2", "OJD"} <= set(names):
        k, i = names.index("L2"), names.index("OJD")
        worst = [names[int(w)] for w in np.argmax(average["complete"], axis=0)]
        share = tables.complete[i, k] / tables.torque_rms[i]
        found.append(
            Conclusion(
                "L2 fails",
                all(name == "L2" for name in worst) and bool(np.any(share > 1.0)),
                f"worst column joint 1 {worst[0]}, joint 2 {worst[1]}; its error on OJD is "
                + ", ".join(f"{share[j]:.2f}" for j in range(2))
                + " of the torque",
            )
        )
    inertia = tables.parameters[REDUCED.index("P_d4")]
    negative = [name for name, value in zip(names, inertia, strict=True) if value < 0.0]
    found.append(
        Conclusion(
            "bad trajectories estimate a negative I_2z",
            bool(negative),
            f"reduced model: {', '.join(negative) or 'none'}; I_2z {', '.join(f'{x:.2f}' for x in inertia)}",
        )
    )
    return found


def shares(tables: Tables, names: Sequence[str]) -> dict[str, float]:
    """Return in what share of the draws each conclusion holds."""
    found: dict[str, float] = {}
    count = len(tables.complete)
    for k in range(count):
        drawn = replace(tables, complete=tables.complete[k], reduced=tables.reduced[k], parameters=tables.parameters[k])
        for item in conclusions(drawn, names):
            found[item.name] = found.get(item.name, 0.0) + item.holds / count
    return found


def rank_correlation(x: Array, y: Array, expected: float) -> tuple[float, float]:
    """Return Spearman's coefficient and the share of all orders that are at least as extreme in the expected sense."""
    a, b = (np.argsort(np.argsort(values)) - 0.5 * (len(values) - 1) for values in (x, y))
    size = float(a @ a)
    orders = np.array(list(permutations(a))) @ a / size
    rho = float(a @ b) / size
    return rho, float(np.mean(expected * orders >= expected * rho - 1e-9))


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
