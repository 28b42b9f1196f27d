"""The table of a fleet: a row for each arm, date and quantity."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from scara_ident.arrays import Array
from scara_ident.estimation.information import triangular
from scara_ident.fleet.causes import REPORTED_RUN_KINDS, Cause, sizes_in_words
from scara_ident.fleet.changes import Change
from scara_ident.fleet.history import History, noise_of, pseudo_inverses, scatter
from scara_ident.fleet.visit import Visit

if TYPE_CHECKING:
    import polars as pl

    from scara_ident.fleet.fleet import Fleet

# An effect of which the model leaves less than this share of its columns is not distinguished from it.
SEEN_SHARE = 1e-5
COLUMNS = (
    "arm", "date", "quantity", "joint", "unit", "parameter", "std", "effect", "since", "error", "verdict", "changes",
    "fault", "odd",
)  # fmt: skip


@dataclass(frozen=True)
class Quantity:
    """One number of one arm on one date.

    Attributes
    ----------
    name : str
        A parameter of the model, or of a watched effect beside it, or ``friction of JOINT`` and ``torque scale of JOINT`` as
        ratios to those of all dates together.
    joint : str or None
    unit : str
    value, std : float
        ``std`` with what differs from run to run.
    cause : str
        Label of the cause that it is the size of, or one of; empty for none.
    """

    name: str
    joint: str | None
    unit: str
    value: float
    std: float
    cause: str = ""


def quantities(histories: Sequence[History]) -> dict[str, tuple[tuple[Quantity, ...], ...]]:
    """Return by arm and date all quantities, with standard deviations that hold from date to date.

    What a quantity differs by from date to date beyond its standard deviation is what the whole fleet shows, see
    `scara_ident.fleet.history`.

    Parameters
    ----------
    histories : sequence of History
        Of one robot and model.
    """
    sizes = {item.arm: [tuple(_sizes(item, visit)) for visit in item.visits] for item in histories}
    # Of an effect the coefficients: an amplitude that is noise scatters less than one that has a size.
    wider = _beyond_noise(
        [{cause.label: (value, np.diag(cover)) for cause, value, cover in each} for each in dates]
        for dates in sizes.values()
    )
    raw = {
        item.arm: [tuple(_of_date(item, k, sizes[item.arm][k], wider)) for k in range(len(item.dates))]
        for item in histories
    }
    more = _beyond_noise(
        [{item.name: (np.array([item.value]), np.array([item.std**2])) for item in each} for each in dates]
        for dates in raw.values()
    )
    return {
        arm: tuple(
            tuple(
                replace(item, std=float(np.sqrt(item.std**2 + more[item.name][0]))) if item.name in more else item
                for item in each
            )
            for each in dates
        )
        for arm, dates in raw.items()
    }


def _beyond_noise(arms: Iterable[Sequence[Mapping[str, tuple[Array, Array]]]]) -> dict[str, Array]:
    """Return by name the variances from date to date beyond noise, of values and their variances by arm, date and name."""
    steps: dict[str, list[Array]] = {}
    for dates in arms:
        for before, after in pairwise(dates):
            for name in after.keys() & before.keys():
                (old, old_noise), (new, new_noise) = before[name], after[name]
                steps.setdefault(name, []).append(np.array([new - old, new_noise + old_noise]))
    return {name: scatter(*np.swapaxes(np.array(found), 0, 1)) for name, found in steps.items()}


def fleet_table(fleet: Fleet) -> pl.DataFrame:
    """Return the table that ``fleet.parquet`` holds, in the order of arms, dates and quantities; faults last of each."""
    import polars as pl

    rows: list[Mapping[str, Any]] = []
    for report in fleet.arms:
        of_arm = {"arm": report.arm, "verdict": report.verdict, "changes": "; ".join(report.sentences) or None}
        of_arm["odd"] = "; ".join(report.oddities) or None
        nothing = dict.fromkeys(COLUMNS) | of_arm
        dates = fleet.quantities.get(report.arm, ())
        for k, each in enumerate(dates):
            visit, day = report.known.visits[k], report.known.dates[k]
            worst = float(np.nanmax(visit.error)) if np.any(np.isfinite(visit.error)) else None
            for item in each:
                joint = None if item.joint is None else fleet.robot.joints.index(item.joint)
                error = worst if joint is None else float(visit.error[joint])
                change = _change_of(item, day, report.changes)
                rows.append(
                    nothing
                    | {
                        "date": day,
                        "quantity": item.name,
                        "joint": item.joint,
                        "unit": item.unit,
                        "parameter": _finite(item.value),
                        "std": _finite(item.std),
                        "effect": None if change is None or change.cause is None else change.cause.effect,
                        "since": None if change is None else change.since,
                        "error": _finite(error),
                    }
                )
        rows += [nothing | {"date": fault.date, "fault": str(fault)} for fault in report.faults]
    kinds = {name: pl.Float64 if name in ("parameter", "std", "error") else pl.String for name in COLUMNS}
    return pl.DataFrame(rows, schema=kinds).with_columns(pl.col("date", "since").str.to_date())


def _change_of(item: Quantity, day: str, changes: Sequence[Change]) -> Change | None:
    """Return the first change of the cause of a quantity, None where there is none up to a day."""
    own = [change for change in changes if change.cause is not None and change.cause.label == item.cause]
    return min((change for change in own if change.since <= day), key=lambda change: change.since, default=None)


def _of_date(
    history: History, k: int, effects: Sequence[tuple[Cause, Array, Array]], wider: Mapping[str, Array]
) -> Iterator[Quantity]:
    visit, model = history.visits[k], history.model
    labels = {cause.words: cause.label for cause in history.causes}
    inertia = next((cause.label for cause in history.causes if cause.effect == "inertia"), "")
    rigid = model.place(model.rigid_body)
    for place, column in enumerate(model.columns):
        label = inertia if rigid.start <= place < rigid.stop else labels.get(column.meaning, "")
        value = float(visit.value[place]) if np.isfinite(visit.std[place]) else np.nan
        yield Quantity(column.name, column.joint, column.unit, value, float(visit.std[place]), label)
    for cause, size, cover in effects:
        determined = bool(np.all(np.isfinite(size)))
        if determined:
            cover = cover + np.diag(wider.get(cause.label, np.zeros(len(size))))
        each = sizes_in_words(
            cause,
            history.scene,
            size if determined else np.zeros(cause.sizes),
            cover if determined else np.eye(cause.sizes),
        )
        for name, item in each.items():
            own = (item.value, item.std) if determined else (np.nan, np.inf)
            yield Quantity(f"{name}: {cause.label}", cause.joint, item.unit, *own, cause.label)
    sizes, covers = (part[k] for part in history.run_sizes(REPORTED_RUN_KINDS))
    for j, joint in enumerate(model.robot.joints):
        for kind, words in enumerate((f"friction of {joint}", f"torque scale of {joint}")):
            place = REPORTED_RUN_KINDS.shape[1] * j + kind
            if words in labels and np.isfinite(covers[place, place]):
                std = float(np.sqrt(covers[place, place]))
                yield Quantity(words, joint, "1", 1.0 + float(sizes[place]), std, labels[words])


def _sizes(history: History, visit: Visit) -> Iterator[tuple[Cause, Array, Array]]:
    """Give the coefficients of each watched effect beside the model alone, and their covariance; NaN where not determined."""
    base, total = len(history.model.columns), max(int(own.max(initial=0)) for own in visit.columns) + 1
    stacked = []
    for own, factor, rows in zip(visit.columns, visit.factors, visit.rows, strict=True):
        noise = noise_of(factor, rows)
        wide = np.zeros((len(factor), total + 1))
        wide[:, [*own, total]] = factor / noise if noise > 0.0 else 0.0
        stacked.append(wide)
    # Below the model's rows stands what the model leaves of each effect's columns.
    left = triangular(np.concatenate(stacked))[base:, base:]
    size = np.linalg.norm(np.concatenate(stacked), axis=0)[base:]
    start = 0
    for cause in history.causes:
        if cause.candidate is None:
            continue
        own_columns = np.arange(start, start + cause.sizes)
        start += cause.sizes
        columns = left[:, own_columns]
        if np.any(np.linalg.norm(columns, axis=0) <= SEEN_SHARE * size[own_columns]) or not np.all(size[own_columns]):
            yield cause, np.full(cause.sizes, np.nan), np.full((cause.sizes, cause.sizes), np.nan)
            continue
        covariance = pseudo_inverses((columns.T @ columns)[None], np.finfo(float).eps)[0]
        yield cause, covariance @ (columns.T @ left[:, -1]), covariance


def _finite(value: float | None) -> float | None:
    return value if value is not None and np.isfinite(value) else None
