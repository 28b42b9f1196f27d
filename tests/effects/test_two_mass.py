"""Motor and link at an elastic joint: closed forms, derivatives by differences, and a two-mass arm by another integrator."""

from __future__ import annotations

import gc
import weakref
from dataclasses import replace

import numpy as np
import pytest
from numpy.linalg import norm
from scipy.integrate import solve_ivp

from scara_ident.effects import Scene, Signals
from scara_ident.effects.elasticity import JointElasticity
from scara_ident.effects.links import usual_link_inertia
from scara_ident.effects.parameters import Member
from scara_ident.effects.two_mass import TwoMasses
from scara_ident.motion.motion import Motion
from scara_ident.robot.robot import Robot, load_robot
from tests.arms import Array, ur5
from tests.effects.carried import carrying, heavier
from tests.effects.scenes import dense, moving, scene_of

STEP = 2e-3


def alone(signals: Signals, joint: int, frequency: float, ratio: float) -> TwoMasses:
    """The only elastic joint."""
    return TwoMasses(signals, (Member(joint, (frequency, ratio)),))


@pytest.mark.parametrize("joint", [0, 1])
def test_slopes_are_the_differences_of_the_torque_once_the_start_is_forgotten(joint: int):
    scene, item = scene_of(load_robot()), moving(load_robot(), 6.0)
    item = replace(item, torque=None)

    def scaled(value: Array, armature: float = 0.0, frequency: float = 4.5, ratio: float = 0.1) -> Array:
        other = replace(scene, value=value, armatures={0: scene.armatures[0] + armature})
        masses = alone(Signals(other, item), joint, frequency, ratio)
        return (masses.stiffness * masses.change / stiffness)[:, 2000:]

    stiffness = alone(Signals(scene, item), joint, 4.5, 0.1).stiffness
    bodies = len(scene.model.rigid_body.columns)
    found = dense(alone(Signals(scene, item), joint, 4.5, 0.1).slopes(0), bodies + 3)[:, :, 2000:]
    for k in range(bodies):
        step = 1e-3 * np.eye(len(scene.value))[k]
        expected = (scaled(scene.value + step) - scaled(scene.value - step)) / 2e-3
        assert np.abs(found[:, k] - expected).max() < 0.002 * np.abs(expected).max() + 1e-5 * np.abs(found).max()
    for k, (name, step) in enumerate((("armature", 1e-3), ("frequency", 1e-3), ("ratio", 1e-4))):
        if name == "armature" and scene.known_armature(joint) is not None:
            continue
        at = {"armature": 0.0, "frequency": 4.5, "ratio": 0.1}[name]
        expected = (scaled(scene.value, **{name: at + step}) - scaled(scene.value, **{name: at - step})) / (2.0 * step)
        assert np.abs(found[:, bodies + k] - expected).max() < 0.002 * np.abs(expected).max()


def swinging(joint: int, stiffness: float, damping: float, start: float) -> tuple[Scene, Motion, Array]:
    """The SCARA03 with one elastic joint, its link integrated by Runge and Kutta; the link begins off by a swing."""
    robot = load_robot()
    scene = scene_of(robot, name="basic")
    term = scene.model.rigid_body
    item = moving(robot, 4.0, rate=1.0 / STEP, seed=4)
    rotor = scene.armature(joint)
    value = scene.value[scene.model.place(term)]
    span, torque = item.time[-1], term.state_torque(value)

    def at(t: float, part: Array) -> Array:
        return np.array([np.interp(t, item.time, row) for row in part])

    def rate(t: float, state: Array) -> Array:
        q, v, a = at(t, item.q), at(t, item.v), at(t, item.a)
        spring = stiffness * (q[joint] - state[0]) + damping * (v[joint] - state[1])
        q[joint], v[joint], a[joint] = state[0], state[1], 0.0
        still = torque(q, v, a)[joint] / robot.row_scale[joint]
        a[joint] = 1.0
        inertia = torque(q, v, a)[joint] / robot.row_scale[joint] - still - rotor
        return np.array([state[1], (spring - still) / inertia])

    first = np.array([item.q[joint, 0] - start, item.v[joint, 0]])
    path = solve_ivp(rate, (0.0, span), first, t_eval=item.time, rtol=1e-7, atol=1e-9).y
    q, v, a = item.q.copy(), item.v.copy(), item.a.copy()
    q[joint], v[joint] = path
    a[joint] = [rate(t, state)[1] for t, state in zip(item.time, path.T, strict=True)]
    moved = Motion("m", "m", item.time, q, v, a, None, item.rate)
    change = term.torque(moved, value) - term.torque(item, value)
    change[joint] += robot.row_scale[joint] * rotor * (item.a[joint] - a[joint])
    return scene, replace(item, torque=Signals(scene, item).predicted + change), change


