"""How the regressor of a motion changes with the motion.

What an optimiser needs is linear in the regressor: the derivative of ``sum_ij G_ij W_ij`` by positions, velocities
and accelerations, for weights G of every sample, and that of the torques of given parameters. Of rigid bodies the first
goes backwards through their arithmetic and the second is Pinocchio's; other terms are evaluated beside the motion and
differences taken.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from scara_ident.arrays import Array
from scara_ident.model.model import TorqueModel
from scara_ident.model.terms import Friction, Offset, RigidBody, Term
from scara_ident.motion.motion import Motion

# f'(x) = sum_k weight_k f(x + shift_k); the step balances its error h^4 with rounding 1e-16 / h.
SMOOTH_STEP = 1e-3
SMOOTH = tuple(
    (k * SMOOTH_STEP, weight / (12.0 * SMOOTH_STEP)) for k, weight in ((1, 8.0), (-1, -8.0), (2, -1.0), (-2, 1.0))
)


@dataclass(frozen=True, eq=False)
class SmoothModel:
    """A torque model whose Coulomb friction turns within a width of speed, so that it can be differentiated.

    Attributes
    ----------
    width : ndarray, shape (n,)
        Speed over which ``tanh(v / width)`` stands for sign(v).
    """

    model: TorqueModel
    width: Array

    def regressor(self, motion: Motion) -> Array:
        """Return the regressor with sign(v) smoothed, shape (n, p, N)."""
        return np.concatenate([self._columns(term, motion) for term in self.model.terms], axis=1)

    def _columns(self, term: Term, motion: Motion) -> Array:
        if isinstance(term, Friction):
            return _friction(term, motion, self.width)[0]
        return term.regressor(motion)

    def derivatives(self, motion: Motion, weights: Array, parameters: Array | None = None) -> tuple[Array, Array]:
        """Differentiate a weighted sum of the regressor, and torques, by the motion.

        Parameters
        ----------
        motion : Motion
            N samples.
        weights : ndarray, shape (n, p, N)
            G: what each entry of the regressor counts.
        parameters : ndarray, shape (p,), optional
            Parameters of the torques.

        Returns
        -------
        gradient : ndarray, shape (3, n, N)
            Derivative of ``sum_ij G_ij W_ij`` of each sample by position, velocity and acceleration of each joint.
        torque : ndarray, shape (n, 3, n, N)
            Derivative of every joint's torque by the same; zeros without parameters.
        """
        n = self.model.robot.n
        gradient = np.zeros((3, n, motion.samples))
        torque = np.zeros((n, 3, n, motion.samples))
        for term in self.model.terms:
            place = self.model.place(term)
            part = np.ascontiguousarray(weights[:, place])
            value = None if parameters is None or not np.any(parameters[place]) else parameters[place]
            if isinstance(term, Offset):
                continue
            if isinstance(term, Friction):
                slope = _friction(term, motion, self.width)[1]
                gradient[1] += np.einsum("ipN,ipN->iN", part, slope)
                if value is not None:
                    torque[np.arange(n), 1, np.arange(n)] += np.einsum("ipN,p->iN", slope, value)
                continue
            if isinstance(term, RigidBody):
                gradient += term.pulled_back(motion, part)
                if value is not None:
                    torque += term.torque_slopes(motion, value)
                continue
            for kind, joint, weight, columns in _beside(term, motion):
                gradient[kind, joint] += weight * np.einsum("ipN,ipN->N", part, columns)
                if value is not None:
                    torque[:, kind, joint] += weight * np.einsum("ipN,p->iN", columns, value)
        return gradient, torque


def _friction(term: Friction, motion: Motion, width: Array) -> tuple[Array, Array]:
    """Return friction columns with sign(v) smoothed, and their derivative by the joint's speed."""
    n, k = term.robot.n, len(term.powers)
    columns, slopes = np.zeros((2, n, n * k, motion.samples))
    for i in range(n):
        v = motion.v[i]
        turn = np.tanh(v / width[i])
        turning = (1.0 - turn**2) / width[i]
        side = np.sign(v)
        powers = [np.ones_like(v)]
        while len(powers) <= max(term.powers):
            powers.append(powers[-1] * v)
        for place, power in enumerate(term.powers):
            j = i * k + place
            below = power * powers[max(0, power - 1)]
            # Only Coulomb friction jumps; sign(v) v^2 has a slope everywhere.
            if power == 0:
                columns[i, j], slopes[i, j] = turn, turning
            elif power % 2:
                columns[i, j], slopes[i, j] = powers[power], below
            else:
                columns[i, j], slopes[i, j] = side * powers[power], side * below
        columns[i] *= term.robot.drive_sign[i]
        slopes[i] *= term.robot.drive_sign[i]
    return columns, slopes


def _beside(term: Term, motion: Motion) -> Iterator[tuple[int, int, float, Array]]:
    """Give (kind, joint, weight, columns) whose weighted sums are derivatives; kind is 0, 1, 2 for q, v, a."""
    for joint in range(len(motion.q)):
        for kind, signal in enumerate("qva"):
            for shift, weight in SMOOTH:
                moved = getattr(motion, signal).copy()
                moved[joint] += shift
                yield kind, joint, weight, term.regressor(replace(motion, **{signal: moved}))
