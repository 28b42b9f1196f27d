"""Design of excitation: the trajectory from which the parameters of a model can be determined best."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from scara_ident.arrays import Array
from scara_ident.calling import asked_for
from scara_ident.diagnosis.diagnose import Diagnosis
from scara_ident.errors import ArgumentError, ScaraIdentError, UsageError
from scara_ident.estimation.information import Information, merge
from scara_ident.excitation.criteria import Criterion, LogDet
from scara_ident.excitation.curves import ExcitationTrajectory, Family, make_basis
from scara_ident.excitation.judge import motion_of
from scara_ident.excitation.limits import Limits, limits_of, nominal_parameters, resting_posture, without_coulomb
from scara_ident.excitation.problem import NARROWEST, Task, speed_within
from scara_ident.excitation.promise import FINE_RATE, ExpectedAnswer, expected_answers
from scara_ident.excitation.search import Effort, Progress, search
from scara_ident.excitation.sensitivity import SmoothModel
from scara_ident.excitation.size import SAMPLES, check_size, default_harmonics, durations_of, harmonics_of
from scara_ident.excitation.tell import search_to_tell
from scara_ident.excitation.verification import Reached, reached
from scara_ident.inquiry.answerability import Inquiry, inquire
from scara_ident.manners import Saved
from scara_ident.model.model import TorqueModel
from scara_ident.motion.motion import Motion
from scara_ident.threads import one_blas_thread


@dataclass(frozen=True, eq=False, repr=False)
class Design(Saved, reported_by="design"):
    """Designed trajectories, with their limits and their expected information.

    Attributes
    ----------
    model : TorqueModel
    criterion : Criterion
    trajectories : tuple of ExcitationTrajectory
    limits : Limits
    nominal : ndarray, shape (p,)
        Parameters with which torques were predicted.
    reached : tuple of Reached
        Every limit and how much of it is used, over all trajectories.
    verified : int
        Samples per trajectory at which the limits were verified.
    information : Information
        Information of all trajectories, with their samples and weights, and torque zero; without the prior.
    prior : Information or None
        Information of existing recordings.
    samples : tuple of int
        Samples of each trajectory in the information.
    weights : ndarray, shape (n,)
        Weight of every joint's rows in it.
    costs : tuple of float
        Cost of every local search, in the order of their starts.
    effort : Effort
    seconds : float
        Time of the search.
    tells : tuple of ExpectedAnswer
        If it was designed to answer questions: the expected answer to each.
    """

    model: TorqueModel
    criterion: Criterion
    trajectories: tuple[ExcitationTrajectory, ...]
    limits: Limits
    nominal: Array
    reached: tuple[Reached, ...]
    verified: int
    information: Information
    prior: Information | None
    samples: tuple[int, ...]
    weights: Array
    costs: tuple[float, ...]
    effort: Effort
    seconds: float
    tells: tuple[ExpectedAnswer, ...] = ()

    def _in_short(self) -> str:
        names = ", ".join(each.name for each in self.trajectories)
        seconds = ", ".join(dict.fromkeys(f"{each.duration:g}" for each in self.trajectories))
        return f"{self.model.robot.name}: {names} of {seconds} s, ln det {self.log_det:.2f}"

    @property
    def total(self) -> Information:
        """Information of the trajectories and of the prior."""
        return self.information if self.prior is None else merge([self.prior, self.information])

    @cached_property
    def unweighted(self) -> Information:
        """Information of all trajectories with equal weight of all rows, as in the paper's criteria."""
        if np.all(self.weights == 1.0):
            return self.information
        each = zip(self.trajectories, self.samples, strict=True)
        return merge([information_of(self.model, trajectory, samples) for trajectory, samples in each])

    @property
    def log_det(self) -> float:
        """J_d: ln det(H^T H) of the trajectories alone, of `unweighted`."""
        return self.unweighted.log_det()

    @property
    def condition(self) -> float:
        """J_k: cond(H^T H) of the trajectories alone, with unscaled columns, of `unweighted`."""
        return self.unweighted.condition()

    def motion(self, number: int = 0, rate: float = 1000.0) -> Motion:
        """Return samples of a trajectory with its predicted torque."""
        trajectory = self.trajectories[number]
        motion = trajectory.motion(round(trajectory.duration * rate) + 1)
        torque = np.einsum("jpN,p->jN", self.model.regressor(motion), self.nominal)
        return replace(motion, torque=np.asarray(torque))

    def std(self) -> Array:
        """Return the expected std of every parameter, shape (p,); infinite if it stays undetermined.

        For the given noise of the torques, or for unit noise on every row; the noise is white, at the design's samples.
        """
        return self.total.std()


