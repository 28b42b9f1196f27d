"""The effects that came in, in that order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest

from scara_ident.arrays import Array
from scara_ident.diagnosis import diagnose
from scara_ident.diagnosis.criteria import CRITERIA
from scara_ident.diagnosis.fitting.effect_parameters import physical_parameters
from scara_ident.diagnosis.found_effect import found_effects, not_found
from scara_ident.effects import Effect, Member, Parameter, effects_named
from scara_ident.effects.measurement import shifted
from scara_ident.effects.position import Spring
from scara_ident.inquiry.next_steps import next_steps
from scara_ident.paper import table5_parameters
from scara_ident.recording.recording import Recording
from scara_ident.robot.robot import load_robot
from tests.arms import noisy, recorded_torque, recording
from tests.diagnosis.made import BANDS, NOISE, RATE, exact_runs, fitted, multisine, virtual_runs


@pytest.mark.slow
@pytest.mark.parametrize(
    ("late", "named"), [((0.008, 0.008, 0.008, 0.008), True), ((0.003, 0.013, 0.006, 0.011), False)]
)
def test_a_delay_by_which_runs_differ_is_corrected_but_not_named(late: tuple[float, ...], named: bool) -> None:
    runs = [shifted(run, -delay) for run, delay in zip(exact_runs(), late, strict=True)]
    found = diagnose(load_robot(), runs, bands=BANDS, catalogue=effects_named("time_delay"))
    assert found.search.correction is not None
    assert np.mean(found.search.correction.value) == pytest.approx(np.mean(late), abs=1.5e-3)
    assert [item.effect for item in found.effects] == (["time_delay"] if named else [])
    said = [note for note in found.notes if "not counted as an effect" in note]
    assert len(said) == (not named)
    # What stands there as its standard deviation is what it was judged by.
    assert all("standard deviations" in note and "within its uncertainty" not in note for note in said)


@pytest.mark.slow
def test_errors_go_from_effect_to_effect() -> None:
    runs = virtual_runs("spring:joint1", "asymmetric_friction:joint2")
    found = diagnose(load_robot(), runs, bands=BANDS, catalogue=effects_named("spring", "asymmetric_friction")).effects
    assert {(item.effect, item.joint) for item in found} == {("spring", "joint1"), ("asymmetric_friction", "joint2")}
    first, second = found
    assert first.after == second.before
    assert all(item.after[item.joint] < item.before[item.joint] for item in found if item.joint)
    assert all(0.0 < item.gain <= 1.0 and item.p_value < 1e-2 for item in found)


class Reciprocal(Spring):
    """A spring of which the compliance is told."""

    def with_symmetric_powers(self, parameters: Mapping[str, Parameter]) -> Mapping[str, Parameter]:
        return {name: replace(item, symmetric_power=-1.0) for name, item in parameters.items()}


@pytest.mark.slow
def test_an_effect_says_as_what_its_parameters_are_determined() -> None:
    (found,) = diagnose(load_robot(), virtual_runs("spring:joint1"), bands=BANDS, catalogue=(Reciprocal(),)).effects
    assert found.parameters["stiffness"].symmetric_power == -1.0


class Beside(Spring):
    """A spring that says what was found beside it."""

    def or_else_beside(self, member: Member, value: Array, others: Sequence[tuple[Effect, Member, Array]]) -> str:
        return "; beside " + ", ".join(f"{effect.name} of {len(size)}" for effect, _, size in others)


@pytest.mark.slow
def test_an_effect_says_what_else_it_may_be_together_with_another() -> None:
    runs = virtual_runs("spring:joint1", "asymmetric_friction:joint2")
    catalogue = (Beside(), *effects_named("asymmetric_friction"))
    found = {item.effect: item for item in diagnose(load_robot(), runs, bands=BANDS, catalogue=catalogue).effects}
    assert found["spring"].description.endswith("; beside asymmetric_friction of 1")


def test_what_a_second_encoder_tells_of_an_effect_that_was_not_added_is_said() -> None:
    readings = {("joint_elasticity", "joint1"): {"stiffness": Parameter(20012.0, 211.0, "N m/rad")}}
    assert not_found(readings, []) == [
        "joint_elasticity of joint1 was not added, but a separate channel gives stiffness 2.001e+04 +- 2e+02 N m/rad"
    ]


def test_a_delay_that_was_taken_out_in_two_steps_is_one_effect() -> None:
    """It stood in `effects` twice, each time with all of it."""
    runs = [shifted(run, -0.008) for run in exact_runs()]
    search = diagnose(load_robot(), runs, bands=BANDS, catalogue=effects_named("time_delay")).search
    (first,) = search.steps
    twice = replace(search, steps=(first, replace(first, rms=(0.0, 0.0))))
    parameters = physical_parameters(twice.whole(twice.step))
    (effect,) = found_effects(twice, (), parameters, {}, {})
    assert effect.effect == "time_delay"
    assert tuple(effect.after.values()) == tuple(first.rms)


def _fast_runs() -> list[Recording]:
    """Twelve runs each of three fast motions, with four times the noise, in which a delay removes little and moves much."""
    robot, truth = load_robot(), table5_parameters("OJD")
    friction = [(*truth[5 + 4 * j : 9 + 4 * j], 0.0) for j in range(2)]
    made = []
    for k, name in enumerate("ABC"):
        motion = multisine(name, 3 + k, 6.0).at(np.arange(round(6.0 * RATE)) / RATE)
        torque = recorded_torque(robot, motion.position, motion.velocity, motion.acceleration, friction)
        for r in range(12):
            clean = recording(robot, f"{name}_{r + 1}", motion.time, motion.position, torque)
            made.append(noisy(clean, np.random.default_rng([k, r]), 4.0 * np.array(NOISE)))
    return made


@pytest.mark.slow
def test_less_than_a_sample_that_removes_little_is_corrected_and_not_counted() -> None:
    """Held commands left inertias within two of their standard deviations in 54 of 100 times, of a Panda."""
    runs, samples = _fast_runs(), -0.4
    late = [shifted(run, -samples / RATE) for run in runs]
    found = diagnose(load_robot(), late, bands=BANDS, catalogue=effects_named("time_delay"))
    (step,) = found.search.steps
    assert 0.0 < step.decision.gain < CRITERIA.min_gain
    assert found.search.correction is not None
    assert found.search.correction.value[0] == pytest.approx(samples / RATE, rel=0.25)
    assert (found.effects, found.verdict) == ((), "complete")
    (note,) = [note for note in found.notes if "not counted as an effect" in note]
    assert "less than one sample" in note
    # Nothing is asked for that would tell it from what is no delay.
    assert "the delay that was corrected" not in {item.question for item in next_steps(found)}
    on_time = fitted(runs)
    off = [fit.value - on_time.value for fit in (found.before, found.after)]
    before, after = (
        d @ np.linalg.solve(f.covariance, d) for d, f in zip(off, (found.before, found.after), strict=True)
    )
    # In the mean over independent combinations by two standard deviations.
    assert before > 4.0 * len(on_time.value) and after < 0.1 * len(on_time.value)
    inertias = np.abs((found.after.value - table5_parameters("OJD")) / found.after.std)[:5]
    assert inertias.max() < 2.0
