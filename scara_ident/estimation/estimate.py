"""An estimate: parameters, the information they came from, and the means to check itself."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scara_ident.arrays import Array
from scara_ident.estimation.information import Information, merge
from scara_ident.estimation.observations import Observations
from scara_ident.estimation.run_offsets import beside_offsets, rms_beside_own
from scara_ident.estimation.run_variation import RunVariation
from scara_ident.manners import Saved
from scara_ident.model.model import TorqueModel
from scara_ident.model.prediction import Prediction

# The paper takes its criteria over this many samples, whatever the recording's length.
PAPER_SAMPLES = 2500


@dataclass(frozen=True)
class JointError:
    """Error of predicted torque on one joint of one recording.

    Attributes
    ----------
    rms : float
        Rms residual within the band, N m or N.
    relative : float or None
        That, as a share of the torque's rms within the band; None where there is no torque.
    rms_unfiltered : float
        Rms residual of the torque as recorded.
    relative_unfiltered : float or None
        That, as a share of the recorded torque's rms.
    rms_own_offset : float or None
        Rms residual within the band beside an offset of each recording's own; None where offsets were not seen to differ.
    """

    rms: float
    relative: float | None
    rms_unfiltered: float
    relative_unfiltered: float | None
    rms_own_offset: float | None = None

    @property
    def beside_own_offset(self) -> tuple[float, float | None]:
        """The rms beside an offset of the recording's own, where offsets differ, and as a share of the torque's."""
        if self.rms_own_offset is None or self.relative is None:
            return self.rms, self.relative
        return self.rms_own_offset, self.relative * self.rms_own_offset / self.rms if self.rms else 0.0


@dataclass(frozen=True, eq=False, repr=False)
class Estimate(Saved, reported_by="estimate"):
    """Parameters of a model with their covariance.

    Attributes
    ----------
    model : TorqueModel
    method : str
    value : ndarray, shape (p,)
    covariance : ndarray, shape (p, p)
        Infinite variance if a parameter is undetermined.
    undetermined : ndarray of bool, shape (p,)
        Parameters that the data do not determine, alone or in a combination.
    information : Information
        Information of all rows, with the weights of the estimate, and with the offsets of runs as noise if it treated
        them so.
    weights : ndarray, shape (n,)
        Weight of each joint's rows.
    std_kind : str
        Method of the covariance, see `scara_ident.estimation.covariance`.
    variation : RunVariation or None
        Differences between runs, which are part of the covariance; None if not estimated.
    offsets : RunVariation or None
        Scatter of the offsets of runs that the fit treated as noise, see `scara_ident.estimation.run_offsets`; None if
        there is none.
    noise_bias : ndarray, shape (p,), or None
        Bias of the parameters by the noise of positions, which is part of the covariance; None if negligible or not
        estimated.
    followed : ndarray, shape (p,), or None
        If columns depend on the parameters: the difference of the parameters from those that would fit the same columns
        best; otherwise None.
    """

    model: TorqueModel
    method: str
    value: Array
    covariance: Array
    undetermined: NDArray[np.bool_]
    information: Information
    weights: Array
    std_kind: str
    variation: RunVariation | None = field(default=None, kw_only=True)
    offsets: RunVariation | None = field(default=None, kw_only=True)
    noise_bias: Array | None = field(default=None, kw_only=True)
    followed: Array | None = field(default=None, kw_only=True)

    def rows(self, observations: Observations) -> tuple[Information, ...]:
        """Return the rows of each joint as used by the estimate, which its parameters fit best.

        Parameters
        ----------
        observations : Observations
            The observations of the estimate.
        """
        joints = beside_offsets(observations, self.offsets).fitted.by_joint
        return joints if self.followed is None else tuple(item.moved(self.followed) for item in joints)

    @property
    def std(self) -> Array:
        """Standard deviation of each parameter, shape (p,)."""
        return np.sqrt(np.clip(np.diag(self.covariance), 0.0, None))

    @cached_property
    def prediction(self) -> Prediction:
        """The torque as a function of position, velocity and acceleration, and the parts of the model that it leaves out."""
        return Prediction(self.model, self.value)

    def predict(self, q: ArrayLike, v: ArrayLike, a: ArrayLike) -> Array:
        """Predict the recorded torque of one state or of many, see `scara_ident.model.prediction.Prediction`."""
        return self.prediction(q, v, a)

    def _in_short(self) -> str:
        model = self.model
        return f"{model.robot.name}, {model.name} by {self.method}: {len(self.value)} parameters"

    def errors(self, observations: Observations) -> tuple[JointError | None, ...]:
        """Return the error on recordings for each joint; None if no sample of a joint was used."""
        return joint_errors(self.value, observations, own_offsets=self.offsets is not None)


def joint_errors(
    value: Array, observations: Observations, *, own_offsets: bool = False
) -> tuple[JointError | None, ...]:
    """Return the error of parameters on recordings together, joint by joint; None where no sample of a joint was used.

    Parameters
    ----------
    value : ndarray, shape (p,)
    observations : Observations
    own_offsets : bool, optional
        Whether to say what is left beside an offset of each recording's own too.
    """
    left, torque = observations.unfiltered_rms(value), observations.unfiltered_torque_rms
    beside = rms_beside_own(value, observations).tolist() if own_offsets else [None] * len(observations.joints)
    found: list[JointError | None] = []
    for rows, rms, whole, own in zip(observations.joints, left, torque, beside, strict=True):
        known = rows.samples > 0.0 and np.isfinite(rms)
        within = rows.rms(value)
        recorded = float(np.linalg.norm(rows.table[-1]) / np.sqrt(max(rows.samples, 1.0)))
        error = JointError(within, _share(within, recorded), float(rms), _share(float(rms), float(whole)), own)
        found.append(error if known else None)
    return tuple(found)


def _share(part: float, whole: float) -> float | None:
    return part / whole if whole > 0.0 else None


def paper_criteria(observations: Observations) -> tuple[float, float]:
    """Return J_d and J_k of Indri et al. (2002) for 2500 equally spaced samples of recordings.

    Returns
    -------
    tuple of float
        ``ln det(H.T H)`` and ``cond(H.T H)`` of the stacked regressor H of all joints, unweighted (R_v = identity).
    """
    information = merge(observations.by_joint)
    share = PAPER_SAMPLES / (information.rows / len(observations.joints))
    return information.log_det() + information.parameters * float(np.log(share)), information.condition()
