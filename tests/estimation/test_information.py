"""The triangular factor against dense linear algebra."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from scara_ident.errors import UsageError
from scara_ident.estimation import information
from scara_ident.estimation.information import GRAM_ROWS, Information, merge


def rows(seed: int, count: int, p: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    w = rng.standard_normal((count, p)) * 10.0 ** rng.uniform(-3, 3, p)
    return w, rng.standard_normal(count)


def gram(information: Information) -> np.ndarray:
    return information.factor.T @ information.factor


def assert_same(one: Information, other: Information) -> None:
    """Equal as statistics: the signs of a factor's rows are free."""
    size = np.sqrt(np.diag(gram(other)))
    size[size == 0.0] = 1.0
    assert_allclose(gram(one) / np.outer(size, size), gram(other) / np.outer(size, size), rtol=0, atol=1e-12)
    assert one.rows == pytest.approx(other.rows, rel=1e-14)
    assert_allclose(np.tril(one.factor, -1), 0.0)


def batch(w: np.ndarray, u: np.ndarray) -> Information:
    return Information.empty(w.shape[1]).absorb(w, u)


def test_the_factor_stands_for_the_normal_equations():
    w, u = rows(0, 700, 5)
    all_ = np.column_stack([w, u])
    expected = all_.T @ all_
    size = np.sqrt(np.diag(expected))
    assert_allclose(gram(batch(w, u)) / np.outer(size, size), expected / np.outer(size, size), atol=1e-13)
    assert batch(w, u).rows == 700


@settings(max_examples=40)
@given(st.integers(0, 10_000), st.integers(1, 6), st.lists(st.integers(0, 40), min_size=1, max_size=6))
def test_merging_parts_in_any_order_is_the_batch(seed: int, p: int, sizes: list[int]):
    w, u = rows(seed, sum(sizes), p)
    bounds = np.cumsum([0, *sizes])
    parts = [batch(w[a:b], u[a:b]) for a, b in zip(bounds, bounds[1:], strict=False)]
    assert_same(merge(parts), batch(w, u))
    assert_same(merge(parts[::-1]), batch(w, u))
    shuffled = [parts[i] for i in np.random.default_rng(seed).permutation(len(parts))]
    assert_same(merge([merge(shuffled[:1]), *shuffled[1:]]), batch(w, u))


@settings(max_examples=15)
@given(st.integers(0, 10_000), st.integers(1, 5), st.integers(8, 60))
def test_row_by_row_gives_the_batch_estimate_to_1e_10(seed: int, p: int, count: int):
    w, u = rows(seed, count, p)
    step = Information.empty(p)
    for k in range(count):
        step = step.absorb(w[k : k + 1], u[k : k + 1])
    assert_same(step, batch(w, u))
    one, other = step.solve(), batch(w, u).solve()
    assert_allclose(one.value, other.value, rtol=1e-10, atol=1e-10 * float(np.max(np.abs(other.value * size_of(w)))))
    assert_allclose(step.inverse(), batch(w, u).inverse(), rtol=1e-10)


def size_of(w: np.ndarray) -> np.ndarray:
    return np.linalg.norm(w, axis=0)


def test_the_order_of_rows_does_not_matter():
    w, u = rows(3, 1500, 4)
    mixed = np.random.default_rng(0).permutation(1500)
    assert_same(batch(w[mixed], u[mixed]), batch(w, u))


def test_the_panels_of_a_long_batch_do_not_matter():
    w, u = rows(4, 5000, 3)
    assert_same(merge(batch(w[k::7], u[k::7]) for k in range(7)), batch(w, u))


def test_the_estimate_is_numpys():
    w, u = rows(5, 300, 6)
    expected, residual, *_ = np.linalg.lstsq(w / size_of(w), u, rcond=None)
    found = batch(w, u)
    assert_allclose(found.solve().value, expected / size_of(w), rtol=1e-11)
    assert found.residual_sum() == pytest.approx(float(residual[0]), rel=1e-12)
    assert found.rms() == pytest.approx(np.sqrt(float(residual[0]) / 300), rel=1e-12)
    assert found.torque_rms == pytest.approx(np.sqrt(np.mean(u**2)), rel=1e-12)
    other = np.ones(6)
    assert found.rms(other) == pytest.approx(np.sqrt(np.mean((u - w @ other) ** 2)), rel=1e-12)


