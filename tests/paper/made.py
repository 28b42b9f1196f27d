"""States for the tests of the paper, and its grouping and friction in closed form."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st
from numpy.typing import ArrayLike, NDArray

from scara_ident import paper
from tests.shared import ROOT

URDF = ROOT / "urdf" / "scara03.urdf"
SEEDS = st.integers(0, 2**32 - 1)
NAMES = [parameter.name for parameter in paper.PARAMETERS]


def random_states(seed: int, count: int = 20) -> tuple[NDArray[np.float64], ...]:
    rng = np.random.default_rng(seed)
    return tuple(scale * rng.uniform(-1, 1, (2, count)) for scale in (np.pi, 3.77, 10.0))


def inertial_grouping(link_length: float = paper.LINK_LENGTH) -> NDArray[np.float64]:
    """Matrix (5, 22) from the standard parameters and two armatures of the two-link arm to P_d, eq. (2).

    Axes of both joints along z, link 2 at (l1, 0) in the frame of link 1.
    """
    mass, mx, my, izz = 0, 1, 2, 9
    grouping = np.zeros((5, 22))
    grouping[0, [izz, 10 + mass, 20]] = 1.0, link_length**2, 1.0
    grouping[1, 10 + mx] = 1.0
    grouping[2, 10 + my] = 1.0
    grouping[3, 10 + izz] = 1.0
    grouping[4, 21] = 1.0
    return grouping


def friction(velocity: ArrayLike, coefficients: ArrayLike) -> NDArray[np.float64]:
    """Friction torque of one joint at the motor by a_0 to a_3, eq. (3)."""
    v = np.asarray(velocity, dtype=np.float64)
    a0, a1, a2, a3 = np.asarray(coefficients, dtype=np.float64)
    direction = np.sign(v)
    return np.asarray(a0 * direction + a1 * v + a2 * direction * v**2 + a3 * v**3)
