"""A model with effects at its present nonlinear parameters: how well it fits there, without what it takes to look for better ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from scara_ident.diagnosis.candidates.candidates import Candidate, with_columns
from scara_ident.diagnosis.candidates.unknowns import Unknown, unknowns_of
from scara_ident.diagnosis.testing.selection_step import SelectionStep
from scara_ident.effects import Scene, Tie
from scara_ident.estimation.information import Information, weighted
from scara_ident.estimation.joint_rows import JointRows
from scara_ident.estimation.run_variation import RunVariation
from scara_ident.threads import one_blas_thread, side_by_side


@dataclass(frozen=True, eq=False)
class PresentModel:
    """The model of a step, linear in what remains with the nonlinear parameters of its effects as they are.

    Attributes
    ----------
    unknowns : tuple of Unknown
        The nonlinear parameters.
    places : tuple of slice
        Columns of each effect.
    joints : tuple of JointRows
        Columns of the base model and of the effects.
    ties : tuple of Tie or None
        What each effect says of its coefficient.
    """

    step: SelectionStep
    unknowns: tuple[Unknown, ...]
    places: tuple[slice, ...]
    joints: tuple[JointRows, ...]
    ties: tuple[Tie | None, ...]

    @property
    def scene(self) -> Scene:
        """Of the step."""
        return self.step.scene

    @property
    def chosen(self) -> tuple[Candidate, ...]:
        """The effects of the step."""
        return self.step.chosen

    @property
    def linear(self) -> int:
        """Number of linear parameters k."""
        return self.places[-1].stop if self.places else self.step.observations.parameters

    @cached_property
    def information(self) -> Information:
        """Of all weighted rows, with offsets of runs as noise; of the k linear parameters."""
        return pooled(self.joints, self.linear, self.step)

    @cached_property
    def fitted(self) -> NDArray[np.bool_]:
        """Which linear parameters are of what is in the model, shape (k,): nothing is left of what was taken out of the data."""
        kept = np.ones(self.linear, dtype=bool)
        for candidate, place in zip(self.chosen, self.places, strict=True):
            kept[place] = not candidate.corrects_data
        return kept

    @cached_property
    def error(self) -> float:
        """Squared residual with what the priors add to it, the bodies as they were where effects follow from them."""
        value, free = np.zeros(self.linear), self.fitted.copy()
        for place, tie in zip(self.places, self.ties, strict=True):
            if tie is not None:
                bodies = self.scene.model.place(self.scene.model.rigid_body)
                value[place], value[bodies] = tie.value, self.scene.value[bodies]
                free[place] = free[bodies] = False
        value[free] = self.information.moved(-value).select(np.flatnonzero(free)).solve().value
        # A row of what the priors say is as weighty as a measured one.
        rows = sum(own.table.shape[1] for own in self.joints)
        far = sum(((item.value - item.nominal) / item.spread) ** 2 for item in self.unknowns)
        return float(self.information.residual_sum(value) * (1.0 + far / rows))


def present_model(step: SelectionStep) -> PresentModel:
    """Return the model of a step at its present nonlinear parameters."""
    scene, chosen = step.scene, step.chosen
    own = step.columns.rows(scene, chosen)
    bounds = step.observations.parameters + np.cumsum([0, *(len(next(iter(rows.values()))) for rows in own)])
    places = tuple(slice(int(a), int(b)) for a, b in zip(bounds[:-1], bounds[1:], strict=True))
    unknowns = unknowns_of(scene, chosen, step.criteria.rotor_inertia_std)
    ties = tuple(item.effect.tie(scene, item.member) for item in chosen)
    return PresentModel(step, unknowns, places, with_columns(step.observations, own), ties)


def pooled(joints: Sequence[JointRows], parameters: int, step: SelectionStep) -> Information:
    """Return the information of all rows of a step's joints, weighted; what offsets of runs make is noise, see `Estimate.offsets`."""
    offsets: RunVariation | None = step.offsets
    rows = joints if offsets is None else offsets.whitened_rows(joints)
    with one_blas_thread():
        return weighted(side_by_side(lambda own: own.information(parameters), rows), step.weights)
