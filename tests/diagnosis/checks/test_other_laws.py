"""Parameters of a law of friction or of a gear's loss, where another law explains as much and where it does not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.diagnosis import diagnose
from scara_ident.diagnosis.candidates.candidates import Candidate
from scara_ident.diagnosis.checks.other_laws import parameters_of_laws
from scara_ident.diagnosis.fitting.effect_parameters import physical_parameters
from scara_ident.diagnosis.fitting.nonlinear_fit import tune
from scara_ident.diagnosis.testing.selection_step import SelectionStep
from scara_ident.effects import Member, effects_named
from scara_ident.effects.drift import WarmUp
from scara_ident.effects.filters.position_filter import PositionFilter
from scara_ident.effects.friction import AsymmetricFriction, Stribeck
from scara_ident.effects.gear import TransmissionLoss
from scara_ident.paper import table5_parameters
from scara_ident.recording.recording import Recording
from scara_ident.robot.robot import load_robot
from tests.arms import noisy, rnea
from tests.diagnosis.made import BANDS, NOISE, exact_runs, step_beside, with_torque

AMPLITUDE, VELOCITY = 0.1, 0.15
WEIGHTS = 1.0 / np.array(NOISE)


def runs_by(exponent: int, noise: float = 0.3) -> list[Recording]:
    """Recordings with a friction that falls with speed by a law, and their noise times a factor."""

    def added(motion):
        return AMPLITUDE * np.sign(motion.v[0]) * np.exp(-(np.abs(motion.v[0] / VELOCITY) ** exponent))

    rng = np.random.default_rng(5)
    return [noisy(run, rng, noise * np.array(NOISE)) for run in with_torque(exact_runs(), 0, added)]


def step_of(runs: list[Recording], exponent: int, noise: float = 0.3) -> SelectionStep:
    chosen = Candidate(Stribeck(exponent), Member(0, (VELOCITY,)))
    return step_beside(runs, [chosen], WEIGHTS / noise)


@pytest.mark.parametrize("exponent", [1, 2])
def test_a_law_that_the_data_tell_leaves_its_parameters_as_sure_as_they_are(exponent: int):
    step = step_of(runs_by(exponent), exponent)
    (own,), (told,) = physical_parameters(step).effects, parameters_of_laws(step).effects
    assert {name: told[name] for name in own} == own
    assert ("exponent" in told) == (exponent == 1)


def test_where_two_laws_explain_as_much_parameters_are_no_surer_than_what_they_differ_by():
    """Amplitudes of 0.236 and 0.344 N m are of one friction by two laws; the standard deviation was 0.003."""
    noise = 20.0
    step = step_of(runs_by(2, noise), 2, noise)
    (own,), (told,) = physical_parameters(step).effects, parameters_of_laws(step).effects
    (other,) = physical_parameters(step_of(runs_by(2, noise), 1, noise)).effects
    for name in ("amplitude", "velocity"):
        assert told[name].value == own[name].value
        assert told[name].std > own[name].std
    assert told["amplitude"].std > 0.5 * abs(other["amplitude"].value - own["amplitude"].value)


def test_what_laws_differ_by_is_in_every_number_that_is_determined_twice():
    """An effect beside was told by a standard deviation that lacked what the laws of the other moved it by."""
    noise = 20.0
    step = step_of(runs_by(2, noise), 2, noise)
    step = replace(step, chosen=(Candidate(AsymmetricFriction(), Member(0)), *step.chosen))
    told = parameters_of_laws(step)
    places = [step.observations.parameters, step.observations.parameters + 1]
    for place, effect, name in zip(places, told.effects, ("viscous_difference", "amplitude"), strict=True):
        one = effect[name]
        found = told.linear.value[place], np.sqrt(told.linear.covariance[place, place])
        assert found == pytest.approx((one.value, one.std), rel=1e-9)
    assert told.effects[0]["viscous_difference"].std > physical_parameters(step).effects[0]["viscous_difference"].std


def test_parameters_are_no_surer_than_what_is_left_of_a_correction_moves_them_by():
    """A gear of 2000 N m/rad behind positions that are means over 40 ms was 2286 +- 39."""
    step, rest = step_of(runs_by(2), 2), Candidate(PositionFilter(), Member(None))
    own, told = physical_parameters(step), parameters_of_laws(replace(step, rest=rest))
    moved = physical_parameters(tune(replace(step, chosen=(*step.chosen, rest))))
    for name, one in own.effects[0].items():
        apart = moved.effects[0][name].value - one.value
        assert told.effects[0][name].std == pytest.approx(np.hypot(one.std, apart), rel=1e-6)
    apart = moved.linear.value[: len(own.linear.value)] - own.linear.value
    assert np.diag(told.linear.covariance) == pytest.approx(np.diag(own.linear.covariance) + apart**2, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("exponent", [1, 2])
def test_the_law_is_the_one_that_explains_more(exponent: int):
    """By the exponent 2 alone an amplitude of the other law came out a third too small, and sure to a percent."""
    (effect,) = diagnose(load_robot(), runs_by(exponent), bands=BANDS, catalogue=(Stribeck(),)).effects
    assert effect.parameters.get("exponent", None) is None or exponent == 1
    assert ("exp(-|v|/velocity)" in effect.description) == (exponent == 1)
    for name, true in (("amplitude", AMPLITUDE), ("velocity", VELOCITY)):
        found = effect.parameters[name]
        assert found.value == pytest.approx(true, abs=4.0 * found.std)
        assert found.std < 0.2 * true


def runs_with_a_loss(size: float, order: int) -> list[Recording]:
    """Recordings with a loss in the second gear by a law of this order, and three tenths of their noise once more."""
    robot = load_robot()

    def added(motion):
        load = robot.row_scale[1] * rnea(robot, motion.q, motion.v, motion.a)[1]
        gain = np.sqrt(1.0 + size**2) - 1.0 if order == 2 else 0.0
        return size * np.abs(load) * np.sign(robot.drive_sign[1] * motion.v[1]) + gain * load

    rng = np.random.default_rng(5)
    return [noisy(run, rng, 0.3 * np.array(NOISE)) for run in with_torque(exact_runs(), 1, added)]


@pytest.mark.slow
@pytest.mark.parametrize(("size", "order", "told"), [(0.4, 1, 1), (0.4, 2, 2), (0.1, 1, 2)])
def test_a_loss_is_by_the_law_that_explains_more_and_leaves_no_scale_of_the_torque(size: float, order: int, told: int):
    """By the law of second order alone a scale of 1 - c^2 / 2 stood beside a loss without it; of a small loss none tells the law."""
    families = effects_named("transmission_loss", "torque_gain_mismatch")
    found = diagnose(load_robot(), runs_with_a_loss(size, order), bands=BANDS, catalogue=families)
    assert [(item.effect, item.joint) for item in found.effects] == [("transmission_loss", "joint2")]
    assert [item.effect for item in found.search.chosen] == [TransmissionLoss(told)]
    (effect,) = found.effects
    assert ("loss_order" in effect.parameters) == (told == 1)
    assert ("with the same loss whether" in effect.description) == (told == 1)
    loss = effect.parameters["loss_coefficient"]
    assert loss.value == pytest.approx(size, abs=3.0 * loss.std)
    assert loss.std < 0.1 * size


SHARE, WARM_TIME = 0.6, 4.0


def warming_runs(part: str) -> list[Recording]:
    """Recordings in which a part of the first joint's friction falls, and three tenths of their noise once more."""
    values = table5_parameters("OJD")[5:9]
    powers = {"all": range(4), "coulomb": range(1), "viscous": range(1, 4)}[part]

    def added(motion):
        v = motion.v[0]
        fallen = sum(values[k] * np.sign(v) * np.abs(v) ** k for k in powers)
        return SHARE * np.exp(-(motion.time - motion.time[0]) / WARM_TIME) * fallen

    rng = np.random.default_rng(5)
    return [noisy(run, rng, 0.3 * np.array(NOISE)) for run in with_torque(exact_runs(), 0, added)]


@pytest.mark.slow
@pytest.mark.parametrize("part", ["all", "coulomb", "viscous"])
def test_what_of_the_friction_warms_up_is_determined(part: str):
    """Of Coulomb friction alone a share of 0.41 +- 0.01 of all friction was said, and steady friction 8.6 deviations off."""
    found = diagnose(load_robot(), warming_runs(part), bands=BANDS, catalogue=(WarmUp(),))
    (effect,) = found.effects
    assert [item.effect for item in found.search.chosen] == [WarmUp(part)]
    assert ("speed_power" in effect.parameters) == (part != "all")
    for name, true in (("share", SHARE), ("time_constant", WARM_TIME)):
        told = effect.parameters[name]
        assert told.value == pytest.approx(true, abs=3.5 * told.std)
        assert told.std < 0.25 * true
    dry = found.after.model.names.index("a01")
    assert found.after.value[dry] == pytest.approx(table5_parameters("OJD")[5], abs=3.5 * found.after.std[dry])
