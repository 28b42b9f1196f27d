"""Members know their joints, and say so where they have none."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.effects import Member, NonlinearParameter, Parameter
from scara_ident.effects.parameters import deviation


def test_no_joint_is_not_the_first_joint():
    assert (Member(0).place, Member(2, (), 1).partner_place) == (0, 1)
    with pytest.raises(ValueError, match="belongs to no one joint"):
        _ = Member(None).place
    with pytest.raises(ValueError, match="has no partner"):
        _ = Member(0).partner_place


def test_a_variance_below_zero_by_rounding_is_none():
    covariance = np.diag([4.0, -1e-20])
    assert [deviation(covariance, k) for k in (0, 1)] == [2.0, 0.0]


def test_an_interval_is_determined_where_value_and_deviation_say_too_little():
    stiffness = Parameter(3845.0, 1504.0, "N m/rad", symmetric_power=-1.0)
    low, high = stiffness.interval
    assert stiffness.entry() == {"value": 3845.0, "std": 1504.0, "unit": "N m/rad", "interval": [low, high]}
    assert (low, high) == (pytest.approx(2157.0, rel=1e-3), pytest.approx(17663.0, rel=1e-3))
    unsettled = Parameter(3845.0, 2000.0, "N m/rad", symmetric_power=-1.0)
    assert unsettled.entry()["interval"] == [pytest.approx(1885.0, rel=1e-3), None]
    for plain in (Parameter(3845.0, 1504.0, "N m/rad"), Parameter(3845.0, 50.0, "N m/rad", symmetric_power=-1.0)):
        assert plain.interval is None
        assert set(plain.entry()) == {"value", "std", "unit"}


@pytest.mark.parametrize(
    ("item", "symmetric_power"),
    [
        (NonlinearParameter("distance", "rad", 1e-5, 0.3), 0.0),
        (NonlinearParameter("place", "rad", -1.0, 4.0, logarithmic=False), 1.0),
        (NonlinearParameter("frequency", "Hz", 0.05, 200.0, symmetric_power=-2.0), -2.0),
    ],
)
def test_a_nonlinear_parameter_is_determined_as_it_is_refined_unless_it_says_otherwise(
    item: NonlinearParameter, symmetric_power: float
):
    assert item.parameter(0.2, 0.1, "rad") == Parameter(0.2, 0.1, "rad", symmetric_power)