def test_the_inverse_log_det_and_condition_are_numpys():
    w, u = rows(6, 300, 4)
    found = batch(w, u)
    assert_allclose(found.inverse(), np.linalg.inv(w.T @ w), rtol=1e-7)
    assert found.log_det() == pytest.approx(np.linalg.slogdet(w.T @ w)[1], rel=1e-9)
    assert found.condition() == pytest.approx(np.linalg.cond(w) ** 2, rel=1e-9)


def test_parameters_of_condition_1e8_are_right():
    """Against an exact solution in fractions: two columns that differ by one part in 1e8."""
    rng = np.random.default_rng(0)
    first = rng.integers(-99, 100, 60)
    second = rng.integers(-99, 100, 60)
    w = np.column_stack([first * 2.0**27, first * 2.0**27 + second])
    assert 1e8 < np.linalg.cond(w) < 1e9
    torque = 5 * second + rng.integers(-3, 4, 60)
    a = [[Fraction(int(x)) for x in row] for row in w]
    u = [Fraction(int(x)) for x in torque]
    g = [[sum(r[i] * r[j] for r in a) for j in range(2)] for i in range(2)]
    b = [sum(r[i] * t for r, t in zip(a, u, strict=True)) for i in range(2)]
    det = g[0][0] * g[1][1] - g[0][1] * g[1][0]
    exact = [float((g[1][1] * b[0] - g[0][1] * b[1]) / det), float((g[0][0] * b[1] - g[1][0] * b[0]) / det)]
    # Normal equations in doubles have nothing left of it: cond(W.T W) is over 1e16.
    found = batch(w, torque.astype(float)).solve()
    assert not found.undetermined.any()
    # Perturbation theory: what rounding of the data alone does, with ten times that for the factor's own.
    kappa = np.linalg.cond(w)
    left = np.linalg.norm(torque - w @ exact) / (np.linalg.norm(w, 2) * np.linalg.norm(exact))
    bound = 10 * np.finfo(float).eps * (kappa + kappa**2 * left)
    assert bound < 1e-4
    assert_allclose(found.value, exact, rtol=bound)
    step = Information.empty(2)
    for k in range(60):
        step = step.absorb(w[k : k + 1], torque[k : k + 1].astype(float))
    assert_allclose(step.solve().value, exact, rtol=bound)


def test_parameters_of_condition_1e8_are_found_without_noise():
    rng = np.random.default_rng(1)
    left, _ = np.linalg.qr(rng.standard_normal((400, 6)))
    right, _ = np.linalg.qr(rng.standard_normal((6, 6)))
    w = left * np.geomspace(1.0, 1e-8, 6) @ right.T
    truth = rng.standard_normal(6)
    assert_allclose(batch(w, w @ truth).solve().value, truth, rtol=1e-6)


def test_selecting_columns_is_the_sub_model():
    w, u = rows(7, 200, 6)
    for columns in ([0, 2, 5], [5, 1], [3], []):
        found = batch(w, u).select(columns)
        assert_same(found, batch(w[:, columns], u))
        assert found.rms() == pytest.approx(batch(w[:, columns], u).rms(), rel=1e-12)


def test_embedding_puts_zero_columns_around():
    w, u = rows(8, 50, 3)
    wide = np.zeros((50, 6))
    wide[:, [4, 0, 3]] = w
    found = batch(w, u).embed([4, 0, 3], 6)
    assert_same(found, batch(wide, u))
    assert_same(found.select([4, 0, 3]), batch(w, u))
    assert found.solve().undetermined.tolist() == [False, True, True, False, False, True]


def test_weights_multiply_rows():
    w, u = rows(9, 80, 3)
    assert_same(batch(w, u).scaled(2.5), batch(2.5 * w, 2.5 * u))


def test_decay_forgets_what_was_known():
    w, u = rows(10, 60, 3)
    old = batch(w[:40], u[:40])
    weight = np.where(np.arange(60) < 40, 0.5, 1.0)
    found = old.absorb(w[40:], u[40:], decay=0.25)
    assert_allclose(found.solve().value, batch(w * weight[:, None], u * weight).solve().value, rtol=1e-11)
    assert found.rows == 0.25 * 40 + 20


