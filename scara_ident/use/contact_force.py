"""The force of a contact: on the tool where that explains the torque, else on a point of the last link that the torque tells."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scara_ident.arrays import Array
from scara_ident.robot.kinematics import (
    UNFELT_SHARE,
    constant_force,
    force_covariance,
    place_of,
    tool_placement,
    weakest_direction,
)
from scara_ident.use.contact_samples import ContactSamples, contact_samples
from scara_ident.use.external_torque import Observed
from scara_ident.use.observer import ContactObserver

# A constant force at the tool explains at least this share of the squared torque of a contact there, on at least so many
# joints: on fewer nearly any torque is that of some force.
FITS, MIN_JOINTS = 0.75, 3
# Of a direction of the force that is determined so much worse than another at once, none is reported.
MIN_DIRECTION_RATIO = 0.03
# Probability that a force where it is said to act is refused for what it leaves of the torque.
REFUSED = 0.01
# Force and point of a contact are six numbers, determined by so many joints.
JOINTS_FOR_POINT = 6
# The last joint is loaded by more than so many standard deviations of its torque, which no contact farther in does.
LOADED = 4.0
# Standard deviation of where on the last link something touches it, about the tool, along each axis, m: a flange, a hand or a gripper.
ABOUT_TOOL = 0.1
# Newton's steps to force and point, and their size relative to the force and to `ABOUT_TOOL` at which they end.
MAX_STEPS, STEP_TOLERANCE = 30, 1e-6


@dataclass(frozen=True, eq=False)
class ContactForce:
    """What the torque of a contact says of its force.

    Attributes
    ----------
    explained : float
        Share of the squared torque that a constant force at the tool explains.
    at_tool : bool
        Whether such a force leaves no more than the residual without contact.
    force : ndarray, shape (3,), or None
        Constant force that explains it, base frame, N; a direction that the arm cannot feel is 0.
    covariance : ndarray, shape (3, 3), or None
        Of that force; NaN along axes that the arm does not tell.
    point, point_std : ndarray, shape (3,), or None
        Where on the last link it acts, as near to the tool as the torque allows, in that link's frame, m; None where it acts
        on the tool or is not determined.
    """

    explained: float
    at_tool: bool
    force: Array | None = None
    covariance: Array | None = None
    point: Array | None = None
    point_std: Array | None = None


def contact_force(
    observer: ContactObserver, observed: Observed, threshold: Array, inside: Array, strong: Array
) -> ContactForce:
    """Return the force of a contact.

    A force f on the tool at the end of the Jacobian J is the external torque ``J^T f``, of which the observer tells what its
    low-pass leaves as the arm moves on. It is believed where what it leaves is the residual without contact, or changes as
    much during the contact. Where it leaves more and the last joint is loaded, the force is on a point of the last link beside
    the tool, which six joints or more tell (De Luca and Mattone 2005): f and that point are the most likely ones, the
    point being near the tool to `ABOUT_TOOL`. Along the force no point is distinguished from another.

    Near a singular pose there is no force: an arm that does not feel one of the directions at once takes any change of the force
    for more or less of it.

    Parameters
    ----------
    threshold : ndarray, shape (n, N)
    inside, strong : ndarray of int
        Samples of the contact, and those of them that are fitted.
    """
    robot = observer.known.robot
    fitted = contact_samples(observer, observed, threshold, inside, strong)
    at_tool = fitted.rows[..., 0]
    force, explained = constant_force(at_tool, fitted.torques)
    determined = weakest_direction(at_tool, observer.felt) >= MIN_DIRECTION_RATIO
    left = fitted.torques - at_tool @ force
    unsure = _unsure(fitted, left)
    beside = None
    if robot.n >= JOINTS_FOR_POINT and determined:
        # What a force elsewhere explains is no change of the force meanwhile.
        beside = _beside_tool(fitted, fitted.scatter, force)
        unsure = _unsure(fitted, beside.left)
        beside = _beside_tool(fitted, unsure, beside.force, beside.point)
    if explained >= FITS and _leaves_noise(np.mean(at_tool, axis=0), np.mean(fitted.torques, axis=0), unsure):
        if not determined:
            return ContactForce(explained, True)
        if beside is None:
            covariance = force_covariance(at_tool, fitted.scatter + left.T @ left / len(left))
        else:
            # Nobody knows that it is on the tool to the millimetre: it is as unsure as a force near the tool, and as what that would be.
            covariance = beside.covariance[:3, :3] + np.outer(beside.force - force, beside.force - force)
        return ContactForce(explained, True, force, covariance)
    last = place_of(robot, robot.model.njoints - 1)
    loaded = abs(float(np.mean(fitted.torques[:, last]))) > LOADED * float(np.sqrt(unsure[last, last]))
    if beside is None or not loaded or not beside.likely:
        return ContactForce(explained, False)
    turn, origin = tool_placement(robot)
    std = np.sqrt(np.diag(turn @ beside.covariance[3:, 3:] @ turn.T))
    return ContactForce(explained, False, beside.force, beside.covariance[:3, :3], origin + turn @ beside.point, std)


def _leaves_noise(row: Array, torque: Array, unsure: Array) -> bool:
    """Whether the best of all forces leaves of a torque (n,), by a row (n, 3), what its covariance (n, n) does.

    A direction that is determined little is one of the best force's too: of a strong force it is more than noise.
    """
    from scipy.special import chdtrc

    half = np.linalg.inv(np.linalg.cholesky(unsure))
    force, _, rank, _ = np.linalg.lstsq(half @ row, half @ torque, rcond=UNFELT_SHARE)
    freedom = len(torque) - int(rank)
    return freedom == 0 or float(chdtrc(freedom, np.sum((half @ (torque - row @ force)) ** 2))) >= REFUSED


def _unsure(fitted: ContactSamples, left: Array) -> Array:
    """Return the covariance (n, n) of a torque of which a force leaves (N, n).

    What the force does not explain since it is not constant is taken for the same throughout, as the residual is.
    """
    return np.asarray(fitted.scatter + np.cov(left.T, bias=True))


@dataclass(frozen=True, eq=False)
class _Beside:
    """The most likely force on the last link, and its point from the tool in the tool's frame, m.

    Attributes
    ----------
    left : ndarray, shape (N, n)
        Of the torques in units of the thresholds.
    covariance : ndarray, shape (6, 6)
        Of force and point.
    likely : bool
        Whether the steps ended, and it leaves no more than is unsure.
    """

    force: Array
    point: Array
    left: Array
    covariance: Array
    likely: bool


def _beside_tool(fitted: ContactSamples, unsure: Array, force: Array, point: Array | None = None) -> _Beside:
    """Return the most likely force and point, by steps of Gauss and Newton from a force on the tool or a point."""
    from scipy.special import chdtrc

    half = np.linalg.inv(np.linalg.cholesky(unsure)) / np.sqrt(len(fitted.torques))
    rows, torques = np.einsum("ij,kjab->kiab", half, fitted.rows), fitted.torques @ half.T
    prior = np.hstack([np.zeros((3, 3)), np.eye(3) / ABOUT_TOOL])
    point, ended = np.zeros(3) if point is None else point, False
    for _ in range(MAX_STEPS):
        by_force = rows[..., 0] + rows[..., 1:] @ point
        by_point = np.einsum("kiab,a->kib", rows[..., 1:], force)
        slope = np.concatenate([np.concatenate([by_force, by_point], axis=2).reshape(-1, 6), prior])
        left = np.concatenate([(torques - by_force @ force).ravel(), -point / ABOUT_TOOL])
        step = np.linalg.lstsq(slope, left, rcond=None)[0]
        force, point = force + step[:3], point + step[3:]
        if (
            np.linalg.norm(step[:3]) < STEP_TOLERANCE * np.linalg.norm(force)
            and np.linalg.norm(step[3:]) < STEP_TOLERANCE * ABOUT_TOOL
        ):
            ended = True
            break
    # Of all joints' torques and the point's three numbers, six are used up.
    likely = ended and float(chdtrc(unsure.shape[0] - 3, left @ left)) >= REFUSED
    whole = fitted.torques - (fitted.rows[..., 0] + fitted.rows[..., 1:] @ point) @ force
    return _Beside(force, point, whole, np.linalg.inv(slope.T @ slope), likely)
