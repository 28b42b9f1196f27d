"""How far, how fast and how strongly each joint of a URDF may move; infinite where it states nothing."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from scara_ident.arrays import Array

# Pinocchio writes the largest double where the URDF has no limit.
UNSTATED = 1e300
# A stated position this far from zero is no stop, but what is written for a joint that turns on and on (+-10000) or, at most, how
# far a controller counts: cables through a joint allow a few turns, and the longest linear axes have some 100 m.
ENDLESS_ANGLE, ENDLESS_WAY = 20 * np.pi, 1000.0


def position_limits(
    model: pin.Model, places: NDArray[np.intp], unbounded: NDArray[np.bool_], prismatic: NDArray[np.bool_]
) -> tuple[Array, Array]:
    """Return the least and the greatest position of joints, rad or m, shape (n,) each.

    Parameters
    ----------
    model : pinocchio.Model
    places : ndarray of int, shape (n,)
        Of the joints in a configuration.
    unbounded, prismatic : ndarray of bool, shape (n,)
        Which joints are continuous in the URDF, and which translate.
    """
    farthest = np.where(prismatic, ENDLESS_WAY, ENDLESS_ANGLE)
    lower, upper = (limit[places] for limit in (model.lowerPositionLimit, model.upperPositionLimit))
    return (
        np.where(unbounded | (lower < -farthest), -np.inf, lower),
        np.where(unbounded | (upper > farthest), np.inf, upper),
    )


def speed_and_effort_limits(model: pin.Model, order: NDArray[np.intp]) -> tuple[Array, Array]:
    """Return the limits of velocity, rad/s or m/s, and of effort, N m or N, of joints, shape (n,) each.

    Parameters
    ----------
    model : pinocchio.Model
    order : ndarray of int, shape (n,)
        Of the joints in a velocity.
    """
    velocity, effort = (np.array(_upper(model, kind)[order], dtype=float) for kind in ("Velocity", "Effort"))
    return _positive_or_inf(velocity), _positive_or_inf(effort)


def _upper(model: pin.Model, kind: Literal["Velocity", "Effort"]) -> Array:
    # Older releases of Pinocchio have velocityLimit and effortLimit.
    name = f"upper{kind}Limit"
    return np.asarray(getattr(model, name if hasattr(model, name) else f"{kind.lower()}Limit"))


def _positive_or_inf(limit: Array) -> Array:
    return np.where((limit > 0.0) & (limit < UNSTATED), limit, np.inf)
