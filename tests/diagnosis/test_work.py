"""Shares of a diagnosis follow each other without a gap or an overlap."""

from __future__ import annotations

import pytest

from scara_ident.diagnosis.work import after_rounds, first, next_of, searching
from scara_ident.progress import Work


@pytest.mark.parametrize("split", [first, next_of])
def test_parts_follow_each_other(split):
    work = Work(start=0.2, stop=0.7)
    one, other = split(work)
    assert work.start == one.start < one.stop == pytest.approx(other.start)
    assert other.start < other.stop == pytest.approx(work.stop)


def test_a_given_band_leaves_the_searches_more():
    assert searching(Work(), band_given=True).start == 0.0 < searching(Work(), band_given=False).start
    assert searching(Work(), band_given=False).stop < 1.0


def test_rounds_never_reach_the_end():
    shares = [after_rounds(k) for k in range(20)]
    assert shares[0] > 0.0
    assert shares == sorted(set(shares))
    assert shares[-1] < 1.0
