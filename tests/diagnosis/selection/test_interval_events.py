"""What may be an effect that acts in intervals is no event before it was tried."""

from __future__ import annotations

import pytest

from scara_ident.diagnosis.selection.interval_events import not_explained
from scara_ident.diagnosis.selection.search import SearchTask
from scara_ident.effects.payload_intervals import PayloadInIntervals
from scara_ident.effects.position import Spring
from scara_ident.identification.events import Event
from scara_ident.robot.robot import Robot
from tests.effects.intervals import CYCLES, arms, runs, seen


@pytest.fixture(scope="module")
def robots(tmp_path_factory: pytest.TempPathFactory) -> tuple[Robot, Robot]:
    return arms(tmp_path_factory.mktemp("arm"))


def event(name: str, start: float, stop: float) -> Event:
    return Event(name, start, stop, ("j1",), 1.0, "push", 2.0)


def test_events_within_intervals_are_tried_first_and_others_stay(robots: tuple[Robot, Robot]):
    _, observations = seen(robots[0], runs(robots, CYCLES))
    inside, outside = event("m0_1", 1.2, 3.0), event("m0_1", 3.4, 4.2)
    elsewhere = event("m1_1", 4.4, 5.7)
    events = (inside, outside, elsewhere)
    task = SearchTask(observations.model, (PayloadInIntervals(), Spring()))
    assert not_explained(task, observations, events) == (outside, elsewhere)
    assert not_explained(SearchTask(observations.model, (Spring(),)), observations, events) == events
    assert not_explained(task, observations, ()) == ()
