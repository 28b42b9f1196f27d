"""Positions behind filters without a delay, by those of SciPy; and that a gear is not believed in their place."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import butter, filtfilt, savgol_filter

from scara_ident.arrays import Array
from scara_ident.diagnosis.diagnose import diagnose
from scara_ident.effects import Effect, Member, Signals, effects_named
from scara_ident.effects.catalogue import available_effects
from scara_ident.effects.elasticity import JointElasticity
from scara_ident.effects.filters.smoothed_positions import WIDEST, NulledPositions, SmoothedPositions
from scara_ident.effects.following import slopes_by_differences
from scara_ident.effects.presliding import Presliding
from scara_ident.motion.motion import Motion
from scara_ident.recording.recording import Recording
from scara_ident.robot.robot import load_robot
from scara_ident.simulation import simulate, virtual_arm
from tests.effects.filters.runs import RATE
from tests.effects.scenes import columns, motion, scene_of, wandering

BAND, ALL = 8.0, Member(None)


def smoothed(item: Recording, order: int, cut: float) -> Recording:
    """The recording with positions that went through a Butterworth filter there and back."""
    up, down = butter(order, cut, fs=item.rate)
    return replace(item, position=filtfilt(up, down, item.position, axis=1))


def harmonics(passed: Callable[[Array], Array]) -> Motion:
    """A motion of three frequencies, of which each passes by so much."""
    time = np.arange(8000) / RATE
    size = np.array([[0.5, 0.05, 0.01], [0.4, 0.06, 0.008]])[..., None]
    frequency = np.array([0.4, 1.7, 4.0])[:, None]
    omega, own = 2.0 * np.pi * frequency, size * passed(frequency)
    angle = omega * time + np.array([[0.3, 1.0, 2.0], [1.5, 0.2, 0.7]])[..., None]
    q, v, a = own * np.sin(angle), own * omega * np.cos(angle), -own * omega**2 * np.sin(angle)
    return motion(q.sum(axis=1), v.sum(axis=1), a.sum(axis=1), rate=RATE)


@pytest.mark.parametrize(("power", "place"), [(2, 0), (4, 1)])
def test_a_share_of_a_power_of_the_frequency_is_what_such_a_filter_took(power: int, place: int):
    scene, cut = scene_of(load_robot(), rate=RATE, band=BAND), 40.0 if power == 2 else 15.0
    # Without the steps of dry friction, which turns elsewhere.
    scene = replace(scene, value=np.where(np.char.startswith(scene.model.names, "a"), 0.0, scene.value))
    before, after = harmonics(np.ones_like), harmonics(lambda frequency: 1.0 / (1.0 + (frequency / cut) ** power))
    missing = [np.einsum("jpn,p->jn", scene.model.regressor(item), scene.value) for item in (before, after)]
    inside = slice(1000, -1000)
    told = (BAND / cut) ** power * columns(SmoothedPositions(), scene, after, ALL)[:, place, inside]
    missed = (missing[0] - missing[1])[:, inside]
    assert np.sqrt(np.mean((told - missed) ** 2)) < 0.02 * np.sqrt(np.mean(missed**2))


@pytest.mark.parametrize(
    ("effect", "member", "value"),
    [(SmoothedPositions(), ALL, [0.3, 0.2]), (NulledPositions(), Member(None, (9.0, 0.05)), [0.4, 0.1, 0.05])],
)
def test_derivatives_by_the_estimate_are_those_of_the_torque(effect: Effect, member: Member, value: list[float]):
    """By differences they took minutes on six joints: each of some forty parameters made all columns anew."""
    scene = scene_of(load_robot(), rate=RATE, band=BAND)
    signals = Signals(scene, harmonics(np.ones_like))
    told = effect.estimate_slopes(signals, member, np.array(value))
    expected = slopes_by_differences(effect, signals, member, np.array(value))
    for joint in range(2):
        own, other = np.zeros((2, len(scene.value), signals.motion.samples))
        own[told[joint][0]], other[expected[joint][0]] = told[joint][1], expected[joint][1]
        assert np.abs(own - other).max() < 1e-6 * np.abs(other).max()


@pytest.mark.parametrize(("ratio", "none"), [(0.05, False), (WIDEST, True)])
def test_one_that_leaves_motion_everywhere_has_no_zero(ratio: float, none: bool):
    """A fit that ended there is that of a damped swing: such a one took the place of a true gear of 36,700 N m/rad."""
    member, value, std = Member(None, (9.0, ratio)), np.array([0.3, 0.0, 0.0]), np.full(3, 0.05)
    assert (NulledPositions().inadmissible(scene_of(load_robot()), member, value, std) is not None) is none


@pytest.mark.parametrize(("shares", "amplified"), [((-1.35, 0.10), True), ((-0.9, 1.9), False), ((-0.1, 0.1), False)])
def test_one_that_would_amplify_the_motion_is_none(shares: tuple[float, float], amplified: bool):
    """Such a one took the place of a gear of 107,000 N m/rad in a band of 50 Hz."""
    found = SmoothedPositions().inadmissible(scene_of(load_robot()), ALL, np.array(shares), np.array([0.05, 0.05]))
    assert (found is not None) is amplified


def test_it_is_asked_for_beside_a_gear_and_presliding_and_in_no_catalogue():
    assert JointElasticity.imitated_by == (SmoothedPositions(), NulledPositions())
    assert Presliding.imitated_by == (SmoothedPositions(),)
    scene, own, value = scene_of(load_robot()), Member(1, (9.0, 0.05)), np.ones(1)
    assert SmoothedPositions().members(scene) == (ALL,)
    assert NulledPositions().in_place_of(scene, JointElasticity(), own, value) == Member(None, (9.0, 0.05))
    # What is wider leaves motion at its frequency, and is a gear.
    wide = NulledPositions().in_place_of(scene, JointElasticity(), Member(1, (9.0, 0.5)), value)
    assert wide == Member(None, (9.0, WIDEST))
    assert NulledPositions().in_place_of(scene, JointElasticity(), Member(1), value) is None
    assert not {type(item) for item in available_effects()} & {SmoothedPositions, NulledPositions}


def test_of_a_filter_with_a_zero_that_is_told_by_its_frequency():
    scene = scene_of(load_robot(), rate=RATE, band=BAND)
    scene = replace(scene, value=np.where(np.char.startswith(scene.model.names, "a"), 0.0, scene.value))
    before, after = harmonics(np.ones_like), harmonics(lambda frequency: 1.0 - (frequency / 40.0) ** 2)
    missing = [np.einsum("jpn,p->jn", scene.model.regressor(item), scene.value) for item in (before, after)]
    inside, member = slice(1000, -1000), Member(None, (40.0, 0.01))
    told = columns(NulledPositions(), scene, after, member)[:, 0, inside]
    missed = (missing[0] - missing[1])[:, inside]
    assert np.sqrt(np.mean((told - missed) ** 2)) < 0.02 * np.sqrt(np.mean(missed**2))
    assert NulledPositions().limits(scene, member) == ((2.0, 200.0), (0.01, WIDEST))


INSTEAD = "a filter of the positions without a delay explains as much in its place, and with it in the model"


@pytest.mark.parametrize("first", [110, 410])
def test_no_presliding_is_believed_where_positions_were_smoothed(first: int):
    """Such an arm was `explained` by 0.15 and 0.20 N m over 0.19 rad of a joint that has none."""
    arm = virtual_arm()
    runs = [
        smoothed(simulate(arm, wandering(arm, f"t{k}", first + k, 7.0), seed=first + k, rate=250.0).recording, 1, 6.0)
        for k in range(4)
    ]
    found = diagnose(load_robot(), runs[:-1], validation=runs[-1:], catalogue=effects_named("presliding"))
    assert (found.effects, found.verdict) == ((), "undecided")
    assert any(item.why.startswith(INSTEAD) for item in found.tentative)


@pytest.mark.slow
def test_no_gear_is_believed_where_a_polynomial_was_fitted_to_the_positions(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """Such an arm was `explained` by one: it was compared with a filter that leaves nothing at the gear's own frequency alone."""
    monkeypatch.syspath_prepend(str(Path(__file__).resolve().parents[3] / "benchmarks"))
    why = "benchmarks are not part of an installed package"
    sets, conditions = (pytest.importorskip(name, reason=why) for name in ("virtual_sets", "virtual_conditions"))
    asked = conditions.Asked(varied=False, rate=250.0, bits=20, recordings=3, duration=(8.0, 20.0))
    made = sets.simulate_set("none", 971003, "scara03", tmp_path, asked)
    training, held_out = (
        [replace(item, position=savgol_filter(item.position, 25, 3, axis=1), velocity=None) for item in each]
        for each in (made.training, made.held_out)
    )
    found = diagnose(made.robot, training, validation=held_out)
    assert (found.effects, found.verdict) == ((), "undecided")
    assert any(item.why.startswith(INSTEAD) for item in found.tentative)


@pytest.mark.slow
def test_no_gear_is_believed_where_positions_were_smoothed():
    arm = virtual_arm()
    runs = [
        smoothed(simulate(arm, wandering(arm, f"t{k}", 10 + k, 10.0), seed=k, rate=250.0).recording, 2, 7.0)
        for k in range(4)
    ]
    found = diagnose(load_robot(), runs[:-1], validation=runs[-1:])
    assert (found.effects, found.verdict) == ((), "undecided")
    why = next(item for item in found.tentative if item.effect == "joint_elasticity").why
    assert why.startswith(INSTEAD)
