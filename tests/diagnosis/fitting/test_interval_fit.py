"""Intervals are moved to where the rows of the fit see them begin and end."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.diagnosis.candidates.candidates import Candidate, CandidateColumns
from scara_ident.diagnosis.criteria import CRITERIA
from scara_ident.diagnosis.fitting.interval_fit import JointSeen, refined
from scara_ident.diagnosis.testing.selection_step import SelectionStep
from scara_ident.effects import Interval, Member
from scara_ident.effects.payload import PayloadChange
from scara_ident.effects.payload_intervals import PayloadInIntervals
from scara_ident.effects.signals import LinkTorque
from scara_ident.robot.robot import Robot
from tests.effects.intervals import CYCLES, arms, runs, seen


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
    held = replace(scene, link_torques=(LinkTorque(chosen[0].effect, chosen[0].member, (1.0,)),))
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