def test_a_prior_alone_is_its_mean_and_std():
    mean, std = np.array([2.0, -3.0, 0.5]), np.array([0.1, 10.0, 1e-6])
    prior = Information.prior(mean, std)
    assert_allclose(prior.solve().value, mean, rtol=1e-13)
    assert_allclose(np.sqrt(np.diag(prior.inverse())), std, rtol=1e-13)
    assert prior.rows == 0


def test_a_prior_is_weighed_against_rows_of_unit_variance():
    w, u = rows(11, 30, 3)
    mean, std = np.array([1.0, 2.0, 3.0]), np.array([0.3, 0.2, 0.1])
    found = merge([Information.prior(mean, std), batch(w, u)])
    precision = w.T @ w + np.diag(std**-2)
    assert_allclose(found.solve().value, np.linalg.solve(precision, w.T @ u + mean / std**2), rtol=1e-7)
    assert_allclose(found.inverse(), np.linalg.inv(precision), rtol=1e-7)


def test_an_infinite_prior_is_no_prior():
    w, u = rows(12, 30, 2)
    nothing = Information.prior(np.array([5.0, 5.0]), np.array([np.inf, np.inf]))
    assert_same(merge([nothing, batch(w, u)]), batch(w, u))
    half = Information.prior(np.array([5.0, 7.0]), np.array([np.inf, 0.5])).solve()
    assert half.undetermined.tolist() == [True, False]
    assert half.value[1] == pytest.approx(7.0)


@pytest.mark.parametrize("std", [0.0, -1.0, np.nan])
def test_a_prior_needs_positive_std(std: float):
    with pytest.raises(ValueError, match="std of a prior must be positive"):
        Information.prior(np.zeros(2), np.array([1.0, std]))


def test_nothing_is_known_of_an_empty_factor():
    empty = Information.empty(3)
    solution = empty.solve()
    assert solution.undetermined.all()
    assert solution.null.shape == (3, 3)
    assert_allclose(empty.inverse(), 0.0)
    assert empty.log_det() == -np.inf
    assert empty.condition() == np.inf
    assert empty.rms() == empty.torque_rms == 0.0
    assert_same(empty.absorb(np.zeros((0, 3)), np.zeros(0)), empty)


@settings(max_examples=40)
@given(st.integers(0, 10_000), st.integers(1, 7), st.floats(-9, 0))
def test_singular_values_are_asked_only_where_that_changes_nothing(seed: int, p: int, decades: float):
    """Far from singular the triangular system is solved as it stands; nearer, and where it is none, by its singular values."""
    w, u = rows(seed, 40, p)
    w[:, -1] = w[:, 0] + 10.0**decades * w[:, -1] * np.linalg.norm(w[:, 0]) / np.linalg.norm(w[:, -1])
    known = batch(w, u)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(information, "SURELY", 2.0)
        asked, span = known.solve(), information.orthonormal(known.regressor_factor)
    found, basis = known.solve(), information.orthonormal(known.regressor_factor)
    condition = np.linalg.cond(w / np.linalg.norm(w, axis=0))
    size = np.linalg.norm(w, axis=0)
    assert_allclose(size * found.value, size * asked.value, atol=1e-14 * condition**2 * np.linalg.norm(u))
    assert found.undetermined.tolist() == asked.undetermined.tolist()
    assert found.null.shape == asked.null.shape == (p, 0)
    # Each is orthonormal on the rows, and both span the same.
    between = (w @ span).T @ (w @ basis)
    assert_allclose(between @ between.T, np.eye(p), atol=1e-13 * condition)
    turned = known.regressor_factor[::-1]
    assert_allclose(
        (turned @ information.orthonormal(turned)).T @ (turned @ information.orthonormal(turned)),
        np.eye(p),
        atol=1e-13 * condition,
    )


