"""What the torque of effects changes by with the estimate that they follow: each family's derivatives against differences."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from scara_ident.effects import Coefficient, Effect, Member, Scene, Signals
from scara_ident.effects.catalogue import CATALOGUE
from scara_ident.effects.filters.position_filter import PositionFilter
from scara_ident.effects.following import EstimateSlopes, predicted_slopes, slopes_by_differences, some_slopes
from scara_ident.effects.measurement import TorqueGainMismatch
from scara_ident.robot.robot import Robot, load_robot
from tests.arms import example_urdf
from tests.effects.scenes import moving, scene_of
from tests.simulation.made import tree

Array = NDArray[np.float64]
# Families that follow the estimate and say their own derivatives, by their place in the catalogue.
FAMILIES = [k for k, effect in enumerate(CATALOGUE) if effect.follows_estimate]


class Squared(Effect):
    """A torque as the square of the predicted one."""

    name = "squared"
    summary = "squared"
    coefficients = (Coefficient("size", "1/{torque}", "square"),)
    follows_estimate = True

    def signal_columns(self, signals, member):
        return [signals.predicted[member.place] ** 2]


def arm(name: str, folder: Path) -> Robot:
    if name == "tree":
        return tree(folder)
    return load_robot() if name == "scara03" else load_robot(example_urdf("ur5_robot.urdf"))


def dense(slopes: EstimateSlopes, signals: Signals) -> Array:
    """Derivatives of all joints' torque by all parameters, shape (n, p, N)."""
    found = np.zeros((signals.scene.robot.n, len(signals.scene.value), signals.motion.samples))
    for joint, (places, rows) in slopes.items():
        found[joint, places] = rows
    return found


def untied(effect: Effect, scene: Scene) -> list[Member]:
    """The first and the last member that its tie does not hold."""
    members = [member for member in effect.members(scene) if effect.tie(scene, member) is None]
    return members[:1] + members[-1:]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["scara03", "ur5", "tree"])
@pytest.mark.parametrize("family", FAMILIES, ids=[type(CATALOGUE[k]).__name__ for k in FAMILIES])
def test_a_familys_derivatives_are_those_of_its_columns(family: int, name: str, tmp_path: Path) -> None:
    scene = scene_of(arm(name, tmp_path), start={"m": 0.0, "other": 0.0, "third": 0.0})
    effect, signals = CATALOGUE[family], Signals(scene, moving(scene.robot, 0.6))
    for member in untied(effect, scene):
        # An encoder's error is small, or the columns are not its torque.
        value = 1e-4 * np.linspace(1.0, 2.0, len(effect.columns(scene, member)))
        said = dense(effect.estimate_slopes(signals, member, value), signals)
        told = dense(slopes_by_differences(effect, signals, member, value), signals)
        assert np.max(np.abs(told)) > 0.0
        size = np.max(np.abs(told), axis=(0, 2), keepdims=True)
        assert np.all(np.abs(said - told) <= 1e-6 * size + 1e-9 * np.max(size))


def test_unless_a_family_says_them_differences_tell_the_derivatives() -> None:
    scene = scene_of(load_robot())
    signals = Signals(scene, moving(scene.robot, 0.6))
    places, rows = predicted_slopes(signals, 1)
    found = Squared().estimate_slopes(signals, Member(1), np.array([0.3]))
    exact = dense({1: (places, 0.6 * signals.predicted[1] * rows)}, signals)
    assert dense(found, signals) == pytest.approx(exact, rel=1e-6, abs=1e-9 * np.max(np.abs(exact)))


def test_the_derivatives_of_all_joints_at_once_are_those_of_their_columns() -> None:
    scene = scene_of(load_robot())
    signals = Signals(scene, moving(scene.robot, 0.6))
    member, value = Member(None), np.array([0.7, -0.3])
    columns = PositionFilter().regressor(signals.at(replace(scene, value=2.0 * scene.value)), member)
    once = PositionFilter().regressor(signals, member)
    for found in (PositionFilter().estimate_slopes, partial(slopes_by_differences, PositionFilter())):
        told = dense(found(signals, member, value), signals)
        assert np.einsum("jpt,p->jt", told, scene.value) == pytest.approx(
            np.einsum("jkt,k->jt", columns - once, value), abs=1e-6 * np.max(np.abs(once[:, 0]) * value[0])
        )


def test_those_of_the_predicted_torque_are_the_base_models_columns() -> None:
    scene = scene_of(load_robot())
    signals = Signals(scene, moving(scene.robot, 0.6))
    whole = dense({joint: predicted_slopes(signals, joint) for joint in range(2)}, signals)
    assert np.array_equal(whole, scene.model.regressor(signals.motion))
    places, rows = some_slopes(predicted_slopes(signals, 0), np.array([0, 1]))
    assert places.tolist() == [place for place in (0, 1) if scene.model.pattern[0, place]]
    assert np.array_equal(rows, whole[0, places])
    (only,) = TorqueGainMismatch().estimate_slopes(signals, Member(1), np.array([0.25])).items()
    assert only[0] == 1
    assert dense(dict([only]), signals)[1] == pytest.approx(0.25 * whole[1])
