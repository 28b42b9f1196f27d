from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import null_space

from scara_ident.estimation.consistent.bodies import pack, packed_pseudo_inertia, unpack
from scara_ident.estimation.consistent.constraints import Cone
from scara_ident.estimation.consistent.nominal import Nominal, _to_standard
from scara_ident.estimation.consistent.options import ConsistentOptions
from scara_ident.estimation.consistent.prior import divergence, nearest_to_nominal, prior_rows
from scara_ident.estimation.consistent.problem import build_unknowns
from scara_ident.model.model import build_model
from scara_ident.robot.robot import load_robot

N = 2
U = build_unknowns(build_model(load_robot(), "complete"), ConsistentOptions())


def random_bodies(rng: np.random.Generator, count: int) -> np.ndarray:
    """Pseudo-inertias of clouds of points."""
    points = rng.standard_normal((count, 4, 6))
    points[:, 3] = rng.uniform(0.3, 1.0, (count, 6))
    return points @ np.swapaxes(points, 1, 2)


def arm(bodies: np.ndarray, rotors: np.ndarray) -> Nominal:
    return Nominal(bodies, rotors, np.ones(len(rotors)), _to_standard(bodies, rotors), ())


def relative(nominal: Nominal, bodies: np.ndarray, rotors: np.ndarray) -> np.ndarray:
    standard = np.concatenate([*(np.linalg.solve(packed_pseudo_inertia(), pack(b)) for b in bodies), rotors])
    return np.linalg.solve(nominal.to_standard, standard)


def test_the_divergence_is_its_definition():
    rng = np.random.default_rng(0)
    start, other = random_bodies(rng, N), random_bodies(rng, N)
    nominal = arm(start, np.array([0.5, 0.1]))
    x = relative(nominal, other, np.array([0.7, 0.3]))
    expected = sum(
        np.trace(np.linalg.solve(p0, p)) - np.log(np.linalg.det(np.linalg.solve(p0, p))) - 4.0
        for p0, p in zip(start, other, strict=True)
    )
    expected += sum(r - np.log(r) - 1.0 for r in (0.7 / 0.5, 0.3 / 0.1))
    np.testing.assert_allclose(divergence(x), expected, rtol=1e-10)
    np.testing.assert_allclose(divergence(nominal.relative), 0.0, atol=1e-14)
    # A body with a negative pseudo-eigenvalue pair has a positive determinant and still cannot exist.
    x[:10] = pack(np.diag([-1.0, -1.0, 1.0, 1.0]))
    assert divergence(x) == np.inf


@pytest.mark.parametrize("trust", [(1.0, 1.0), (0.01, 1.0)])
def test_the_nearest_bodies_are_those_of_a_general_solver(trust):
    import cvxpy as cp

    rng = np.random.default_rng(1)
    nominal = arm(random_bodies(rng, N), np.array([0.5, 0.1]))
    start = relative(nominal, random_bodies(rng, N), np.array([0.7, 0.3]))
    held = rng.standard_normal((12, 11 * N))
    found = nearest_to_nominal(start, null_space(held), rotors=np.array(trust))
    np.testing.assert_allclose(held @ found, held @ start, rtol=1e-10)

    bodies, rotors = [cp.Variable((4, 4), symmetric=True) for _ in range(N)], cp.Variable(N)
    weights = pack(np.ones((4, 4)))
    rows, columns = np.triu_indices(4)
    order = np.argsort(columns, kind="stable")
    x = cp.hstack(
        [
            *(
                cp.multiply(weights, cp.hstack([b[i, j] for i, j in zip(rows[order], columns[order], strict=True)]))
                for b in bodies
            ),
            rotors,
        ]
    )
    cost = sum(cp.trace(b) - cp.log_det(b) for b in bodies) + np.array(trust) @ (rotors - cp.log(rotors))
    cp.Problem(cp.Minimize(cost), [held @ x == held @ start]).solve(cp.CLARABEL)
    np.testing.assert_allclose(found, x.value, atol=2e-4 * np.abs(found).max())
    assert divergence(found, 1.0, np.array(trust)) <= divergence(x.value, 1.0, np.array(trust)) + 1e-6


