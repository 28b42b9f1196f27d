"""Links in the clearance of their gears: flights against closed forms, slopes against differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.effects import Signals
from scara_ident.effects.flight import FreeLink, flank
from scara_ident.robot.robot import load_robot
from tests.arms import Array
from tests.effects.carried import carrying, heavier
from tests.effects.scenes import dense, moving, scene_of


def test_a_free_link_crosses_its_clearance_as_a_falling_body():
    step, width = 1e-4, 2e-3
    drift = np.where(np.arange(4000) < 1000, 1.0, -0.7)
    place, _ = flank(drift, width, step)
    assert np.all(place[:1000] == 0.5)
    time = (np.arange(4000) - 999) * step
    landing = np.sqrt(2.0 * width / 0.7)
    flight = (time > 0.0) & (time < landing - 2 * step)
    assert np.abs(place - (0.5 - 0.5 * 0.7 * time**2 / width))[flight].max() < 0.01
    assert np.all(place[time > landing + 2 * step] == -0.5)


def test_a_push_too_short_to_cross_brings_the_link_back_to_its_flank():
    drift = np.ones(3000)
    drift[1000:1010] = -1.0
    place, flights = flank(drift, 1e-2, 1e-3)
    assert np.all(place[:1000] == 0.5)
    assert 0.45 < place[1000:1100].min() < 0.5
    assert np.all(place[1100:] == 0.5)
    assert [(item.first, item.side) for item in flights] == [(1000, 1.0)]
    assert np.all(flank(drift[::-1].copy() * -1.0, 1e-2, 1e-3)[0][:1900] == -0.5)


def test_a_load_that_reverses_between_two_samples_is_flown_exactly():
    step, width, slope = 2e-3, 1e-3, -7.0
    time = (np.arange(400) - 100.37) * step
    place, (flight,) = flank(slope * time, width, step)
    flown = slice(flight.first, flight.stop)
    assert flight.since == pytest.approx(0.63)
    assert place[flown] == pytest.approx(0.5 + slope * time[flown] ** 3 / 6.0 / width, abs=1e-12)
    assert flight.stop == np.flatnonzero(time > (6.0 * width / -slope) ** (1.0 / 3.0))[0]


def test_a_link_that_lands_against_its_load_leaves_at_once():
    # Pushed across fast, the load reverses on the way: after landing it must not stay on the far flank.
    drift = np.concatenate([np.ones(100), -np.ones(30), np.full(200, 0.1)])
    place, flights = flank(drift, 1.5e-3, 1e-3)
    assert [item.side for item in flights] == [1.0, -1.0]
    assert flights[1].first == flights[0].stop
    assert place[flights[1].stop :] == pytest.approx(0.5)


@pytest.mark.parametrize("joint", [0, 1])
def test_slopes_are_the_differences_of_the_torque(joint: int):
    scene, item, width = scene_of(load_robot()), moving(load_robot(), 4.0), 2e-3

    def torque(value: Array, armature: float = 0.0, flown: float = width) -> Array:
        other = replace(scene, value=value, armatures={0: scene.armatures[0] + armature})
        return (width * FreeLink(Signals(other, item), joint, flown).change)[:, 200:-200]

    bodies = len(scene.model.rigid_body.columns)
    found = dense(FreeLink(Signals(scene, item), joint, width).slopes(), bodies + 2)[:, :, 200:-200]
    differences = []
    for k in range(bodies):
        step = 2e-3 * max(abs(scene.value[k]), 0.05) * np.eye(len(scene.value))[k]
        differences.append((torque(scene.value + step) - torque(scene.value - step)) / (2.0 * step[k]))
    step = 2e-3 * scene.armatures[0]
    differences.append((torque(scene.value, step) - torque(scene.value, -step)) / (2.0 * step))
    step = 5e-3 * width
    differences.append((torque(scene.value, 0.0, width + step) - torque(scene.value, 0.0, width - step)) / (2.0 * step))
    for k, expected in enumerate(differences):
        if k == bodies and scene.known_armature(joint) is not None:
            continue
        # Flights end at samples, which a difference moves over one at a time.
        assert np.linalg.norm(found[:, k] - expected) < 0.06 * np.linalg.norm(expected) + 1e-9


def test_what_acts_on_links_flies_with_them_as_if_the_bodies_had_it():
    robot, item = load_robot(), moving(load_robot(), 2.0)
    carried, merged, empty = (
        FreeLink(Signals(scene, item), 1, 1e-3).change
        for scene in (carrying(scene_of(robot), 2.0), heavier(robot, 2.0), scene_of(robot))
    )
    size = np.max(np.abs(merged))
    assert np.max(np.abs(carried - merged)) < 1e-5 * size
    assert np.max(np.abs(empty - merged)) > 0.1 * size
