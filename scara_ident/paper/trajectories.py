"""The two trajectories that the paper prints as formulas."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from scara_ident.arrays import Array
from scara_ident.paper.model import LINK_LENGTH

SAMPLES = 2500
"""Samples per trajectory that the paper uses."""


@dataclass(frozen=True)
class Trajectory:
    """Harmonic motion of both joints, eq. (7): q_i = alpha_0i + sum_j alpha_ji sin(omega_ji t).

    Attributes
    ----------
    duration : float
        s.
    offset : tuple of float
        alpha_0 of each joint, rad.
    amplitude, omega : tuple of tuple of float
        For each joint the harmonics' amplitudes, rad, and angular frequencies, rad/s.
    """

    name: str
    duration: float
    offset: tuple[float, float]
    amplitude: tuple[tuple[float, ...], tuple[float, ...]]
    omega: tuple[tuple[float, ...], tuple[float, ...]]

    def times(self, count: int = SAMPLES) -> Array:
        """Return equally spaced times over the duration, both ends included, shape (count,)."""
        return np.linspace(0.0, self.duration, count)

    def motion(self, time: ArrayLike) -> tuple[Array, Array, Array]:
        """Position, velocity and acceleration of both joints.

        Parameters
        ----------
        time : array_like, shape (N,)
            s.

        Returns
        -------
        q, v, a : ndarray, shape (2, N)
            rad, rad/s, rad/s^2, differentiated by hand.
        """
        t = np.asarray(time, dtype=np.float64)
        q, v, a = (np.empty((2, t.size)) for _ in range(3))
        for joint in range(2):
            amplitude = np.array(self.amplitude[joint])
            omega = np.array(self.omega[joint])
            phase = np.outer(omega, t)
            sine, cosine = np.sin(phase), np.cos(phase)
            q[joint] = self.offset[joint] + amplitude @ sine
            v[joint] = (amplitude * omega) @ cosine
            a[joint] = -(amplitude * omega**2) @ sine
        return q, v, a


OJK = Trajectory(
    name="OJK",
    duration=20.0,
    offset=(1.57, 0.0),
    amplitude=((0.2545, -0.1091, 0.1091, -0.1091), (0.5454, -0.5454, -0.4727, -0.5454)),
    omega=((3.7082, 0.2472, 2.7194, 0.4944), (1.7305, 0.2472, 0.2472, 0.2472)),
)
"""Four harmonics, chosen by the paper for the least condition number J_k."""

OJD = Trajectory(
    name="OJD",
    duration=25.0,
    offset=(1.57, 0.0),
    amplitude=((-2.18166,), (2.18166,)),
    omega=((1.37509,), (1.17865,)),
)
"""One harmonic, chosen by the paper for the greatest determinant J_d."""


def tool_acceleration(q: Array, v: Array, a: Array, *, link_length: float = LINK_LENGTH) -> Array:
    """Horizontal acceleration of the gripper.

    Parameters
    ----------
    q, v, a : ndarray, shape (2, N)
        Joint motion, rad, rad/s, rad/s^2.
    link_length : float, optional
        Length of both links, m.

    Returns
    -------
    ndarray, shape (N,)
        Magnitude, m/s^2.
    """
    angle, rate, change = q[0] + q[1], v[0] + v[1], a[0] + a[1]
    # Along and across each link: centripetal and tangential parts, as complex numbers.
    first = np.exp(1j * q[0]) * (1j * a[0] - v[0] ** 2)
    second = np.exp(1j * angle) * (1j * change - rate**2)
    return np.asarray(link_length * np.abs(first + second))
