"""Intervals in which the last link carries something are found, and none of what else changes."""

from __future__ import annotations

import pytest

from scara_ident.effects import Interval, Scene
from scara_ident.effects.interval_search import carried
from scara_ident.robot.robot import Robot
from tests.effects.intervals import CYCLES, MIDWAY, ONE, SECONDS, SINGLE, Spells, arms, run, runs, seen

SHOWN = (0, 1, 3)
# Cells are a sixteenth of a second long here.
CELL = 1.0 / 16.0


@pytest.fixture(scope="module")
def robots(tmp_path_factory: pytest.TempPathFactory) -> tuple[Robot, Robot]:
    return arms(tmp_path_factory.mktemp("arm"))


def in_order(scene: Scene, found: tuple[Interval, ...]) -> list[tuple[str, float, float]]:
    names = list(scene.start)
    return [(names[item.recording], item.start, item.stop) for item in found]


@pytest.mark.parametrize("spells", [CYCLES, MIDWAY, ONE, SINGLE], ids=["cycles", "midway", "one", "single"])
def test_intervals_of_a_body_are_found(robots: tuple[Robot, Robot], spells: Spells):
    scene, _ = seen(robots[0], runs(robots, spells))
    found = carried(scene, SHOWN)
    truth = [(name, start, stop) for name, own in sorted(spells.items()) for start, stop in own]
    assert [name for name, *_ in in_order(scene, found)] == [name for name, *_ in truth]
    for item, (_, start, stop) in zip(found, truth, strict=True):
        # Where friction turns its torque is unsure, and so is an instant there.
        assert abs(item.start - start) < 2.0 * CELL + 3.0 * item.start_std
        assert abs(item.stop - stop) < 2.0 * CELL + 3.0 * item.stop_std
        assert item.start_std < 0.2
        assert (item.stop_std == 0.0) == (stop == SECONDS)


def test_of_one_recording_cycles_are_found(robots: tuple[Robot, Robot]):
    cycles = {"m2_1": tuple((5.0 * k + 0.3 * (k % 3), 5.0 * k + 2.6) for k in range(1, 8))}
    scene, _ = seen(robots[0], [run(robots, 2, cycles, seconds=40.0)])
    found = carried(scene, SHOWN)
    assert [(item.start, item.stop) for item in found] == [
        (pytest.approx(a, abs=0.2), pytest.approx(b, abs=0.2)) for a, b in cycles["m2_1"]
    ]


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["offset", "friction", "scale", "contact", "nothing"])
@pytest.mark.parametrize("spells", [CYCLES, MIDWAY, ONE, SINGLE], ids=["cycles", "midway", "one", "single"])
def test_what_else_changes_is_no_body(robots: tuple[Robot, Robot], spells: Spells, kind: str):
    scene, _ = seen(robots[0], runs(robots, spells, kind))
    assert carried(scene, SHOWN) == ()