def test_slopes_are_the_differences_of_the_torque_where_its_first_samples_are_wrong():
    scene, item = scene_of(load_robot()), moving(load_robot(), 4.0)
    motor = item.a.copy()
    # As of positions of which nobody knows what was before.
    motor[:, 0] += 20.0
    change = alone(Signals(scene, item), 1, 4.5, 0.05).change
    item = replace(item, a=motor)
    item = replace(item, torque=Signals(scene, item).predicted + change)

    def torque(frequency: float) -> Array:
        return alone(Signals(scene, item), 1, frequency, 0.05).change[1, 50:]

    masses = alone(Signals(scene, item), 1, 4.5, 0.05)
    # Those of stiffness times the change are had by the share too.
    share = 2.0 / 4.5 * masses.change[1, 50:]
    found = dense(masses.slopes(0), len(scene.model.rigid_body.columns) + 3)[1, -2, 50:] - share
    expected = (torque(4.5 + 1e-4) - torque(4.5 - 1e-4)) / 2e-4
    # What stays of the wrong samples themselves, within the band, and the size of the lag.
    assert np.abs(found - expected).max() < 0.2 * np.abs(expected).max()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("joint", "frequency", "ratio", "start"),
    # Of the first joint the other folds the link, whose inertia then changes faster than so little damping.
    [(1, 3.0, 0.04, 0.0), (1, 9.0, 0.04, 0.01), (0, 4.0, 0.01, 0.0)],
)
def test_the_torque_is_that_of_a_two_mass_arm_by_runge_and_kutta(
    joint: int, frequency: float, ratio: float, start: float
):
    scene = scene_of(load_robot(), name="basic", band=15.0)
    masses = alone(Signals(scene, moving(load_robot())), joint, frequency, ratio)
    scene, item, change = swinging(joint, masses.stiffness[0], masses.damping[0], start)
    found = alone(Signals(scene, item), joint, frequency, ratio).change
    inside = slice(100, -100)
    assert np.abs(found - change)[:, inside].max() < 0.002 * np.abs(change)[:, inside].max()


@pytest.mark.parametrize("frequency", [4.0, 40.0])
def test_what_acts_on_links_swings_with_them_as_if_the_bodies_had_it(frequency: float):
    robot, item = load_robot(), moving(load_robot(), 2.0)
    scenes = carrying(scene_of(robot), 2.0), heavier(robot, 2.0), scene_of(robot)
    usual = [alone(Signals(scene, item), 1, 1.0, 0.1).inertia[0] for scene in scenes]
    # The same stiffness and damping: both are told by the usual inertia, which the mass is part of or not.
    ratios = np.sqrt(usual[0] / np.array(usual))
    carried, merged, empty = (
        alone(Signals(scene, item), 1, frequency * ratio, 0.1 * ratio)
        for scene, ratio in zip(scenes, ratios, strict=True)
    )
    assert merged.stiffness == pytest.approx(carried.stiffness) and merged.damping == pytest.approx(carried.damping)
    size = np.max(np.abs(merged.change))
    assert np.max(np.abs(carried.change - merged.change)) < 1e-4 * size
    assert np.max(np.abs(empty.change - merged.change)) > 0.1 * size


def periodic(robot: Robot, stiffness: dict[int, float], size: float = 1.0) -> tuple[Scene, Motion, Array]:
    """Elastic joints whose links move in sines, the motors by the Fourier series of what their springs carry.

    No equation is solved in time: the torque of the links is that of the rigid bodies at their own motion.
    """
    scene = scene_of(robot, name="basic")
    term, rate, count = scene.model.rigid_body, 500.0, 4000
    value = scene.value[scene.model.place(term)]
    rng, time = np.random.default_rng(5), np.arange(count) / rate
    w = 2.0 * np.pi * rate / count * np.arange(1, 13)
    parts = rng.standard_normal((2, robot.n, 12)) / np.arange(1, 13)
    angles = w[:, None] * time
    q = size * 0.3 * (parts[0] @ np.sin(angles) + parts[1] @ np.cos(angles))
    turning = 2j * np.pi * np.fft.rfftfreq(count, 1.0 / rate)

    def derived(part: Array, order: int = 1) -> Array:
        return np.fft.irfft(turning**order * np.fft.rfft(part), count)

    links = Motion("m", "m", time, q, derived(q), derived(q, 2), None, rate)
    scale, armature = robot.row_scale[:, None], np.array([scene.armature(j) for j in range(robot.n)])[:, None]
    gear = term.torque(links, value) / scale - armature * links.a
    lag = np.zeros_like(q)
    for j, k in stiffness.items():
        lag[j] = np.fft.irfft(np.fft.rfft(gear[j]) / (k * (1.0 + 0.004 * turning)), count)
    motor = replace(links, q=q + lag, v=derived(q + lag), a=derived(q + lag, 2))
    change = scale * (gear + armature * motor.a) - term.torque(motor, value)
    return scene, replace(motor, torque=Signals(scene, motor).predicted + change), change