def test_a_zero_column_is_undetermined_and_changes_nothing_else():
    w, u = rows(13, 50, 3)
    wide = np.insert(w, 1, 0.0, axis=1)
    solution = batch(wide, u).solve()
    assert solution.undetermined.tolist() == [False, True, False, False]
    assert_allclose(solution.value[[0, 2, 3]], batch(w, u).solve().value, rtol=1e-11)
    assert solution.value[1] == 0.0
    assert_allclose(np.abs(solution.null), [[0.0], [1.0], [0.0], [0.0]])


@settings(max_examples=30)
@given(st.integers(0, 10_000), st.floats(-4, 4))
def test_a_combination_that_rows_leave_open_is_found_whatever_the_units(seed: int, decades: float):
    rng = np.random.default_rng(seed)
    w = rng.standard_normal((80, 5))
    w[:, 3] = 2.0 * w[:, 1] - 0.5 * w[:, 4]
    unit = 10.0 ** (decades * rng.uniform(-1, 1, 5))
    u = rng.standard_normal(80)
    found = batch(w * unit, u)
    solution = found.solve()
    assert solution.undetermined.tolist() == [False, True, False, True, True]
    assert solution.null.shape == (5, 1)
    direction = solution.null[:, 0] * unit
    assert np.linalg.norm(w @ direction) < 1e-10 * np.linalg.norm(direction)
    # Its prediction is still the best there is.
    expected = np.linalg.lstsq(w, u, rcond=None)[0]
    assert_allclose(w * unit @ solution.value, w @ expected, atol=1e-10)
    assert found.log_det() == -np.inf
    assert found.condition() == np.inf


def test_fewer_rows_than_parameters_leave_some_open():
    w, u = rows(14, 2, 4)
    found = batch(w, u)
    assert found.solve().null.shape == (4, 2)
    assert found.solve().undetermined.all()
    assert_allclose(w @ found.solve().value, u, rtol=1e-9)
    assert (found.log_det(), found.condition()) == (-np.inf, np.inf)


@settings(max_examples=30)
@given(st.integers(0, 10_000), st.floats(-6, 6))
def test_units_of_parameters_do_not_change_what_is_known(seed: int, decades: float):
    w, u = rows(seed, 40, 3)
    unit = 10.0 ** (decades * np.random.default_rng(seed).uniform(-1, 1, 3))
    one, other = batch(w, u), batch(w * unit, u)
    assert_allclose(other.solve().value * unit, one.solve().value, rtol=1e-7)
    assert_allclose(other.inverse() * np.outer(unit, unit), one.inverse(), rtol=1e-6)
    assert other.log_det() == pytest.approx(one.log_det() + 2 * np.sum(np.log(unit)), rel=1e-9, abs=1e-7)
    assert other.rms() == pytest.approx(one.rms(), rel=1e-9)


def test_shapes_that_do_not_fit_are_refused():
    empty = Information.empty(3)
    for w, u in ((np.ones((5, 2)), np.ones(5)), (np.ones((5, 3)), np.ones(4)), (np.ones(3), np.ones(1))):
        with pytest.raises(ValueError, match=r"expected a regressor \(N, 3\)"):
            empty.absorb(w, u)
    with pytest.raises(UsageError, match="nothing to merge"):
        merge([])
    with pytest.raises(UsageError, match="information about 3 and 4 parameters cannot be merged"):
        merge([empty, Information.empty(4)])


def weak_rows(seed: int, count: int, condition: float) -> np.ndarray:
    """Columns of unit size, in which one direction is weaker by a condition; the last is the torque."""
    rng = np.random.default_rng(seed)
    basis, _ = np.linalg.qr(rng.standard_normal((6, 6)))
    return rng.standard_normal((count, 6)) * np.geomspace(1.0, 1.0 / condition, 6) @ basis.T


@pytest.mark.parametrize("condition", [1e2, 1e8])
def test_many_rows_keep_the_digits_of_a_dense_solution(condition: float):
    table = weak_rows(0, 10 * GRAM_ROWS, condition)
    own = Information.empty(5).absorb_columns(table.T)
    for part in (own, Information.empty(5).absorb_columns(table[:3000].T).absorb_columns(table[3000:].T)):
        singular = np.linalg.svd(part.factor, compute_uv=False)
        assert_allclose(singular, np.linalg.svd(table, compute_uv=False), rtol=1e-15 * condition)
        assert part.rows == len(table)
        assert_allclose(np.tril(part.factor, -1), 0.0)


