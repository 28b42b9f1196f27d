"""Motor and link at an elastic joint: closed forms, derivatives by differences, and a two-mass arm by another integrator."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from scara_ident.effects import Scene, Signals
from scara_ident.effects.two_mass import InitialState, Swing, TwoMasses
from scara_ident.motion.motion import Motion
from scara_ident.robot.robot import load_robot
from tests.arms import Array
from tests.effects.carried import carrying, heavier
from tests.effects.scenes import dense, moving, scene_of

STEP = 2e-3


@pytest.mark.parametrize(("frequency", "step"), [(3.0, 5e-4), (40.0, 5e-4), (9.0, 1e-2), (30.0, 1e-2)])
def test_a_forced_link_swings_as_the_closed_form_says(frequency: float, step: float):
    inertia, stiffness, damping, count = 2.0, 2.0 * (2 * np.pi * 12.0) ** 2, 30.0, round(4.0 / step)
    time = np.arange(count) * step
    w = 2 * np.pi * frequency
    whole = np.ones(count)
    found = Swing(inertia * whole, damping * whole, stiffness * whole, step).solve(np.cos(w * time))
    gain = 1.0 / (stiffness - inertia * w**2 + 1j * w * damping)
    steady = slice(count // 2, count - 10)
    # The scheme of fourth order errs by (w step)^4 / 240 of the square of the frequency.
    allowed = 0.01 if w * step < 1.0 else 0.2
    expected = np.real(gain * np.exp(1j * w * time))
    assert np.abs(found[0] - expected)[steady].max() < allowed * np.abs(gain)


def test_a_link_let_go_swings_at_its_own_frequency_and_dies_away():
    count, omega, ratio = 3000, 2 * np.pi * 5.0, 0.05
    whole, time = np.ones(count), np.arange(count) * STEP
    swing = Swing(whole, 2.0 * ratio * omega * whole, omega**2 * whole, STEP)
    damped = omega * np.sqrt(1.0 - ratio**2)
    expected = np.exp(-ratio * omega * time) * (np.cos(damped * time) + ratio * omega / damped * np.sin(damped * time))
    x, first, second = swing.solve(np.zeros(count), expected[:2])
    assert np.abs(x - expected).max() < 2e-3
    assert np.abs(second + omega**2 * x + 2.0 * ratio * omega * first).max() < 1e-9


@pytest.mark.parametrize("ratio", [0.02, 0.2, 3.0])
def test_a_free_swing_is_over_after_its_memory_and_its_first_samples_are_those_of_the_whole(ratio: float):
    count, omega = 18000, 2 * np.pi * 6.0
    varied = 1.0 + 0.3 * np.sin(np.arange(count) * STEP)
    swing = Swing(varied, 2.0 * ratio * omega * np.ones(count), omega**2 * np.ones(count), STEP)
    start = np.array([1.0, 1.0 - ratio * STEP])
    x = swing.solve(np.zeros(count), start)
    memory = swing.memory(1e-9)
    assert memory < count
    assert np.abs(x[0][memory:]).max() < 3e-9
    for part, whole in zip(swing.solve(np.zeros(memory), start), x, strict=True):
        # But for the derivative at the last sample, which has no next one.
        np.testing.assert_array_equal(part[:-1], whole[: memory - 1])


def test_no_digits_are_lost_to_the_length_of_a_run():
    # Beside the same recursion with three more digits, which rounding of 2e-16 moves by the steps in a radian of the swing.
    count, omega, step = 6000, 2 * np.pi * 3.0, 1e-3
    rows = np.cumsum(np.random.default_rng(0).standard_normal(count))
    x = Swing(*(size * np.ones(count) for size in (1.0, 0.02 * omega, omega**2)), step).solve(rows)[0]
    precise, forces = [np.longdouble(value) for value in x[:2]], rows.astype(np.longdouble)
    heavy, slow, spring = 1.0 / step**2, 0.01 * omega / step, omega**2 / 12.0
    for k in range(2, count):
        force = (forces[k] + 10.0 * forces[k - 1] + forces[k - 2]) / 12.0
        before = (heavy - slow + spring) * precise[-2] + (10.0 * spring - 2.0 * heavy) * precise[-1]
        precise.append((force - before) / (heavy + slow + spring))
    assert np.abs(x - np.array(precise)).max() < 1e-11 * np.abs(x).max()


def test_a_slow_load_winds_the_gear_up_by_load_over_stiffness():
    load, whole = 5.0 + 3.0 * np.sin(np.arange(2000) / 300.0), np.ones(2000)
    x, _, second = Swing(0.5 * whole, 20.0 * whole, 8e4 * whole, 1e-3).solve(load)
    assert x == pytest.approx(load / 8e4, rel=1e-3)
    assert np.all(np.isfinite(second))


@pytest.mark.parametrize("joint", [0, 1])
def test_slopes_are_the_differences_of_the_torque_once_the_start_is_forgotten(joint: int):
    scene, item = scene_of(load_robot()), moving(load_robot(), 4.0)
    item = replace(item, torque=None)

    def scaled(value: Array, armature: float = 0.0, frequency: float = 4.5, ratio: float = 0.1) -> Array:
        other = replace(scene, value=value, armatures={0: scene.armatures[0] + armature})
        masses = TwoMasses(Signals(other, item), joint, frequency, ratio)
        return (masses.stiffness * masses.change / stiffness)[:, 1000:]

    stiffness = TwoMasses(Signals(scene, item), joint, 4.5, 0.1).stiffness
    bodies = len(scene.model.rigid_body.columns)
    found = dense(TwoMasses(Signals(scene, item), joint, 4.5, 0.1).slopes(), bodies + 3)[:, :, 1000:]
    for k in range(bodies):
        step = 1e-3 * np.eye(len(scene.value))[k]
        expected = (scaled(scene.value + step) - scaled(scene.value - step)) / 2e-3
        assert np.abs(found[:, k] - expected).max() < 0.02 * np.abs(expected).max() + 1e-5 * np.abs(found).max()
    for k, (name, step) in enumerate((("armature", 1e-3), ("frequency", 1e-3), ("ratio", 1e-4))):
        if name == "armature" and scene.told_armature(joint) is not None:
            continue
        at = {"armature": 0.0, "frequency": 4.5, "ratio": 0.1}[name]
        expected = (scaled(scene.value, **{name: at + step}) - scaled(scene.value, **{name: at - step})) / (2.0 * step)
        # Slopes are taken about no lag, and err by its size, here some hundredths of a radian.
        assert np.abs(found[:, bodies + k] - expected).max() < 0.05 * np.abs(expected).max()


def swinging(stiffness: float, damping: float, start: float) -> tuple[Scene, Motion, Array]:
    """The SCARA03 with an elastic second joint, its link integrated by Runge and Kutta; the link begins off by a swing."""
    robot = load_robot()
    scene = scene_of(robot, name="basic")
    term = scene.model.rigid_body
    item = moving(robot, 4.0, rate=1.0 / STEP, seed=4)
    rotor = scene.armature(1)
    value = scene.value[scene.model.place(term)]
    span, torque = item.time[-1], term.state_torque(value)

    def at(t: float, part: Array) -> Array:
        return np.array([np.interp(t, item.time, row) for row in part])

    def rate(t: float, state: Array) -> Array:
        q, v, a = at(t, item.q), at(t, item.v), at(t, item.a)
        spring = stiffness * (q[1] - state[0]) + damping * (v[1] - state[1])
        q[1], v[1], a[1] = state[0], state[1], 0.0
        still = torque(q, v, a)[1] / robot.row_scale[1]
        a[1] = 1.0
        inertia = torque(q, v, a)[1] / robot.row_scale[1] - still - rotor
        return np.array([state[1], (spring - still) / inertia])

    first = np.array([item.q[1, 0] - start, item.v[1, 0]])
    path = solve_ivp(rate, (0.0, span), first, t_eval=item.time, rtol=1e-7, atol=1e-9).y
    q, v, a = item.q.copy(), item.v.copy(), item.a.copy()
    q[1], v[1] = path
    a[1] = [rate(t, state)[1] for t, state in zip(item.time, path.T, strict=True)]
    moved = Motion("m", "m", item.time, q, v, a, None, item.rate)
    change = term.torque(moved, value) - term.torque(item, value)
    change[1] += robot.row_scale[1] * rotor * (item.a[1] - a[1])
    return scene, replace(item, torque=Signals(scene, item).predicted + change), change


def test_the_swing_at_the_beginning_is_found_however_far_off_it_is_assumed():
    count, rate = 2000, 500.0
    swing = Swing(np.ones(count), np.full(count, 0.8), np.full(count, 25.0**2), 1.0 / rate)
    free = swing.solve(np.zeros((2, count)), np.array([[1.0, 1.0], [0.0, swing.step]]))
    torque, true = 100.0 * free[2], np.array([0.01, -2.0])
    initial = InitialState(free, torque, rate, 20.0, slice(25, count - 25))
    # As large a lag as a start that is 2 rad/s off makes.
    found = initial.state(true @ torque, (np.full(count, 0.04), np.full(count, 1.0)))
    assert np.abs((found - true) @ torque).max() < 1e-4 * np.abs(true @ torque).max()
    # Of what no torque shows there is no more than was assumed.
    unseen = InitialState(free, torque * [[1.0], [1e-7]], rate, 20.0, initial.used)
    assert abs(unseen.state(true @ torque, (np.full(count, 0.04), np.full(count, 1.0)))[1]) < 0.05


def test_slopes_are_the_differences_of_the_torque_where_its_first_samples_are_wrong():
    scene, item = scene_of(load_robot()), moving(load_robot(), 4.0)
    motor = item.a.copy()
    # As of positions of which nobody knows what was before.
    motor[:, 0] += 20.0
    change = TwoMasses(Signals(scene, item), 1, 4.5, 0.05).change
    item = replace(item, a=motor)
    item = replace(item, torque=Signals(scene, item).predicted + change)

    def torque(frequency: float) -> Array:
        return TwoMasses(Signals(scene, item), 1, frequency, 0.05).change[1, 50:]

    masses = TwoMasses(Signals(scene, item), 1, 4.5, 0.05)
    # Those of stiffness times the change are had by the share too.
    share = 2.0 / 4.5 * masses.change[1, 50:]
    found = dense(masses.slopes(), len(scene.model.rigid_body.columns) + 3)[1, -2, 50:] - share
    expected = (torque(4.5 + 1e-4) - torque(4.5 - 1e-4)) / 2e-4
    # What stays of the wrong samples themselves, within the band, and the size of the lag.
    assert np.abs(found - expected).max() < 0.2 * np.abs(expected).max()


@pytest.mark.slow
@pytest.mark.parametrize(("frequency", "start"), [(3.0, 0.0), (9.0, 0.01)])
def test_the_torque_is_that_of_a_two_mass_arm_by_runge_and_kutta(frequency: float, start: float):
    scene = scene_of(load_robot(), name="basic", band=15.0)
    masses = TwoMasses(Signals(scene, moving(load_robot())), 1, frequency, 0.04)
    scene, item, change = swinging(masses.stiffness, masses.damping, start)
    found = TwoMasses(Signals(scene, item), 1, frequency, 0.04).change
    inside = slice(100, -100)
    assert np.abs(found - change)[:, inside].max() < 0.02 * np.abs(change)[:, inside].max()


@pytest.mark.parametrize("frequency", [4.0, 40.0])
def test_what_acts_on_links_swings_with_them_as_if_the_bodies_had_it(frequency: float):
    robot, item = load_robot(), moving(load_robot(), 2.0)
    scenes = carrying(scene_of(robot), 2.0), heavier(robot, 2.0), scene_of(robot)
    usual = [TwoMasses(Signals(scene, item), 1, 1.0, 0.1).inertia for scene in scenes]
    # The same stiffness and damping: both are told by the usual inertia, which the mass is part of or not.
    ratios = np.sqrt(usual[0] / np.array(usual))
    carried, merged, empty = (
        TwoMasses(Signals(scene, item), 1, frequency * ratio, 0.1 * ratio)
        for scene, ratio in zip(scenes, ratios, strict=True)
    )
    assert merged.stiffness == pytest.approx(carried.stiffness) and merged.damping == pytest.approx(carried.damping)
    size = np.max(np.abs(merged.change))
    assert np.max(np.abs(carried.change - merged.change)) < 1e-4 * size
    assert np.max(np.abs(empty.change - merged.change)) > 0.1 * size