def members_with(scene: Scene, stiffness: dict[int, float]) -> tuple[Member, ...]:
    """The members of gears with a stiffness and the damping of `periodic`."""
    found = []
    for j, k in stiffness.items():
        turning = np.sqrt(k / usual_link_inertia(scene, j))
        found.append(Member(j, (turning / (2.0 * np.pi), 0.5 * 0.004 * turning)))
    return tuple(found)


@pytest.mark.parametrize(
    ("name", "stiffness"),
    [("scara03", {0: 4000.0, 1: 900.0}), ("ur5", {0: 3000.0, 1: 3000.0}), ("ur5", {0: 3000.0, 1: 3000.0, 2: 3000.0})],
)
def test_several_elastic_joints_are_those_of_links_whose_motion_is_given(name: str, stiffness: dict[int, float]):
    scene, item, change = periodic(load_robot() if name == "scara03" else load_robot(name), stiffness)
    members = members_with(scene, stiffness)

    def off(found: Array, part: slice) -> float:
        return float(np.linalg.norm((found - change)[:, part]) / np.linalg.norm(change[:, part]))

    together = TwoMasses(Signals(scene, item), members).change
    alone = sum(TwoMasses(Signals(scene, item), (one,)).change for one in members)
    # How they began is fitted to first order in lags of up to 0.03 rad, which fades.
    assert off(together, slice(100, -100)) < 0.015
    assert off(together, slice(1500, -100)) < 1e-3
    assert off(alone, slice(100, -100)) > 0.05


def test_what_each_link_adds_is_all_that_they_do_together():
    scene, item, change = periodic(load_robot(), {0: 4000.0, 1: 900.0})
    # Of first order, and of all orders.
    for stiffness in ({0: 4e4, 1: 9e3}, {0: 4000.0, 1: 900.0}):
        masses = TwoMasses(Signals(scene, item), members_with(scene, stiffness))
        assert np.abs(sum(masses.parts) - masses.change).max() < 1e-9 * np.abs(change).max()


@pytest.mark.parametrize("frequency", [4.0, 40.0])
def test_what_members_share_goes_with_the_signals(frequency: float):
    """With a small lag what was shared held the signals themselves: a search took three times the memory."""
    item, member = moving(load_robot(), 2.0), Member(1, (frequency, 0.1))
    scene = replace(scene_of(load_robot()), together=((JointElasticity(), member),))
    signals = Signals(scene, item)
    held = weakref.ref(signals)
    assert len(list(TwoMasses(signals, (member,)).slopes(0))) == 2
    del signals
    gc.collect()
    assert held() is None


def test_an_estimate_of_no_arm_lets_nothing_grow():
    scene, item, _ = periodic(ur5(), {0: 3000.0, 1: 3000.0})
    rng = np.random.default_rng(8)
    value = scene.value * (1.0 + rng.standard_normal(len(scene.value)))
    other = replace(scene, value=value)
    members = tuple(Member(j, (5.0, 0.1)) for j in (1, 2) if usual_link_inertia(other, j) > 0.0)
    lag = TwoMasses(Signals(other, item), members).lag
    assert np.all(np.isfinite(lag[0])) and np.abs(lag[0]).max() < 10.0


def test_no_swing_is_read_from_samples_in_which_friction_is_unknown():
    """Of two joints that began at rest, what friction did about turns made a swing that stayed for seconds."""
    scene, item, change = periodic(load_robot(), {0: 4000.0, 1: 900.0})
    members = members_with(scene, {0: 4000.0, 1: 900.0})
    fade, torque = np.ones_like(item.q), item.torque.copy()
    for start in (0, 500, 900):
        fade[:, start : start + 40] = 0.0
        torque[:, start : start + 40] += np.abs(change).max()

    def off(motion: Motion) -> float:
        found = TwoMasses(Signals(scene, motion), members).change
        return float(np.linalg.norm((found - change)[:, 100:-100]) / np.linalg.norm(change[:, 100:-100]))

    assert off(replace(item, torque=torque, fade=fade)) < 0.02
    assert off(replace(item, torque=torque)) > 0.05


