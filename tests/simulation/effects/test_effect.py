"""What all effects share: sizes, places, refusals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scara_ident.errors import UsageError
from scara_ident.robot.robot import load_robot
from scara_ident.simulation import (
    EFFECTS,
    ideal,
    on_side,
    parse_effect,
    simulate,
    virtual_arm,
)
from scara_ident.simulation import effects as fx
from tests.arms import CYLINDRICAL, PLANAR_2R, example_urdf, in_unit, write_urdf
from tests.simulation.effects.runs import run
from tests.simulation.made import left_over, scara, swing

NOTHING = [
    fx.TransmissionLoss(loss_coefficient=0.0),
    fx.Stribeck(amplitude=0.0),
    fx.AsymmetricFriction(viscous_difference=0.0),
    fx.Presliding(presliding_distance=0.0),
    fx.SmoothCoulomb(velocity=0.0),
    fx.WarmUp(share=0.0),
    fx.TorqueRipple(amplitude=0.0),
    fx.PositionDependentFriction(share=0.0),
    fx.Spring(stiffness=0.0),
    fx.BaseTilt(tilt_x=0.0, tilt_y=0.0),
    fx.PayloadChange(mass=0.0, time=0.3),
    fx.TimeDelay(delay=0.0),
    fx.TorqueFilter(time_constant=0.0),
    fx.PositionFilter(time_constant=0.0),
    fx.TorqueSensorNonlinearity(cubic=0.0),
    fx.TorqueSensorNonlinearity(cubic=0.0, square=0.0),
    fx.TorqueGainMismatch(ratio=1.0),
    fx.Backlash(width=0.0),
    fx.EncoderEccentricity(amplitude=0.0),
    fx.JointZero(offset=0.0),
    fx.FrictionCoupling(viscous=0.0, coulomb=0.0),
    fx.OffsetDrift(rate=0.0),
    fx.Vibration(amplitude=0.0),
    fx.Push(force=0.0, time=0.3),
    fx.Payload(mass=0.0),
    fx.CoupledShaft(inertia=0.0, viscous=0.0, coulomb=0.0),
    fx.UnlistedSignedSine(amplitude=0.0),
    fx.UnlistedSwingingViscous(viscous=0.0),
]


def test_an_effect_of_no_size_is_no_effect_at_all() -> None:
    # A rigid joint is an elastic one of infinite stiffness, the only size that is not a number here.
    assert {type(effect) for effect in NOTHING} == set(EFFECTS.values()) - {fx.JointElasticity}
    plain = run(duration=0.6)
    for effect in NOTHING:
        result = run(effect, duration=0.6)
        np.testing.assert_array_equal(result.true.effort, plain.true.effort, err_msg=effect.name)
        np.testing.assert_array_equal(result.true.position, plain.true.position, err_msg=effect.name)
        np.testing.assert_array_equal(result.recording.effort, plain.recording.effort, err_msg=effect.name)


@pytest.mark.slow
@pytest.mark.parametrize("urdf", [None, "ur5_robot.urdf"])
def test_every_effect_runs_with_its_own_sizes_and_is_felt(urdf: str | None) -> None:
    arm = scara() if urdf is None else ideal(virtual_arm(load_robot(example_urdf(urdf))))
    motion = swing(arm.robot, 0.5, amplitude=0.2)
    plain = simulate(arm, motion)
    for name, kind in EFFECTS.items():
        effect = kind(time=0.2) if "time" in kind.parameter_names().values() else kind()
        result = simulate(arm, motion, effects=[effect])
        assert "nan" not in str(result.effects[0].as_dict()["parameters"]), name
        changed = np.abs(result.recording.effort - plain.recording.effort).max(axis=1) / arm.torque_scale
        if kind is fx.PositionFilter:
            # The controller does not have it.
            assert changed.max() == 0.0
            changed = np.abs(result.recording.position - plain.recording.position).max(axis=1)
        assert 1e-4 < changed.max() < (5.0 if kind is fx.Push else 1.5), name


@pytest.mark.parametrize("joint", [1, 4])
def test_an_effect_on_a_joint_of_a_six_axis_arm_is_its_equation_there_and_nothing_elsewhere(joint: int) -> None:
    arm = ideal(virtual_arm(load_robot(example_urdf("ur5_robot.urdf"))))
    name, other = arm.robot.joints[joint], arm.robot.joints[joint + 1]
    spring, coupling = fx.Spring(name, 2.0, 0.1), fx.FrictionCoupling(name, 0.4, 0.3)
    assert coupling.other(arm) == other
    true = simulate(arm, swing(arm.robot, 1.5, amplitude=0.3), effects=[spring, coupling]).true
    extra = left_over(arm, true)
    expected = 2.0 * (true.position[joint] - 0.1)
    expected += 0.4 * true.velocity[joint + 1] + 0.3 * true.direction[joint + 1]
    moving = true.direction[joint] != 0.0
    np.testing.assert_allclose(extra[joint, moving], expected[moving], atol=1e-9 * np.abs(true.effort).max())
    assert np.nanmax(np.abs(np.delete(extra, joint, axis=0))) < 1e-9 * np.abs(true.effort).max()


def test_effects_act_together() -> None:
    chosen = [
        fx.Spring("joint1", 0.05, 0.2),
        fx.TorqueRipple("joint1", 1.0, 0.03),
        fx.TorqueRipple("joint1", 2.0, 0.02),
    ]
    chosen = [effect.resolve(scara()) for effect in chosen]
    result = simulate(scara(), swing(scara().robot, 1.0), effects=chosen)
    q = result.true.position[0]
    expected = 0.05 * (q - 0.2) + sum(e.amplitude * np.sin(100 * e.order * q + e.phase) for e in chosen[1:])
    extra = left_over(result.arm, result.true)[0]
    moving = np.isfinite(extra)
    np.testing.assert_allclose(extra[moving], expected[moving], atol=1e-10)


def test_sizes_on_the_joint_side_are_n_times_the_motors() -> None:
    motor, joint = scara(), on_side(scara(), "joint")
    sized = {"spring": "stiffness", "stribeck": "amplitude", "torque_ripple": "amplitude", "offset_drift": "rate"}
    for name, key in sized.items():
        one, other = (EFFECTS[name]().resolve(arm).as_dict()["parameters"][key] for arm in (motor, joint))
        assert other == pytest.approx(100.0 * one), name


@pytest.mark.parametrize(
    ("effects", "said"),
    [
        (["spring:joint9"], "its joints are joint1, joint2"),
        (["base_tilt:joint1"], "belongs to the whole arm"),
        (["transmission_loss:loss_coefficient=-0.1"], "expected 0 to 5"),
        (["warm_up:time_constant=0"], "or more s"),
        (["torque_gain_mismatch:joint1"], "a joint other than joint1"),
        (["spring", "spring:joint1"], "given twice for joint1"),
        (["presliding:presliding_distance=1e-12"], "so stiff"),
        (["smooth_coulomb:velocity=1e-12"], "so stiff"),
        (["offset_drift:rate=nan"], None),
    ],
)
def test_an_effect_that_does_not_fit_is_one_line(effects: list[str], said: str | None) -> None:
    chosen = [parse_effect(text) for text in effects]
    if said is None:  # nan is how a size is left to the arm
        simulate(scara(), swing(scara().robot, 0.1), effects=chosen)
        return
    with pytest.raises(UsageError, match=said) as caught:
        simulate(scara(), swing(scara().robot, 0.1), effects=chosen)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("unit", [0.05, 20.0])
def test_lengths_that_an_effect_of_a_slide_has_are_shares_of_its_stroke(unit: float, tmp_path: Path) -> None:
    # What they are of a joint that turns, rad.
    lengths = {
        ("stribeck", "velocity"): 0.1, ("presliding", "presliding_distance"): 0.005, ("backlash", "width"): 0.001,
        ("smooth_coulomb", "velocity"): 0.05, ("spring", "rest_position"): 0.3, ("joint_zero", "offset"): 0.05,
    }  # fmt: skip
    arm = virtual_arm(in_unit(CYLINDRICAL, unit, tmp_path))
    for (name, key), turn in lengths.items():
        sizes = [EFFECTS[name](joint).resolve(arm).as_dict()["parameters"][key] for joint in ("j1", "j3")]
        assert sizes == pytest.approx([turn, turn * 6.0 * unit / np.pi]), name
    stiffness = fx.Spring("j3").resolve(arm).stiffness
    assert stiffness * 6.0 * unit / np.pi == pytest.approx(0.1 * arm.torque_scale[2])
    # Friction that varies with the position goes through half a period over the stroke.
    draft = arm.draft()
    for joint in ("j1", "j3"):
        fx.PositionDependentFriction(joint).apply(arm, draft)
    np.testing.assert_allclose(draft.array("position_order")[arm.robot.order], [1.0, 1.0, np.pi / (6.0 * unit)])
    # Of the friction that a slide's speed drives on a joint that turns.
    viscous = fx.FrictionCoupling("j1").resolve(arm).viscous
    assert viscous * arm.radian[1] == pytest.approx(0.3 * arm.friction[0, 1])


@pytest.mark.parametrize("name", ["torque_gain_mismatch", "friction_coupling"])
def test_what_needs_two_joints_is_refused_in_a_line_of_an_arm_of_one(name: str, tmp_path: Path) -> None:
    arm = virtual_arm(load_robot(write_urdf(tmp_path / "arm.urdf", PLANAR_2R[:1])))
    with pytest.raises(UsageError, match=r"test_arm has one joint; .* needs two") as caught:
        simulate(arm, swing(arm.robot, 0.1), effects=[EFFECTS[name]()])
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("seed", range(4))
def test_any_mix_of_effects_leaves_the_arm_on_its_way(seed: int) -> None:
    random = np.random.default_rng(seed)
    arm = virtual_arm()
    for _ in range(4):
        kinds = random.permutation(list(EFFECTS.values()))[:5]
        chosen = [
            kind(
                joint=None
                if kind.whole_arm != "never" or kind is fx.TorqueGainMismatch
                else random.choice(["joint1", "joint2"])
            )
            for kind in kinds
        ]
        motion = swing(arm.robot, 1.0, amplitude=float(random.choice([0.002, 0.3])))
        result = simulate(arm, motion, effects=chosen)
        assert np.abs(result.recording.position - motion.position).max() < 0.05
        assert result.stops < 200
