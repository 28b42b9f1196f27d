"""Intervals are moved to where the rows of the fit see them begin and end."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.diagnosis.candidates.candidates import Candidate, CandidateColumns
from scara_ident.diagnosis.criteria import CRITERIA
from scara_ident.diagnosis.fitting.interval_fit import JointSeen, bounds_of_cells, refined
from scara_ident.diagnosis.testing.selection_step import SelectionStep
from scara_ident.effects import Interval, Member
from scara_ident.effects.payload import PayloadChange
from scara_ident.effects.payload_intervals import PayloadInIntervals
from scara_ident.effects.signals import ModelledEffect
from scara_ident.robot.robot import Robot
from tests.effects.intervals import CYCLES, arms, run, runs, seen


@pytest.fixture(scope="module")
def robots(tmp_path_factory: pytest.TempPathFactory) -> tuple[Robot, Robot]:
    return arms(tmp_path_factory.mktemp("arm"))


def test_intervals_that_are_off_are_moved(robots: tuple[Robot, Robot]):
    scene, observations = seen(robots[0], runs(robots, CYCLES))
    truth = [(k, *span) for k, own in enumerate(CYCLES.values()) for span in own]
    off = tuple(Interval(k, start + 0.2, stop - 0.15) for k, start, stop in truth)
    chosen = (Candidate(PayloadInIntervals(), Member(None, intervals=off)),)
    step = SelectionStep(scene, CandidateColumns(observations), chosen, np.full(2, 20.0), 1, CRITERIA)
    # Two rounds from far away: to a row, which is as long.
    held = replace(scene, link_torques=(ModelledEffect(chosen[0].effect, chosen[0].member, (1.0,)),))
    moved = refined(replace(step, scene=held))
    (found,) = moved.chosen
    # What acts on links acts then.
    assert [item.member for item in moved.scene.link_torques] == [found.member]
    for item, (k, start, stop) in zip(found.member.intervals, truth, strict=True):
        assert item.recording == k
        assert item.start == pytest.approx(start, abs=0.05)
        assert item.stop == pytest.approx(stop, abs=0.05)
        assert 0.0 < item.start_std < 0.1
    other = replace(step, chosen=(Candidate(PayloadChange(), Member(None, (3.0,))),))
    assert refined(other) is other


@pytest.mark.parametrize("length", [8.9, 9.0, 9.1, 9.4, 9.5, 9.6])
def test_cells_end_with_the_recording_and_none_is_of_no_length(length: float):
    bounds = bounds_of_cells(1.0, (0.0, length))
    assert (bounds[0], bounds[-1]) == (0.0, length)
    assert np.min(np.diff(bounds)) > 0.0
    # The last row before the end is in the last cell, or half a cell at the most before it.
    assert len(bounds) - 2 <= np.floor(length + 0.5) <= len(bounds) - 1


@pytest.mark.parametrize("seconds", [9.97, 9.98, 9.99, 10.0, 10.01, 10.02])
def test_what_acts_to_the_end_of_a_recording_does_not_end_before(robots: tuple[Robot, Robot], seconds: float):
    """A payload that stayed in the gripper was put down 50 ms before the end of every other recording, `until 11.55 ± 0.04 s`."""
    made = [run(robots, seed, {"m2_1": ((3.0, np.inf),)}, seconds=seconds) for seed in range(3)]
    scene, observations = seen(robots[0], made)
    length = float(np.ptp(made[2].time))
    chosen = (Candidate(PayloadInIntervals(), Member(None, intervals=(Interval(2, 3.0, length),))),)
    step = SelectionStep(scene, CandidateColumns(observations), chosen, np.full(2, 20.0), 1, CRITERIA)
    held = replace(scene, link_torques=(ModelledEffect(chosen[0].effect, chosen[0].member, (1.0,)),))
    ((item,),) = (own.member.intervals for own in refined(replace(step, scene=held)).chosen)
    assert item.start == pytest.approx(3.0, abs=0.05)
    assert (item.stop, item.stop_std) == (pytest.approx(length), 0.0)


def test_an_offset_of_the_recording_speaks_neither_for_nor_against():
    rng = np.random.default_rng(1)
    time, made = np.linspace(0.0, 9.4, 500), rng.uniform(1.0, 2.0, 500)
    state = np.repeat([0.0, 1.0], 5)
    cells = np.round(time).astype(int)
    seen_by = [
        JointSeen(time, np.zeros(500, dtype=np.intp), state[cells] * made + offset, made, 4.0) for offset in (0.0, 3.0)
    ]
    plain, shifted = (item.cells(0, 1.0, 10, state) for item in seen_by)
    assert np.allclose(plain, shifted)
    assert np.allclose(plain[1], 4.0 * np.bincount(cells, made**2, 10))
    assert not np.allclose(seen_by[1].cells(0, 1.0, 10, None), plain)