@one_blas_thread()
def design_excitation(
    model: TorqueModel,
    *,
    duration: float | Sequence[float] = 25.0,
    harmonics: int | Sequence[int] | None = None,
    criterion: Criterion | None = None,
    tell: Inquiry | Diagnosis | None = None,
    limits: Limits | None = None,
    known: Mapping[str, float] | None = None,
    trajectories: int = 1,
    prior: Information | None = None,
    torque_std: Array | None = None,
    start: Array | None = None,
    family: Family = "fourier",
    samples: int = SAMPLES,
    name: str = "excitation",
    effort: Effort | None = None,
    progress: Callable[[Progress], None] | None = None,
) -> Design:
    """Design trajectories that excite the parameters of a model within the limits of the robot.

    Parameters
    ----------
    model : TorqueModel
        Its columns must depend only on position, velocity and acceleration at the same time.
    duration : float or sequence of float
        Duration of each trajectory, s; a sequence gives the duration of each of several trajectories.
    harmonics : int or sequence of int, optional
        Number of harmonics, or their orders (a multisine). See `default_harmonics`. If durations differ, the number for
        the longest; shorter ones have as many as reach the same frequency.
    criterion : Criterion, optional
        Default: the log determinant.
    tell : Inquiry or Diagnosis, optional
        Instead of a criterion: the questions about this model that one motion of harmonics should answer best; see
        `scara_ident.inquiry.answerability`.
    limits : Limits, optional
        Default: those of `limits_of`.
    known : mapping from parameter to value, optional
        Parameters that predict the torques, in addition to the URDF; see `nominal_parameters`.
    trajectories : int
        Number of trajectories that are designed together and complement each other.
    prior : Information, optional
        Information of existing recordings, with the columns of the model, and rows weighted as in the design.
    torque_std : ndarray, shape (n,), optional
        Noise of every joint's torque; by default every row has weight one.
    start : ndarray, shape (n,), optional
        Posture to start in (and, for harmonics, to end in), rad or m.
    family : {"fourier", "spline"}
    samples : int
        Samples of each trajectory in the criterion; if durations differ, of the longest, and the others have the same
        rate.
    name : str
        Name of the trajectory; several are called ``name-a``, ``name-b``, ... .
    effort : Effort, optional
    progress : callable, optional
        Called after every local search.

    Returns
    -------
    Design

    Raises
    ------
    InfeasibleLimits
        If no motion keeps the limits, or none begins at the start.
    RobotError
        If a joint has no limits.
    UsageError
        If the arguments do not fit the model.
    ArgumentError
        If the model is no `TorqueModel`.
    ScaraIdentError
        If ``tell`` has no question.

    References
    ----------
    J. Swevers et al., "Optimal robot excitation and identification", IEEE Transactions on Robotics and Automation
    13(5), 1997. G. Calafiore, M. Indri, B. Bona, "Robot dynamic calibration: optimal excitation trajectories and
    experimental parameter estimation", Journal of Robotic Systems 18(2), 2001.

    Examples
    --------
    >>> from scara_ident import Effort, build_model, design_excitation, load_robot, write_trajectory
    >>> quick = Effort(starts=1, rounds=1)
    >>> design = design_excitation(build_model(load_robot()), duration=5.0, harmonics=3, effort=quick)
    >>> design.to_frame().shape
    (5001, 7)
    >>> write_trajectory(design.trajectories[0], "trajectory.csv")
    """
    begun = time.perf_counter()
    if not isinstance(model, TorqueModel):
        raise ArgumentError(f"model: expected a TorqueModel, as build_model gives; found {type(model).__name__}")
    robot, count = model.robot, len(model.names)
    durations = durations_of(duration, trajectories)
    trajectories, longest = len(durations), max(durations)
    if samples < 2:
        raise UsageError(f"samples {samples}: expected at least 2")
    if prior is not None and prior.parameters != count:
        raise UsageError(
            f"existing information is about {prior.parameters} parameters, the model {model.name} has {count}; compute "
            f"it with the same model"
        )
    effort = Effort() if effort is None else effort
    limits = limits_of(robot) if limits is None else limits
    weights = _weights(torque_std, robot.n)
    nominal = nominal_parameters(model, known)
    smooth, left = without_coulomb(model, limits, nominal)
    if harmonics is None:
        harmonics = default_harmonics(longest, robot.n, trajectories)
    chosen = [
        harmonics_of(harmonics, each / longest) if isinstance(harmonics, int) else harmonics for each in durations
    ]
    counted = tuple(max(2, round(samples * each / longest)) for each in durations)
    for orders, size in zip(chosen, counted, strict=True):
        check_size(orders, robot.n, trajectories, size)
    bases = tuple(
        make_basis(each, orders, family, fixed_start=start is not None)
        for each, orders in zip(durations, chosen, strict=True)
    )
    task = Task(
        smooth=SmoothModel(model, NARROWEST * speed_within(limits, bases)),
        limits=left,
        nominal=smooth,
        criterion=LogDet() if criterion is None else criterion,
        bases=bases,
        posture=resting_posture(model, left, smooth, start=start, seed=effort.seed),
        samples=counted,
        weights=weights,
        prior=np.zeros((count, count)) if prior is None else prior.regressor_factor.T @ prior.regressor_factor,
    )
    if tell is None:
        found = search(task, effort, progress)
    else:
        inquiry = inquire(tell) if isinstance(tell, Diagnosis) else tell
        _check_asked(inquiry, model, criterion, trajectories, family)
        found = search_to_tell(task, inquiry, effort, progress)
    suffixes = [""] if trajectories == 1 else [f"-{chr(ord('a') + k)}" for k in range(trajectories)]
    designed = tuple(
        ExcitationTrajectory(name + suffix, robot.joints, basis, task.posture, x[:, : basis.size])
        for suffix, basis, x in zip(suffixes, task.bases, found.x, strict=True)
    )
    return Design(
        model=model,
        criterion=task.criterion,
        trajectories=designed,
        limits=limits,
        nominal=nominal,
        reached=reached(task, limits.torque, found.x, found.times),
        verified=found.times,
        information=merge(
            [information_of(model, each, size, weights) for each, size in zip(designed, task.samples, strict=True)]
        ),
        prior=prior,
        samples=task.samples,
        weights=weights,
        costs=found.costs,
        effort=effort,
        seconds=time.perf_counter() - begun,
        tells=()
        if tell is None
        else expected_answers(inquiry, [motion_of(task.bases[0], task.posture, found.x[0], FINE_RATE)]),
    )


