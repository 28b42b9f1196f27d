"""The held-out gain of each effect: what it removes on recordings that no choice has seen."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from scara_ident.arrays import Array
from scara_ident.diagnosis.criteria import CRITERIA, SelectionCriteria
from scara_ident.diagnosis.evidence.evidence import Evidence
from scara_ident.diagnosis.fitting.correction import Correction
from scara_ident.diagnosis.selection.search import Search
from scara_ident.diagnosis.testing.selection_step import moments_of, observed
from scara_ident.estimation import Estimate
from scara_ident.estimation.another_run import variance_of_another_run
from scara_ident.estimation.joint_rows import JointRows
from scara_ident.estimation.least_squares import determined_value_and_weights
from scara_ident.estimation.observations import Observations
from scara_ident.estimation.run_offsets import offsets_on
from scara_ident.recording.recording import Recording

# Likelihood ratio of no effect to the effect as found, from which the held-out recordings contradict it: fairly strong
# evidence (Royall 1997, Statistical Evidence, ch. 1). For a true effect of the size found, normal errors reach it in at
# most 2 % of all cases.
MIN_LIKELIHOOD_RATIO = 8.0


@dataclass(frozen=True)
class HeldOutGain:
    """What an effect changes on recordings held out, all other parameters fitted again to the training without it.

    Attributes
    ----------
    share : float
        What it removes of the weighted squared error, as a share of that and what it leaves on its joint, as
        `FoundEffect.gain`; below zero where the error is larger with it.
    size, std : float
        How much of the change that it makes to the predicted torque those recordings show, 1 where all of it: a share s of it
        removes 2 s - 1 of what all of it would, so that below a half the error is larger with it. Infinite std where it changes nothing there.
    joint : str
        On which it changes most.
    without, rms : float
        Error of that joint without it and with it, N m or N.
    """

    share: float
    size: float
    std: float
    joint: str
    without: float
    rms: float

    def entry(self) -> dict[str, object]:
        """Return it as plain values."""
        std = self.std if np.isfinite(self.std) else None
        shown = {"gain": self.share, "size": self.size, "std": std}
        return {**shown, "joint": self.joint, "without": self.without, "with": self.rms}

    @staticmethod
    def of_entry(entry: Mapping[str, Any]) -> HeldOutGain:
        """Return what an entry tells."""
        std = np.inf if entry["std"] is None else entry["std"]
        return HeldOutGain(entry["gain"], entry["size"], std, entry["joint"], entry["without"], entry["with"])

    def against(self, criteria: SelectionCriteria = CRITERIA) -> bool:
        """Whether the held-out recordings contradict it: it stands for another effect, or no effect is more likely.

        It stands for another if its size there certainly differs, and is more than twice as large or removes less than half
        of what its size predicts. To differ certainly is not enough: laws are only approximations, and of a true effect
        99.0 +- 0.3 % may show. No effect is more likely if the size seen is so much nearer to 0 than to 1
        (`MIN_LIKELIHOOD_RATIO`), with its uncertainty.
        """
        removed, least = 2.0 * self.size - 1.0, criteria.min_of_repeatable
        another = (removed < least or least * self.size > 1.0) and (
            abs(1.0 - self.size) > criteria.min_final_size * self.std
        )
        # The logarithm of the ratio of normal likelihoods of sizes 0 and 1.
        return another or 0.5 - self.size > np.log(MIN_LIKELIHOOD_RATIO) * self.std**2

    def borne_out(self, criteria: SelectionCriteria = CRITERIA) -> bool:
        """Whether it surely shows there, and makes the error smaller by what it should."""
        return self.size > max(0.5, criteria.min_size * self.std) and not self.against(criteria)


def held_out_gains(
    found: Search,
    after: Estimate,
    held_out: Observations,
    uncorrected: Observations,
    quiet: Array,
    correction: Correction | None,
) -> Mapping[str, HeldOutGain]:
    """Return what each effect found changes on recordings held out, by its label; those that act in none left out.

    Nothing is chosen by it: the model is the one that the training recordings led to.

    Parameters
    ----------
    after : Estimate
        With the effects found.
    held_out : Observations
        Of the model with the effects found, corrected as the training recordings were.
    uncorrected : Observations
        Of the base model, not corrected.
    quiet : ndarray, shape (blocks,)
        0 for blocks of time that count for nothing in ``held_out``, as an event is there, 1 for others.
    correction : Correction or None
        What was taken out of the recordings held out.

    Notes
    -----
    Of a torque that lacks the change d, ``e . d / d . d`` is the least-squares estimate of how much of it is there, with the
    sandwich variance of blocks of time (White 1980; Liang and Zeger 1986), those of one moment of a motion as one.
    """
    if not held_out.data.recordings:
        return {}
    joints = found.scene.robot.joints
    errors = _errors(held_out.joints, after.value)
    whole = _squares(errors, after.weights)
    gains = {}
    for label, own, others, beside in _each_left_out(found, after, held_out, uncorrected, quiet, correction):
        without = _squares(others, after.weights)
        # What all else becomes without it may change other joints by what the training leaves unsure there.
        joint = slice(None) if own is None else own
        removed, left = float(np.sum((without - whole)[joint])), float(np.sum(whole[joint]))
        place = int(np.argmax(np.abs(without - whole))) if own is None else own
        count = max(1.0, float(np.sum(held_out.joints[place].counts)))
        before, now = (float(np.sqrt(np.sum(each[place] ** 2) / count)) for each in (others, errors))
        size, std = _shown(held_out, others, beside, after, own)
        share = removed / (max(removed, 0.0) + left) if left > 0.0 or removed > 0.0 else 0.0
        gains[label] = HeldOutGain(share, size, std, joints[place], before, now)
    return gains


def spoken_against(
    shown: Sequence[Evidence], gains: Mapping[str, HeldOutGain], criteria: SelectionCriteria = CRITERIA
) -> tuple[Evidence, ...]:
    """Take back that a residual is noise on a joint where the recordings held out speak against an effect found."""
    why = {
        item.joint: f"{shown_of(item, label)} on the held-out recordings"
        for label, item in gains.items()
        if item.against(criteria)
    }
    return tuple(
        replace(item, shown=False, by="", why=why[item.joint]) if item.shown and item.joint in why else item
        for item in shown
    )


def shown_of(gain: HeldOutGain, what: str = "it") -> str:
    """Say how much of an effect recordings held out show."""
    if not np.isfinite(gain.std):
        return f"{what} does not show"
    percent = 100.0 * gain.std
    return f"{100.0 * gain.size:.0f} ± {percent:.{'2g' if percent < 10.0 else '0f'}} % of {what} shows"


def words_of(gain: HeldOutGain, unit: str) -> str:
    """Say what recordings held out show of an effect, in the unit of the joint that it changes most."""
    error, least = (f"{size:.3g} {unit}" for size in (gain.rms, gain.without))
    return f"{shown_of(gain)}; the error of {gain.joint} is {error} with it and {least} without it"


def _each_left_out(
    found: Search,
    after: Estimate,
    held_out: Observations,
    uncorrected: Observations,
    quiet: Array,
    correction: Correction | None,
) -> Iterator[tuple[str, int | None, list[Array], list[Array]]]:
    """Give each effect's label and joint with the errors held out of all else, fitted to the training without it, and with it."""
    scene, start = found.scene, uncorrected.parameters
    errors = _errors(held_out.joints, after.value)
    for place, candidate in enumerate(found.chosen):
        stop = start + len(candidate.effect.columns(scene, candidate.member))
        columns = np.arange(start, stop)
        start = stop
        if any(np.any(rows.table[:-1][np.isin(rows.columns, columns)]) for rows in held_out.joints):
            value, _ = determined_value_and_weights(observed(found.step.without(place)), after.offsets)
            value = np.insert(value, np.full(len(columns), columns[0]), 0.0)
            own = None if candidate.effect.all_joints else candidate.member.joint
            yield candidate.label(scene), own, _errors(held_out.joints, value), errors
    if correction is not None:
        step = replace(found.step, columns=found.step.columns.beside(found.uncorrected))
        value, _ = determined_value_and_weights(observed(step), after.offsets)
        candidate = correction.candidate
        joints = held_out.with_torque(uncorrected.data).faded(quiet).joints
        # Both of the recordings as they are: what correcting makes of their noise would count as half of the effect.
        beside = _errors(joints, after.value)
        for j, change in enumerate(_put_in(held_out, correction, after.value)):
            beside[j] = beside[j] - np.repeat(quiet, np.diff(joints[j].starts)) * change
        yield candidate.label(scene), candidate.member.joint, _errors(joints, value), beside


