"""What differs from date to date where nothing changes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.fleet.changes import find_changes, trials_of
from scara_ident.fleet.scatter import fleet_scatter
from tests.fleet.made import DATES, drawn


@pytest.mark.slow
def test_dates_that_differ_by_noise_alone_widen_nothing(histories):
    random, arm = np.random.default_rng(0), histories[0]
    first = arm.visits[0]
    fleet = [replace(arm, dates=DATES[:3], visits=tuple(drawn(first, random) for _ in range(3))) for _ in range(20)]
    ratios = np.concatenate(list(fleet_scatter(fleet).causes.values()))
    # Forty differences tell a ratio to a quarter, of which the half above 1 stays: 1.1 on average.
    assert 1.0 <= np.mean(ratios) < 1.2


@pytest.mark.slow
def test_one_difference_is_worth_no_more_than_what_all_causes_tell_and_names_nothing(histories):
    # Of few ratios any chance explains how they differ, and runs that differ by less than noise say nothing of them: both at
    # once made the degrees of freedom of some causes infinite.
    for seed in range(40):
        random, arm = np.random.default_rng(seed), histories[0]
        visits = tuple(drawn(arm.visits[0], random) for _ in range(2))
        pair = replace(arm, dates=DATES[:2], visits=visits)
        noise = fleet_scatter([pair])
        told = np.array(list(noise.freedoms.values()))
        # Satterthwaite's sum is at the most that of both parts.
        assert np.all(told <= noise.freedom + sum(cause.sizes for cause in arm.causes))
        assert find_changes(pair, noise, trials_of(pair, noise)) == ()
