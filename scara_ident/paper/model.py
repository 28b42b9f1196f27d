"""The paper's torque equation U = W P on the motor side, and its criteria J_d and J_k."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scara_ident.arrays import Array

LINK_LENGTH = 0.33
"""Length of each link, m."""
REDUCTION = (100.0, 100.0)
"""Motor turns per joint turn, 1/tau."""


@dataclass(frozen=True)
class Parameter:
    """One entry of the paper's parameter vector P.

    Attributes
    ----------
    name : str
        Such as ``P_d1``, ``a01`` (order 0, joint 1) or ``p_o2``.
    joint : str or None
        Joint of the SCARA03 it belongs to; None where both share it.
    """

    name: str
    joint: str | None
    unit: str
    meaning: str


def _friction_parameters(joint: int) -> tuple[Parameter, ...]:
    name = f"joint{joint}"
    return (
        Parameter(f"a0{joint}", name, "N m", "Coulomb friction at the motor, times sign(v)"),
        Parameter(f"a1{joint}", name, "N m s/rad", "viscous friction at the motor, times v"),
        Parameter(f"a2{joint}", name, "N m s^2/rad^2", "quadratic friction at the motor, times sign(v) v^2"),
        Parameter(f"a3{joint}", name, "N m s^3/rad^3", "cubic friction at the motor, times v^3"),
    )


PARAMETERS: tuple[Parameter, ...] = (
    Parameter("P_d1", "joint1", "kg m^2", "I1z + m2 l1^2 + Jm1/tau1^2"),
    Parameter("P_d2", None, "kg m", "m2 s2x"),
    Parameter("P_d3", None, "kg m", "m2 s2y"),
    Parameter("P_d4", None, "kg m^2", "I2z"),
    Parameter("P_d5", "joint2", "kg m^2", "Jm2/tau2^2"),
    *_friction_parameters(1),
    *_friction_parameters(2),
    Parameter("p_o1", "joint1", "N m", "torque offset at the motor"),
    Parameter("p_o2", "joint2", "N m", "torque offset at the motor"),
)
"""P = [P_d, P_f, P_o], eqs. (2), (4), (5); I1z and I2z are about the joint axes."""

REDUCED: tuple[str, ...] = ("P_d1", "P_d2", "P_d4", "P_d5", "a01", "a11", "a21", "a02", "a12", "a22")
"""The ten parameters of the reduced model: no P_d3, no cubic friction, no offset."""


def regressor(
    q: Array, v: Array, a: Array, *, link_length: float = LINK_LENGTH, reduction: tuple[float, float] = REDUCTION
) -> Array:
    """Regressor W of the 15 parameters, motor side.

    Parameters
    ----------
    q, v, a : ndarray, shape (2, N)
        Joint positions, velocities and accelerations, rad, rad/s, rad/s^2.
    link_length : float, optional
        Length of link 1, m.
    reduction : tuple of float, optional
        Motor turns per joint turn of each joint.

    Returns
    -------
    ndarray, shape (2, 15, N)
        Motor torque in N m per unit of each of `PARAMETERS`.

    Raises
    ------
    ValueError
        When the shapes are not all (2, N).

    Notes
    -----
    Eq. (1) with the dots that print lost: accelerations in the linear terms, velocities in the products.
    """
    if q.ndim != 2 or q.shape[0] != 2 or v.shape != q.shape or a.shape != q.shape:
        raise ValueError(f"q, v, a must all have shape (2, N); got {q.shape}, {v.shape}, {a.shape}")
    tau1, tau2 = 1.0 / reduction[0], 1.0 / reduction[1]
    c2, s2 = np.cos(q[1]), np.sin(q[1])
    twice = 2.0 * a[0] + a[1]
    coriolis = v[1] * (2.0 * v[0] + v[1])
    w = np.zeros((2, len(PARAMETERS), q.shape[1]))
    w[0, 0] = tau1 * a[0]
    w[0, 1] = tau1 * link_length * (c2 * twice - s2 * coriolis)
    w[0, 2] = tau1 * link_length * (-s2 * twice - c2 * coriolis)
    w[0, 3] = tau1 * (a[0] + a[1])
    w[1, 1] = tau2 * link_length * (c2 * a[0] + s2 * v[0] ** 2)
    w[1, 2] = tau2 * link_length * (-s2 * a[0] + c2 * v[0] ** 2)
    w[1, 3] = tau2 * (a[0] + a[1])
    w[1, 4] = tau2 * a[1]
    for joint in range(2):
        speed = v[joint]
        direction = np.sign(speed)
        first = 5 + 4 * joint
        w[joint, first : first + 4] = direction, speed, direction * speed**2, speed**3
        w[joint, 13 + joint] = 1.0
    return w


def criteria(w: Array) -> tuple[float, float]:
    """D-optimality and conditioning of a regressor, R_v = identity.

    Parameters
    ----------
    w : ndarray, shape (n, p, N)
        Regressor; the rows of all joints and samples are stacked to H, shape (n N, p).

    Returns
    -------
    J_d : float
        ln det(H^T H), in the parameters' own units; -inf where H has not full rank.
    J_k : float
        cond(H^T H) = cond(H)^2; inf where H has not full rank.

    Notes
    -----
    Taken from the singular values of the triangular factor of H. H^T H is never formed: it would square the
    condition number, and its determinant overflows.
    """
    stacked = np.moveaxis(w, 1, 2).reshape(-1, w.shape[1])
    if stacked.shape[0] < stacked.shape[1]:
        return -np.inf, np.inf
    singular = np.linalg.svd(np.linalg.qr(stacked, mode="r"), compute_uv=False)
    if singular[-1] <= np.finfo(np.float64).eps * max(stacked.shape) * singular[0]:
        return -np.inf, np.inf
    return 2.0 * float(np.sum(np.log(singular))), float(singular[0] / singular[-1]) ** 2
