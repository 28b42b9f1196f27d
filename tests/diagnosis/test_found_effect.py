"""The effects that came in, in that order."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.diagnosis import diagnose
from scara_ident.diagnosis.effect_parameters import physical_parameters
from scara_ident.diagnosis.found_effect import found_effects, not_found
from scara_ident.effects import Parameter, effects_named
from scara_ident.effects.measurement import shifted
from scara_ident.robot.robot import load_robot
from tests.diagnosis.made import BANDS, exact_runs, virtual_runs


@pytest.mark.parametrize(
    ("late", "named"), [((0.008, 0.008, 0.008, 0.008), True), ((0.003, 0.013, 0.006, 0.011), False)]
)
def test_a_delay_by_which_runs_differ_is_corrected_but_not_named(late: tuple[float, ...], named: bool) -> None:
    runs = [shifted(run, -delay) for run, delay in zip(exact_runs(), late, strict=True)]
    found = diagnose(load_robot(), runs, bands=BANDS, catalogue=effects_named("time_delay"))
    assert found.search.correction is not None
    assert found.search.correction.value[0] == pytest.approx(np.mean(late), abs=1.5e-3)
    assert [item.effect for item in found.effects] == (["time_delay"] if named else [])
    said = [note for note in found.notes if "not counted as an effect" in note]
    assert len(said) == (not named)
    # What stands there as its standard deviation is what it was judged by.
    assert all("standard deviations" in note and "within its uncertainty" not in note for note in said)


def test_errors_go_from_effect_to_effect() -> None:
    runs = virtual_runs("spring:joint1", "asymmetric_friction:joint2")
    found = diagnose(load_robot(), runs, bands=BANDS, catalogue=effects_named("spring", "asymmetric_friction")).effects
    assert {(item.effect, item.joint) for item in found} == {("spring", "joint1"), ("asymmetric_friction", "joint2")}
    first, second = found
    assert first.after == second.before
    assert all(item.after[item.joint] < item.before[item.joint] for item in found if item.joint)
    assert all(0.0 < item.gain <= 1.0 and item.p_value < 1e-2 for item in found)


def test_what_a_second_encoder_tells_of_an_effect_that_was_not_added_is_said() -> None:
    readings = {("joint_elasticity", "joint1"): {"stiffness": Parameter(20012.0, 211.0, "N m/rad")}}
    assert not_found(readings, []) == [
        "joint_elasticity of joint1 was not added, but a channel of its own tells stiffness 2.001e+04 +- 2e+02 N m/rad"
    ]


def test_a_delay_that_was_taken_out_in_two_steps_is_one_effect() -> None:
    """It stood in `effects` twice, each time with all of it."""
    runs = [shifted(run, -0.008) for run in exact_runs()]
    search = diagnose(load_robot(), runs, bands=BANDS, catalogue=effects_named("time_delay")).search
    (first,) = search.steps
    twice = replace(search, steps=(first, replace(first, rms=(0.0, 0.0))))
    parameters = physical_parameters(twice.whole(twice.step))
    (effect,) = found_effects(twice, twice.step, parameters, {}, {})
    assert effect.effect == "time_delay"
    assert tuple(effect.after.values()) == tuple(first.rms)
