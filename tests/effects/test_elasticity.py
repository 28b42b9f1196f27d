"""Elastic gears and clearance: columns against closed forms, recovery, what is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scara_ident.diagnosis.criteria import CRITERIA
from scara_ident.diagnosis.fitting.effect_parameters import size_is_determined
from scara_ident.effects import Member, Parameter, Scene, Signals
from scara_ident.effects.elasticity import Backlash, JointElasticity
from scara_ident.effects.links import lagging, usual_link_inertia
from scara_ident.effects.two_mass import TwoMasses, usual_coupling
from scara_ident.model.model import build_model
from scara_ident.robot.robot import load_robot
from scara_ident.simulation import parse_effect, simulate, virtual_arm
from tests.arms import Array, Link, example_urdf, write_urdf
from tests.effects.scenes import columns, fit, moving, scene_of, wandering


def test_far_below_its_frequency_the_column_is_minus_inertia_times_the_loads_second_derivative():
    scene = scene_of(load_robot(), band=60.0)
    item = moving(scene.robot, 3.0, rate=1000.0)
    signals = Signals(scene, item)
    column = columns(JointElasticity(), scene, item, Member(1, (150.0, 0.3)))[:, 0]
    load = signals.load(1) / 0.01
    lag = [load]
    for _ in range(2):
        lag.append(np.gradient(lag[-1], 1e-3))
    expected = lagging(signals, 1, (lag[0], lag[1], lag[2]))
    inside = slice(300, -300)
    assert np.abs(column - expected)[:, inside].max() < 0.05 * np.abs(expected[:, inside]).max()


@pytest.mark.slow
@pytest.mark.parametrize(("joint", "stiffness"), [("joint1", 60000.0), ("joint2", 12000.0)])
def test_the_stiffness_is_recovered(joint: str, stiffness: float):
    arm = virtual_arm()
    effect = parse_effect(f"joint_elasticity:{joint}:stiffness={stiffness}")
    data = [simulate(arm, wandering(arm, f"t{k}", k), effects=[effect], seed=k).recording for k in (1, 2)]
    family, j = JointElasticity(), arm.robot.joints.index(joint)
    frequency = np.sqrt(stiffness / usual_link_inertia(scene_of(arm.robot), j)) / (2 * np.pi)
    member = Member(j, (float(frequency), 0.2))
    scene, value, covariance = fit(build_model(arm.robot), data, family, member, rounds=2)
    found = family.parameters(scene, member, value, covariance)["stiffness"]
    assert found.value == pytest.approx(stiffness, rel=0.15)
    assert family.inadmissible(scene, member, value, np.sqrt(np.diag(covariance))) is None


@pytest.mark.parametrize(
    ("of_inertia", "of_frequency", "power"), [(0.3, 1e-9, 1.0), (0.0, 0.15, -1.0), (0.2, 0.1, 0.0), (0.3, np.inf, -1.0)]
)
def test_a_stiffness_is_determined_as_what_is_unsure_of_it_is(of_inertia: float, of_frequency: float, power: float):
    """k = I (2 pi f)^2: even about itself with the inertia, and as its reciprocal with a frequency that nothing shows."""
    std = 5000.0 * np.hypot(of_inertia, 2.0 * of_frequency if np.isfinite(of_frequency) else 0.0)
    own = {"stiffness": Parameter(5000.0, std, "N m/rad"), "frequency": Parameter(20.0, 20.0 * of_frequency, "Hz")}
    told = JointElasticity().with_symmetric_powers(own)
    assert told["stiffness"].symmetric_power == pytest.approx(power)
    assert (told["stiffness"].value, told["stiffness"].std, told["frequency"]) == (5000.0, std, own["frequency"])
    assert (told["stiffness"].interval is None) == (power == 1.0)


@pytest.mark.parametrize("share", [0.0, 0.2, 0.4, 0.6, 0.8, 1.0])
def test_a_stiffness_with_an_open_end_is_not_called_settled(share: float):
    """By whatever power it is told: what is told by more than the standard deviations asked has both its ends."""
    family, opened = JointElasticity(), []
    for part in np.linspace(0.05, 2.0, 79):
        frequency = Parameter(20.0, 20.0 * 0.5 * np.sqrt(share) * part, "Hz")
        told = family.with_symmetric_powers(
            {"stiffness": Parameter(5000.0, 5000.0 * part, "N m/rad"), "frequency": frequency}
        )
        ends = told["stiffness"].interval
        opened.append(ends is not None and not np.all(np.isfinite(ends)))
        assert not (opened[-1] and size_is_determined(family, told, CRITERIA.min_size))
    assert any(opened) == (share > 0.0)


def test_a_stiffness_that_nothing_tells_stays_so():
    own = {"stiffness": Parameter(np.inf, np.inf, "N m/rad"), "frequency": Parameter(20.0, 3.0, "Hz")}
    assert JointElasticity().with_symmetric_powers(own) == own


def test_the_width_is_recovered():
    arm = virtual_arm()
    effect = parse_effect("backlash:joint2:width=0.002")
    data = [simulate(arm, wandering(arm, f"t{k}", k), effects=[effect], seed=k).recording for k in (1, 2)]
    family, member = Backlash(), Member(1, (0.002,))
    scene, value, covariance = fit(build_model(arm.robot), data, family, member, rounds=2)
    found = family.parameters(scene, member, value, covariance)["width"]
    assert found.value == pytest.approx(0.002, rel=0.1)


def test_what_no_gear_can_have_is_refused():
    scene = scene_of(load_robot())
    std = np.array([1e-7])
    assert "ahead of its motor" in str(
        JointElasticity().inadmissible(scene, Member(0, (30.0, 0.3)), np.array([-1e-5]), std)
    )
    assert "Hz" in str(JointElasticity().inadmissible(scene, Member(0, (30.0, 0.3)), np.array([1e-2]), std))
    assert JointElasticity().inadmissible(scene, Member(0, (30.0, 0.3)), np.array([1.2e-5]), std) is None
    # Damped as far as a fit may go it has no resonance, where that would be seen.
    wide, soft = replace(scene, band=60.0), np.array([1.2e-5])
    assert "resonance" in str(JointElasticity().inadmissible(wide, Member(0, (30.0, 0.7)), soft, std))
    assert JointElasticity().inadmissible(wide, Member(0, (30.0, 0.3)), soft, std) is None
    assert JointElasticity().inadmissible(replace(scene, band=20.0), Member(0, (30.0, 0.7)), soft, std) is None
    assert "negative" in str(Backlash().inadmissible(scene, Member(0, (1e-3,)), np.array([-1e-4]), std))
    assert "felt by hand" in str(Backlash().inadmissible(scene, Member(0, (1e-3,)), np.array([0.2]), std))


@pytest.mark.parametrize(
    ("frequency", "ratio", "band"), [(20.0, 0.2, 30.0), (20.0, 0.01, 30.0), (103.2, 0.7, 0.0), (200.0, 0.2, 0.0)]
)
def test_what_has_no_resonance_asks_for_no_band(frequency: float, ratio: float, band: float):
    """A second gear that does not swing, of 135 Hz by the end of its fit, had led from 21 to 100 Hz, where nothing was told of it."""
    assert JointElasticity().band(Member(0, (frequency, ratio))) == pytest.approx(band)


def test_columns_of_members_in_the_model_add_up_and_that_of_another_is_what_it_changes_beside_them():
    family, scene = JointElasticity(), scene_of(load_robot())
    item = moving(scene.robot, 3.0)
    members = Member(0, (6.0, 0.1)), Member(1, (5.0, 0.1))
    first, both = (replace(scene, together=tuple((family, one) for one in members[:k])) for k in (1, 2))

    def torque(beside: Scene, member: Member) -> Array:
        (column,) = family.signal_columns(Signals(beside, item), member)
        tie = family.tie(beside, member)
        assert tie is not None
        return tie.value * column

    alone = torque(scene, members[0])
    assert np.array_equal(torque(first, members[0]), alone)
    whole = torque(both, members[0]) + torque(both, members[1])
    beside = alone + torque(first, members[1])
    assert np.abs(whole - beside).max() < 1e-9 * np.abs(whole).max()
    # Of other parameters than those in the model it is a candidate in their place.
    assert np.array_equal(torque(both, members[0]), torque(both, replace(members[0])))
    other = torque(both, Member(0, (6.5, 0.1)))
    assert np.abs(other + torque(replace(scene, together=both.together[1:]), members[1]) - whole).max() > 1e-3
    assert np.abs(alone + torque(scene, members[1]) - whole).max() > 0.05 * np.abs(whole).max()


def test_a_link_whose_inertia_is_misjudged_lags_nothing_and_loads_no_other():
    family, scene = JointElasticity(), scene_of(load_robot())
    value = scene.value.copy()
    place = scene.model.place(scene.model.rigid_body)
    value[place] *= -1.0
    item, member = moving(scene.robot, 1.0), Member(1, (5.0, 0.1))
    misjudged = replace(scene, value=value, together=((family, Member(0, (6.0, 0.1))), (family, member)))
    assert not usual_link_inertia(misjudged, 1) > 0.0
    (column,) = family.signal_columns(Signals(misjudged, item), member)
    assert np.all(column == 0.0)


def test_one_soft_gear_may_stand_for_two_of_links_that_share_their_inertia():
    family, robot = JointElasticity(), load_robot(example_urdf("ur5_robot.urdf"))
    scene, member = scene_of(robot), Member(1, (4.0, 0.03))
    pairs = family.instead(scene, member)
    # The elbow first, and not the pan, whose axis stands across that of the lift.
    assert pairs[0][1].joint == 2 and all(one.joint == 1 and one.nonlinear == other.nonlinear for one, other in pairs)
    assert 0 not in {other.joint for _, other in pairs}
    both = pairs[0]
    item = moving(robot, 0.1)
    masses = TwoMasses(Signals(scene, item), both)
    inertia = np.diag(masses.inertia)
    inertia[0, 1] = inertia[1, 0] = usual_coupling(scene, 1, 2) * np.sqrt(masses.inertia[0] * masses.inertia[1])
    slowest = np.sqrt(np.min(np.linalg.eigvals(np.linalg.solve(inertia, np.diag(masses.stiffness))).real)) / (
        2.0 * np.pi
    )
    assert slowest == pytest.approx(4.0)
    beside = replace(scene, together=((family, member), (family, Member(2, (9.0, 0.1)))))
    assert 2 not in {other.joint for _, other in family.instead(beside, member)}
    assert family.instead(replace(scene, value=-scene.value), member) == ()


def test_a_fit_begins_elsewhere_as_far_off_as_what_is_tried_is_apart():
    family, scene = JointElasticity(), scene_of(load_robot())
    softer, stiffer = family.elsewhere(scene, Member(1, (10.0, 0.5)))
    assert (softer.joint, stiffer.joint) == (1, 1)
    assert stiffer.nonlinear[0] / 10.0 == pytest.approx(10.0 / softer.nonlinear[0])
    # Not beyond what arms have.
    assert [item.nonlinear[0] > 2.0 for item in family.elsewhere(scene, Member(1, (2.1, 0.5)))] == [True]


def test_what_is_not_found_is_stiffer_than_is_seen_and_shares_inertia():
    family, robot = JointElasticity(), load_robot(example_urdf("ur5_robot.urdf"))
    scene = scene_of(robot)
    (other,) = family.unfound(scene, Member(1, (4.0, 0.03)))
    assert other.joint == 2 and other.nonlinear[0] > scene.band
    beside = replace(scene, together=((family, Member(1, (4.0, 0.03))), (family, Member(2, (9.0, 0.1)))))
    assert 2 not in {item.joint for item in family.unfound(beside, Member(1, (4.0, 0.03)))}


@pytest.mark.parametrize("travel", [0.05, 5.0])
def test_clearances_of_a_slide_are_shares_of_its_travel(tmp_path: Path, travel: float):
    robot = load_robot(write_urdf(tmp_path / "arm.urdf", [Link("prismatic")]))
    scene = replace(scene_of(robot), travel=np.array([travel]))
    widths = np.array([member.nonlinear[0] for member in Backlash().members(scene)])
    # From a micrometre of a stage of some centimetres to what anybody feels; refinement bridges a factor of three.
    assert widths[0] < 5e-6 * travel and widths[-1] > 5e-3 * travel and np.max(widths[1:] / widths[:-1]) < 3.0
    ((lower, upper),) = Backlash().limits(scene, Member(0, (widths[0],)))
    assert lower <= widths[0] and widths[-1] < upper
    std = np.array([1e-9])
    assert Backlash().inadmissible(scene, Member(0, (1e-3,)), np.array([0.01 * travel]), std) is None
    assert "m could be felt" in str(Backlash().inadmissible(scene, Member(0, (1e-3,)), np.array([0.02 * travel]), std))