@pytest.mark.parametrize("recorded", [False, True])
def test_slopes_add_up_to_the_differences_of_what_all_links_do(recorded: bool):
    _, item, whole = periodic(load_robot(), {0: 12000.0, 1: 2500.0})
    scene = scene_of(load_robot())
    members = members_with(scene, {0: 12000.0, 1: 2500.0})
    item = replace(item, torque=Signals(scene, item).predicted + whole if recorded else None)
    inside = slice(60, -60) if recorded else slice(2500, None)
    # How links swung when the recording began is read about no lag.
    near = 0.03 if recorded else 0.002
    bodies = len(scene.model.rigid_body.columns)

    def change(value: Array, members: tuple[Member, ...] = members, armature: float = 0.0) -> Array:
        other = replace(scene, value=value, armatures={0: scene.armatures[0] + armature})
        return TwoMasses(Signals(other, item), members).change[:, inside]

    def other(place: int, which: int, by: float) -> tuple[Member, ...]:
        nonlinear = list(members[place].nonlinear)
        nonlinear[which] += by
        return (*members[:place], replace(members[place], nonlinear=tuple(nonlinear)), *members[place + 1 :])

    family = JointElasticity()
    masses = TwoMasses(Signals(scene, item), members)
    total, own = np.zeros((scene.robot.n, bodies, item.samples)), []
    for place, member in enumerate(members):
        found = dense(masses.slopes(place), bodies + 3)
        # The tie takes away what the coefficient changes by.
        tie = family.tie(scene, member)
        assert tie is not None
        found += tie.slopes[None, :, None] * (masses.stiffness[place] * masses.parts[place])[:, None]
        total += found[:, :bodies]
        own.append(found[:, bodies:])
    for k in range(bodies):
        step = 1e-3 * np.eye(len(scene.value))[k]
        expected = (change(scene.value + step) - change(scene.value - step)) / 2e-3
        assert norm(total[:, k, inside] - expected) < near * norm(expected) + 1e-5 * norm(total)
    for place in range(2):
        for which, step in ((0, 1e-3), (1, 1e-4)):
            expected = change(scene.value, other(place, which, step)) - change(scene.value, other(place, which, -step))
            expected /= 2.0 * step
            assert norm(own[place][:, 1 + which, inside] - expected) < near * norm(expected)
    expected = (change(scene.value, armature=1e-3) - change(scene.value, armature=-1e-3)) / 2e-3
    assert norm(own[0][:, 0, inside] - expected) < near * norm(expected)


def test_a_link_that_lags_by_more_than_gears_give_has_no_elastic_gear():
    """A wrist of which an estimate leaves the weight and next to no inertia: at a low frequency its spring held nothing, and lags grew until they overflowed."""
    robot = ur5()
    scene, item = scene_of(robot), moving(robot)
    names, value = list(scene.model.names), scene.value.copy()
    value[names.index("mx6")] = 0.05
    value[names.index("I6yy")] += 2e-5 - usual_link_inertia(replace(scene, value=value), 5)
    scene = replace(scene, value=value)
    assert 1e-5 < usual_link_inertia(scene, 5) < 1e-4
    signals, effect = Signals(scene, item), JointElasticity()
    with np.errstate(all="raise"):
        loose = TwoMasses(signals, (Member(1, (8.0, 0.1)), Member(5, (2.0, 0.2))))
        assert not loose.held and not list(loose.slopes(0))
        assert not np.any(loose.change) and not np.any(loose.parts)
        (columns,) = effect.signal_columns(signals, Member(5, (2.0, 0.2)))
        assert not np.any(columns)
    stiff = TwoMasses(signals, (Member(1, (8.0, 0.1)), Member(5, (200.0, 0.2))))
    assert stiff.held and np.any(stiff.change)


def test_what_a_swing_at_the_beginning_does_is_made_once_for_all_that_swing(monkeypatch):
    scene, item, _ = periodic(ur5(), {0: 3000.0, 1: 3000.0, 2: 3000.0})
    members = members_with(scene, {0: 3000.0, 1: 3000.0, 2: 3000.0})
    scene = replace(scene, together=tuple((JointElasticity(), member) for member in members))
    signals, made, make = Signals(scene, item), [], TwoMasses._made_begun
    assert item.torque is not None
    monkeypatch.setattr(TwoMasses, "_made_begun", lambda self: made.append(self) or make(self))
    for place in range(3):
        assert len(list(TwoMasses(signals, members).slopes(place))) == 6
    assert len(made) == 1
