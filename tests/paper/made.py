"""States and rows for the tests of the paper."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray

from scara_ident import paper
from tests.shared import ROOT

URDF = ROOT / "urdf" / "scara03.urdf"


SEEDS = st.integers(0, 2**32 - 1)


NAMES = [parameter.name for parameter in paper.PARAMETERS]


def random_states(seed: int, count: int = 20) -> tuple[NDArray[np.float64], ...]:
    rng = np.random.default_rng(seed)
    return tuple(scale * rng.uniform(-1, 1, (2, count)) for scale in (np.pi, 3.77, 10.0))