def _put_in(observations: Observations, correction: Correction, value: Array) -> list[Array]:
    """Return on the rows of each joint what the effect that was taken out of the recordings makes of the torque predicted."""
    effect, member = correction.candidate.effect, correction.candidate.member
    predicted, parts = iter(observations.predicted(value)), []
    for item in observations.data.recordings:
        for part in item.stretches:
            torque = next(predicted)
            one = Recording(item.name, item.name, 1, item.recording.joints, part.motion.time, part.motion.q, torque)
            moved = effect.corrected(one, member, -correction.of(item.name)).effort
            parts.append((part, np.zeros_like(torque) if moved is None else moved - torque))
    return [
        np.concatenate([part.rows(j, change[j : j + 1])[0] for part, change in parts if part.usable])
        for j in range(len(observations.joints))
    ]


def _errors(joints: Sequence[JointRows], value: Array) -> list[Array]:
    """Return what parameters leave of every joint's rows."""
    return [rows.left(value) for rows in joints]


def _squares(errors: Sequence[Array], weights: Array) -> Array:
    """Return the weighted sum of squares of each joint, shape (n,)."""
    return np.array([weight**2 * float(own @ own) for own, weight in zip(errors, weights, strict=True)])


def _shown(
    held_out: Observations, without: Sequence[Array], whole: Sequence[Array], after: Estimate, own: int | None
) -> tuple[float, float]:
    """Return how much of the change that an effect makes on its own joint, or on all, is seen, and its standard deviation.

    By moments of motions; by what the training leaves unsure of the parameters, for motions that are faster than it tell how
    far those go wrong there, not whether the effect is; and by what runs were seen to differ by, their offsets weighed as such.
    """
    joints, data = held_out.joints, held_out.data
    of_block, pull = np.zeros((2, len(joints[0].starts) - 1)), np.zeros(held_out.parameters)
    changes: list[Array] = []
    offsets = offsets_on(held_out, after.offsets)
    for joint, (rows, before, now, weight) in enumerate(zip(joints, without, whole, after.weights, strict=True)):
        if own not in (None, joint):
            changes.append(np.zeros(len(before)))
            continue
        both, signals = np.array([before, before - now]), rows.table[:-1]
        if offsets is not None:
            # A run's offset says nothing of it, and is noise here as it is to the fit.
            both, signals = offsets.whitened(joint, both), offsets.whitened(joint, signals)
        change = weight**2 * both[1]
        pull[rows.columns] += signals @ change
        changes.append(change if offsets is None else offsets.whitened(joint, change[None])[0])
        of_block += [rows.by_block(own * change) for own in both]
    # What a model lacks besides is the same in all repetitions of a moment.
    motion = np.array([data.trajectories.index(label) for label in data.labels])[held_out.owner]
    _, place = np.unique(np.column_stack([motion, moments_of(data)]), axis=0, return_inverse=True)
    shown, made = (np.bincount(place.reshape(-1), own) for own in of_block)
    total, moments = float(np.sum(made)), np.count_nonzero(made)
    if total == 0.0 or moments < 2:
        return (float(np.sum(shown)) / total if total > 0.0 else 0.0), np.inf
    size = float(np.sum(shown)) / total
    scatter = float(np.sum((shown - size * made) ** 2)) * moments / (moments - 1.0)
    known = np.isfinite(np.diag(after.covariance))
    unsure = float(pull[known] @ after.covariance[np.ix_(known, known)] @ pull[known])
    apart = 0.0
    if after.variation is not None:
        apart = variance_of_another_run(after.variation, held_out, after.value, changes)
    return size, float(np.sqrt(scatter + max(0.0, unsure) + apart)) / total
