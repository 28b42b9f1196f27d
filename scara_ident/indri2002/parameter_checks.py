"""Checks of Table 5 against what a real arm can have."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from scara_ident.indri2002.model import LINK_LENGTH, PARAMETERS, friction
from scara_ident.indri2002.report import Check, inequality, information
from scara_ident.indri2002.tables import TABLE_1, TRAJECTORIES, VELOCITY_LIMIT, table5_parameters

JOINTS = ("joint1", "joint2")


def inertia() -> Iterator[Check]:
    """Check the inertial parameters: signs, and whether an arm with these P_d can exist.

    With I1z and Jm1 at least 0, P_d1 >= m2 l1^2. With c the distance of link 2's centre of mass from joint 2,
    I2z >= m2 c^2, so m2 >= (P_d2^2 + P_d3^2) / P_d4. An arm exists when both leave room for one m2:
    P_d4 >= l1^2 (P_d2^2 + P_d3^2) / P_d1, with P_d1, P_d4, P_d5 positive.
    """
    section = "Table 5, inertia"
    for trajectory in TRAJECTORIES:
        d1, d2, d3, d4, d5 = (float(value) for value in table5_parameters(trajectory)[:5])
        for quantity, value, unit, why in (
            ("P_d1", d1, "kg m^2", "an inertia"),
            ("P_d2 = m2 s2x", d2, "kg m", "the centre of mass of link 2 is on the gripper's side of joint 2"),
            ("P_d4 = I2z", d4, "kg m^2", "an inertia"),
            ("P_d5 = Jm2/tau2^2", d5, "kg m^2", "an inertia"),
        ):
            yield inequality(
                section,
                quantity,
                "printed > 0",
                value > 0.0,
                value,
                0.0,
                trajectory=trajectory,
                unit=unit,
                comment=why,
            )
        first_moment = d2**2 + d3**2
        least = LINK_LENGTH**2 * first_moment / d1
        exists = min(d1, d4, d5) > 0.0 and d4 >= least
        yield inequality(
            section,
            "an arm exists: least I2z that P_d1, P_d2 allow",
            "printed >= computed, P_d1, P_d4, P_d5 > 0",
            exists,
            d4,
            least,
            trajectory=trajectory,
            unit="kg m^2",
        )
        if d4 > 0.0:
            yield information(
                section,
                "least mass of link 2, P_d2^2 / P_d4",
                None,
                first_moment / d4,
                trajectory=trajectory,
                unit="kg",
            )


def friction_signs() -> Iterator[Check]:
    """Check the friction: Coulomb and viscous parts not negative, and no speed at which it drives the joint."""
    section = "Table 5, friction"
    for column, trajectory in enumerate(TRAJECTORIES):
        parameters = table5_parameters(trajectory)
        for joint, name in enumerate(JOINTS):
            first = 5 + 4 * joint
            coefficients = parameters[first : first + 4]
            for k, quantity in ((0, "Coulomb"), (1, "viscous")):
                parameter = PARAMETERS[first + k]
                value = float(coefficients[k])
                yield inequality(
                    section,
                    f"{parameter.name}, {quantity}",
                    "printed >= 0",
                    value >= 0.0,
                    value,
                    0.0,
                    trajectory=trajectory,
                    joint=name,
                    unit=parameter.unit,
                )
            for quantity, top in (
                ("least friction at speeds it was estimated from", TABLE_1.peak_velocity[joint][column]),
                ("least friction at speeds the joint can reach", VELOCITY_LIMIT),
            ):
                value, zero = least_friction(coefficients, top)
                where = "" if zero is None else f", negative from {zero:.2f} rad/s on: it would drive the joint"
                yield inequality(
                    section,
                    quantity,
                    "computed >= 0",
                    value >= 0.0,
                    None,
                    value,
                    trajectory=trajectory,
                    joint=name,
                    unit="N m",
                    comment=f"up to {top:g} rad/s{where}",
                )


def least_friction(coefficients: NDArray[np.float64], top: float) -> tuple[float, float | None]:
    """Least friction torque at speeds above 0 up to ``top``, and where it first becomes negative.

    Parameters
    ----------
    coefficients : ndarray, shape (4,)
        a_0 to a_3 of eq. (3).
    top : float
        Greatest speed, rad/s.

    Returns
    -------
    least : float
        N m.
    zero : float or None
        Speed at which it first falls below 0, rad/s; None where it does not.
    """
    polynomial = np.polynomial.Polynomial(coefficients)

    def real(roots: NDArray[np.complex128]) -> NDArray[np.float64]:
        inside = roots[np.abs(roots.imag) < 1e-9 * (1.0 + np.abs(roots))].real
        return inside[(inside > 0.0) & (inside < top)]

    turning = real(np.asarray(polynomial.deriv().roots(), dtype=np.complex128))
    # The friction just above standstill is a_0; sign(0) would make it 0.
    speeds = np.concatenate([turning, [top]])
    least = float(min(coefficients[0], *friction(speeds, coefficients)))
    if least >= 0.0:
        return least, None
    if coefficients[0] < 0.0:
        return least, 0.0
    crossings = real(np.asarray(polynomial.roots(), dtype=np.complex128))
    return least, float(crossings.min()) if crossings.size else top
