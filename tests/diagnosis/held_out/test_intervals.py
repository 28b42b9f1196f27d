"""Intervals of held-out recordings: no joint's own torque says where it is predicted with an effect."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.diagnosis.candidates.candidates import Candidate, CandidateColumns
from scara_ident.diagnosis.criteria import CRITERIA
from scara_ident.diagnosis.held_out.intervals import intervals_by_others, words_of
from scara_ident.diagnosis.testing.selection_step import SelectionStep, observed
from scara_ident.effects import Interval, Member
from scara_ident.effects.payload_intervals import PayloadInIntervals
from scara_ident.estimation import wls
from scara_ident.recording.recording import Recording
from scara_ident.robot.robot import Robot
from tests.effects.intervals import CYCLES, arms, run, runs, seen

SPELLS = {"m7_1": ((1.5, 4.0), (5.5, 8.0))}


@pytest.fixture(scope="module")
def robots(tmp_path_factory: pytest.TempPathFactory) -> tuple[Robot, Robot]:
    return arms(tmp_path_factory.mktemp("arm"))


def told(robots: tuple[Robot, Robot], held_out: Recording) -> tuple[tuple[Interval, ...], tuple[Interval, ...]]:
    scene, observations = seen(robots[0], runs(robots, CYCLES))
    truth = tuple(Interval(k, *span) for k, own in enumerate(CYCLES.values()) for span in own)
    chosen = (Candidate(PayloadInIntervals(), Member(None, intervals=truth)),)
    step = SelectionStep(scene, CandidateColumns(observations), chosen, np.full(2, 20.0), 1, CRITERIA)
    after = wls(observed(step))
    _, one = seen(robots[0], [held_out])
    scene = replace(scene, start={**scene.start, held_out.name: float(held_out.time[0])})
    return intervals_by_others(one, scene, chosen, 0, after.value, after.weights)


def test_each_joint_is_determined_by_the_others(robots: tuple[Robot, Robot]):
    apart, together = told(robots, run(robots, 7, SPELLS))
    for joint in (None, 0, 1):
        own = [item for item in (*apart, *together) if item.joint == joint]
        assert [item.recording for item in own] == [3, 3]
        edges = [edge for item in own for edge in (item.start, item.stop)]
        assert edges == pytest.approx([1.5, 4.0, 5.5, 8.0], abs=0.3)
    assert words_of(together).startswith("from 1.")


def test_the_torque_of_a_joint_does_not_say_where_it_is_loaded_itself(robots: tuple[Robot, Robot]):
    """Only the second joint is loaded: the first, which is predicted by it, is; the second is not."""
    bare, loaded = run(robots, 7, {}), run(robots, 7, SPELLS)
    assert bare.effort is not None and loaded.effort is not None
    mixed = replace(loaded, effort=np.array([bare.effort[0], loaded.effort[1]]))
    apart, _ = told(robots, mixed)
    assert {item.joint for item in apart} == {0}


def test_nothing_acts_where_nothing_is_carried(robots: tuple[Robot, Robot]):
    apart, together = told(robots, run(robots, 7, {}))
    assert apart == together == ()
    assert words_of(together) == "nowhere"
