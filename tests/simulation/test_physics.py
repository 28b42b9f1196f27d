"""The virtual arm against Pinocchio, conserved energy, closed forms and its own parameters."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from scara_ident.errors import RobotError, ScaraIdentError
from scara_ident.model.base_parameters import find_base_parameters, standard_regressor
from scara_ident.robot.robot import load_robot
from scara_ident.simulation import VirtualArm, free_motion, ideal, on_side, simulate, virtual_arm
from scara_ident.simulation.effects import JointElasticity, TransmissionLoss
from scara_ident.simulation.spatial import TOLERANCE, check_against_pinocchio, configuration, mass_and_bias, with_bodies
from tests.arms import PLANAR_2R, Link, example_urdf, write_urdf
from tests.simulation.made import bare, friction, left_over, scara, swing, tree


def random_bodies(seed: int, n: int) -> np.ndarray:
    """Return standard parameters of random ellipsoids."""
    random = np.random.default_rng(seed)
    rows = []
    for _ in range(n):
        inertia = pin.Inertia.Random()
        inertia.mass = random.uniform(0.5, 5.0)
        inertia.lever = random.uniform(-0.3, 0.3, 3)
        rows.append(inertia.toDynamicParameters())
    return np.array(rows)


@pytest.mark.parametrize("name", ["ur5_robot.urdf", "panda.urdf"])
def test_compiled_dynamics_are_pinocchios_on_example_arms(name: str) -> None:
    robot = load_robot(example_urdf(name))
    assert check_against_pinocchio(robot.model, random_bodies(1, robot.n), states=50) <= TOLERANCE


def test_compiled_dynamics_are_pinocchios_on_a_branched_arm(tmp_path: Path) -> None:
    robot = tree(tmp_path)
    assert check_against_pinocchio(robot.model, random_bodies(2, robot.n), states=50) <= TOLERANCE


def test_forward_dynamics_are_pinocchios_aba(tmp_path: Path) -> None:
    robot = tree(tmp_path)
    bodies = random_bodies(3, robot.n)
    model = with_bodies(robot.model, bodies)
    data = model.createData()
    random = np.random.default_rng(4)
    for _ in range(10):
        q, v, torque = random.uniform(-2, 2, (3, robot.n))
        mass, bias = mass_and_bias(robot.model, bodies, q, v)
        expected = pin.aba(model, data, configuration(model, q), v, torque)
        np.testing.assert_allclose(np.linalg.solve(mass, torque - bias), expected, rtol=1e-9, atol=1e-9)


def test_a_body_that_pinocchio_sees_differently_is_refused() -> None:
    robot = load_robot(example_urdf("ur5_robot.urdf"))
    bodies = random_bodies(5, robot.n)
    bodies[2, 0] = np.nan
    with pytest.raises(RobotError, match="differ from Pinocchio"):
        check_against_pinocchio(robot.model, bodies)


def energy(arm: VirtualArm, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    model, data = arm.robot.model, arm.robot.model.createData()
    rotors = 0.5 * np.sum(arm.armature[:, None] * v**2, axis=0)
    back = np.argsort(arm.robot.order)
    links = [
        pin.computeKineticEnergy(model, data, configuration(model, x), y)
        + pin.computePotentialEnergy(model, data, configuration(model, x))
        for x, y in zip(q[back].T, v[back].T, strict=True)
    ]
    return rotors + np.array(links)


@pytest.mark.parametrize("kind", ["scara", "vertical", "tree"])
def test_without_losses_and_control_energy_is_conserved(kind: str, tmp_path: Path) -> None:
    links = {"vertical": lambda: load_robot(write_urdf(tmp_path / "v.urdf", PLANAR_2R)), "tree": lambda: tree(tmp_path)}
    arm = bare(scara()) if kind == "scara" else bare(ideal(virtual_arm(links[kind]())))
    n = arm.robot.n
    start = np.linspace(0.4, 1.1, n), np.linspace(1.8, -1.3, n)
    if kind == "tree":  # no end stop holds a sliding link: keep it from falling for 10 s
        arm = replace(arm, robot=replace(arm.robot, model=weightless(arm.robot.model)))
    time, true = free_motion(arm, *start, 10.0)
    every = slice(None, None, 50)
    total = energy(arm, true.position[:, every], true.velocity[:, every])
    kinetic = 0.5 * float(np.max(arm.armature @ true.velocity**2))
    assert time[-1] == 10.0
    assert np.ptp(true.position, axis=1).min() > 0.5
    assert np.abs(total - total[0]).max() < 1e-6 * kinetic


def weightless(model: pin.Model) -> pin.Model:
    model = pin.Model(model)
    model.gravity.linear = np.zeros(3)
    return model


def test_an_elastic_arm_without_damping_conserves_energy() -> None:
    arm = bare(scara())
    spring = JointElasticity(joint="joint1", stiffness=9000.0, damping_ratio=0.0)
    _, true = free_motion(arm, np.array([0.3, 0.5]), np.array([2.0, -1.0]), 10.0, effects=[spring])
    every = slice(None, None, 50)
    link_only = replace(arm, rotor_inertia=np.array([0.0, arm.rotor_inertia[1]]))
    total = energy(link_only, true.link_position[:, every], true.link_velocity[:, every])
    total += 0.5 * arm.armature[0] * true.velocity[0, every] ** 2
    total += 0.5 * 9000.0 * (true.position - true.link_position)[0, every] ** 2
    assert np.abs(true.position - true.link_position)[0].max() > 1e-4
    assert np.abs(total - total[0]).max() < 1e-6 * total[0]


@pytest.mark.parametrize("side", ["motor", "joint"])
def test_least_squares_on_exact_signals_give_the_arm_its_own_parameters(side: str) -> None:
    arm = on_side(replace(scara(), torque_offset=np.array([0.03, -0.02])), side)
    arm = replace(arm, friction=arm.friction + np.array([[0, 0, 0, 0.01], [0, 0, 0, -0.002]]))
    assert_own_parameters(arm, duration=12.0)


def test_least_squares_give_back_parameters_of_a_branched_arm_with_reversing_gears(tmp_path: Path) -> None:
    write_urdf(tmp_path / "tree.urdf", TREE_LINKS)
    text = "urdf: tree.urdf\neffort_side: motor\njoints:\n"
    for name, ratio in zip(("j4", "j1", "j3", "j2"), (-50, 100, 80, -30), strict=True):
        text += f"  {name}: {{reduction: {ratio}, rotor_inertia: 1.0e-4}}\n"
    (tmp_path / "robot.yaml").write_text(text)
    robot = load_robot(tmp_path / "robot.yaml")
    assert list(robot.order) != sorted(robot.order)
    arm = ideal(virtual_arm(robot))
    assert_own_parameters(replace(arm, torque_offset=0.1 * arm.torque_scale), duration=8.0)


TREE_LINKS = (
    Link(axis=(0.0, 0.0, 1.0), mass=6.0),
    Link(kind="prismatic", axis=(1.0, 0.0, 0.4), xyz=(0.2, 0.0, 0.1), rpy=(0.3, -0.2, 0.5), mass=3.0),
    Link(axis=(0.0, 1.0, 0.0), xyz=(0.1, 0.0, 0.1), rpy=(0.1, 0.4, 0.0), mass=2.0),
    Link(axis=(-1.0, 0.0, 0.0), xyz=(-0.1, 0.2, 0.0), mass=1.5, parent=0),
)


def assert_own_parameters(arm: VirtualArm, duration: float) -> None:
    robot, n = arm.robot, arm.robot.n
    true = simulate(arm, swing(robot, duration)).true
    keep = np.all(true.velocity != 0.0, axis=0)
    q, v, a = true.position[:, keep], true.velocity[:, keep], true.acceleration[:, keep]
    base = find_base_parameters(robot)
    inertial = standard_regressor(robot, q, v, a)[:, base.kept] * robot.row_scale[:, None, None]
    columns = [inertial]
    for j in range(n):
        own = np.zeros((n, 5, v.shape[1]))
        speed = robot.drive_sign[j] * v[j]
        own[j] = np.sign(speed), speed, np.abs(speed) * speed, speed**3, np.ones_like(speed)
        columns.append(own)
    stacked = np.concatenate(columns, axis=1).transpose(0, 2, 1).reshape(n * q.shape[1], -1)
    size = np.linalg.norm(stacked, axis=0)
    found = np.linalg.lstsq(stacked / size, true.effort[:, keep].ravel(), rcond=None)[0] / size
    standard = np.concatenate([arm.bodies.ravel(), arm.armature])
    expected = np.concatenate(
        [base.grouping @ standard, *(np.append(arm.friction[j], arm.torque_offset[j]) for j in range(n))]
    )
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max())
    small = np.abs(found[len(base.kept) :] - expected[len(base.kept) :])
    assert small.max() < 1e-6 * np.abs(true.effort).max()


def test_a_torque_below_breakaway_moves_nothing() -> None:
    arm = scara()
    torque = np.array([0.2, -0.08])
    _, true = free_motion(arm, [0.4, 0.9], [0.0, 0.0], 2.0, torque=torque)
    assert np.all(true.position == [[0.4], [0.9]])
    assert np.all(true.velocity == 0.0)
    np.testing.assert_array_equal(true.effort, np.repeat(torque[:, None], true.effort.shape[1], axis=1))


def test_a_torque_above_breakaway_moves_at_once() -> None:
    _, true = free_motion(scara(), [0.4, 0.9], [0.0, 0.0], 0.01, torque=np.array([0.215, 0.0]))
    assert np.all(true.velocity[0, 1:] > 0.0)
    assert np.all(true.velocity[1] == 0.0)


def test_a_coasting_joint_stops_once_and_stays() -> None:
    arm = scara()
    _, true = free_motion(arm, [0.0, 0.5], [1.5, -1.0], 6.0)
    for v in true.velocity:
        stop = int(np.flatnonzero(v == 0.0)[0])
        assert np.all(v[stop:] == 0.0)
        assert np.count_nonzero(np.diff(np.sign(v[:stop]))) <= 1


def test_a_sliding_joint_stops_when_its_momentum_is_spent() -> None:
    # One joint, constant torque against Coulomb friction alone: v0 = (c - u) N t / J.
    arm = scara()
    arm = replace(arm, friction=np.array([[0.3, 0, 0, 0], [0.5, 0, 0, 0]]))
    _, true = free_motion(arm, [0.0, 0.0], [1.0, 0.0], 3.0, torque=np.array([0.1, 0.0]))
    assert np.all(true.velocity[1] == 0.0)
    inertia = arm.link_inertia()[0] + arm.armature[0]
    assert true.velocity[0, 400] == pytest.approx(1.0 - 0.4 * 20.0 / inertia, abs=1e-9)
    way = inertia / (2.0 * 20.0)
    assert true.position[0, -1] == pytest.approx(way, abs=1e-9)


def test_closed_loop_reverses_without_chatter() -> None:
    arm = virtual_arm()
    motion = swing(arm.robot, 10.0)
    result = simulate(arm, motion)
    for wanted, done in zip(motion.velocity, result.true.velocity, strict=True):
        moving = done[done != 0.0]
        turns = np.count_nonzero(np.diff(np.sign(moving)))
        # Quantised feedback may make a joint stop and go on; it may not turn more often than the reference.
        assert turns <= np.count_nonzero(np.diff(np.sign(wanted[1:])))
    assert 0 < result.stops < 200
    assert np.abs(motion.position - result.true.position).max() < 0.02


def test_elastic_joint_rings_at_its_resonance() -> None:
    arm = bare(scara())
    stiffness = 20000.0
    # The other joint's drive is held by friction that nothing breaks, so its link turns with link 1.
    arm = replace(arm, friction=np.array([[0, 0, 0, 0], [50.0, 0, 0, 0]]))
    effect = JointElasticity(joint="joint1", stiffness=stiffness, damping_ratio=0.0)
    rate = 4000.0
    time, true = free_motion(arm, [0.0, 0.0], [0.0, 0.0], 2.0, torque=np.array([0.1, 0.0]), effects=[effect], rate=rate)
    link, rotor = arm.link_inertia()[0], arm.armature[0]
    expected = np.sqrt(stiffness * (1.0 / link + 1.0 / rotor)) / (2 * np.pi)
    wind_up = (true.position - true.link_position)[0]
    wind_up = wind_up - wind_up.mean()
    crossings = np.flatnonzero((wind_up[:-1] < 0.0) & (wind_up[1:] >= 0.0))
    exact = time[crossings] - wind_up[crossings] / np.diff(wind_up)[crossings] / rate
    assert (len(exact) - 1) / (exact[-1] - exact[0]) == pytest.approx(expected, rel=1e-4)


def test_the_same_arm_gives_joint_torque_n_times_the_motors() -> None:
    motor = scara()
    joint = on_side(motor, "joint")
    effect = TransmissionLoss(joint="joint2", loss_coefficient=0.2)
    motion = swing(motor.robot, 2.0)
    one, other = (simulate(arm, motion, effects=[effect]) for arm in (motor, joint))
    np.testing.assert_allclose(other.true.effort, 100.0 * one.true.effort, rtol=1e-9, atol=1e-7)
    np.testing.assert_allclose(other.true.position, one.true.position, atol=1e-10)
    assert on_side(joint, "motor").friction == pytest.approx(motor.friction)


def test_a_reversing_gear_mirrors_the_motors_torque() -> None:
    arm = scara()
    other = replace(arm, robot=replace(arm.robot, reduction=np.array([-100.0, 100.0])))
    motion = swing(arm.robot, 2.0)
    one, mirrored = simulate(arm, motion).true, simulate(other, motion).true
    np.testing.assert_allclose(mirrored.effort, one.effort * [[-1.0], [1.0]], atol=1e-12)
    assert np.nanmax(np.abs(left_over(other, mirrored))) < 1e-10


@pytest.mark.parametrize("name", ["ur5_robot.urdf", "panda.urdf"])
def test_example_arms_follow_a_motion(name: str) -> None:
    arm = virtual_arm(load_robot(example_urdf(name)))
    motion = swing(arm.robot, 2.0, amplitude=0.2)
    result = simulate(arm, motion)
    assert np.abs(result.true.position - motion.position).max() < 0.03
    assert np.nanmax(np.abs(left_over(arm, result.true)) / arm.torque_scale[:, None]) < 1e-9


def test_a_sliding_axis_runs(tmp_path: Path) -> None:
    robot = load_robot(write_urdf(tmp_path / "axis.urdf", [Link(kind="prismatic", mass=3.0)]))
    arm = ideal(virtual_arm(robot))
    result = simulate(arm, swing(robot, 3.0))
    true = result.true
    moving = true.direction[0] != 0.0
    force = (3.0 + arm.armature[0]) * true.acceleration[0] + 3.0 * 9.81
    force = force + friction(arm, true.velocity, true.direction)[0]
    np.testing.assert_allclose(true.effort[0, moving], force[moving], rtol=1e-10)


def test_feed_forward_takes_most_of_the_error_away() -> None:
    arm = scara()
    motion = swing(arm.robot, 3.0)
    fed = replace(arm, controller=replace(arm.controller, feed_forward=True))
    errors = [np.abs(simulate(x, motion).true.position - motion.position).max() for x in (arm, fed)]
    assert errors[1] < 0.2 * errors[0]


def test_a_lost_arm_is_one_line() -> None:
    arm = scara()
    wild = replace(arm, controller=replace(arm.controller, derivative=-1e9 * np.ones(2)))
    wild = replace(wild, robot=replace(arm.robot, effort_limit=np.full(2, np.inf)))
    with pytest.raises(ScaraIdentError, match="out of control at"):
        simulate(wild, swing(arm.robot, 2.0))
