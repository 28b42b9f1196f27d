"""Links that swing in their gears: closed forms, one and two of them, and how they began."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.effects import swing as module
from scara_ident.effects.matrices import times
from scara_ident.effects.swing import InitialState, Swing, free_swings
from tests.arms import Array

STEP = 2e-3


def alone(inertia: Array, damping: Array, stiffness: Array, step: float) -> Swing:
    """One link."""
    return Swing(inertia[None, None], damping[None, None], stiffness[None, None], step)


def solved(swing: Swing, torque: Array, start: Array | None = None) -> tuple[Array, Array, Array]:
    """What one link does under torques (..., N)."""
    x, first, second = swing.solve(torque[..., None, :], None if start is None else start[..., None, :])
    return x[..., 0, :], first[..., 0, :], second[..., 0, :]


@pytest.mark.parametrize(("frequency", "step"), [(3.0, 5e-4), (40.0, 5e-4), (9.0, 1e-2), (30.0, 1e-2)])
def test_a_forced_link_swings_as_the_closed_form_says(frequency: float, step: float):
    inertia, stiffness, damping, count = 2.0, 2.0 * (2 * np.pi * 12.0) ** 2, 30.0, round(4.0 / step)
    time = np.arange(count) * step
    w = 2 * np.pi * frequency
    whole = np.ones(count)
    found = solved(alone(inertia * whole, damping * whole, stiffness * whole, step), np.cos(w * time))
    gain = 1.0 / (stiffness - inertia * w**2 + 1j * w * damping)
    steady = slice(count // 2, count - 10)
    # The scheme of fourth order errs by (w step)^4 / 240 of the square of the frequency.
    allowed = 0.01 if w * step < 1.0 else 0.2
    expected = np.real(gain * np.exp(1j * w * time))
    assert np.abs(found[0] - expected)[steady].max() < allowed * np.abs(gain)


def test_a_link_let_go_swings_at_its_own_frequency_and_dies_away():
    count, omega, ratio = 3000, 2 * np.pi * 5.0, 0.05
    whole, time = np.ones(count), np.arange(count) * STEP
    swing = alone(whole, 2.0 * ratio * omega * whole, omega**2 * whole, STEP)
    damped = omega * np.sqrt(1.0 - ratio**2)
    expected = np.exp(-ratio * omega * time) * (np.cos(damped * time) + ratio * omega / damped * np.sin(damped * time))
    x, first, second = solved(swing, np.zeros(count), expected[:2])
    assert np.abs(x - expected).max() < 2e-3
    assert np.abs(second + omega**2 * x + 2.0 * ratio * omega * first).max() < 1e-9


@pytest.mark.parametrize("ratio", [0.02, 0.2, 3.0])
def test_a_free_swing_is_over_after_its_memory_and_its_first_samples_are_those_of_the_whole(ratio: float):
    count, omega = 18000, 2 * np.pi * 6.0
    varied = 1.0 + 0.3 * np.sin(np.arange(count) * STEP)
    swing = alone(varied, 2.0 * ratio * omega * np.ones(count), omega**2 * np.ones(count), STEP)
    start = np.array([1.0, 1.0 - ratio * STEP])
    x = solved(swing, np.zeros(count), start)
    memory = swing.memory(1e-9)
    assert memory < count
    assert np.abs(x[0][memory:]).max() < 3e-9
    for part, whole in zip(solved(swing, np.zeros(memory), start), x, strict=True):
        # But for the derivative at the last sample, which has no next one.
        np.testing.assert_array_equal(part[:-1], whole[: memory - 1])


def test_no_digits_are_lost_to_the_length_of_a_run():
    # Beside the same recursion with three more digits, which rounding of 2e-16 moves by the steps in a radian of the swing.
    count, omega, step = 6000, 2 * np.pi * 3.0, 1e-3
    rows = np.cumsum(np.random.default_rng(0).standard_normal(count))
    x = solved(alone(*(size * np.ones(count) for size in (1.0, 0.02 * omega, omega**2)), step), rows)[0]
    precise, forces = [np.longdouble(value) for value in x[:2]], rows.astype(np.longdouble)
    heavy, slow, spring = 1.0 / step**2, 0.01 * omega / step, omega**2 / 12.0
    for k in range(2, count):
        force = (forces[k] + 10.0 * forces[k - 1] + forces[k - 2]) / 12.0
        before = (heavy - slow + spring) * precise[-2] + (10.0 * spring - 2.0 * heavy) * precise[-1]
        precise.append((force - before) / (heavy + slow + spring))
    assert np.abs(x - np.array(precise)).max() < 1e-11 * np.abs(x).max()


def test_a_slow_load_winds_the_gear_up_by_load_over_stiffness():
    load, whole = 5.0 + 3.0 * np.sin(np.arange(2000) / 300.0), np.ones(2000)
    x, _, second = solved(alone(0.5 * whole, 20.0 * whole, 8e4 * whole, 1e-3), load)
    assert x == pytest.approx(load / 8e4, rel=1e-3)
    assert np.all(np.isfinite(second))


def test_the_swing_at_the_beginning_is_found_however_far_off_it_is_assumed():
    count, rate = 2000, 500.0
    swing = alone(np.ones(count), np.full(count, 0.8), np.full(count, 25.0**2), 1.0 / rate)
    free = free_swings(swing, count)
    torque, true = 100.0 * free[2], np.array([0.01, -2.0])
    initial = InitialState(free, torque, np.ones(1), np.ones((1, count)), rate, 20.0, slice(25, count - 25))
    # As large a lag as a start that is 2 rad/s off makes.
    found = initial.state(np.tensordot(true, torque, 1), (np.full((1, count), 0.04), np.full((1, count), 1.0)))
    shown = np.tensordot(true, torque, 1)
    assert np.abs(np.tensordot(found - true, torque, 1)).max() < 1e-4 * np.abs(shown).max()
    # Of what no torque shows there is no more than was assumed.
    unseen = InitialState(free, torque * [[[1.0]], [[1e-7]]], np.ones(1), np.ones((1, count)), rate, 20.0, initial.used)
    assert abs(unseen.state(shown, (np.full((1, count), 0.04), np.full((1, count), 1.0)))[1]) < 0.05


def two(count: int, step: float = STEP) -> Swing:
    """Two links of which each loads the other's gear."""
    whole = np.ones(count)
    inertia = np.array([[3.0, 1.1], [1.1, 0.8]])[..., None] * whole
    damping = np.array([[9.0, 0.7], [-0.7, 3.0]])[..., None] * whole
    stiffness = np.array([[2500.0, 40.0], [40.0, 1200.0]])[..., None] * whole
    return Swing(inertia, damping, stiffness, step)


