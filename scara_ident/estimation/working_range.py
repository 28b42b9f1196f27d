"""Directions of parameters that data leave open within the arm's working range, and what the description says of them instead.

No joint needs more torque than its drive gives, wherever and however fast the arm moves within its limits. That is known
before any data, and data say something of a direction of parameters only where they say more. Where a joint hardly
moves, or moves so slowly that the cube of its speed is noise, they do not: least squares then finds some value, the
torque of which grows beyond all bounds in any other motion. Such directions are left at zero, what is known of them
without data. Directions are those of the generalised singular value decomposition of the rows and of the arm's torque
over its range (Hansen, Rank-Deficient and Discrete Ill-Posed Problems, 1998, section 2.1.2), so that neither the
choice of base parameters nor their units matter.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.estimation.information import UNDETERMINED, Information, triangular, weighted
from scara_ident.estimation.observations import Observations
from scara_ident.estimation.urdf_scale import USUAL
from scara_ident.model.terms.friction import Friction, Offset
from scara_ident.model.terms.rigid_body import RigidBody
from scara_ident.model.urdf_values import urdf_values
from scara_ident.motion.motion import Motion

# The drive's torque is so many standard deviations of what is known without data.
DRIVE_STDS = 3.0
# How many times the friction recorded each of its terms may be, anywhere in the range: one standard deviation.
MAX_FRICTION_RATIO = 2.0
# Random states per parameter that stand for the range.
STATES_PER_PARAMETER = 8
# An open share of a parameter's variance, as it is known without data, above which the parameter is called undetermined.
OPEN_SHARE = 0.5
# What moves the torques over the arm's range by less than this share of them leaves the estimate as it is, and what was made of it.
SAME_TORQUE_SHARE = 1e-3


@dataclass(frozen=True, eq=False)
class DeterminedDirections:
    """Directions of parameters, scaled so that their torque over the arm's range is the drives' (rms over states).

    Attributes
    ----------
    kept : ndarray, shape (p, k)
        Those that data tell.
    left_open : ndarray, shape (p, m)
        Those that are left at zero.
    """

    kept: Array
    left_open: Array

    @property
    def undetermined(self) -> NDArray[np.bool_]:
        """Parameters that are mostly left open, shape (p,)."""
        open_, kept = np.sum(self.left_open**2, axis=1), np.sum(self.kept**2, axis=1)
        return np.asarray(open_ > OPEN_SHARE * (open_ + kept))

    @property
    def prior(self) -> Array:
        """Covariance of what is left open, shape (p, p)."""
        return np.asarray(self.left_open @ self.left_open.T) / DRIVE_STDS**2

    def within(self, information: Information) -> Information:
        """Return information of the coordinates along the directions kept."""
        rows = np.column_stack([information.factor[:, :-1] @ self.kept, information.factor[:, -1]])
        return Information(triangular(rows), information.rows)


def determined_directions(observations: Observations, noise: Array) -> DeterminedDirections | None:
    """Tell directions that data determine from those that they leave open.

    Parameters
    ----------
    noise : ndarray, shape (n,)
        Std of each joint's rows, N m or N, see `Information.noise`.

    Returns
    -------
    DeterminedDirections or None
        None where all is determined that can be, or for a model with terms that are no function of the state.
    """
    range_ = _range_factor(observations)
    if range_ is None:
        return None
    joints, parameters = observations.by_joint, len(range_)
    rows = np.array([joint.independent for joint in observations.joints])
    # A row stands for several samples, and has their noise.
    step = np.array([part.rows for part in joints]) / np.maximum(rows, 1)
    whole = weighted(joints, 1.0 / (noise * np.sqrt(np.maximum(step, 1.0))))
    _, singular, right = np.linalg.svd(whole.regressor_factor @ range_)
    some = int(np.count_nonzero(singular > UNDETERMINED * singular[0]))
    std = np.sqrt(rows.sum() / max(int(rows.sum()) - parameters, 1)) / singular[:some]
    known = DRIVE_STDS * std <= 1.0
    # What no row shows at all is open anyway, see `Information.solve`.
    if np.all(known):
        return None
    unknown = np.append(~known, np.ones(parameters - some, dtype=bool))
    directions = range_ @ right.T
    return DeterminedDirections(directions[:, ~unknown], directions[:, unknown])


def believable(observations: Observations, value: Array, noise: Array) -> Array:
    """Return parameters to foresee torques of other motions with, shape (p,).

    An estimate as far as data tell it, and else what is known without them: bodies that the URDF describes have its torque
    over the arm's range within a factor of `USUAL`, no term of friction is there many times the friction recorded, and all
    together is what drives give. In units of what each is known to, the squares of all deviations are least.

    Parameters
    ----------
    value : ndarray, shape (p,)
        The estimate.
    noise : ndarray, shape (n,)
        Of each joint's torque, (N m)^2 s; infinite where it is not known, and data of that joint say nothing.

    Returns
    -------
    ndarray, shape (p,)
        The estimate itself where all of it is determined, and for a model with terms that are no function of the state.
    """
    range_ = _range_rows(observations)
    if range_ is None:
        return value
    model, (rows, drive) = observations.model, range_
    rate = min(part.rate for part in observations.data.stretches)
    stated = urdf_values(model)
    bodies, aim = np.isfinite(stated), np.nan_to_num(stated)
    rubbing = np.zeros(len(value), dtype=bool)
    for term in model.terms:
        rubbing[model.place(term)] = isinstance(term, Friction)
    data = weighted(observations.by_joint, 1.0 / np.sqrt(noise * rate)).regressor_factor
    known = [DRIVE_STDS * (rows / (drive[:, None, None] * np.sqrt(len(rows)))).reshape(-1, len(value))]
    for own, torque in zip(observations.joints, rows, strict=True):
        size = float(np.sqrt(np.mean((torque @ aim) ** 2)))
        if size > 0.0:
            known.append(torque * bodies / ((1.0 - 1.0 / USUAL) * size))
        rubbed = value[own.columns] * rubbing[own.columns] @ own.table[:-1]
        size = float(np.sqrt(rubbed @ rubbed / max(own.samples, 1.0)))
        if size > 0.0:
            most = np.max(np.abs(torque), axis=0) * np.sqrt(rows.shape[1])
            known.append(np.diag(rubbing * most / (MAX_FRICTION_RATIO * size)))
    before = np.vstack(known) / np.sqrt(rows.shape[1])
    wanted = np.concatenate([data @ value, before @ aim])
    found = np.asarray(np.linalg.lstsq(np.vstack([data, before]), wanted, rcond=None)[0])
    moved = (
        np.linalg.norm(torque @ (found - value)) > SAME_TORQUE_SHARE * np.linalg.norm(torque @ value) for torque in rows
    )
    return found if any(moved) else value


def _range_rows(observations: Observations) -> tuple[Array, Array] | None:
    """Return the regressor over random states of the arm's range, shape (n, N, p), and the drives' torques, shape (n,)."""
    model, robot = observations.model, observations.model.robot
    if not all(isinstance(term, RigidBody | Friction | Offset) for term in model.terms):
        return None
    stretches = [part for part in observations.data.stretches if part.usable]
    if not stretches:
        return None
    peak = np.max([np.max(np.abs(part.motion.v), axis=1) for part in stretches], axis=0)
    torque = np.max([np.max(np.abs(part.torque), axis=1) for part in stretches], axis=0)
    lowest = np.min([np.min(part.stretch.position, axis=1) for part in stretches], axis=0)
    highest = np.max([np.max(part.stretch.position, axis=1) for part in stretches], axis=0)
    # What a description does not state, or states too small, the recordings show.
    speed = np.where(np.isfinite(robot.velocity_limit), np.maximum(robot.velocity_limit, peak), np.max(peak))
    drive = np.where(np.isfinite(robot.torque_limit), np.maximum(robot.torque_limit, torque), torque)
    lower = np.where(np.isfinite(robot.lower), np.minimum(robot.lower, lowest), lowest)
    upper = np.where(np.isfinite(robot.upper), np.maximum(robot.upper, highest), highest)
    half = np.where(robot.prismatic, 0.5 * (upper - lower), np.pi)
    # No joint is faster than its drive makes it within its range, whatever is stated.
    inertia = np.diag(pin.crba(robot.model, robot.model.createData(), pin.neutral(robot.model)))[robot.order]
    inertia = inertia + robot.reduction**2 * robot.rotor_inertia
    moved = inertia > 0.0
    fastest = np.sqrt(
        np.divide(half * drive / np.abs(robot.row_scale), inertia, out=np.full(robot.n, np.inf), where=moved)
    )
    speed = np.minimum(speed, np.maximum(fastest, peak))
    if not (np.all(speed > 0.0) and np.all(drive > 0.0) and np.all(half > 0.0)):
        return None
    random = np.random.default_rng(0)
    count = STATES_PER_PARAMETER * observations.parameters
    q, v, a = random.uniform(-1.0, 1.0, (3, robot.n, count))
    # A joint that swings through its range at its highest speed reaches this acceleration.
    q, v, a = 0.5 * (lower + upper)[:, None] + half[:, None] * q, speed[:, None] * v, (speed**2 / half)[:, None] * a
    motion = Motion("range", "range", np.arange(count, dtype=float), q, v, a, None, 1.0)
    return model.regressor(motion).transpose(0, 2, 1), drive


def _range_factor(observations: Observations) -> Array | None:
    """Return sums of columns, shape (p, p), whose torques over the arm's range are orthonormal, in drives' torques."""
    found = _range_rows(observations)
    if found is None:
        return None
    rows = found[0] / found[1][:, None, None]
    factor = triangular(rows.reshape(-1, rows.shape[2]) / np.sqrt(rows.shape[0] * rows.shape[1]))
    size = np.linalg.norm(factor, axis=0)
    if np.any(size == 0.0) or np.linalg.cond(factor / size) > 1.0 / UNDETERMINED:
        return None
    return np.asarray(np.linalg.inv(factor))
