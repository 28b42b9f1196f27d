"""Every effect against its equation, on the noise-free torque, by Pinocchio and numpy."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from scara_ident.errors import UsageError
from scara_ident.robot.robot import load_robot
from scara_ident.simulation import (
    CATALOGUE,
    EFFECTS,
    Effect,
    SimulationResult,
    VirtualArm,
    ideal,
    on_side,
    parse_effect,
    simulate,
    virtual_arm,
)
from scara_ident.simulation import effects as fx
from tests.arms import example_urdf, rnea
from tests.shared import shared_path
from tests.simulation.made import friction, left_over, scara, swing

Array = NDArray[np.float64]


def run(effect: Effect | None = None, arm: VirtualArm | None = None, duration: float = 3.0) -> SimulationResult:
    arm = scara() if arm is None else arm
    return simulate(arm, swing(arm.robot, duration), effects=[] if effect is None else [effect])


def with_gravity(arm: VirtualArm, extra: Array) -> VirtualArm:
    model = pin.Model(arm.robot.model)
    model.gravity.linear = model.gravity.linear + extra
    return replace(arm, robot=replace(arm.robot, model=model))


def load_at_motor(result: SimulationResult) -> Array:
    t = result.true
    return rnea(result.arm.robot, t.position, t.velocity, t.acceleration) * result.arm.robot.row_scale[:, None]


EQUATIONS: dict[Effect, Callable[[SimulationResult], Array]] = {
    fx.TransmissionLoss("joint2", 0.2): lambda r: (
        (math.sqrt(1.04) - 1.0) * load_at_motor(r)[1] + 0.2 * abs(load_at_motor(r)[1]) * r.true.direction[1]
    ),
    fx.Stribeck("joint1", 0.1, 0.3): lambda r: 0.1 * r.true.direction[0] * np.exp(-((r.true.velocity[0] / 0.3) ** 2)),
    fx.AsymmetricFriction("joint2", 0.03): lambda r: 0.015 * abs(r.true.velocity[1]),
    fx.WarmUp("joint1", 0.4, 1.5): lambda r: (
        0.4 * np.exp(-r.recording.time / 1.5) * friction(r.arm, r.true.velocity, r.true.direction)[0]
    ),
    fx.PositionDependentFriction("joint2", 0.5, 0.3): lambda r: (
        0.5 * 0.088 * np.sin(r.true.position[1] + 0.3) * r.true.direction[1]
    ),
    fx.FrictionCoupling("joint1", 0.02, 0.03): lambda r: 0.02 * r.true.velocity[1] + 0.03 * r.true.direction[1],
    fx.TorqueRipple("joint1", 3.0, 0.04, 0.6): lambda r: 0.04 * np.sin(300.0 * r.true.position[0] + 0.6),
    fx.Spring("joint2", 0.05, 0.2): lambda r: 0.05 * (r.true.position[1] - 0.2),
    fx.Vibration("joint1", 7.0, 0.03, 0.1): lambda r: 0.03 * np.sin(2 * np.pi * 7.0 * r.recording.time + 0.1),
    fx.UnlistedSignedSine("joint1", 0.05): lambda r: 0.05 * np.sin(3.0 * r.true.position[1]) * r.true.direction[0],
    fx.UnlistedSwingingViscous("joint2", 0.04): lambda r: 0.04 * np.cos(2.0 * r.true.position[0]) * r.true.velocity[1],
}


@pytest.mark.parametrize("effect", EQUATIONS, ids=lambda effect: effect.name)
def test_torque_changes_by_the_equation(effect: Effect) -> None:
    result = run(effect)
    extra = left_over(result.arm, result.true)
    j = result.arm.joint_index(effect.joint)
    expected = EQUATIONS[effect](result)
    moving = result.true.direction[j] != 0.0
    assert np.abs(expected[moving]).max() > 0.005
    np.testing.assert_allclose(extra[j, moving], expected[moving], atol=1e-10)
    assert np.nanmax(np.abs(extra[1 - j])) < 1e-10


def test_transmission_loss_takes_power_in_both_directions_of_its_flow() -> None:
    effect = fx.TransmissionLoss("joint2", 0.3)
    frictionless = replace(scara(), friction=np.zeros((2, 4)), rotor_inertia=np.array([0.0014, 0.0]))
    result = run(effect, frictionless)
    moving = result.true.direction[1] != 0.0
    given = (100.0 * result.true.effort[1] * result.true.velocity[1])[moving]
    passed = (load_at_motor(result)[1] * 100.0 * result.true.velocity[1])[moving]
    assert effect.efficiency == pytest.approx(math.sqrt(1.09) - 0.3)
    driving, driven = passed > 1e-3, passed < -1e-3
    assert driving.sum() > 300
    assert driven.sum() > 300
    np.testing.assert_allclose(passed[driving] / given[driving], effect.efficiency, rtol=1e-9)
    np.testing.assert_allclose(given[driven] / passed[driven], effect.efficiency, rtol=1e-9)


def test_a_loaded_gear_with_loss_holds_what_it_could_not_lift() -> None:
    # One vertical link: between load x eta and load / eta the gear stands still.
    robot = load_robot(example_urdf("ur5_robot.urdf"))
    arm = replace(ideal(virtual_arm(robot)), friction=np.zeros((6, 4)))
    from scara_ident.simulation import free_motion

    pose = np.array([0.0, -0.6, 0.4, 0.1, 0.2, 0.0])
    load = rnea(robot, pose[:, None], np.zeros((6, 1)), np.zeros((6, 1)))[:, 0]
    effects = [fx.TransmissionLoss(joint, 0.2) for joint in robot.joints]
    for share, stands in ((1.1, True), (0.9, True), (1.3, False), (0.7, False)):
        _, true = free_motion(arm, pose, np.zeros(6), 0.05, torque=share * load, effects=effects)
        assert bool(np.all(true.velocity[1] == 0.0)) == stands


def test_presliding_state_follows_dahls_equation() -> None:
    distance = 0.02
    result = run(fx.Presliding("joint1", distance), duration=4.0)
    true = result.true
    assert np.nanmax(np.abs(left_over(result.arm, true))) < 1e-10
    z = np.zeros_like(true.position[0])
    for k, way in enumerate(np.diff(true.position[0])):
        side = np.sign(way)
        z[k + 1] = side - (side - z[k]) * np.exp(-abs(way) / distance)
    assert np.ptp(z) > 1.9
    np.testing.assert_allclose(true.direction[0], z, atol=1e-4)


def test_base_tilt_is_gravity_along_the_base() -> None:
    result = run(fx.BaseTilt(tilt_x=0.03, tilt_y=-0.02))
    tilted = with_gravity(result.arm, -9.81 * np.array([0.03, -0.02, 0.0]))
    assert np.nanmax(np.abs(left_over(result.arm, result.true))) > 0.01
    assert np.nanmax(np.abs(left_over(tilted, result.true))) < 1e-10


def test_payload_acts_from_its_time_on() -> None:
    result = run(fx.PayloadChange(mass=4.0, time=1.5))
    model = pin.Model(result.arm.robot.model)
    point = np.array([0.33, 0.0, 0.0])
    model.inertias[2] = model.inertias[2] + pin.Inertia(4.0, point, np.zeros((3, 3)))
    loaded = replace(result.arm, robot=replace(result.arm.robot, model=model))
    late = result.recording.time >= 1.5
    for arm, part in ((result.arm, ~late), (loaded, late)):
        assert np.nanmax(np.abs(left_over(arm, result.true)[:, part])) < 1e-10
    assert np.nanmax(np.abs(left_over(result.arm, result.true)[:, late])) > 0.01


@pytest.mark.parametrize("ticks", [3, -2])
def test_delay_is_a_shift_of_effort(ticks: int) -> None:
    plain, late = run().recording.effort, run(fx.TimeDelay(delay=ticks * 1e-3)).recording.effort
    assert plain is not None
    assert late is not None
    shifted = np.roll(plain, ticks, axis=1)
    np.testing.assert_allclose(late[:, 5:-5], shifted[:, 5:-5], atol=1e-12)


def test_a_delay_by_half_a_sample_is_the_mean_of_neighbours_where_torque_is_straight() -> None:
    plain, late = run().recording.effort, run(fx.TimeDelay("joint2", 0.5e-3)).recording.effort
    assert plain is not None
    assert late is not None
    np.testing.assert_array_equal(plain[0], late[0])
    bend = np.abs(np.diff(plain[1], 2))[1:]
    wrong = np.abs(late[1, 2:-1] - 0.5 * (plain[1, 2:-1] + plain[1, 1:-2]))
    assert np.all(wrong <= np.maximum(bend, np.roll(bend, 1)) + 1e-12)


def test_sensor_effects_change_the_record_alone() -> None:
    plain = run()
    u, t = plain.recording.effort, plain.recording.time
    assert u is not None
    cases = {
        fx.TorqueSensorNonlinearity("joint1", 0.3): (0, u[0] + 0.3 * u[0] ** 3),
        fx.TorqueGainMismatch("joint2", 1.2): (1, 1.2 * u[1]),
        fx.OffsetDrift("joint1", 0.02): (0, u[0] + 0.02 * t),
        fx.TorqueRipple("joint2", 1.0, 0.03, 0.4, sensor=True): (
            1,
            u[1] + 0.03 * np.sin(100.0 * plain.true.position[1] + 0.4),
        ),
    }
    for effect, (j, expected) in cases.items():
        result = run(effect)
        assert result.recording.effort is not None
        np.testing.assert_array_equal(result.true.position, plain.true.position)
        np.testing.assert_allclose(result.recording.effort[j], expected, atol=1e-12)
        np.testing.assert_array_equal(result.recording.effort[1 - j], u[1 - j])


def test_encoder_eccentricity_is_in_the_measured_position() -> None:
    result = run(fx.EncoderEccentricity("joint1", 4e-5, 2.0, 0.3))
    q = result.true.position
    expected = 4e-5 * np.sin(200.0 * q[0] + 0.3)
    np.testing.assert_allclose(result.recording.position[0] - q[0], expected, atol=1e-15)
    np.testing.assert_array_equal(result.recording.position[1], q[1])
    assert np.nanmax(np.abs(left_over(result.arm, result.true))) < 1e-10
    assert np.abs(q - run().true.position).max() > 1e-6


@pytest.mark.parametrize("effect", [fx.JointElasticity("joint2", 3000.0), fx.Backlash("joint2", 0.002, 30000.0)])
def test_an_elastic_joint_has_a_link_and_a_motor_of_its_own(effect: Effect) -> None:
    result = run(effect)
    arm, true = result.arm, result.true
    load = rnea(arm.robot, true.link_position, true.link_velocity, true.link_acceleration)
    np.testing.assert_allclose(true.load, load, atol=1e-9)
    rotor = (load + arm.armature[:, None] * true.acceleration) * arm.robot.row_scale[:, None]
    torque = rotor + friction(arm, true.velocity, true.direction)
    moving = true.direction != 0.0
    np.testing.assert_allclose(true.effort[moving], torque[moving], atol=1e-10)
    stretch = (true.position - true.link_position)[1]
    assert np.all(true.position[0] == true.link_position[0])
    if isinstance(effect, fx.JointElasticity):
        rate = (true.velocity - true.link_velocity)[1]
        link, rotor_inertia = arm.link_inertia()[1], arm.armature[1]
        reduced = link * rotor_inertia / (link + rotor_inertia)
        damping = 2.0 * effect.damping_ratio * np.sqrt(3000.0 * reduced)
        np.testing.assert_allclose(load[1], 3000.0 * stretch + damping * rate, atol=1e-9)
    else:
        free = np.abs(stretch) < 0.001
        assert free.sum() > 20
        assert np.abs(load[1, free]).max() < 1e-9
        assert np.all(load[1] * stretch >= -1e-9)
        assert np.abs(load[1, ~free]).max() > 1.0


NOTHING = [
    fx.TransmissionLoss(loss_coefficient=0.0),
    fx.Stribeck(amplitude=0.0),
    fx.AsymmetricFriction(viscous_difference=0.0),
    fx.Presliding(presliding_distance=0.0),
    fx.WarmUp(share=0.0),
    fx.TorqueRipple(amplitude=0.0),
    fx.PositionDependentFriction(share=0.0),
    fx.Spring(stiffness=0.0),
    fx.BaseTilt(tilt_x=0.0, tilt_y=0.0),
    fx.PayloadChange(mass=0.0, time=0.3),
    fx.TimeDelay(delay=0.0),
    fx.TorqueSensorNonlinearity(cubic=0.0),
    fx.TorqueGainMismatch(ratio=1.0),
    fx.Backlash(width=0.0),
    fx.EncoderEccentricity(amplitude=0.0),
    fx.FrictionCoupling(viscous=0.0, coulomb=0.0),
    fx.OffsetDrift(rate=0.0),
    fx.Vibration(amplitude=0.0),
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


def test_a_very_stiff_elastic_joint_is_a_rigid_one() -> None:
    plain = run(duration=1.0).true.position
    errors = [
        np.abs(run(fx.JointElasticity("joint1", k), duration=1.0).true.position - plain).max() for k in (1e5, 1e6, 1e7)
    ]
    assert errors[0] > errors[1] > errors[2]
    assert errors[2] < 2e-5


@pytest.mark.parametrize("urdf", [None, "ur5_robot.urdf"])
def test_every_effect_runs_with_its_own_sizes_and_is_felt(urdf: str | None) -> None:
    arm = scara() if urdf is None else ideal(virtual_arm(load_robot(example_urdf(urdf))))
    motion = swing(arm.robot, 0.5, amplitude=0.2)
    plain = simulate(arm, motion)
    for name, kind in EFFECTS.items():
        effect = kind(time=0.2) if kind is fx.PayloadChange else kind()
        result = simulate(arm, motion, effects=[effect])
        assert all(math.isfinite(value) for value in result.effects[0].as_dict()["parameters"].values()), name
        changed = np.abs(result.recording.effort - plain.recording.effort).max(axis=1) / arm.torque_scale
        assert 1e-4 < changed.max() < 1.5, name


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


def test_names_are_the_contracts() -> None:
    text = shared_path("interface.md").read_text(encoding="utf-8")
    rows = [line.split("|")[1].strip().strip("`") for line in text.splitlines() if line.startswith("| `")]
    table = text[text.index("| `effect` | `parameters` |") :]
    named = {line.split("|")[1].strip().strip("`") for line in table.splitlines()[2:] if line.startswith("| `")}
    assert rows
    assert {kind.name for kind in CATALOGUE} == named


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("spring", fx.Spring()),
        ("spring:joint2", fx.Spring("joint2")),
        ("spring:joint2:stiffness=0.05", fx.Spring("joint2", stiffness=0.05)),
        ("time_delay:delay=0.002", fx.TimeDelay(delay=0.002)),
        ("torque_ripple:joint1:order=4,amplitude=0.05,sensor=true", fx.TorqueRipple("joint1", 4.0, 0.05, sensor=True)),
    ],
)
def test_text_stands_for_an_effect(text: str, expected: Effect) -> None:
    assert repr(parse_effect(text)) == repr(expected)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("sprang", "did you mean spring"),
        ("", "there are transmission_loss"),
        ("spring:joint1:size=3", "stiffness, rest_position"),
        ("spring:joint1:stiffness=much", "expected a number"),
        ("spring:joint1:joint2", "expected NAME:JOINT"),
        ("spring:stiffness=1,stiffness=2", "given twice"),
        ("torque_ripple:sensor=3", "expected true or false"),
    ],
)
def test_text_that_stands_for_none_is_one_line(text: str, said: str) -> None:
    with pytest.raises(UsageError, match=said) as caught:
        parse_effect(text)
    assert "\n" not in str(caught.value)


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


def test_an_elastic_joint_needs_a_rotor(tmp_path: Path) -> None:
    arm = replace(scara(), rotor_inertia=np.array([0.0, 4e-4]))
    with pytest.raises(UsageError, match="joint1 has no rotor inertia"):
        run(fx.JointElasticity("joint1", 1000.0), arm, 0.1)


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
        assert np.abs(result.true.position - motion.position).max() < 0.05
        assert result.stops < 200