def test_two_links_that_are_forced_swing_as_the_closed_form_says():
    count, w = 6000, 2 * np.pi * 4.0
    swing, time, force = two(count), np.arange(count) * STEP, np.array([5.0, -2.0])
    system = swing.stiffness[..., 0] - w**2 * swing.inertia[..., 0] + 1j * w * swing.damping[..., 0]
    expected = np.real(np.linalg.solve(system, force)[:, None] * np.exp(1j * w * time))
    found = swing.solve(force[:, None] * np.cos(w * time))
    # Once the slower of their two ways to swing has faded.
    steady = slice(4000, -10)
    assert np.abs(found[0] - expected)[:, steady].max() < 1e-3 * np.abs(expected).max()
    second = -(w**2) * expected
    assert np.abs(found[2] - second)[:, steady].max() < 1e-2 * np.abs(second).max()


def test_links_that_do_not_load_each_other_swing_as_if_alone():
    load = np.random.default_rng(2).standard_normal((3, 2, 2000)).cumsum(axis=2)
    both = two(2000)
    apart = [part * np.eye(2)[..., None] for part in (both.inertia, both.damping, both.stiffness)]
    found = Swing(*apart, STEP).solve(load)
    for k in range(2):
        expected = solved(alone(*(part[k, k] for part in apart), STEP), load[:, k])
        for part, own in zip(found, expected, strict=True):
            assert np.abs(part[:, k] - own).max() < 1e-9 * np.abs(own).max()


def test_two_links_that_are_let_go_have_faded_after_their_memory():
    swing = two(20000)
    memory = swing.memory(1e-6)
    assert memory < 20000
    free = free_swings(swing, 20000)[0]
    for each in free:
        assert np.abs(each[:, memory:]).max() < 1e-6 * np.abs(each).max()


def test_how_two_links_began_is_determined_by_the_torques_of_both():
    count, rate = 3000, 1.0 / STEP
    swing = two(count)
    free, true = free_swings(swing, count), np.array([0.01, -0.02, 0.5, 0.8])
    torque = -times(swing.inertia, free[2])
    initial = InitialState(free, torque, np.array([1.0, 3.0]), np.ones((2, count)), rate, 30.0, slice(20, count - 20))
    found = initial.state(np.tensordot(true, torque, 1), (np.full((2, count), 0.02), np.full((2, count), 0.6)))
    assert found == pytest.approx(true, rel=0.01)
    rest = np.zeros((2, count))
    begun = initial.added((rest, rest, rest), true)
    assert begun[0][:, 0] == pytest.approx(true[:2])


def test_what_friction_hides_of_the_beginning_is_taken_for_no_swing():
    """Two elastic joints of the virtual SCARA03 had swings of 2 N m from rest, which no recording showed, and fitted worse than one."""
    count, rate = 3000, 1.0 / STEP
    swing = two(count)
    free, true = free_swings(swing, count), np.array([0.001, -0.002, 0.05, 0.08])
    torque = -times(swing.inertia, free[2])
    fade, size = np.ones((2, count)), (np.full((2, count), 0.02), np.full((2, count), 0.6))
    fade[:, 60:100] = fade[:, :20] = 0.0
    left = np.tensordot(true, torque, 1)
    left[:, 60:100] += 20.0
    left[:, :20] -= 20.0
    known, unknown = (
        InitialState(free, torque, np.ones(2), each, rate, 30.0, slice(20, count - 20)) for each in (fade, fade**0.0)
    )
    # The ridge holds back a little of what is seen least.
    assert known.state(left, size) == pytest.approx(true, rel=0.06)
    assert np.max(np.abs(unknown.state(left, size) / true - 1.0)) > 0.5
    # Where all that would show it is faded out it stays as assumed.
    fade[:] = 0.0
    fade[:, -200:] = 1e-3
    hidden = InitialState(free, torque, np.ones(2), fade, rate, 30.0, slice(20, count - 20))
    assert np.all(np.abs(hidden.state(left, size)) < 1e-3 * np.array([0.02, 0.02, 0.6, 0.6]))


def test_torques_that_are_solved_for_together_are_solved_for_as_if_alone():
    load = np.random.default_rng(4).standard_normal((2 * module.ROWS_AT_ONCE + 1, 2, 500))
    swing = two(500)
    for part, each in zip(swing.solve(load), zip(*map(swing.solve, load), strict=True), strict=True):
        np.testing.assert_array_equal(part, each)
