"""What an examination says, against brute force, closed forms and the distribution that a p-value must have."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import lfilter
from scipy.stats import f

from scara_ident.diagnosis.candidates.candidates import Rows
from scara_ident.diagnosis.criteria import CRITERIA
from scara_ident.diagnosis.testing.candidate_tests import Examination, coefficients, examine, gains, held_out_gains
from scara_ident.diagnosis.testing.fitted_model import FittedModel
from scara_ident.estimation.joint_rows import JointRows
from tests.diagnosis.made import dense_rows, model_of, uneven_blocks

ROWS = 1600


def examined(columns: np.ndarray, torque: np.ndarray, model, *groups, block: int = 40) -> list[Examination]:
    """Examine groups of the columns (N, k) of one joint beside the model of others."""
    fitted = model_of(columns[:, list(model)], torque, block=block)
    return examine(fitted, [{0: columns[:, group].T} for group in groups])


def slow(rng: np.random.Generator, count: int, rows: int = ROWS) -> np.ndarray:
    """Sines slower than a block, as motion is."""
    t = np.arange(rows)[:, None]
    return np.sin(2 * np.pi * t * rng.uniform(0.004, 0.03, count) + rng.uniform(0, 6, count))


@pytest.mark.slow
@pytest.mark.parametrize("memory", [0.0, 0.8])
def test_the_p_value_is_uniform_where_nothing_is_missing(memory: float):
    rng = np.random.default_rng(1)
    found = []
    for _ in range(300):
        columns = slow(rng, 5)
        noise = lfilter([1.0], [1.0, -memory], rng.standard_normal(ROWS))
        found.append(examined(columns, columns[:, :3] @ [1.0, -2.0, 0.5] + noise, range(3), [3, 4])[0].p_value)
    p = np.sort(found)
    # Kolmogorov and Smirnov's distance; 0.094 is its 1 % quantile for 300 values.
    distance = np.max(np.abs(p - (np.arange(300) + 0.5) / 300))
    assert distance < 0.094
    assert 0.02 <= np.mean(p < 0.05) <= 0.09


@pytest.mark.slow
def test_a_textbook_test_would_call_correlated_noise_an_effect():
    """The power of the check above: without blocks every other p-value is below 5 %."""
    rng = np.random.default_rng(1)
    low = 0
    for _ in range(100):
        columns = slow(rng, 5)
        noise = lfilter([1.0], [1.0, -0.8], rng.standard_normal(ROWS))
        low += examined(columns, noise, range(3), [3, 4], block=1)[0].p_value < 0.05
    assert low > 20


def test_value_and_gain_are_those_of_the_joint_fit():
    rng = np.random.default_rng(2)
    columns = slow(rng, 6)
    torque = columns @ [1.0, -2.0, 0.5, 0.3, -0.2, 0.0] + rng.standard_normal(ROWS)
    found = examined(columns, torque, range(3), [3, 4], [5])
    for result, group in zip(found, ([3, 4], [5]), strict=True):
        joined = np.linalg.lstsq(columns[:, [0, 1, 2, *group]], torque)[0]
        alone = np.linalg.lstsq(columns[:, :3], torque)[0]
        assert_allclose(result.value, joined[3:], rtol=1e-7)
        assert_allclose(result.model_value, joined[:3], rtol=1e-7)
        before = np.sum((torque - columns[:, :3] @ alone) ** 2)
        after = np.sum((torque - columns[:, [0, 1, 2, *group]] @ joined) ** 2)
        assert result.gain == pytest.approx(1.0 - after / before, rel=1e-6)


@pytest.mark.parametrize("place", range(7))
def test_coefficients_alone_are_those_of_an_examination(place: int):
    model, candidates = uneven_blocks(1)
    (wanted,) = examine(model, [candidates[place]])
    value, products = coefficients(model, candidates[place])
    assert_allclose(value, wanted.value, rtol=1e-9, atol=1e-12 * np.max(np.abs(wanted.value)))
    assert_allclose(products, wanted.products, rtol=1e-9, atol=1e-12 * np.max(np.abs(wanted.products)))


@pytest.mark.slow
def test_the_standard_deviation_is_the_scatter_of_repeated_estimates():
    rng = np.random.default_rng(3)
    columns = slow(rng, 4)
    found = []
    for _ in range(200):
        noise = lfilter([1.0], [1.0, -0.8], rng.standard_normal(ROWS))
        found.append(examined(columns, noise, range(3), [3])[0])
    scatter = np.std([item.value[0] for item in found])
    told = np.sqrt(np.mean([item.covariance[0, 0] for item in found]))
    assert told == pytest.approx(scatter, rel=0.2)


def test_what_the_model_spans_is_absorbed_and_says_nothing():
    rng = np.random.default_rng(4)
    own = slow(rng, 3)
    columns = np.column_stack([own, own @ [1.0, 2.0, 3.0], own @ [1e-6, 0.0, 1e-6]])
    torque = rng.standard_normal(ROWS)
    for result in examined(columns, torque, range(3), [3], [4], [3, 4]):
        assert result.outside < CRITERIA.absorbed
        assert (result.p_value, result.gain, result.held_out, result.votes) == (1.0, 0.0, 0.0, (0, 0))
        assert np.all(result.value == 0.0)
        assert np.all(np.isinf(result.covariance))


def test_the_share_outside_the_model_is_the_sine_of_the_angle_squared():
    model, other = np.zeros(ROWS), np.zeros(ROWS)
    model[::2], other[1::2] = 1.0, 1.0
    candidate = np.cos(0.3) * model + np.sin(0.3) * other
    torque = np.random.default_rng(5).standard_normal(ROWS)
    assert examined(np.column_stack([model, candidate]), torque, [0], [1])[0].outside == pytest.approx(np.sin(0.3) ** 2)


def test_the_gain_held_out_is_that_of_leaving_one_trajectory_out():
    rng = np.random.default_rng(6)
    columns = slow(rng, 4)
    torque = columns @ [1.0, 0.0, 2.0, 0.4] + rng.standard_normal(ROWS)
    result = examined(columns, torque, range(3), [3])[0]
    clean = [x - columns[:, :3] @ np.linalg.lstsq(columns[:, :3], x)[0] for x in (columns[:, 3], torque)]
    saved, gains = 0.0, []
    for fold in np.split(np.arange(ROWS), 4):
        rest = np.setdiff1d(np.arange(ROWS), fold)
        guess = clean[0][rest] @ clean[1][rest] / (clean[0][rest] @ clean[0][rest])
        base = np.sum(clean[1][fold] ** 2)
        saving = base - np.sum((clean[1][fold] - guess * clean[0][fold]) ** 2)
        gains.append(saving / base)
        saved += saving
    assert_allclose(result.fold_gains, gains, rtol=1e-6)
    assert result.held_out == pytest.approx(saved / np.sum(clean[1] ** 2), rel=1e-6)
    assert result.held_out < result.gain


def test_a_trajectory_that_does_not_excite_a_candidate_abstains():
    rng = np.random.default_rng(7)
    columns = slow(rng, 3)
    columns[800:1200, 2] = 0.0
    columns[:, :2] = rng.standard_normal((ROWS, 2))
    torque = columns @ [1.0, 2.0, 1.0] + 0.5 * rng.standard_normal(ROWS)
    result = examined(columns, torque, [0, 1], [2])[0]
    assert result.fold_gains[2] is None
    assert result.votes == (3, 3)


def test_what_helps_in_one_trajectory_and_harms_in_the_others_gains_nothing_held_out():
    rng = np.random.default_rng(8)
    columns = slow(rng, 3)
    torque = 0.1 * rng.standard_normal(ROWS)
    torque[:400] += columns[:400, 2]
    torque[400:] -= 0.3 * columns[400:, 2]
    result = examined(columns, torque, [0, 1], [2])[0]
    assert result.held_out < 0.0


def test_nothing_is_found_in_torque_that_the_model_explains_exactly():
    columns = slow(np.random.default_rng(9), 3)
    result = examined(columns, np.zeros(ROWS), [0, 1], [2])[0]
    assert (result.p_value, result.gain) == (1.0, 0.0)


def test_units_of_columns_change_nothing():
    rng = np.random.default_rng(10)
    columns = slow(rng, 5)
    torque = columns @ [1.0, 0.0, 2.0, 0.1, 0.1] + rng.standard_normal(ROWS)
    unit = np.array([1e6, 1.0, 1e-6, 1e-7, 1e5])
    one = examined(columns, torque, range(3), [3, 4])[0]
    two = examined(columns * unit, torque, range(3), [3, 4])[0]
    assert_allclose(two.value * unit[3:], one.value, rtol=1e-6)
    assert_allclose([two.p_value, two.gain, two.held_out], [one.p_value, one.gain, one.held_out], rtol=1e-6)


def test_what_is_left_is_the_residual_of_every_block():
    rng = np.random.default_rng(11)
    columns = slow(rng, 4)
    torque = rng.standard_normal(ROWS)
    for width, left in (
        (3, model_of(columns[:, :3], torque).squares),
        (4, examined(columns, torque, range(3), [3])[0].left),
    ):
        rest = torque - columns[:, :width] @ np.linalg.lstsq(columns[:, :width], torque)[0]
        assert_allclose(left, np.sum(rest.reshape(-1, 40) ** 2, axis=1), rtol=1e-8)


def by_leaving_out(
    model: FittedModel, columns: np.ndarray, place: np.ndarray, torque: np.ndarray, size: int
) -> tuple[np.ndarray, float, float]:
    """Covariance, p-value and freedom of the last coefficients from fits of all parameters without one block after the other."""
    blocks = len(model.owner)
    everything = np.linalg.pinv(columns, rcond=1e-12)[-size:]
    change = np.zeros((blocks, size, len(torque)))
    for b in range(blocks):
        kept = place != b
        change[b] = everything
        change[b][:, kept] -= np.linalg.pinv(columns[kept], rcond=1e-12)[-size:]
    near = np.eye(blocks)
    for b in range(1, blocks):
        if model.owner[b] == model.owner[b - 1]:
            near[b, b - 1] = near[b - 1, b] = 0.5
    white = everything @ everything.T
    # Directions in which the candidate is of unit size, as the test takes them.
    scale = np.sqrt(np.diag(np.linalg.inv(white)))
    values, vectors = np.linalg.eigh(np.linalg.inv(white) / np.outer(scale, scale))
    into = vectors / np.sqrt(values) / scale[:, None]
    turned = np.einsum("ki,bkn->bin", np.linalg.inv(into).T, change)
    gamma = np.einsum("bin,cjn->bicj", turned, turned)
    expected = np.einsum("bc,bicj->ij", near, gamma)
    seen = np.einsum("bc,bi,cj->ij", near, turned @ torque, turned @ torque)
    values, vectors = np.linalg.eigh(expected)
    scaling = vectors / np.sqrt(values) @ vectors.T
    unbiased = scaling @ seen @ scaling
    freedom = min(
        np.trace(near @ gamma[:, i, :, i]) ** 2 / np.trace(near @ gamma[:, i, :, i] @ near @ gamma[:, i, :, i])
        for i in range(size)
    )
    value = np.linalg.inv(into) @ (everything @ torque)
    wald = value @ np.linalg.solve(unbiased, value)
    rest = freedom - size + 1.0
    p_value = float(f.sf(wald * rest / (freedom * size), size, rest)) if rest > 0.0 else 1.0
    return into @ unbiased @ into.T, p_value, float(freedom)


def by_all_rows(model: FittedModel, candidate: Rows) -> Examination:
    """The same examination from dense rows of all joints, the model projected out of them."""
    width = len(next(iter(candidate.values())))
    rows, place = dense_rows(model, candidate)
    own, blocks = rows[:, : model.parameters], len(model.owner)

    def beside(target: np.ndarray) -> np.ndarray:
        return target - own @ np.linalg.lstsq(own, target, rcond=1e-12)[0]

    x, e = beside(rows[:, model.parameters : -1]), beside(rows[:, -1])
    share = np.sum(x**2, axis=0) / np.sum(rows[:, model.parameters : -1] ** 2, axis=0)
    x[:, share < CRITERIA.absorbed] = 0.0
    outside = float(np.max(np.where(share < CRITERIA.absorbed, 0.0, share)))
    free = np.flatnonzero(np.any(x, axis=0))

    def by_block(values: np.ndarray) -> np.ndarray:
        return np.array([np.sum(values[place == b], axis=0) for b in range(blocks)])

    def without(kept: np.ndarray) -> np.ndarray:
        found = np.zeros(width)
        found[free] = np.linalg.lstsq(x[np.ix_(kept, free)], e[kept])[0]
        return found

    value = without(np.ones(len(e), dtype=bool))
    left = e - x @ value
    covariance, p_value, freedom = np.full((width, width), np.inf), 1.0, 1.0
    if len(free):
        covariance = np.zeros((width, width))
        inner, p_value, freedom = by_leaving_out(
            model, np.column_stack([own, x[:, free]]), place, rows[:, -1], len(free)
        )
        covariance[np.ix_(free, free)] = inner
    gains: list[float | None] = []
    saved = 0.0
    power = by_block(np.sum(x**2, axis=1))
    in_fold = [np.sum(power[model.fold == fold]) for fold in range(model.folds)]
    for fold in range(model.folds):
        mine = np.isin(place, np.flatnonzero(model.fold == fold))
        if not len(free) or in_fold[fold] < CRITERIA.abstains * np.mean(in_fold):
            gains.append(None)
            continue
        saving = np.sum(e[mine] ** 2) - np.sum((e[mine] - x[mine] @ without(~mine)) ** 2)
        gains.append(float(saving / np.sum(e[mine] ** 2)))
        saved += saving
    before, after = np.sum(e**2), np.sum(left**2)
    torque = rows[:, -1] - rows[:, model.parameters : -1] @ value
    return Examination(
        value,
        value,
        covariance,
        p_value,
        outside,
        float(1.0 - after / before),
        float(saved / before),
        tuple(gains),
        own @ np.linalg.lstsq(own, torque, rcond=1e-12)[0],
        by_block(left**2),
        x.T @ x,
        freedom,
    )


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
def test_it_is_what_all_rows_of_all_joints_say(seed: int):
    model, candidates = uneven_blocks(seed)
    assert all(np.any(np.diff(rows.starts) == 0) for rows in model.joints)
    found = examine(model, candidates)
    assert [item.outside < CRITERIA.absorbed for item in found] == [False] * 5 + [True, False]
    assert found[4].outside < 1e-3
    for item, candidate in zip(found, candidates, strict=True):
        dense = by_all_rows(model, candidate)
        size = np.sqrt(np.diag(dense.covariance))
        with np.errstate(invalid="ignore"):
            assert_allclose(item.value, dense.value, rtol=1e-9, atol=1e-9 * np.min(size))
            assert_allclose(item.covariance, dense.covariance, rtol=1e-8, atol=1e-9 * np.max(dense.covariance))
        assert_allclose(item.p_value, dense.p_value, rtol=1e-7)
        assert item.freedom == pytest.approx(dense.freedom, rel=1e-7)
        assert item.outside == pytest.approx(dense.outside, rel=1e-9)
        for name in ("gain", "held_out"):
            assert getattr(item, name) == pytest.approx(getattr(dense, name), rel=1e-9, abs=1e-9), name
        assert [gain is None for gain in item.fold_gains] == [gain is None for gain in dense.fold_gains]
        assert [x for x in item.fold_gains if x is not None] == pytest.approx(
            [x for x in dense.fold_gains if x is not None], rel=1e-8, abs=1e-9
        )
        assert_allclose(item.left, dense.left, rtol=1e-9, atol=1e-9 * np.mean(dense.left))
        fitted = [
            weight * (item.model_value[rows.columns] @ rows.table[:-1])
            for rows, weight in zip(model.joints, model.weights, strict=True)
        ]
        assert_allclose(
            np.concatenate(fitted), dense.model_value, rtol=0, atol=1e-9 * np.max(np.abs(dense.model_value))
        )


def test_candidates_are_examined_alike_alone_and_in_company():
    """More of them than have their products made together."""
    model, candidates = uneven_blocks(0)
    company = examine(model, candidates * 30)
    for place in (0, 100, 200):
        (alone,) = examine(model, [(candidates * 30)[place]])
        assert_allclose(company[place].value, alone.value, rtol=1e-9)
        assert company[place].p_value == pytest.approx(alone.p_value, rel=1e-9)
        assert company[place].held_out == pytest.approx(alone.held_out, rel=1e-9)
    assert examine(model, []) == []


def test_gains_alone_are_those_of_the_whole_examination():
    model, candidates = uneven_blocks(1)
    found = examine(model, candidates)
    assert_allclose(held_out_gains(model, candidates), [item.held_out for item in found], rtol=1e-12, atol=1e-15)
    assert held_out_gains(model, []) == []


@pytest.mark.parametrize("seed", range(4))
def test_it_is_what_is_removed_over_that_and_what_the_joint_keeps(seed: int):
    model, candidates = uneven_blocks(seed)
    candidates = candidates[:4]
    found = examine(model, candidates)
    sizes = [rows.table.shape[1] for rows in model.joints]
    for joint in range(3):
        own = slice(sum(sizes[:joint]), sum(sizes[: joint + 1]))
        told = gains(model, candidates, [joint] * len(candidates), found)
        for candidate, item, gain in zip(candidates, found, told, strict=True):
            rows, _ = dense_rows(model, candidate)
            errors = [
                rows[:, -1] - columns @ np.linalg.lstsq(columns, rows[:, -1], rcond=1e-10)[0]
                for columns in (rows[:, : model.parameters], rows[:, :-1])
            ]
            before, after = errors
            removed = item.held_out * float(np.sum(before**2))
            lost = float(np.sum(before**2) - np.sum(after**2)) - removed
            kept = float(np.sum(after[own] ** 2)) + lost
            assert gain == pytest.approx(removed / (max(removed, 0.0) + kept), rel=1e-6, abs=1e-9)
    assert gains(model, candidates, [None] * len(candidates), found) == [item.held_out for item in found]


def test_it_is_not_above_the_whole_where_other_joints_errors_fall_too():
    """Two joints share a parameter, which what is missing on the first has pushed off: both errors fall with it."""
    rng = np.random.default_rng(3)
    shared, missing = rng.standard_normal((2, 400))
    missing += shared
    torques = (shared + missing + 0.1 * rng.standard_normal(400), shared + 0.1 * rng.standard_normal(400))
    starts, counts = np.arange(0, 401, 40), np.full(10, 40.0)
    rows = tuple(JointRows(np.array([0]), np.vstack([shared, torque]), starts, counts) for torque in torques)
    owner = np.arange(10) // 5
    model = FittedModel(rows, 1, owner, owner, np.ones(2))
    candidate = {0: missing[None]}
    (item,) = examine(model, [candidate])
    (gain,) = gains(model, [candidate], [0], [item])
    before = [float(np.sum(error**2)) for error in model.residual]
    # All that it saves, over what its joint had left.
    assert item.held_out * sum(before) / before[0] > 1.1
    assert 0.95 < gain < 1.0