@settings(max_examples=15)
@given(st.integers(0, 100_000), st.floats(1e-3, 1e3), st.floats(1e-3, 1e3))
def test_the_nearest_bodies_know_neither_frame_nor_unit(seed, length_unit, mass_unit):
    rng = np.random.default_rng(seed)
    start, other = random_bodies(rng, N), random_bodies(rng, N)
    rotors, known = rng.uniform(0.1, 1.0, (2, N))
    held = rng.standard_normal((12, 11 * N))
    first = arm(start, rotors)
    found = first.to_standard @ nearest_to_nominal(relative(first, other, known), null_space(held @ first.to_standard))
    # Other axes and origins for every body, other units for length and mass.
    frames = np.zeros((N, 4, 4))
    for k in range(N):
        frames[k, :3, :3] = length_unit * np.linalg.qr(rng.standard_normal((3, 3)))[0]
        frames[k, :3, 3] = length_unit * rng.standard_normal(3)
        frames[k, 3, 3] = 1.0
    change = np.zeros((11 * N, 11 * N))
    to_packed = packed_pseudo_inertia()
    for k, t in enumerate(frames):
        columns = [pack(mass_unit * t @ unpack(unit) @ t.T) for unit in np.eye(10)]
        block = np.linalg.solve(to_packed, np.array(columns).T @ to_packed)
        change[10 * k : 10 * k + 10, 10 * k : 10 * k + 10] = block
    change[10 * N :, 10 * N :] = mass_unit * length_unit**2 * np.eye(N)

    def moved(bodies: np.ndarray) -> np.ndarray:
        return mass_unit * frames @ bodies @ np.swapaxes(frames, 1, 2)

    unit = mass_unit * length_unit**2
    second = arm(moved(start), unit * rotors)
    rows = held @ np.linalg.inv(change) @ second.to_standard
    again = second.to_standard @ nearest_to_nominal(relative(second, moved(other), unit * known), null_space(rows))
    scale = np.abs(change) @ np.abs(found)
    np.testing.assert_allclose(again / scale, change @ found / scale, atol=1e-5)


def test_the_nearest_bodies_within_limits_are_those_of_a_general_solver():
    import cvxpy as cp

    # Along the rotors alone the divergence is a sum of a - log(a) - 1: every rotor goes to 1 or to its limit.
    start = np.concatenate([U.nominal.relative[: 10 * N], [3.0, 3.0]])
    free = np.eye(11 * N)[:, 10 * N :]
    at_least = Cone("nonnegative", np.eye(11 * N)[[10 * N]], np.array([-2.0]))
    ball = np.zeros((4, 11 * N))
    ball[1, 10 * N + 1] = 1.0
    near = Cone("ball", ball, np.array([0.5, -3.0, 0.0, 0.0]))
    found = nearest_to_nominal(start, free, (at_least, near))
    rotors = cp.Variable(N)
    cost = cp.sum(rotors) - cp.sum(cp.log(rotors))
    cp.Problem(cp.Minimize(cost), [rotors[0] >= 2.0, cp.abs(rotors[1] - 3.0) <= 0.5]).solve(cp.CLARABEL)
    np.testing.assert_allclose(found[10 * N :], rotors.value, atol=1e-5)
    np.testing.assert_allclose(found[: 10 * N], start[: 10 * N])


@settings(max_examples=25)
@given(st.integers(0, 100_000), st.floats(0.0, 5.0))
def test_a_determined_direction_is_moved_by_less_than_a_tenth_of_its_std(seed, wrong):
    """Directions that the data determine better than to nominal size, or tell from nominal, however wrong it is."""
    rng = np.random.default_rng(seed)
    bodies, others = 11 * U.n, U.size - 11 * U.n
    # Friction and offsets are known well; their scale is their own and does not mix with the bodies'.
    directions = np.eye(U.size)
    directions[:bodies, :bodies] = np.linalg.qr(rng.standard_normal((bodies, bodies)))[0]
    std = np.concatenate([np.geomspace(1e-3, 1e3, bodies), np.full(others, 1e-3)])
    rows = (directions / std).T
    # The data ask for an arm that differs from nominal by up to a hundred thousand times, within their noise.
    truth = U.reference + 10.0**wrong * rng.standard_normal(U.size)
    target = rows @ truth + rng.standard_normal(U.size)
    prior = prior_rows(U, rows, target, 0.01)
    without = np.linalg.solve(rows, target)
    stacked = np.vstack([rows, prior])
    with_prior = np.linalg.lstsq(stacked, np.concatenate([target, prior @ U.reference]), rcond=None)[0]
    moved = np.abs(directions.T @ (with_prior - without)) / std
    apart = np.abs(directions.T @ (without - U.reference)) / std
    determined = (std < 1.0) | (apart > 4.0)
    assert np.all(moved[determined] < 0.1)


def test_directions_that_the_data_do_not_see_stay_nominal():
    rng = np.random.default_rng(1)
    rows = rng.standard_normal((5, U.size))
    target = rows @ U.reference
    prior = prior_rows(U, rows, target, 0.01)
    normal = rows.T @ rows + prior.T @ prior
    found = np.linalg.solve(normal, rows.T @ target + prior.T @ prior @ U.reference)
    np.testing.assert_allclose(found, U.reference, atol=1e-8)
    assert np.linalg.matrix_rank(prior) == U.size
