"""An identified model, from an identification or a diagnosis at hand; `scara_ident.export.result` reads one from its file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.diagnosis.diagnose import Diagnosis
from scara_ident.diagnosis.held_out.gain import HeldOutGain, shown_of
from scara_ident.effects import EffectTerm
from scara_ident.estimation.consistent.estimator import ConsistentEstimate
from scara_ident.estimation.estimate import joint_errors
from scara_ident.estimation.information import Information, weighted
from scara_ident.estimation.observations import Observations
from scara_ident.identification.identify import Identification
from scara_ident.model.model import TorqueModel
from scara_ident.model.terms import Friction
from scara_ident.motion.motion import Motion
from scara_ident.motion.recorded_range import RecordedRange, recorded_range
from scara_ident.robot.robot import Robot

# An effect as ``diagnosis.json`` has it: ``effect``, ``joint``, ``parameters`` with ``value`` and ``std``, and ``held_out``.
Entry = Mapping[str, Any]


@dataclass(frozen=True, eq=False)
class IdentifiedModel:
    """A model with its parameters, and what its observations said.

    Attributes
    ----------
    model : TorqueModel
        With the effects that were found as further terms.
    value : ndarray, shape (p,)
        Of its parameters.
    covariance : ndarray, shape (p, p)
        Infinite variance where a parameter is not determined.
    before : ndarray, shape (q,)
        The first ``q <= p`` parameters without the effects found.
    undetermined : ndarray of bool, shape (p,)
    weights : ndarray, shape (n,)
        Of each joint's rows in the estimate.
    fitted : tuple of Information
        Training rows as the estimate saw them, per joint, see `Estimate.rows`.
    training, validation : tuple of Information
        Per joint, within the band; validation has no rows where nothing was held out.
    standard : ndarray, shape (11 n,), or None
        Of the arm that the estimate belongs to, where it was estimated with one.
    bands : tuple of float or None, one per joint
        Low-pass that the estimate used, Hz.
    rms : ndarray, shape (n,)
        Rms error of the predicted torque, unfiltered, on recordings that were held out, else on those fitted; NaN where not
        known.
    found : tuple of Entry
        The effects found.
    reached : RecordedRange or None
        Of the recordings that it was fitted to; None where it is not known.
    """

    model: TorqueModel
    value: Array
    covariance: Array
    before: Array
    undetermined: NDArray[np.bool_]
    weights: Array
    fitted: tuple[Information, ...]
    training: tuple[Information, ...]
    validation: tuple[Information, ...]
    standard: Array | None
    bands: tuple[float | None, ...]
    rms: Array
    found: tuple[Entry, ...] = ()
    reached: RecordedRange | None = None

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self.model.robot

    @property
    def std(self) -> Array:
        """Standard deviation of each parameter, shape (p,); NaN where it is not determined."""
        return np.where(self.undetermined, np.nan, np.sqrt(np.clip(np.diag(self.covariance), 0.0, None)))

    @property
    def removed(self) -> tuple[str, ...]:
        """Effects that were found and taken out of the recordings."""
        in_model = {term.name for term in self.model.terms}
        return tuple(item["effect"] for item in self.found if item["effect"] not in in_model)

    @property
    def doubts(self) -> tuple[str, ...]:
        """In words, which of the effects found the recordings held out speak against."""
        with_gain = [(item, HeldOutGain.of_entry(item["held_out"])) for item in self.found if item.get("held_out")]
        return tuple(
            f"{item['effect']}{' of ' + item['joint'] if item['joint'] else ''} is in doubt: {shown_of(gain)} on the held-out recordings"
            for item, gain in with_gain
            if gain.against()
        )

    @property
    def information(self) -> Information:
        """All training rows as the estimate weighted them."""
        return weighted(self.fitted, self.weights)

    @property
    def held_out(self) -> tuple[str, tuple[Information, ...]]:
        """What errors are of: ``validation``, or ``training`` where nothing was held out."""
        if any(item.rows for item in self.validation):
            return "validation", self.validation
        return "training", self.training

    def errors(self, value: Array) -> dict[str, float | None]:
        """Return the rms of what parameters leave of the torque on each joint, held out where something was."""
        rows = self.held_out[1]
        return {
            name: item.rms(value) if item.rows else None for name, item in zip(self.robot.joints, rows, strict=True)
        }

    def without_effects(self) -> IdentifiedModel:
        """Return the model as it was before the effects were found, on the same observations."""
        base = TorqueModel(
            self.model.name, self.robot, tuple(term for term in self.model.terms if not isinstance(term, EffectTerm))
        )
        own = np.arange(len(self.before))
        return replace(
            self,
            model=base,
            value=self.before,
            covariance=self.covariance[np.ix_(own, own)],
            undetermined=self.undetermined[own],
            fitted=tuple(item.select(own) for item in self.fitted),
            training=tuple(item.select(own) for item in self.training),
            validation=tuple(item.select(own) for item in self.validation),
            found=(),
        )

    def torque_parts(self, motion: Motion) -> dict[str, Array]:
        """Return the torque along a motion by what it comes from, recorded side, shape (n, N) each; their sum is the torque.

        The rigid bodies with the rotors, friction by power of speed, and every other term by its name.
        """
        found: dict[str, Array] = {}
        columns = self.model.joint_columns(motion)
        labels = [label for term in self.model.terms for label in _labels(term)]
        for joint, (own, rows) in enumerate(zip(self.model.active, columns, strict=True)):
            for column, row in zip(own, rows, strict=True):
                part = found.setdefault(labels[column], np.zeros((self.robot.n, motion.samples)))
                part[joint] += self.value[column] * row
        return found

    def torque(self, motion: Motion) -> Array:
        """Return the torque along a motion, recorded side, shape (n, N)."""
        return self.model.torque(motion, self.value)

    def torque_std(self, motion: Motion) -> Array:
        """Return by how much the parameters leave the torque along a motion open, recorded side, shape (n, N).

        One standard deviation; NaN where a parameter that counts there is not determined.
        """
        covariance = np.where(np.isfinite(self.covariance), self.covariance, np.nan)
        columns = self.model.joint_columns(motion)
        variance = [
            np.sum((covariance[np.ix_(own, own)] @ rows) * rows, axis=0)
            for own, rows in zip(self.model.active, columns, strict=True)
        ]
        return np.sqrt(np.maximum(variance, 0.0))


def identified_model(found: Identification | Diagnosis) -> IdentifiedModel:
    """Return the model of an identification, or of a diagnosis with the effects found."""
    entries: tuple[Entry, ...] = ()
    if isinstance(found, Diagnosis):
        estimate, before, bands = found.after, found.before, found.search.bands
        fitted, held_out = found.training_after, found.validation_after
        entries = tuple(
            {
                "effect": item.effect,
                "joint": item.joint,
                "parameters": {name: parameter.entry() for name, parameter in item.parameters.items()},
                "held_out": None if item.held_out is None else item.held_out.entry(),
            }
            for item in found.effects
        )
    else:
        estimate = before = found.estimate
        fitted, held_out, bands = found.training, found.validation, found.bands
    errors = joint_errors(estimate.value, held_out if held_out.data.recordings else fitted)
    return IdentifiedModel(
        model=estimate.model,
        value=estimate.value,
        covariance=estimate.covariance,
        before=before.value,
        undetermined=estimate.undetermined,
        weights=estimate.weights,
        fitted=estimate.rows(fitted),
        training=tuple(fitted.by_joint),
        validation=tuple(held_out.by_joint),
        standard=estimate.standard if isinstance(estimate, ConsistentEstimate) else None,
        bands=tuple(bands),
        rms=np.array([np.nan if error is None else error.rms_unfiltered for error in errors]),
        found=entries,
        reached=reached_by(fitted),
    )


def reached_by(observations: Observations) -> RecordedRange | None:
    """Return the range of recordings; None of files so long that a part of them alone is held."""
    return recorded_range(observations.data) if observations.kept is None else None


def _labels(term: Any) -> list[str]:
    """Name what each column of a term is part of."""
    if isinstance(term, Friction):
        return [f"{column.meaning.partition(' of ')[0]}" for column in term.columns]
    return [term.name.replace("_", " ")] * len(term.columns)
