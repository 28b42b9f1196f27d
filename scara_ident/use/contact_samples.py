"""Samples of a contact that its force is fitted to: those at which the observer shows all of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.robot.kinematics import constant_force, leaning_torques
from scara_ident.use.external_torque import Observed
from scara_ident.use.observer import ContactObserver

# States of a contact at which the Jacobian is taken, and the share of its peak from which on a first force is fitted.
STATES, PEAK_SHARE = 80, 0.5
# A contact's force is whole from the first to the last sample that shows so much of the first one: less is its begin or its end.
WHOLE = 0.9
# Fits of that first force, the second without what the first takes for its end.
FITS = 2
# What acted before counts for less than a seventh, exp(-2), after so many time constants of a low-pass, of the observer or of
# the differentiator: later more noise would be left out with it than error.
FORGOTTEN = 2.0


@dataclass(frozen=True, eq=False)
class ContactSamples:
    """The samples of a contact that are fitted, of each joint in units of its threshold.

    Attributes
    ----------
    torques : ndarray, shape (N, n)
    rows : ndarray, shape (N, n, 3, 4)
        Of `leaning_torques`, as the observer shows them.
    scatter : ndarray, shape (n, n)
        Second moments of the torque without contact. They are those of every sample alike: the residual changes slowly, so that
        no mean lessens it.
    """

    torques: Array
    rows: Array
    scatter: Array


def contact_samples(
    observer: ContactObserver, observed: Observed, threshold: Array, inside: Array, strong: Array
) -> ContactSamples:
    """Return what the force of a contact is fitted to.

    The observer's low-pass shows of a force that begins less than all of it, and goes on showing it when it has ended. Where the
    force is whole from a sample s to another, its torque thereafter is ``y_s exp(-g t)`` of what was seen at s, and what the
    low-pass of gain g makes of the force from rest; so much of each sample is fitted, from `FORGOTTEN` on, and nothing has to be
    known of how it began. A contact that is shorter is taken for a step where its torque begins, and fitted where it is strong.

    Parameters
    ----------
    threshold : ndarray, shape (n, N)
    inside, strong : ndarray of int
        Samples of the contact, and those in which its torque is at least `PEAK_SHARE` of the largest.
    """
    places = inside[:: max(1, len(inside) // STATES)]
    gain, time = 2.0 * np.pi * observer.settings.bandwidth, observed.time[places]
    lag = 0.0 if observer.velocity else _lag(observer.settings.differentiator, observed.time)
    turned = _turned(observer, observed, time - lag)
    size = np.max(np.abs(observed.torque[:, inside]) / threshold[:, inside], axis=0)
    # At its begin as much of it has passed the low-pass as of the largest torque.
    rows = _low_passed(turned, gain, time, float(size[0] / np.max(size)) * turned[0])
    torques, usual = observed.torque[:, places].T, threshold[:, places].T
    kept = np.flatnonzero(np.isin(places, strong))
    own = _whole(torques / usual, rows[..., 0] / usual[..., None], kept, time, FORGOTTEN * lag)
    shown = -np.expm1(-gain * (time[own] - time[own[:1]]))
    late = shown >= -np.expm1(-FORGOTTEN)
    if np.any(late):
        kept, share = own[late], shown[late]
        from_rest = _low_passed(turned[own], gain, time[own], np.zeros_like(turned[0]))[late]
        rest = torques[kept] - (1.0 - share[:, None]) * torques[own[0]]
        torques[kept], rows[kept] = rest / share[:, None], from_rest / share[:, None, None, None]
    unit = np.mean(usual[kept], axis=0)
    scatter = observer.scatter.covariance(np.mean(observed.features[:, :, places[kept]], axis=2))
    return ContactSamples(
        torques[kept] / usual[kept], rows[kept] / usual[kept, :, None, None], scatter / unit[:, None] / unit
    )


def _turned(observer: ContactObserver, observed: Observed, time: Array) -> Array:
    """Return what forces on the last link are at the joints at so many times, shape (N, n, 3, 4)."""
    positions = np.array([np.interp(time, observed.time, row) for row in observed.position])
    states = map(observer.external.arm.configuration, positions.T)
    return np.array(list(leaning_torques(observer.known.robot, states)))


def _low_passed(values: Array, gain: float, time: Array, first: Array) -> Array:
    """Return values (N, ...) behind a low-pass that begins with the first, by the mean of both ends of each step."""
    seen = [first]
    for share, before, now in zip(-np.expm1(-gain * np.diff(time)), values[:-1], values[1:], strict=True):
        seen.append(seen[-1] + share * (0.5 * (before + now) - seen[-1]))
    return np.array(seen)


def _lag(cut_off: float, time: Array) -> float:
    """Return how late the differentiator shows positions and efforts, s: it takes each sample for the step before it."""
    return max(0.0, 2.0 / (2.0 * np.pi * cut_off) - 0.5 * float(np.median(np.diff(time))))


def _whole(torques: Array, rows: Array, fitted: NDArray[np.intp], time: Array, held: float) -> NDArray[np.intp]:
    """Return the samples between the first and the last at which `WHOLE` of the constant force that explains those fitted is seen.

    The differentiator shows all of the begin so much later, and of the end the first so much before it is found.
    """
    for _ in range(FITS):
        force, _ = constant_force(rows[fitted], torques[fitted])
        expected = rows @ force
        fitted = np.flatnonzero(np.sum(expected * torques, axis=1) >= WHOLE * np.sum(expected**2, axis=1))
        if len(fitted) == 0:
            return fitted
    begin, end = max(time[fitted[0]], time[0] + held), time[fitted[-1]] - held
    return np.flatnonzero((time >= begin) & (time < end))
