"""The estimate of a result file, whichever of the two kinds that hold a model it is."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from scara_ident.estimation.estimate import Estimate
from scara_ident.estimation.saved import read_estimate
from scara_ident.export.result import KEY, read_content, read_identified
from scara_ident.robot.robot import Robot


def load_estimate(path: Path | str, robot: Robot) -> Estimate:
    """Load the estimate of an ``identification.json`` or ``diagnosis.json``: parameters, covariance and triangular factor.

    Predictions, standard deviations and information are those of the saved estimate: for an identification bit by bit;
    for a diagnosis of the estimate with the effects found. The file contains no recordings.

    Parameters
    ----------
    path : path
        A file written by `Identification.save`, `Diagnosis.save` or the commands ``identify`` and ``diagnose``.
    robot : Robot
        The same robot; its model is built again.

    Returns
    -------
    Estimate
        A `ConsistentEstimate` if the saved one was.

    Raises
    ------
    ScaraIdentError
        If the file cannot be read, contains no estimate, or belongs to another robot or model.

    Examples
    --------
    >>> from scara_ident import identify, load_estimate, load_robot, named_motion, simulate, virtual_arm
    >>> robot = load_robot()
    >>> run = simulate(virtual_arm(robot), named_motion("OJK", robot), rate=250.0)
    >>> result = identify(robot, [run.recording], model="basic")
    >>> result.save("identification.json")
    >>> load_estimate("identification.json", robot)
    Estimate(scara03, basic by wls: 11 parameters)
    """
    path = Path(path)
    saved = read_estimate(path, robot)
    return _of_diagnosis(path, robot) if saved is None else saved


def _of_diagnosis(path: Path, robot: Robot) -> Estimate:
    """Return the estimate of a file that has what rebuilds a model, and no estimate as such."""
    found, known = read_identified(path, robot), read_content(path)[KEY]
    covariance = found.covariance.copy()
    covariance[np.diag_indices_from(covariance)] = np.where(found.undetermined, np.inf, np.diag(covariance))
    # A diagnosis fits by weighted least squares; results of earlier versions do not say how the covariance was found.
    kind = str(known.get("std_kind", "block"))
    open_, weights = found.undetermined, found.weights
    return Estimate(found.model, "wls", found.value, covariance, open_, found.information, weights, kind)
