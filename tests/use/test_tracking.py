"""Feeding forward the right torque takes the tracking error away."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from scara_ident.errors import LostArm
from scara_ident.simulation import parse_effect, virtual_arm
from scara_ident.simulation.arm import ideal
from scara_ident.simulation.simulate import SimulationResult, simulate
from scara_ident.simulation.truth import _complete_parameters
from scara_ident.use import tracking
from scara_ident.use.identified_arm import arm_with
from scara_ident.use.tracking import MORE_SUBSTEPS, SUBSTEPS, at_ticks, needed_torque, tracked, urdf_torque
from scara_ident.use.trial_motion import trial_motion
from tests.simulation.made import scara


def test_the_true_torque_leaves_next_to_nothing_and_effects_count() -> None:
    arm = ideal(scara())
    spring = parse_effect("spring:joint1:stiffness=0.5").resolve(arm)
    motion = trial_motion(arm, 1)
    motion = at_ticks(motion.at(motion.time[:4000]))
    feeds = {
        "pid": None,
        "urdf": urdf_torque(arm, motion),
        "without": needed_torque(arm, (), motion),
        "with": needed_torque(arm, [spring], motion),
    }
    found = {item.name: item.rms for item in tracked(arm, [spring], motion, feeds)}
    # What is left comes from the stops, where dry friction holds the joint until the torque is enough.
    assert np.all(found["with"] < 0.1 * found["pid"])
    assert found["with"][0] < 0.2 * found["without"][0]
    assert np.all(found["without"] < found["pid"])


def test_the_urdf_alone_knows_no_friction() -> None:
    arm = virtual_arm()
    motion = at_ticks(trial_motion(arm))
    some = motion.velocity[0] > 0.1
    gap = needed_torque(arm, (), motion) - urdf_torque(arm, motion)
    v = motion.velocity[:, some]
    expected = arm.friction[0, 0] + arm.friction[0, 1] * v[0] + arm.friction[0, 2] * v[0] ** 2
    np.testing.assert_allclose(gap[0, some], expected, rtol=1e-9)


def test_an_arm_made_of_its_parameters_is_the_arm() -> None:
    arm = virtual_arm()
    names = [*(f"P_d{k}" for k in range(1, 6)), *(f"a{p}{j}" for j in (1, 2) for p in range(4)), "p_o1", "p_o2"]
    same = arm_with(arm.robot, dict(zip(names, _complete_parameters(arm), strict=True)))
    motion = at_ticks(trial_motion(arm))
    np.testing.assert_allclose(needed_torque(same, (), motion), needed_torque(arm, (), motion), rtol=1e-9, atol=1e-9)


def test_a_ripple_faster_than_the_controller_does_not_spoil_what_is_fed_forward() -> None:
    arm = ideal(scara())
    ripple = parse_effect("torque_ripple:joint2:order=2,amplitude=0.05").resolve(arm)
    motion = trial_motion(arm, 1)
    motion = at_ticks(motion.at(motion.time[:3000]))
    feeds = {"without": needed_torque(arm, (), motion), "with": needed_torque(arm, [ripple], motion)}
    found = {item.name: item.rms for item in tracked(arm, [ripple], motion, feeds)}
    assert np.all(found["with"] < 1.1 * found["without"])


def test_an_arm_that_is_lost_in_few_steps_is_tried_in_more(monkeypatch: pytest.MonkeyPatch) -> None:
    """Wrists of a UR10 with 2.5 N m of friction and an inertia of 0.001 kg m^2 were lost at two steps a sample."""
    tried: list[int] = []

    def coarse(*given: Any, min_substeps: int, **more: Any) -> SimulationResult:
        tried.append(min_substeps)
        if min_substeps == SUBSTEPS:
            raise LostArm("lost")
        return simulate(*given, min_substeps=min_substeps, **more)

    monkeypatch.setattr(tracking, "simulate", coarse)
    arm = ideal(scara())
    motion = trial_motion(arm, 1)
    (found,) = tracked(arm, (), at_ticks(motion.at(motion.time[:300])), {"pid": None})
    assert tried == [SUBSTEPS, MORE_SUBSTEPS]
    assert np.all(np.isfinite(found.error))


def test_an_arm_that_cannot_be_held_is_said_with_its_lightest_joint() -> None:
    arm = scara()
    wild = replace(arm, controller=replace(arm.controller, derivative=-1e9 * np.ones(2)))
    wild = replace(wild, robot=replace(arm.robot, effort_limit=np.full(2, np.inf)), rotor_inertia=np.array([1e-3, 0.0]))
    with pytest.raises(
        LostArm, match=r"^trial: .*: joint2 has a mean inertia of .* the rotor has almost nothing, .*excite"
    ):
        tracked(wild, (), at_ticks(trial_motion(arm)), {"pid": None})
