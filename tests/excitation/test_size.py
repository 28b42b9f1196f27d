"""How large a design may be, and is by default."""

from __future__ import annotations

import pytest

from scara_ident.errors import UsageError
from scara_ident.excitation.size import check_size, default_harmonics, durations_of, harmonics_of


def test_harmonics_are_fewer_for_more_joints():
    assert default_harmonics(25.0, 2) == 40
    assert default_harmonics(25.0, 6) == 13
    assert default_harmonics(1.0, 2) == 5


def test_each_trajectory_has_its_length_and_as_many_harmonics():
    assert durations_of(25.0, 3) == (25.0, 25.0, 25.0)
    assert durations_of((20.0, 5.0)) == durations_of((20.0, 5.0), 2) == (20.0, 5.0)
    assert [harmonics_of(40, share) for share in (1.0, 0.5, 0.05)] == [40, 20, 5]
    assert harmonics_of(3, 0.1) == 3


def test_sizes_that_no_search_handles_are_refused():
    check_size(150, 2, 1, 2500)
    with pytest.raises(UsageError, match="use at most 150"):
        check_size(151, 2, 1, 2500)
    with pytest.raises(UsageError, match="harmonic 700: 2500 samples cannot resolve"):
        check_size((1, 700), 2, 1, 2500)
    with pytest.raises(UsageError, match="3 durations for 2 trajectories"):
        durations_of((5.0, 6.0, 7.0), 2)
