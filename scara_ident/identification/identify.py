"""The main task: from recordings to parameters, their standard deviations, and their predictions."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from scara_ident.arrays import Array
from scara_ident.errors import ArgumentError, EstimationError, UsageError
from scara_ident.estimation import Estimate, History, JointError, wls
from scara_ident.estimation.consistent.estimator import ConsistentEstimate, physical_consistency
from scara_ident.estimation.consistent.feasibility import PhysicalConsistency
from scara_ident.estimation.consistent.options import ConsistentOptions
from scara_ident.estimation.estimate import paper_criteria
from scara_ident.estimation.information import Information, merge
from scara_ident.estimation.observations import Observations, observe
from scara_ident.estimation.robust import disagreement, robust_fit
from scara_ident.estimation.run_offsets import beside_offsets, offsets_on
from scara_ident.estimation.urdf_scale import urdf_scale
from scara_ident.files import real_path
from scara_ident.identification import ESTIMATORS
from scara_ident.identification.arguments import Recordings, model_of, recordings_of
from scara_ident.identification.channel_check import channel_faults
from scara_ident.identification.channel_fault import ChannelFault, refuse_exchanged
from scara_ident.identification.clock_check import clock_drift
from scara_ident.identification.events import Event, event_notes, find_events
from scara_ident.identification.gain_check import gain_said
from scara_ident.identification.long_recordings import with_all_samples
from scara_ident.identification.recording_check import held_out_events
from scara_ident.identification.usable import check_rows, usable_in_bands
from scara_ident.manners import Saved, several
from scara_ident.model.base_parameters import parameter_scale
from scara_ident.model.model import TorqueModel
from scara_ident.motion.position_noise import noise_sizes
from scara_ident.motion.repeatability import repeatability
from scara_ident.progress import Tell, Work, log_notes, silent
from scara_ident.recording.recording import Recording
from scara_ident.recording.shared_samples import shared_samples
from scara_ident.robot.robot import Robot
from scara_ident.threads import one_thread, side_by_side

_LOG = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False, repr=False)
class Identification(Saved, reported_by="identification"):
    """The result of one identification.

    Attributes
    ----------
    estimate : Estimate
    history : History or None
        History of the recursive estimate.
    bands : tuple of float or None
        Low-pass of both sides of each joint's equation, Hz; None if not filtered.
    training, validation : Observations
        Observations of the recordings; no choice used the validation recordings.
    noise : mapping of str to ndarray
        Repeatability of the torque per trajectory, see `repeatability`.
    log_det, condition : float
        J_d and J_k of the training recordings for the paper's 2500 samples.
    notes : tuple of str
        Findings in the data, and how they were treated.
    events : tuple of Event
        What happens in a part of the time: left out of the fit, or in held-out recordings.
    channels : tuple of ChannelFault
        Channels that seem to have the opposite sign.
    """

    estimate: Estimate
    history: History | None
    bands: tuple[float | None, ...]
    training: Observations
    validation: Observations
    noise: Mapping[str, Array]
    log_det: float
    condition: float
    notes: tuple[str, ...]
    events: tuple[Event, ...] = ()
    channels: tuple[ChannelFault, ...] = ()

    @property
    def model(self) -> TorqueModel:
        """The model that was fitted."""
        return self.estimate.model

    def predict(self, q: ArrayLike, v: ArrayLike, a: ArrayLike) -> Array:
        """Predict the recorded torque, friction and offset included, of one state or of many.

        Parameters
        ----------
        q, v, a : array_like, shape (n,) or (N, n)
            Position, velocity and acceleration in rad or m, per s and s^2; joints in the robot's order.

        Returns
        -------
        ndarray, shape (n,) or (N, n)
            N m (N), on the side of the gear where effort is recorded.

        Raises
        ------
        UsageError
            If the shapes are not these.
        """
        return self.estimate.predict(q, v, a)

    def _in_short(self) -> str:
        return f"{self.estimate._in_short()} from {several(len(self.training.data.recordings), 'recording')}"

    @cached_property
    def physical_consistency(self) -> PhysicalConsistency:
        """Whether the parameters are physically consistent, and what contradicts it; computed at the first use."""
        return physical_consistency(self.estimate)

    def training_errors(self) -> dict[str, tuple[JointError | None, ...]]:
        """Return the errors on the training recordings, by recording."""
        return self._errors(self.training)

    def validation_errors(self) -> dict[str, tuple[JointError | None, ...]]:
        """Return the errors on the held-out recordings, by recording."""
        return self._errors(self.validation)

    def _errors(self, observations: Observations) -> dict[str, tuple[JointError | None, ...]]:
        # One after the other: each is so short that two threads would only compete for the interpreter's lock.
        with one_thread():
            return {item.name: self.estimate.errors(item) for item in observations.each}


def identify(
    robot: Robot,
    recordings: Recordings,
    *,
    model: str | TorqueModel = "complete",
    method: str = "wls",
    validation: Recordings = (),
    bands: Sequence[float | None] | None = None,
    options: ConsistentOptions | None = None,
    progress: Tell = silent,
) -> Identification:
    """Identify a robot from recordings of its motion.

    Parameters
    ----------
    robot : Robot
    recordings : sequence of Recording, or of path
        The recordings to fit, or files or folders of them.
    model : str or TorqueModel, optional
        A name of `scara_ident.model.MODELS`: ``complete``, ``reduced``, ``basic`` or an installed package's.
    method : str, optional
        A name of `scara_ident.identification.ESTIMATORS`: ``wls`` (each joint weighted by its residual), ``ols`` (every
        row counts the same, as in Indri et al. 2002), ``rls``, ``consistent`` or an installed package's.
    validation : sequence of Recording, or of path, optional
        Held-out recordings: neither the fit nor any choice uses them.
    bands : sequence of float or None, one per joint, optional
        Low-pass of both sides of each joint's equation, Hz; default: chosen from the recordings.
    options : ConsistentOptions, optional
        Options of the method ``consistent``: shape of friction, masses, centres of mass, priors.
    progress : callable, optional
        Called at the begin of every step with its name and the share of the work done.

    Returns
    -------
    Identification

    Raises
    ------
    UsageError
        If there are no recordings, the model or the method is unknown, a recording is both fitted and held out, a band
        is not positive or above half of the slowest sample rate, or options are given with another method than
        ``consistent``; `ArgumentError` if an argument is of the wrong kind.
    RecordingError
        If none of the recordings to fit can be used, or they have fewer rows than the model has parameters, or two joints are
        exchanged or efforts have no sign (see `channel_faults`). If one of several recordings, or a held-out one,
        cannot be used, it is left out with a note.

    Examples
    --------
    >>> from scara_ident import identify, load_robot, named_motion, simulate, virtual_arm
    >>> robot = load_robot()
    >>> run = simulate(virtual_arm(robot), named_motion("OJK", robot), rate=250.0)
    >>> result = identify(robot, [run.recording])
    >>> result
    Identification(scara03, complete by wls: 15 parameters from 1 recording)
    >>> result.predict([0.1, 0.2], [0.5, -0.5], [1.0, 2.0]).shape
    (2,)
    >>> result.to_frame().columns[:4]
    ['name', 'joint', 'value', 'std']
    """
    recordings, validation = recordings_of(recordings, robot), recordings_of(validation, robot, "validation")
    if not recordings:
        raise UsageError("no recordings to identify from")
    if not isinstance(options, ConsistentOptions | None):
        raise ArgumentError(f"options: expected ConsistentOptions; found {type(options).__name__}")
    if options is not None and method != "consistent":
        raise UsageError(f"options: these belong to the method consistent; {method!r} has no options")
    ESTIMATORS.get(method)  # a package that cannot be loaded is named before the work, not after it
    check_held_out(recordings, validation)
    equation = model_of(model, robot)
    if bands is not None:
        check_bands(robot, bands, (*recordings, *validation))
    if bands is None:
        progress("choosing the bands", 0.0)
    data, held_out, notes = usable_in_bands(equation, recordings, validation, bands)
    progress("absorbing the recordings", 0.5)
    training, validated = observe(equation, data), observe(equation, held_out)
    check_rows(training)
    faults = channel_faults(training)
    refuse_exchanged(faults)
    notes[:0] = (*robot.notes, *equation.notes)
    progress("looking for events", 0.6)
    # With a wrong sign or exchanged joints nothing is explained anywhere.
    robust = None if faults else robust_fit(training)
    # All look at samples alone, so that they go side by side; the estimators ask for the noise of positions.
    (events, noise, _) = side_by_side(
        lambda work: work(),
        [
            lambda: () if robust is None else find_events(training, robust.value),
            lambda: repeatability(data),
            lambda: noise_sizes(data),
        ],
    )
    steady = None if robust is None else robust.value
    training, events, more = with_all_samples(training, events, steady, Work(progress, 0.6, 0.7))
    notes += more
    progress("estimating", 0.7)
    try:
        estimate, history = estimate_by(method, training, options)
    except EstimationError as error:
        if not faults:
            raise
        # What no arm can have is mended in the channels, not in the method.
        raise EstimationError("; ".join(str(fault) for fault in faults)) from error
    differs = None
    if robust is not None:
        # Both estimates are of the same samples, and without constraints.
        plain = estimate
        if isinstance(estimate, ConsistentEstimate):
            plain = wls(training.in_memory)
        elif training.kept is not None:
            plain, _ = estimate_by(method, training.kept, options)
        if plain.offsets is not None:
            kept = training.in_memory
            robust = robust_fit(beside_offsets(kept, offsets_on(kept, plain.offsets)).fitted)
        differs = disagreement(plain, robust)
    events += () if faults else held_out_events(estimate.value, training, validated)
    drift = None if faults else clock_drift(estimate.value, training.in_memory)
    gain = None if faults else gain_said(training.in_memory)
    notes += event_notes(robot, events) + [said for said in (gain, differs, drift) if said is not None]
    if isinstance(estimate, ConsistentEstimate):
        notes += estimate.notes
    log_notes(_LOG, (*map(str, faults), *notes))
    log_det, condition = paper_criteria(training)
    return Identification(
        estimate, history, data.bands, training, validated, noise, log_det, condition, tuple(notes), events, faults
    )


def known_information(
    model: TorqueModel, recordings: Sequence[Recording], rate: float, weights: Array | None = None
) -> Information:
    """Return the information of existing recordings about a model, as if sampled at ``rate`` per second.

    Parameters
    ----------
    rate : float
        Samples per second that the design they are to be joined with counts.
    weights : ndarray, shape (n,), optional
        Of every joint's rows in it; 1 by default.
    """
    each_joint = np.ones(model.robot.n) if weights is None else weights
    data, _, _ = usable_in_bands(model, recordings)
    return merge(
        information.scaled(float(weight * np.sqrt(rate / item.data.sources[0].rate)))
        for item in observe(model, data).each
        for weight, information in zip(each_joint, item.by_joint, strict=True)
    )


def check_bands(robot: Robot, bands: Sequence[float | None], recordings: Sequence[Recording]) -> None:
    """Refuse bands that are not one for each joint, or no frequencies that the slowest recording carries.

    Raises
    ------
    UsageError
    """
    if not isinstance(bands, Sequence) and not isinstance(bands, np.ndarray):
        raise ArgumentError(f"bands: expected one for each of {', '.join(robot.joints)}; found {type(bands).__name__}")
    if len(bands) != robot.n:
        raise UsageError(f"bands: {len(bands)} given; expected one for each of {', '.join(robot.joints)}")
    for joint, band in zip(robot.joints, bands, strict=True):
        if band is not None and not 0.0 < band < np.inf:
            raise UsageError(f"band of {joint} is {band:g} Hz; expected a frequency above 0, or none")
        slowest = min(recordings, key=lambda recording: recording.rate)
        if band is not None and band >= 0.5 * slowest.rate:
            raise UsageError(
                f"band of {joint} is {band:g} Hz; {slowest.name} has {slowest.rate:.4g} samples per second, which carry "
                f"less than {0.5 * slowest.rate:.4g} Hz; give a lower band"
            )


def estimate_by(
    method: str, observations: Observations, options: ConsistentOptions | None = None
) -> tuple[Estimate, History | None]:
    """Estimate by a method given by name; the options are those of ``consistent``.

    Raises
    ------
    EstimationError
        If the method, as one of a package, returns something else than an estimate of the model's p parameters, or such
        an estimate and a `History`.
    """
    estimator = ESTIMATORS.get(method)
    more: dict[str, Any] = {"options": options} if method == "consistent" else {}
    found = estimator(observations, **more)
    estimate, history = found if isinstance(found, tuple) and len(found) == 2 else (found, None)
    if not isinstance(estimate, Estimate):
        raise EstimationError(f"method {method!r} returned {type(estimate).__name__}; expected an Estimate")
    p = observations.parameters
    for name, shape in (("value", (p,)), ("covariance", (p, p)), ("undetermined", (p,))):
        given = np.shape(getattr(estimate, name))
        if given != shape:
            raise EstimationError(f"method {method!r} returned {name} of shape {given}; the model asks for {shape}")
    return estimate, history


def check_held_out(recordings: Sequence[Recording], validation: Sequence[Recording]) -> None:
    """Refuse a recording that is both fitted and held out, or has samples of one that is fitted.

    Raises
    ------
    UsageError
    """
    fitted = {real_path(recording.path) for recording in recordings if recording.path is not None}
    for recording in validation:
        known = recording.path is not None and real_path(recording.path) in fitted
        if known or any(recording is other for other in recordings):
            raise UsageError(
                f"{recording.path or recording.name}: given to fit and to validate; a validation recording must be held out"
            )
    for other, first, share in shared_samples(recordings, validation):
        raise UsageError(
            f"{other.path or other.name}: {share:.0%} of its samples are those of {first.path or first.name}, given to fit and "
            "to validate; a validation recording must be held out"
        )


def undetermined(identification: Identification) -> list[str]:
    """Return the names of the parameters that the data do not determine."""
    estimate = identification.estimate
    return [name for name, open_ in zip(estimate.model.names, estimate.undetermined, strict=True) if open_]


def determined_in_sums(identification: Identification) -> list[str]:
    """Return the names of body parameters that are determined, but with a standard deviation larger than the sum of all bodies in the description.

    They are almost sums of others, for example because an angle in the description has few digits: the torque
    determines only the sums.
    Where efforts are in units of their own, bodies are as many times larger.
    """
    estimate, robot, term = identification.estimate, identification.model.robot, identification.model.rigid_body
    mass = float(np.sum(robot.standard_parameters()[: 10 * robot.n : 10]))
    if mass <= 0.0:
        return []
    mass *= max([1.0, *map(abs, urdf_scale(estimate, identification.training).values())])
    place = identification.model.place(term)
    unsure = estimate.std[place] > mass * parameter_scale(robot)[term.base.kept[term.kept]]
    unsure &= ~estimate.undetermined[place] & np.isfinite(estimate.std[place])
    return [column.name for column, beyond in zip(term.columns, unsure, strict=True) if beyond]


def insignificant_parameters(identification: Identification) -> list[str]:
    """Return the names of the determined parameters that are within two standard deviations, where known, of zero."""
    estimate = identification.estimate
    small = (np.abs(estimate.value) < 2.0 * estimate.std) & ~estimate.undetermined & np.isfinite(estimate.std)
    return [name for name, is_small in zip(estimate.model.names, small, strict=True) if is_small]


def of_unknown_std(identification: Identification) -> list[str]:
    """Return the names of the determined parameters whose standard deviation the recordings do not determine."""
    estimate = identification.estimate
    unknown = ~np.isfinite(estimate.std) & ~estimate.undetermined
    return [name for name, is_unknown in zip(estimate.model.names, unknown, strict=True) if is_unknown]


def worst_validation(identification: Identification) -> tuple[str, str, JointError] | None:
    """Return the held-out recording and joint with the largest relative error within the band, after offsets that differ are removed."""
    found = [
        (error.beside_own_offset[1], name, joint, error)
        for name, errors in identification.validation_errors().items()
        for joint, error in zip(identification.model.robot.joints, errors, strict=True)
        if error is not None and error.relative is not None
    ]
    return max(found, key=lambda item: item[0] or 0.0)[1:] if found else None
