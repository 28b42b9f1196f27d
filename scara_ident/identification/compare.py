"""Every trajectory's parameters against every trajectory (Tables 1 to 5 of Indri et al. 2002), for any arm."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scara_ident.arrays import Array
from scara_ident.errors import RecordingError
from scara_ident.estimation import Estimate, wls
from scara_ident.estimation.estimate import paper_criteria
from scara_ident.estimation.information import Information, merge
from scara_ident.estimation.observations import Observations, observe
from scara_ident.estimation.own_offsets import without
from scara_ident.estimation.run_offsets import rms_beside_own
from scara_ident.identification.arguments import Recordings, model_of, recordings_of
from scara_ident.identification.identify import check_bands, estimate_by
from scara_ident.identification.usable import check_rows, usable_in_bands
from scara_ident.manners import Saved
from scara_ident.model.model import TorqueModel
from scara_ident.model.offsets import OWN_LEAVE, offset_columns
from scara_ident.motion.repeatability import repeatability
from scara_ident.progress import Tell, log_notes, silent
from scara_ident.robot.robot import Robot

_LOG = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class TrajectorySummary:
    """What one trajectory is and what it gives (a column of Tables 1 and 5).

    Attributes
    ----------
    log_det, condition : float
        J_d and J_k for 2500 samples.
    sigma : ndarray, shape (n,) or None
        Repeatability of the torque; None without repetitions.
    peak_velocity, peak_acceleration : ndarray, shape (n,)
        Within the band.
    torque_rms : ndarray, shape (n,)
        Within the band.
    estimate : Estimate
        From this trajectory alone.
    """

    name: str
    recordings: tuple[str, ...]
    log_det: float
    condition: float
    sigma: Array | None
    peak_velocity: Array
    peak_acceleration: Array
    torque_rms: Array
    estimate: Estimate


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(Saved, reported_by="comparison"):
    """The parameters of each trajectory, and their errors on every trajectory.

    Attributes
    ----------
    model : TorqueModel
    method : str
    bands : tuple of float or None
    trajectories : tuple of TrajectorySummary
    errors : ndarray, shape (t, t, n)
        ``errors[i, k, j]``: rms error on trajectory i, joint j, of the parameters from trajectory k.
    expected : ndarray, shape (t, t, n)
        The error predicted by the covariance of the parameters and the error of i's own parameters. A much larger error
        is bias and not noise. Infinite if trajectory k does not determine a parameter that the joint depends on; the
        error that noise explains is then not known. If offsets of recordings are the main part of all errors, both are
        given after each recording's own offset is removed.
    notes : tuple of str
    """

    model: TorqueModel
    method: str
    bands: tuple[float | None, ...]
    trajectories: tuple[TrajectorySummary, ...]
    errors: Array
    expected: Array
    notes: tuple[str, ...]

    def _in_short(self) -> str:
        names = ", ".join(item.name for item in self.trajectories)
        return f"{self.model.robot.name}, {self.model.name} by {self.method}: {names}"


def compare(
    robot: Robot,
    recordings: Recordings,
    *,
    model: str | TorqueModel = "complete",
    method: str = "wls",
    bands: Sequence[float | None] | None = None,
    progress: Tell = silent,
) -> Comparison:
    """Estimate from each trajectory alone, and predict all trajectories with each estimate.

    Parameters
    ----------
    robot : Robot
    recordings : sequence of Recording, or of path
        Repetitions of at least two trajectories.
    model, method, bands, progress
        As in `identify`; the bands are chosen from all recordings together.

    Returns
    -------
    Comparison

    Raises
    ------
    UsageError
        If a band is not positive or above half of the slowest sample rate.
    RecordingError
        If there are fewer than two trajectories, or none of the recordings can be used; one of several that cannot, or a trajectory with fewer rows than the model has
        parameters, is left out with a note.

    Examples
    --------
    >>> from scara_ident import compare, load_robot, named_motion, simulate, virtual_arm
    >>> robot = load_robot()
    >>> motions = [named_motion(name, robot) for name in ("OJK", "OJD")]
    >>> compare(robot, [simulate(virtual_arm(robot), motion, rate=250.0).recording for motion in motions])
    Comparison(scara03, complete by wls: OJK, OJD)
    """
    recordings = recordings_of(recordings, robot)
    equation = model_of(model, robot)
    if bands is not None:
        check_bands(robot, bands, recordings)
    else:
        progress("choosing the bands", 0.0)
    data, _, notes = usable_in_bands(equation, recordings, bands=bands)
    progress("absorbing the recordings", 0.4)
    observations = observe(equation, data)
    noise = repeatability(data)
    each, useless = _with_enough(observations)
    if len(each) < 2:
        raise RecordingError(
            "; ".join(
                [
                    f"compare needs recordings of at least two trajectories, found {len(each)}; "
                    "recordings of the same motion are repetitions of one trajectory, whatever they are named",
                    *(note for note in (*notes, *useless) if note.endswith("left out")),
                ]
            )
        )
    names, rows = list(each), [own.by_joint for own in each.values()]
    if _offsets_differ(observations):
        rows = [_beside_own_offsets(own) for own in each.values()]
        notes = [
            *notes,
            "offsets differ from recording to recording: errors are given after each recording's own offset is removed",
        ]
    summaries = []
    for k, (name, own) in enumerate(each.items()):
        progress(f"estimating from {name}", 0.5 + 0.4 * k / len(names))
        summaries.append(_summary(name, own, method, noise.get(name)))
    errors = np.zeros((len(names), len(names), robot.n))
    expected = np.zeros_like(errors)
    for i, predicted in enumerate(rows):
        for k, summary in enumerate(summaries):
            for j, information in enumerate(predicted):
                if not information.rows:
                    errors[i, k, j] = expected[i, k, j] = np.nan
                    continue
                errors[i, k, j] = information.rms(summary.estimate.value)
                spread = _spread(information, summary.estimate.covariance)
                expected[i, k, j] = np.sqrt(
                    information.rms(summaries[i].estimate.value) ** 2 + max(spread, 0.0) / information.rows
                )
    log_notes(_LOG, (*notes, *useless))
    return Comparison(equation, method, data.bands, tuple(summaries), errors, expected, (*notes, *useless))


def _offsets_differ(observations: Observations) -> bool:
    """Whether offsets of recordings differ so that they make most of what parameters of all leave."""
    found = wls(observations)
    if found.offsets is None:
        return False
    left = np.array([rows.rms(found.value) if rows.samples else np.nan for rows in observations.joints])
    shares = (rms_beside_own(found.value, observations) / left) ** 2
    return bool(np.nanmean(shares) < OWN_LEAVE)


def _beside_own_offsets(observations: Observations) -> tuple[Information, ...]:
    """Return what rows of each joint say with an offset of every recording's own."""
    each = [item.by_joint for item in observations.each]
    pairs = zip(zip(*each, strict=True), offset_columns(observations.model), strict=True)
    return tuple(merge([item if column is None else without(item, column) for item in runs]) for runs, column in pairs)


