"""Effects that the motion cannot tell apart are named together, and only those."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from scara_ident.diagnosis.candidates.candidates import Candidate
from scara_ident.diagnosis.checks.variation_check import counted
from scara_ident.diagnosis.criteria import CRITERIA
from scara_ident.diagnosis.selection.confounding import confounders
from scara_ident.diagnosis.testing.selection_step import SelectionStep, observed
from scara_ident.effects import Coefficient, Effect, Member, NonlinearParameter
from scara_ident.effects.friction import AsymmetricFriction
from scara_ident.effects.position import Spring
from scara_ident.effects.sinusoid import Sinusoid, sine_and_cosine
from scara_ident.estimation.least_squares import value_and_weights
from tests.diagnosis.made import Bent, Bump, exact_runs, runs_with_a_spring, searched, step_beside, with_torque

MIDDLE = 1.57
STIFFNESS = 0.3


@dataclass(frozen=True)
class Pendulum(Effect):
    """What gravity does to a joint of a base that stands on edge: the sine of the angle where a spring has the angle."""

    name = "pendulum"
    summary = "pendulum"
    coefficients = (Coefficient("moment", "N m", "moment of gravity", "it would push up"),)

    def joints(self, scene):
        return [0]

    def signal_columns(self, signals, member):
        return [np.sin(signals.motion.q[0] - MIDDLE)]


def own_gain(step: SelectionStep, place: int) -> float:
    """The gain of an effect found beside the others, runs counted as for those in its place."""
    found, others = step.chosen[place], step.without(place)
    return counted(others, others.judge([found])[0]).judge([found])[0].gain


def groups(size: float, added) -> dict[str, dict[str, float]]:
    """Each effect found with its confounders and their gain as a share of its own."""
    runs = with_torque(exact_runs(size=size), 0, added)
    result = searched(runs, Spring(), Pendulum(), AsymmetricFriction())
    found = confounders(result.step, result.decisions, result.first)
    return {
        item.label(result.scene): {
            confounder.label: confounder.gain / own_gain(result.step, place) for confounder in others
        }
        for place, (item, others) in enumerate(zip(result.chosen, found, strict=True))
    }


def spring(motion):
    return STIFFNESS * (motion.q[0] - MIDDLE)


def test_a_spring_and_a_pendulum_are_one_on_a_small_range():
    for added in (spring, lambda motion: STIFFNESS * np.sin(motion.q[0] - MIDDLE)):
        ((name, others),) = groups(0.3, added).items()
        assert {name, *others} == {"spring of joint1", "pendulum of joint1"}
        assert all(abs(share - 1.0) < 0.05 for share in others.values())


def test_a_confounder_is_named_however_many_others_were_tried():
    result = searched(with_torque(exact_runs(size=0.3), 0, spring), Spring(), Pendulum())
    # So many that neither would be believed.
    step = replace(result.step, tried=10**250)
    ((rival,),) = confounders(step, result.decisions, result.first)
    assert {result.chosen[0].label(result.scene), rival.label} == {"spring of joint1", "pendulum of joint1"}


def test_on_a_large_range_each_stands_alone():
    assert groups(1.9, spring) == {"spring of joint1": {}}
    pendulum = groups(1.9, lambda motion: STIFFNESS * np.sin(motion.q[0] - MIDDLE))
    assert pendulum == {"pendulum of joint1": {}}


def test_an_effect_of_another_kind_is_no_confounder():
    assert groups(1.9, lambda motion: 0.03 * np.abs(motion.v[0])) == {"asymmetric_friction of joint1": {}}


def test_two_effects_at_once_are_not_confounders_of_each_other():
    both = groups(1.9, lambda motion: spring(motion) + 0.03 * np.abs(motion.v[0]))
    assert both == {"spring of joint1": {}, "asymmetric_friction of joint1": {}}


class Wave(Sinusoid):
    """A sine of so many periods per turn, of which no recording holds enough to be believed."""

    name = "wave"
    summary = "a wave"
    coefficients = sine_and_cosine("wave_{part}", "{part} of a wave")
    nonlinear = (NonlinearParameter("order", "1", 0.05, 9.0, False),)

    def members(self, scene):
        return ()

    def doubtful(self, scene):
        return (Member(0, (1.0,)),)

    def signal_columns(self, signals, member):
        turn = member.nonlinear[0] * signals.motion.q[0]
        return [np.sin(turn), np.cos(turn)]

    def resolution(self, scene, member):
        return (1.0,)


def test_what_recordings_hold_too_little_of_is_named_as_it_is():
    # Over 3.8 rad the sine of the angle is no spring; refined, its order would fall until it is one.
    for size, rivals in ((0.3, ["wave of joint1"]), (1.9, [])):
        result = searched(with_torque(exact_runs(size=size), 0, spring), Spring(), Wave())
        (others,) = confounders(result.step, result.decisions, result.first, result.doubtful)
        assert [item.label for item in others] == rivals
        assert all(item.candidate.member.nonlinear == (1.0,) for item in others)


def test_two_that_nearly_cancel_are_not_distinguished():
    """A cubic spring was a spring and a counterbalance, each of five times its torque, and surely so."""

    def cubic(motion):
        turn = motion.q[0] - MIDDLE
        return 2.0 * (turn - np.sin(turn))

    step = step_beside(
        with_torque(exact_runs(size=1.2), 0, cubic), (Candidate(Spring(), Member(0)), Candidate(Lifting(), Member(0)))
    )
    first, second = confounders(step, [], step.scene)
    assert [item.label for item in first] == ["lifting of joint1"] and [item.label for item in second] == [
        "spring of joint1"
    ]
    assert first[0].value == () and first[0].gain == 0.0
    # Half of it taken back is no cancelling.
    step = step_beside(with_torque(exact_runs(size=1.2), 0, lambda motion: 2.0 * motion.q[0]), step.chosen)
    assert confounders(step, [], step.scene) == [(), ()]


@dataclass(frozen=True)
class Lifting(Pendulum):
    """What a counterbalance does to that joint."""

    name = "lifting"
    coefficients = (Coefficient("moment", "N m", "moment that lifts"),)


def test_what_runs_differ_by_does_not_tell_which_of_two_is_there():
    runs = runs_with_a_spring()
    found, there = (Candidate(effect, Member(0)) for effect in (Bent(), Spring()))
    for chosen, other, rivals in ((found, there, ["spring of joint1"]), (there, found, [])):
        step = step_beside(runs, (chosen,))
        step = replace(step, weights=value_and_weights(observed(step))[1])
        (others,) = confounders(step, step.without(0).judge([other]), step.scene)
        assert [item.label for item in others] == rivals


class OfTheArm(Spring):
    """The same spring as an effect of the whole arm."""

    name = "of_the_arm"

    coefficients = (Coefficient("stiffness", "N m/rad", "stiffness"),)

    def members(self, scene):
        return (Member(None),)

    def columns(self, scene, member):
        return Effect.columns(self, scene, member)

    def signal_columns(self, signals, member):
        turn = signals.motion.q[0] - MIDDLE
        return [np.array([turn, np.zeros_like(turn)])]


def test_a_confounder_of_the_whole_arm_is_named_where_it_removes_little_of_what_all_joints_leave():
    step = searched(with_torque(exact_runs(), 0, lambda motion: 0.0023 * (motion.q[0] - MIDDLE)), Spring()).step
    (own,) = step.without(0).judge(step.chosen)
    beside = step.without(0).judge([Candidate(OfTheArm(), Member(None))])
    assert beside[0].gain < CRITERIA.min_gain < own.gain
    ((rival,),) = confounders(step, beside, step.scene)
    assert rival.label == "of_the_arm"


class Pull(Spring):
    """A torque by the acceleration, which has the noise of the positions most."""

    name = "pull"

    def signal_columns(self, signals, member):
        return [signals.motion.a[0] * np.sin(3.0 * signals.motion.q[0])]


class SmoothPull(Pull):
    """The same without what is fast in it."""

    name = "smooth"

    def signal_columns(self, signals, member):
        return [smooth_pull(signals.motion)]


def smooth_pull(motion):
    return gaussian_filter1d(motion.a[0] * np.sin(3.0 * motion.q[0]), 8.0)


@pytest.mark.parametrize(("size", "turn", "found", "other", "named"), [
    (0.02, 2.0**12, Pull(), SmoothPull(), True),
    (0.07, np.inf, SmoothPull(), Pull(), False),
])  # fmt: skip
def test_the_noise_of_the_positions_does_not_tell_which_of_two_is_there(size, turn, found, other, named):
    runs = with_torque(exact_runs(), 0, lambda motion: size * smooth_pull(motion))
    if np.isfinite(turn):
        step = 2.0 * np.pi / turn
        runs = [replace(item, position=step * np.round(item.position / step)) for item in runs]
    step = step_beside(runs, (Candidate(found, Member(0)),))
    step = replace(step, weights=value_and_weights(observed(step))[1])
    (others,) = confounders(step, step.without(0).judge([Candidate(other, Member(0))]), step.scene)
    assert bool(others) is named


class Twin(Pendulum):
    """Another cause of the same columns, which the search does not try."""

    name = "twin"


class WithTwin(Pendulum):
    """A pendulum that knows of it."""

    def same_columns(self, scene, member):
        return ((Twin(), member),)


def test_another_cause_of_the_same_columns_is_named_though_it_is_not_tried():
    runs = with_torque(exact_runs(size=1.9), 0, lambda motion: STIFFNESS * np.sin(motion.q[0] - MIDDLE))
    result = searched(runs, WithTwin())
    ((twin,),) = confounders(result.step, result.decisions, result.first)
    assert (twin.label, twin.gain) == ("twin of joint1", own_gain(result.step, 0))


class KnownBump(Bump):
    """One that is tried where it is."""

    def members(self, scene):
        return (Member(0, (1.15,)),)

    def resolution(self, scene, member):
        # Lines about a grid point reach no farther.
        return (0.01,)


class FittedBump(KnownBump):
    """Another cause of it, at a grid point that loses half."""

    name = "fitted"
    fitted_first = True

    def members(self, scene):
        return (Member(0, (1.35,)),)


def test_a_confounder_that_a_fit_chooses_is_compared_by_its_fit():
    runs = with_torque(exact_runs(size=1.9), 0, lambda motion: 0.2 * np.exp(-(((motion.q[0] - 1.15) / 0.3) ** 2)))
    step = searched(runs, KnownBump()).step
    rival = Candidate(FittedBump(), Member(0, (1.35,)))
    ((found,),) = confounders(step, step.without(0).judge([rival]), step.scene)
    assert found.label == "fitted of joint1"
    assert abs(found.candidate.member.nonlinear[0] - 1.15) < 0.02
