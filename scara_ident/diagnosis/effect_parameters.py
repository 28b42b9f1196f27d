"""Physical parameters of the effects found, with standard deviations that include the nonlinear ones."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from scara_ident.diagnosis.candidate_tests import examine
from scara_ident.diagnosis.candidates import Candidate
from scara_ident.diagnosis.nonlinear_fit import Linearised, linearise
from scara_ident.diagnosis.table import Table, tabulate
from scara_ident.effects import Parameter, Scene
from scara_ident.estimation.covariance import block_covariance
from scara_ident.estimation.information import Information, triangular
from scara_ident.recording.recording import Recording

Array = NDArray[np.float64]


def physical_parameters(
    scene: Scene,
    recordings: Sequence[Recording],
    bands: Sequence[float | None],
    weights: Array,
    chosen: Sequence[Candidate],
) -> list[dict[str, Parameter]]:
    """Return the physical parameters of each effect.

    Nonlinear parameters, armatures included, join the fit by the derivative of the effects' columns, so that the
    covariance is that of all parameters together.
    """
    state = linearise(scene, recordings, bands, tabulate(scene.model, recordings, bands), weights, chosen)
    covariance = _covariance(state)
    found = []
    for owner, (candidate, own) in enumerate(zip(chosen, state.places, strict=True)):
        parameters = dict(candidate.effect.parameters(scene, candidate.member, state.value[own], covariance[own, own]))
        for position, unknown in enumerate(state.unknowns):
            if unknown.owner != owner:
                continue
            parameter = candidate.effect.nonlinear[unknown.place]
            # An underscore marks a parameter that only serves the shape of the columns.
            if not parameter.name.startswith("_"):
                variance = covariance[len(state.value) + position, len(state.value) + position]
                parameters[parameter.name] = Parameter(
                    unknown.value, float(np.sqrt(max(variance, 0.0))), parameter.unit
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

    The model's columns are projected out, and the covariance is that of the effect's block scores. Armatures stay as
    they are.
    """
    state = linearise(scene, recordings, bands, table, weights, [candidate])
    nonlinear = [k for k, unknown in enumerate(state.unknowns) if unknown.owner is not None]
    first, own = table.columns.shape[1], state.places[0]
    wide = state.table.beside(state.derivatives[:, nonlinear])
    (found,) = examine(wide, range(first), [list(range(first, wide.columns.shape[1]))])
    size = own.stop - own.start
    return dict(candidate.effect.parameters(scene, candidate.member, state.value[own], found.covariance[:size, :size]))


def _covariance(state: Linearised) -> Array:
    """Block covariance of all parameters, columns scaled to unit size meanwhile."""
    rows, aim = state.prior
    columns = state.columns
    size = np.linalg.norm(np.vstack([columns, rows]), axis=0)
    size[size == 0.0] = 1.0
    table = np.column_stack([columns / size, state.table.torque])
    prior = np.column_stack([rows / size, aim])
    bounds = [*state.table.starts, len(columns)]
    sequences: dict[int, list[tuple[Information, ...]]] = {}
    for block, recording in enumerate(state.table.recording):
        part = table[bounds[block] : bounds[block + 1]]
        factor = triangular(part)
        sequences.setdefault(int(recording), []).append((Information(factor, float(len(part))),))
    whole = Information(triangular(np.vstack([table, prior])), float(len(table)))
    inverse = whole.inverse()
    value = np.concatenate([state.value, np.zeros(len(state.unknowns))])
    spread = block_covariance(inverse, value * size, list(sequences.values())).matrix
    # What the priors leave open, which no residual shows.
    spread = spread + state.variance * inverse @ (prior[:, :-1].T @ prior[:, :-1]) @ inverse
    return np.asarray(spread / np.outer(size, size))