def _with_enough(observations: Observations) -> tuple[dict[str, Observations], list[str]]:
    """Return the observations of each trajectory, without those that cannot be estimated from alone, and say which."""
    found, notes = {}, []
    labels = observations.data.labels
    for name in observations.data.trajectories:
        own = observations.of([place for place, label in enumerate(labels) if label == name])
        try:
            check_rows(own)
        except RecordingError as error:
            notes.append(f"{error}; left out")
        else:
            found[name] = own
    return found, notes


def _spread(information: Information, covariance: Array) -> float:
    """Return the power that a covariance of the parameters predicts over a joint's rows; infinite where one is open."""
    factor = information.regressor_factor
    seen = np.any(factor != 0.0, axis=0)
    factor, own = factor[:, seen], covariance[np.ix_(seen, seen)]
    return float(np.sum((factor @ own) * factor)) if np.all(np.isfinite(own)) else np.inf


def _summary(name: str, observations: Observations, method: str, sigma: Array | None) -> TrajectorySummary:
    estimate, _ = estimate_by(method, observations)
    log_det, condition = paper_criteria(observations)
    motions = [part.motion for part in observations.data.recordings[0].stretches]
    return TrajectorySummary(
        name,
        tuple(item.name for item in observations.data.recordings),
        log_det,
        condition,
        sigma,
        np.max([np.max(np.abs(motion.v), axis=1) for motion in motions], axis=0),
        np.max([np.max(np.abs(motion.a), axis=1) for motion in motions], axis=0),
        np.array([information.torque_rms for information in observations.by_joint]),
        estimate,
    )
