"""Checks of Table 5 against what a real arm can have."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np

from scara_ident.arrays import Array
from scara_ident.paper.model import LINK_LENGTH, PARAMETERS
from scara_ident.paper.report import JOINTS, Check, Subject, inequality, information
from scara_ident.paper.tables import TABLE_1, TRAJECTORIES, VELOCITY_LIMIT, table5_parameters


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
            subject = Subject(section, quantity, trajectory, unit=unit)
            yield inequality(subject, "printed > 0", value > 0.0, value, 0.0, why)
        first_moment = d2**2 + d3**2
        least = LINK_LENGTH**2 * first_moment / d1
        exists = min(d1, d4, d5) > 0.0 and d4 >= least
        subject = Subject(section, "an arm exists: least I2z that P_d1, P_d2 allow", trajectory, unit="kg m^2")
        yield inequality(subject, "printed >= computed, P_d1, P_d4, P_d5 > 0", exists, d4, least)
        if d4 > 0.0:
            subject = Subject(section, "least mass of link 2, P_d2^2 / P_d4", trajectory, unit="kg")
            yield information(subject, None, first_moment / d4)


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
                subject = Subject(section, f"{parameter.name}, {quantity}", trajectory, name, parameter.unit)
                yield inequality(subject, "printed >= 0", value >= 0.0, value, 0.0)
            for quantity, top in (
                ("least friction at speeds it was estimated from", TABLE_1.peak_velocity[joint][column]),
                ("least friction at speeds the joint can reach", VELOCITY_LIMIT),
            ):
                value, zero = min_friction(coefficients, top)
                where = "" if zero is None else f", negative from {zero:.2f} rad/s on: it would drive the joint"
                subject = Subject(section, quantity, trajectory, name, "N m")
                yield inequality(subject, "computed >= 0", value >= 0.0, None, value, f"up to {top:g} rad/s{where}")


def min_friction(coefficients: Array, top: float) -> tuple[float, float | None]:
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

    def at(speed: float) -> float:
        a0, a1, a2, a3 = (float(value) for value in coefficients)
        # Just above standstill the friction is a_0; at it, where sign is 0, it would be 0.
        return a0 + speed * (a1 + speed * (a2 + speed * a3))

    # Between these speeds the friction only rises or only falls.
    stops = [0.0, *_turning_speeds(coefficients, top), top]
    least = min(at(speed) for speed in stops)
    if at(0.0) < 0.0:
        return least, 0.0
    for low, high in itertools.pairwise(stops):
        if at(high) < 0.0:
            while low < (middle := 0.5 * (low + high)) < high:
                low, high = (low, middle) if at(middle) < 0.0 else (middle, high)
            return least, high
    return least, None


def _turning_speeds(coefficients: Array, top: float) -> list[float]:
    """Speeds inside (0, top) where the slope a_1 + 2 a_2 v + 3 a_3 v^2 is 0, ascending."""
    c, b, a = (float(k * coefficients[k]) for k in (1, 2, 3))
    discriminant = b * b - 4.0 * a * c
    if discriminant < 0.0:
        return []
    # The form that does not cancel; each root is a quotient that may be undefined.
    q = -0.5 * (b + np.copysign(np.sqrt(discriminant), b))
    roots = {num / den for num, den in ((q, a), (c, q)) if abs(num) < top * abs(den)}
    return sorted(root for root in roots if root > 0.0)