def test_many_rows_unlike_the_first_are_absorbed_as_exactly(monkeypatch):
    monkeypatch.setattr(information, "AT_ONCE", 0)
    # At rest, then a motion: what was known is no scale for what comes.
    table = weak_rows(1, 2 * GRAM_ROWS, 10.0)
    still = table[:GRAM_ROWS] * np.array([1e-9, 1.0, 0.0, 1.0, 1e-9, 1.0])
    rows = np.vstack([still, table])
    quick = Information.empty(5).absorb_columns(still.T).absorb_columns(table.T)
    nothing = Information.empty(5).absorb_columns(np.zeros((6, GRAM_ROWS))).absorb_columns(rows.T)
    monkeypatch.setattr("scara_ident.estimation.information.GRAM_ROWS", 10**9)
    exact = Information.empty(5).absorb_columns(rows.T)
    for one in (quick, nothing):
        assert_allclose(gram(one), gram(exact), atol=1e-13 * gram(exact).max())
        assert_allclose(one.solve().value, exact.solve().value, rtol=1e-12)


def test_columns_of_any_size_and_dependent_ones_take_the_quick_way_and_keep_their_digits(
    monkeypatch: pytest.MonkeyPatch,
):
    monkeypatch.setattr(information, "AT_ONCE", 0)
    table = weak_rows(2, 3 * GRAM_ROWS, 1e4)
    table[:, 3] = table[:, 1]
    table *= 10.0 ** np.array([8.0, -8.0, 0.0, 5.0, -3.0, 2.0])
    found = Information.empty(5)
    for part in np.split(table, 3):
        updated = information._updated(found.factor, part.T, np.eye(6))
        found = found.absorb_columns(part.T)
        assert updated is None or np.array_equal(updated, found.factor)
    assert updated is not None
    size = np.linalg.norm(table, axis=0)
    whole = (table / size).T @ (table / size)
    assert_allclose(gram(found) / np.outer(size, size), whole, atol=1e-13)
    assert found.solve().undetermined.tolist() == [False, True, False, True, False]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("value", [1e200, np.nan, np.inf])
def test_what_the_quick_way_cannot_take_is_left_to_the_other(value: float, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(information, "AT_ONCE", 0)
    table = weak_rows(3, 2 * GRAM_ROWS, 10.0)
    known = Information.empty(5).absorb_columns(table[:GRAM_ROWS].T)
    table[-1, 2] = value
    assert information._updated(known.factor, table[GRAM_ROWS:].T, np.eye(6)) is None
    found = known.absorb_columns(table[GRAM_ROWS:].T).factor
    assert np.isfinite(found).all() == np.isfinite(value)


def test_how_near_to_singular_is_measured_by_the_whole_matrix():
    # One column goes with each of the others: the upper half alone looks a third as large.
    near = np.eye(12)
    near[0, 1:] = near[1:, 0] = 0.995 / np.sqrt(11.0)
    assert 0.4e-3 < 1.0 / np.linalg.cond(near, 1) < 0.6e-3
    table = np.vstack([np.linalg.cholesky(near).T, np.zeros((GRAM_ROWS, 12))])
    assert information._updated(np.eye(12), table.T, np.zeros((12, 12))) is None


def test_rows_that_are_fitted_exactly_whatever_their_noise_tell_no_noise():
    few = Information.empty(6).absorb(*rows(3, 4, 6))
    left = few.solve().value
    assert few.rms(left) < 1e-9 * few.torque_rms
    assert few.noise(left) == few.torque_rms
    # Of more rows an exact fit says that there is next to none, and one that is not exact how much there is.
    w, u = rows(4, 40, 6)
    exact = Information.empty(6).absorb(w, w @ np.ones(6))
    assert exact.noise(np.ones(6)) == 1e-6 * exact.torque_rms
    noisy = Information.empty(6).absorb(w, u)
    value = noisy.solve().value
    assert noisy.noise(value) == noisy.rms(value)
    assert Information.empty(6).noise(np.zeros(6)) == 1.0
