"""Physical parameters of the effects found, with standard deviations that include the nonlinear ones."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from scara_ident.covariance import block_covariance
from scara_ident.diagnosis.bank import Candidate
from scara_ident.diagnosis.examination import examine
from scara_ident.diagnosis.table import Table, tabulate, tabulate_candidates
from scara_ident.effects import Parameter, Scene
from scara_ident.information import Information, triangular
from scara_ident.recording import Recording

Array = NDArray[np.float64]

# Step for the derivative by a nonlinear parameter, as a share of it.
DERIVATIVE_STEP = 1e-3


def physical_parameters(
    scene: Scene,
    recordings: Sequence[Recording],
    bands: Sequence[float | None],
    weights: Array,
    chosen: Sequence[Candidate],
) -> list[dict[str, Parameter]]:
    """Return the physical parameters of each effect.

    Nonlinear parameters join the fit by the derivative of the effect's columns (Gauss and Newton), so that the
    covariance is that of all parameters together.
    """
    steps = [(i, k) for i, candidate in enumerate(chosen) for k in range(len(candidate.effect.knobs))]
    variants: list[Candidate] = []
    for i, k in steps:
        for sign in (1.0, -1.0):
            knobs = list(chosen[i].member.knobs)
            knobs[k] += sign * _step(chosen[i], k)
            variants.append(chosen[i].at(knobs))
    model = tabulate(scene.model, recordings, bands)
    extra, places = tabulate_candidates(scene, [*chosen, *variants], recordings, bands)
    rows = model.beside(extra).weighted(weights)
    base = len(scene.model.columns)
    linear = list(range(base + places[len(chosen) - 1].stop))
    value = _solve(rows.rows[:, linear], rows.rows[:, -1])
    derivatives = []
    for place, (i, k) in enumerate(steps):
        coefficients = value[_shifted(places[i], base)]
        up, down = (places[len(chosen) + 2 * place + side] for side in (0, 1))
        change = rows.rows[:, _shifted(up, base)] - rows.rows[:, _shifted(down, base)]
        derivatives.append(change @ coefficients / (2.0 * _step(chosen[i], k)))
    columns = np.column_stack([rows.rows[:, linear], *derivatives])
    full = np.concatenate([value, np.zeros(len(steps))])
    covariance = _covariance(rows, columns, full)
    found = []
    for i, candidate in enumerate(chosen):
        own = _shifted(places[i], base)
        parameters = dict(candidate.effect.parameters(scene, candidate.member, value[own], covariance[own, own]))
        for position, (owner, k) in enumerate(steps):
            if owner != i:
                continue
            knob = candidate.effect.knobs[k]
            # An underscore marks a parameter that only serves the shape of the columns.
            if not knob.name.startswith("_"):
                variance = covariance[len(linear) + position, len(linear) + position]
                parameters[knob.name] = Parameter(
                    candidate.member.knobs[k], float(np.sqrt(max(variance, 0.0))), knob.unit
                )
        found.append(parameters)
    return found


def parameters_beside(
    scene: Scene,
    recordings: Sequence[Recording],
    bands: Sequence[float | None],
    table: Table,
    weights: Array,
    candidate: Candidate,
) -> dict[str, Parameter]:
    """Return the physical parameters of one effect beside a model, as `physical_parameters` at a fraction of the work.

    The model's columns are projected out, and the covariance is that of the effect's block scores.
    """
    variants = [
        candidate.at([value + sign * _step(candidate, k) * (i == k) for i, value in enumerate(candidate.member.knobs)])
        for k in range(len(candidate.effect.knobs))
        for sign in (1.0, -1.0)
    ]
    columns, places = tabulate_candidates(scene, [candidate, *variants], recordings, bands)
    count, own = table.columns.shape[1], columns[:, places[0]]
    value = examine(table.beside(own).weighted(weights), range(count), [list(range(count, count + own.shape[1]))])[
        0
    ].value
    changes = [
        (columns[:, places[1 + 2 * k]] - columns[:, places[2 + 2 * k]]) @ value / (2.0 * _step(candidate, k))
        for k in range(len(candidate.effect.knobs))
    ]
    wide = np.column_stack([own, *changes])
    found = examine(table.beside(wide).weighted(weights), range(count), [list(range(count, count + wide.shape[1]))])[0]
    size = own.shape[1]
    return dict(candidate.effect.parameters(scene, candidate.member, value, found.covariance[:size, :size]))


def _step(candidate: Candidate, k: int) -> float:
    knob, value = candidate.effect.knobs[k], candidate.member.knobs[k]
    return DERIVATIVE_STEP * (abs(value) if value else knob.upper - knob.lower)


def _shifted(place: slice, by: int) -> slice:
    return slice(place.start + by, place.stop + by)


def _solve(columns: Array, target: Array) -> Array:
    size = np.linalg.norm(columns, axis=0)
    size[size == 0.0] = 1.0
    return np.asarray(np.linalg.lstsq(columns / size, target, rcond=1e-10)[0] / size)


def _covariance(rows: Table, columns: Array, value: Array) -> Array:
    """Block covariance of all parameters, columns scaled to unit size meanwhile."""
    size = np.linalg.norm(columns, axis=0)
    size[size == 0.0] = 1.0
    bounds = [*rows.starts, len(columns)]
    table = np.column_stack([columns / size, rows.rows[:, -1]])
    sequences: dict[int, list[tuple[Information, ...]]] = {}
    for block, recording in enumerate(rows.recording):
        part = table[bounds[block] : bounds[block + 1]]
        factor = triangular(part)
        sequences.setdefault(int(recording), []).append((Information(factor, float(len(part))),))
    whole = Information(triangular(table), float(len(table)))
    spread = block_covariance(whole.inverse(), value * size, list(sequences.values()))
    return np.asarray(spread.matrix / np.outer(size, size))
