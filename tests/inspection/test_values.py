"""What the numbers of a column say."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.inspection.values import time_unit
from tests.inspection.made import MADE


@pytest.mark.parametrize(("unit", "factor"), [("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9)])
def test_a_clocks_unit_is_told_by_its_steps(unit, factor):
    assert time_unit(factor * MADE["time"] + 5 * factor) == unit


def test_what_does_not_grow_is_no_clock():
    assert time_unit(np.zeros(100)) is None
    assert time_unit(np.sin(np.arange(100.0))) is None