def _check_asked(
    inquiry: Inquiry, model: TorqueModel, criterion: Criterion | None, trajectories: int, family: Family
) -> None:
    if not inquiry.questions:
        raise ScaraIdentError("the diagnosis left no question that a motion could answer; no recording is needed")
    if criterion is not None or trajectories > 1 or family != "fourier":
        raise UsageError(f"a motion for {asked_for('--tell')} is one trajectory of harmonics, and takes no criterion")
    asked = inquiry.scene.model
    if asked.names != model.names:
        raise UsageError(
            f"the diagnosis is for the model {asked.name}, the design for {model.name}; use the model of the diagnosis"
        )


def information_of(
    model: TorqueModel, trajectory: ExcitationTrajectory, samples: int = SAMPLES, weights: Array | None = None
) -> Information:
    """Return the information of equally spaced samples of a trajectory, with torque zero.

    Parameters
    ----------
    model : TorqueModel
    trajectory : ExcitationTrajectory
    samples : int
    weights : ndarray, shape (n,), optional
        Of every joint's rows; 1 by default.
    """
    regressor = model.regressor(trajectory.motion(samples))
    if weights is not None:
        regressor = regressor * weights[:, None, None]
    rows = regressor.transpose(2, 0, 1).reshape(-1, regressor.shape[1])
    return Information.empty(rows.shape[1]).absorb(rows, np.zeros(len(rows)))


def _weights(torque_std: Array | None, joints: int) -> Array:
    if torque_std is None:
        return np.ones(joints)
    std = np.asarray(torque_std, dtype=float)
    if std.shape != (joints,) or not np.all(std > 0.0):
        raise UsageError(f"torque noise: expected {joints} positive numbers, given {std.tolist()}")
    return 1.0 / std
