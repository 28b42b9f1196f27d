"""Where identified friction drives the joint: a law that supplies energy within the recorded speeds is not friction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scara_ident.arrays import Array
from scara_ident.estimation.estimate import Estimate
from scara_ident.estimation.observations import Observations
from scara_ident.model.terms.friction import Friction

# Standard deviations by which no parameter of an arm comes to lie below zero by chance, where a hundred may: one would in 300 identifications by
# noise of a known size, in some more where it is known from few blocks.
BEYOND_CHANCE = 4.0
# Speeds that a law is asked at: a polynomial of degree 3 turns twice at the most.
SPEEDS = 24


@dataclass(frozen=True)
class Push:
    """A speed that a joint had, at which its friction pushes by more than chance makes, and is surest to.

    Attributes
    ----------
    speed : float
        rad/s or m/s.
    torque : float
        That it pushes with, N m or N, positive; ``std`` its standard deviation.
    """

    speed: float
    torque: float
    std: float

    @property
    def stds(self) -> float:
        """By how many standard deviations it pushes."""
        return self.torque / self.std


def pushes(estimate: Estimate, observations: Observations) -> tuple[Push | None, ...]:
    """Return for each joint where its friction pushes by more than chance makes; None where it nowhere does.

    Parameters
    ----------
    estimate : Estimate
        Not held to what an arm can have.
    observations : Observations
        Of its model. Faster than here nothing is asked: a law may say anything there.
    """
    model = estimate.model
    law = next((term for term in model.terms if isinstance(term, Friction)), None)
    if law is None:
        return (None,) * model.robot.n
    places = np.arange(len(model.columns))[model.place(law)].reshape(model.robot.n, -1)
    return tuple(
        _push(law.powers, estimate.value[own], estimate.covariance[np.ix_(own, own)], float(speed))
        for own, speed in zip(places, _fastest(observations), strict=True)
    )


def _push(powers: Sequence[int], value: Array, covariance: Array, fastest: float) -> Push | None:
    """Return where a law pushes up to a speed."""
    if fastest == 0.0 or not np.all(np.isfinite(covariance)):
        return None
    speed = fastest * np.arange(1, SPEEDS + 1) / SPEEDS
    columns = speed[:, None] ** np.array(powers)
    std = np.sqrt(np.einsum("vk,kl,vl->v", columns, covariance, columns))
    found = [
        Push(float(own), float(torque), float(unsure))
        for own, torque, unsure in zip(speed, -columns @ value, std, strict=True)
        if torque > BEYOND_CHANCE * unsure > 0.0
    ]
    return max(found, key=lambda push: push.stds, default=None)


def _fastest(observations: Observations) -> Array:
    """Return the largest speed of each joint in the samples that are fitted, shape (n,)."""
    parts = observations.data.stretches
    return np.asarray(
        np.max([np.max(np.abs(part.motion.v) * part.used, axis=1, initial=0.0) for part in parts], axis=0)
    )
