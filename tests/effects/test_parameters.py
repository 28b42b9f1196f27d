"""Members know their joints, and say so where they have none."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.effects import Member
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
