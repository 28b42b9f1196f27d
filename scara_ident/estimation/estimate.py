"""An estimate: parameters, the information they came from, and the means to check itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scara_ident.errors import EstimationError
from scara_ident.estimation.information import Information, merge
from scara_ident.estimation.observations import Evidence
from scara_ident.model.model import TorqueModel
from scara_ident.motion.motion import Motion

Array = NDArray[np.float64]

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
    """

    rms: float
    relative: float | None
    rms_unfiltered: float
    relative_unfiltered: float | None


@dataclass(frozen=True, eq=False)
class Estimate:
    """Parameters of a model and how sure they are.

    Attributes
    ----------
    model : TorqueModel
    method : str
    value : ndarray, shape (p,)
    covariance : ndarray, shape (p, p)
        Infinite variance where a parameter is undetermined.
    undetermined : ndarray of bool, shape (p,)
        Parameters that the data leave open, alone or in a combination.
    information : Information
        All rows with the weights of the estimate.
    weights : ndarray, shape (n,)
        Weight of each joint's rows.
    std_kind : str
        How the covariance was found, see `scara_ident.estimation.covariance`.
    """

    model: TorqueModel
    method: str
    value: Array
    covariance: Array
    undetermined: NDArray[np.bool_]
    information: Information
    weights: Array
    std_kind: str

    @property
    def std(self) -> Array:
        """Standard deviation of each parameter, shape (p,)."""
        return np.sqrt(np.clip(np.diag(self.covariance), 0.0, None))

    def predict(self, motion: Motion) -> Array:
        """Predict the recorded torque along a motion, shape (n, N)."""
        return np.asarray(np.einsum("jpn,p->jn", self.model.regressor(motion), self.value))

    def errors(self, evidence: Evidence) -> tuple[JointError | None, ...]:
        """Return the error on a recording, joint by joint; None where no sample of a joint was used."""
        return tuple(
            joint_error(evidence.joint(j), evidence.unfiltered[j], self.value) for j in range(self.model.robot.n)
        )


def joint_error(banded: Information, unfiltered: Information, value: Array) -> JointError | None:
    """Return the error of parameters on rows of one joint, None without rows."""
    if not banded.rows or not unfiltered.rows:
        return None
    rms, raw = banded.rms(value), unfiltered.rms(value)
    return JointError(rms, _share(rms, banded.torque_rms), raw, _share(raw, unfiltered.torque_rms))


def _share(part: float, whole: float) -> float | None:
    return part / whole if whole > 0.0 else None


def pooled_information(evidence: Sequence[Evidence], weights: Array) -> Information:
    """Merge the rows of all recordings and joints, each joint's with its weight.

    Raises
    ------
    EstimationError
        If there is nothing to merge.
    """
    if not evidence:
        raise EstimationError("no recording to estimate from")
    return merge(item.joint(j).scaled(float(weights[j])) for item in evidence for j in range(len(weights)))


def weighted_blocks(evidence: Sequence[Evidence], weights: Array) -> list[list[tuple[Information, ...]]]:
    """Return for every recording its blocks, each joint's rows with its weight."""
    return [
        [
            tuple(part.scaled(float(weight)) for part, weight in zip(block, weights, strict=True))
            for block in item.blocks
        ]
        for item in evidence
    ]


def paper_criteria(information: Information, evidence: Sequence[Evidence]) -> tuple[float, float]:
    """Return J_d and J_k of Indri et al. (2002) for 2500 equally spaced samples of the recordings.

    Parameters
    ----------
    information : Information
        Unweighted rows of all joints (R_v = identity).
    evidence : sequence of Evidence

    Returns
    -------
    tuple of float
        ``ln det(H.T H)`` and ``cond(H.T H)`` of the stacked regressor H.
    """
    joints = len(evidence[0].unfiltered)
    share = PAPER_SAMPLES / (information.rows / joints)
    return information.log_det() + information.parameters * float(np.log(share)), information.condition()
