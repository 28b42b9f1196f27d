"""What each effect found removes on recordings that no choice has seen."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from scara_ident.arrays import Array
from scara_ident.diagnosis.criteria import CRITERIA, SelectionCriteria
from scara_ident.diagnosis.evidence import Evidence
from scara_ident.diagnosis.search import Search
from scara_ident.diagnosis.selection_step import observed
from scara_ident.estimation import Estimate
from scara_ident.estimation.information import Information
from scara_ident.estimation.least_squares import told_value_and_weights
from scara_ident.estimation.observations import Observations


@dataclass(frozen=True)
class HeldOutGain:
    """What an effect changes on recordings held out, all other parameters fitted again to the training without it.

    Attributes
    ----------
    share : float
        What it removes of the weighted squared error, as a share of that and what it leaves on its joint, as
        `FoundEffect.gain`; below zero where the error is larger with it.
    joint : str
        On which it changes most.
    without, rms : float
        Error of that joint without it and with it, N m or N.
    """

    share: float
    joint: str
    without: float
    rms: float

    def against(self, criteria: SelectionCriteria = CRITERIA) -> bool:
        """Whether it makes the error larger by more than an effect must remove to be believed."""
        return self.share < -criteria.least_gain


def held_out_gains(
    found: Search, after: Estimate, held_out: Observations, uncorrected: Observations
) -> Mapping[str, HeldOutGain]:
    """Return what each effect found changes on recordings held out, by its label; those that act in none left out.

    Nothing is chosen by it: the model is the one that the training recordings led to.

    Parameters
    ----------
    found : Search
    after : Estimate
        With the effects found.
    held_out : Observations
        Of the model with the effects found, corrected as the training recordings were.
    uncorrected : Observations
        Of the base model, not corrected.
    """
    if not held_out.data.recordings:
        return {}
    joints = found.scene.robot.joints
    whole = _squares(held_out.by_joint, after.value, after.weights)
    gains = {}
    for label, own, value, others in _each_left_out(found, held_out, uncorrected):
        without = _squares(others, value, after.weights)
        removed, left = float(np.sum(without - whole)), float(np.sum(whole if own is None else whole[own]))
        largest = int(np.argmax(np.abs(without - whole)))
        rms, before = held_out.by_joint[largest].rms(after.value), others[largest].rms(value)
        if left > 0.0 or removed > 0.0:
            gains[label] = HeldOutGain(removed / (max(removed, 0.0) + left), joints[largest], before, rms)
    return gains


def spoken_against(
    shown: Sequence[Evidence], gains: Mapping[str, HeldOutGain], criteria: SelectionCriteria = CRITERIA
) -> tuple[Evidence, ...]:
    """Take back that a residual is noise on a joint where an effect found makes the recordings held out worse."""
    why = {item.joint: f"{label}: {words_against(item)}" for label, item in gains.items() if item.against(criteria)}
    return tuple(
        replace(item, shown=False, by="", why=why[item.joint]) if item.shown and item.joint in why else item
        for item in shown
    )


def words_against(gain: HeldOutGain, unit: str = "") -> str:
    """Say how recordings held out speak against an effect, in the unit of the joint if it is given."""
    error, least = (f"{size:.3g} {unit}".rstrip() for size in (gain.rms, gain.without))
    return f"on the recordings held out {gain.joint} has an error of {error} with it and {least} without it"


def _each_left_out(
    found: Search, held_out: Observations, uncorrected: Observations
) -> Iterator[tuple[str, int | None, Array, Sequence[Information]]]:
    """Give each effect's label and joint with the parameters fitted without it, and the rows held out for them."""
    scene, start = found.scene, uncorrected.parameters
    for place, candidate in enumerate(found.chosen):
        stop = start + len(candidate.effect.columns(scene, candidate.member))
        columns = np.arange(start, stop)
        start = stop
        if any(np.any(rows.table[:-1][np.isin(rows.columns, columns)]) for rows in held_out.joints):
            value, _ = told_value_and_weights(observed(found.step.without(place)))
            value = np.insert(value, np.full(len(columns), columns[0]), 0.0)
            yield candidate.label(scene), candidate.member.joint, value, held_out.by_joint
    if found.correction is not None:
        step = replace(found.step, columns=found.step.columns.beside(found.uncorrected))
        value, _ = told_value_and_weights(observed(step))
        candidate = found.correction.candidate
        yield candidate.label(scene), candidate.member.joint, value, held_out.with_torque(uncorrected.data).by_joint


def _squares(joints: Sequence[Information], value: Array, weights: Array) -> Array:
    """Return the weighted sum of squares that parameters leave on each joint, shape (n,)."""
    return np.array([weight**2 * item.residual_sum(value) for item, weight in zip(joints, weights, strict=True)])
