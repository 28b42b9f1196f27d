"""Reported standard deviations against the spread of estimates, on synthetic linear recordings."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.signal import lfilter

from scara_ident.estimation import covariance
from scara_ident.estimation.covariance import Covariance, block_covariance
from scara_ident.estimation.information import merge
from scara_ident.estimation.joint_rows import JointRows
from scara_ident.estimation.student_t import widening


def white(rng: np.random.Generator, count: int) -> np.ndarray:
    return rng.standard_normal(count)


def coloured(rng: np.random.Generator, count: int) -> np.ndarray:
    """First-order autoregression with a memory of 10 samples, unit variance."""
    a = 0.9
    return lfilter([np.sqrt(1 - a**2)], [1.0, -a], rng.standard_normal(count + 200))[200:]


def smooth_columns(rng: np.random.Generator, count: int, p: int) -> np.ndarray:
    """Columns as motion makes them: slow sines, so that correlated noise matters."""
    time = np.arange(count)
    return np.column_stack(
        [np.sin(2 * np.pi * time * rng.uniform(0.002, 0.008) + rng.uniform(0, 6)) for _ in range(p - 1)]
        + [np.ones(count)]
    )


def joint_rows(w: np.ndarray, u: np.ndarray, length: int) -> JointRows:
    """Rows of one joint, w of shape (N, p), in blocks of equal length."""
    starts = np.arange(0, len(u) + 1, length)
    return JointRows(np.arange(w.shape[1]), np.vstack([w.T, u]), starts, np.diff(starts).astype(float))


def estimated(*joints: JointRows, ends: tuple[int, ...] = ()) -> tuple[np.ndarray, Covariance]:
    """Estimate and covariance from rows of all joints; a recording ends before each of the blocks ``ends``."""
    parameters = joints[0].columns.size
    rows = merge(joint.information(parameters) for joint in joints)
    value = rows.solve().value
    owner = np.searchsorted(np.array(ends, dtype=int), np.arange(len(joints[0].counts)), side="right")
    return value, block_covariance(rows.inverse(), value, joints, owner, np.ones(len(joints)))


def variance(found: Covariance) -> np.ndarray:
    """Variance of each parameter before its degrees of freedom widen it."""
    return np.diag(found.matrix) / widening(found.freedom) ** 2


def of_block(joints: list[JointRows], weights: np.ndarray, block: int) -> np.ndarray:
    """Products of the columns of all joints in one block."""
    rows = [joint.table[:-1, joint.starts[block] : joint.starts[block + 1]] for joint in joints]
    return np.asarray(sum(weight**2 * own @ own.T for weight, own in zip(weights, rows, strict=True)))


def spread_and_reported(
    noise: Callable[[np.random.Generator, int], np.ndarray], count: int, length: int, draws: int = 150, p: int = 4
) -> tuple[np.ndarray, np.ndarray, str]:
    rng = np.random.default_rng(0)
    w = smooth_columns(rng, count, p)
    values, stds, kind = [], [], ""
    for _ in range(draws):
        u = w @ np.arange(1.0, p + 1) + 0.1 * noise(rng, count)
        value, found = estimated(joint_rows(w, u, length))
        values.append(value)
        stds.append(np.sqrt(variance(found)))
        kind = found.kind
        assert found.blocks == count // length
    return np.std(values, axis=0, ddof=1), np.sqrt(np.mean(np.square(stds), axis=0)), kind


@pytest.mark.parametrize("noise", [white, coloured])
def test_the_reported_std_is_the_spread_of_estimates(noise: Callable[..., np.ndarray]):
    spread, reported, kind = spread_and_reported(noise, count=6000, length=150)
    assert kind == "block"
    np.testing.assert_allclose(reported, spread, rtol=0.3)


@pytest.mark.parametrize("noise", [white, coloured])
def test_with_few_blocks_the_pooled_std_is_the_spread(noise: Callable[..., np.ndarray]):
    spread, reported, kind = spread_and_reported(noise, count=1500, length=250)
    assert kind == "pooled block"
    np.testing.assert_allclose(reported, spread, rtol=0.3)


def test_the_textbook_covariance_would_promise_too_much():
    """That the test above is one: for coloured noise the white formula is off by more than its tolerance."""
    rng = np.random.default_rng(0)
    w = smooth_columns(rng, 6000, 4)
    textbook = 0.1 * np.sqrt(np.diag(np.linalg.inv(w.T @ w)))
    spread, _, _ = spread_and_reported(coloured, count=6000, length=150)
    assert np.all(spread > 2.0 * textbook)


def test_several_recordings_count_like_one_and_their_ends_are_not_neighbours():
    rng = np.random.default_rng(2)
    w = smooth_columns(rng, 6000, 3)
    u = w @ np.ones(3) + 0.1 * coloured(rng, 6000)
    rows = joint_rows(w, u, 150)
    _, one = estimated(rows)
    _, two = estimated(rows, ends=(20,))
    _, swapped = estimated(rows.part(np.roll(np.arange(40), 20)), ends=(20,))
    assert two.blocks == one.blocks == 40
    np.testing.assert_allclose(two.matrix, swapped.matrix, rtol=1e-9)
    np.testing.assert_allclose(np.diag(two.matrix), np.diag(one.matrix), rtol=0.3)


@pytest.mark.parametrize("length", [150, 1500])
def test_units_of_parameters_scale_their_std(length: int):
    rng = np.random.default_rng(3)
    w = smooth_columns(rng, 6000, 4)
    u = w @ np.ones(4) + 0.1 * coloured(rng, 6000)
    unit = np.array([1e-4, 1.0, 1e5, 30.0])
    found = []
    for columns in (w, w * unit):
        found.append(estimated(joint_rows(columns, u, length))[1].matrix)
    np.testing.assert_allclose(found[1] * np.outer(unit, unit), found[0], rtol=1e-6, atol=1e-9 * np.max(found[0]))


@pytest.mark.parametrize("length", [150, 1500])
def test_the_covariance_is_symmetric_and_not_negative(length: int):
    rng = np.random.default_rng(4)
    w = smooth_columns(rng, 6000, 4)
    matrix = estimated(joint_rows(w, w @ np.ones(4) + 0.1 * coloured(rng, 6000), length))[1].matrix
    np.testing.assert_allclose(matrix, matrix.T, rtol=1e-10)
    assert np.linalg.eigvalsh(matrix)[0] > -1e-14 * np.trace(matrix)


def test_joints_of_different_noise_are_both_honest():
    rng = np.random.default_rng(5)
    w = [smooth_columns(rng, 3000, 2), smooth_columns(rng, 3000, 2)]
    wide = [np.column_stack([w[0], np.zeros((3000, 2))]), np.column_stack([np.zeros((3000, 2)), w[1]])]
    values, pooled = [], []
    for _ in range(120):
        u = [wide[j] @ np.ones(4) + size * rng.standard_normal(3000) for j, size in enumerate((0.01, 1.0))]
        # Six blocks for four parameters: pooled, with one size of noise per joint.
        value, found = estimated(*(joint_rows(wide[j], u[j], 500) for j in (0, 1)))
        assert found.kind == "pooled block"
        values.append(value)
        pooled.append(variance(found))
    np.testing.assert_allclose(np.sqrt(np.mean(pooled, axis=0)), np.std(values, axis=0, ddof=1), rtol=0.3)


def test_what_one_block_alone_tells_is_not_reported_as_certain():
    """A parameter whose column lives in one block of forty is as unsure as the noise makes it."""
    values, reported = [], []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        w = smooth_columns(np.random.default_rng(9), 6000, 3)
        w[:, 0] = 0.0
        w[3000:3150, 0] = 1.0
        u = w @ np.ones(3) + 0.1 * white(rng, 6000)
        value, found = estimated(joint_rows(w, u, 150))
        values.append(value)
        reported.append(variance(found))
    np.testing.assert_allclose(np.sqrt(np.mean(reported, axis=0)), np.std(values, axis=0, ddof=1), rtol=0.3)


def test_a_fit_without_redundancy_is_infinitely_unsure():
    _, found = estimated(joint_rows(np.eye(3), np.ones(3), 3))
    assert np.all(np.diag(found.matrix) == np.inf)


def test_what_is_undetermined_does_not_disturb_the_others():
    rng = np.random.default_rng(6)
    w = smooth_columns(rng, 6000, 3)
    u = w @ np.ones(3) + 0.1 * white(rng, 6000)
    wide = np.insert(w, 1, 0.0, axis=1)
    found = []
    for columns in (w, wide):
        found.append(estimated(joint_rows(columns, u, 150))[1].matrix)
    np.testing.assert_allclose(found[1][np.ix_([0, 2, 3], [0, 2, 3])], found[0], rtol=1e-9)


def test_a_dozen_blocks_are_unbiased():
    """What the correction for leverage is for: without it the std of four parameters would be a tenth too small."""
    spread, reported, kind = spread_and_reported(white, count=1800, length=150, draws=500)
    assert kind == "block"
    np.testing.assert_allclose(np.mean(reported / spread), 1.0, atol=0.05)


def test_noise_that_reaches_into_the_next_block_is_counted():
    """Blocks only three memories long: each by itself would promise a sixth too little."""
    spread, reported, kind = spread_and_reported(coloured, count=1800, length=30, draws=200)
    assert kind == "block"
    np.testing.assert_allclose(np.mean(reported / spread), 1.0, atol=0.08)


def test_it_is_the_sandwich_of_bias_reduced_scores_and_their_neighbours():
    """Dense, as Bell and McCaffrey (2002) and Newey and West (1987) write it; two joints of different weight."""
    rng = np.random.default_rng(7)
    w = [smooth_columns(rng, 600, 3) for _ in range(2)]
    joints = [joint_rows(x, x @ np.ones(3) + coloured(rng, 600), 50) for x in w]
    weights = np.array([2.0, 0.5])
    rows = merge(joint.information(3).scaled(weight) for joint, weight in zip(joints, weights, strict=True))
    value, inverse, owner = rows.solve().value, rows.inverse(), np.repeat([0, 1], 6)
    scores = np.zeros((12, 3))
    for b in range(12):
        part = slice(50 * b, 50 * b + 50)
        x = np.vstack([weight * columns[part] for columns, weight in zip(w, weights, strict=True)])
        torque = np.concatenate([weight * joint.table[-1, part] for joint, weight in zip(joints, weights, strict=True)])
        size, turn = np.linalg.eigh(np.eye(100) - x @ inverse @ x.T)
        scores[b] = x.T @ (turn / np.sqrt(size)) @ turn.T @ (torque - x @ value)
    cross = sum(np.outer(scores[b + 1], scores[b]) for b in range(11) if b != 5)
    expected = inverse @ (scores.T @ scores + 0.5 * (cross + cross.T)) @ inverse
    found = block_covariance(inverse, value, joints, owner, weights)
    assert found.kind == "block"
    # Of white residuals: what neighbours show too little of, and as how many blocks of equal weight they are.
    blocks = [inverse @ of_block(joints, weights, b) for b in range(12)]
    told = np.array([np.diag(part @ inverse) for part in blocks])
    opposed = sum(np.diag(blocks[b + 1] @ blocks[b] @ inverse) for b in range(11) if b != 5)
    neighbours = sum(told[b + 1] * told[b] for b in range(11) if b != 5)
    freedom = np.diag(inverse) ** 2 / (np.sum(told**2, axis=0) + 0.5 * neighbours)
    np.testing.assert_allclose(found.freedom, freedom, rtol=1e-8)
    wider = widening(freedom) / np.sqrt(1.0 - opposed / np.diag(inverse))
    expected = expected * np.outer(wider, wider)
    np.testing.assert_allclose(found.matrix, expected, rtol=1e-8, atol=1e-10 * np.max(np.abs(expected)))


@pytest.mark.parametrize("strengths", [(0.01, 0.4), (0.3, 0.98), (0.6, 0.9)])
def test_weak_and_strong_leverages_are_released_alike(strengths: tuple[float, float]):
    rng = np.random.default_rng(11)
    turns = np.linalg.qr(rng.standard_normal((40, 5, 5)))[0]
    sizes = rng.uniform(*strengths, (40, 1)) * rng.uniform(0.0, 1.0, (40, 5))
    products = (turns * sizes[:, None]) @ turns.transpose(0, 2, 1)
    scores = rng.standard_normal((40, 5))
    expected = np.einsum("bij,bj->bi", (turns / np.sqrt(1.0 - sizes)[:, None]) @ turns.transpose(0, 2, 1), scores)
    found = covariance.inverse_root_times(products, scores)
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-13 * np.max(np.abs(expected)))


def test_a_block_that_fixes_a_direction_alone_cannot_be_released():
    products = np.array([np.diag([0.1, 0.0]), np.diag([0.995, 0.0])])
    assert covariance.inverse_root_times(products, np.ones((2, 2))) is None


def slow(rng: np.random.Generator, count: int, memory: float) -> np.ndarray:
    """First-order autoregression with a memory in samples, unit variance; white without one."""
    a = np.exp(-1.0 / memory) if memory else 0.0
    return lfilter([np.sqrt(1 - a**2)], [1.0, -a], rng.standard_normal(count + 1000))[1000:]


@pytest.mark.slow
@pytest.mark.parametrize(("count", "memory"), [(1500, 0), (1500, 50), (1500, 100), (3000, 0), (3000, 50)])
def test_two_standard_deviations_cover_95_per_cent(count: int, memory: float):
    """Of 15 or 30 blocks of 100 samples for 12 parameters, noise that remembers none, half or all of a block.

    Of 1800 parameters, some four of each twelve independent, a share of 95 % is good to 0.9 %.
    """
    rng = np.random.default_rng(0)
    covered = []
    for _ in range(150):
        w = smooth_columns(rng, count, 12)
        rows = joint_rows(w, w @ np.ones(12) + 0.1 * slow(rng, count, memory), 100)
        inverse = np.linalg.inv(w.T @ w)
        value = inverse @ w.T @ rows.table[-1]
        found = block_covariance(inverse, value, [rows], np.zeros(len(rows.counts), dtype=int), np.ones(1))
        assert found.kind == ("pooled block" if count == 1500 else "block")
        covered.append(np.abs(value - 1.0) < 2.0 * np.sqrt(np.diag(found.matrix)))
    np.testing.assert_allclose(np.mean(covered), 0.95, atol=0.015)


def test_the_size_of_few_blocks_is_that_of_times_as_long_as_the_recording():
    """Dense, by the covariance of all scores of white residuals, of two recordings of different length."""
    rng = np.random.default_rng(12)
    w = smooth_columns(rng, 900, 5)
    u = w @ np.ones(5) + slow(rng, 900, 100)
    rows = joint_rows(w, u, 100)
    _, found = estimated(rows, ends=(6,))
    assert found.kind == "pooled block"
    inverse, owner = np.linalg.inv(w.T @ w), np.array([0] * 6 + [1] * 3)
    apart = np.abs(np.subtract.outer(np.arange(9), np.arange(9)))
    kernel = np.where(owner[:, None] == owner, 1.0 - apart / np.where(owner == 0, 6, 3), 0.0)
    residual = np.eye(900) - w @ inverse @ w.T
    root = np.linalg.cholesky(inverse)
    scores = np.zeros((9, 5, 900))
    for b in range(9):
        scores[b, :, 100 * b : 100 * b + 100] = (w[100 * b : 100 * b + 100] @ root).T
    weight = np.einsum("ab,aim,bin->mn", kernel, scores, scores)
    left = residual @ u
    expected, white = np.trace(residual @ weight), residual @ weight @ residual @ weight
    np.testing.assert_allclose(found.freedom, expected**2 / np.trace(white), rtol=1e-6)
    np.testing.assert_allclose(variance(found), left @ weight @ left / expected * np.diag(inverse), rtol=1e-6)


def test_neighbouring_blocks_beyond_the_parts_that_are_looked_at_count_as_one():
    rng = np.random.default_rng(13)
    w = smooth_columns(rng, 2400, 20)
    u = w @ np.ones(20) + coloured(rng, 2400)
    found = [estimated(joint_rows(w, u, length))[1] for length in (100, 200)]
    assert [item.blocks for item in found] == [2 * covariance.MAX_PARTS, covariance.MAX_PARTS]
    np.testing.assert_allclose(found[0].matrix, found[1].matrix, rtol=1e-9)


@pytest.mark.parametrize("blocks", [3, 64, 65, 200])
def test_what_white_residuals_show_does_not_depend_on_how_many_blocks_are_worked_on_together(
    blocks: int, monkeypatch: pytest.MonkeyPatch
):
    rng = np.random.default_rng(14)
    w = smooth_columns(rng, 20 * blocks, 1)
    rows = joint_rows(w, w[:, 0] + white(rng, 20 * blocks), 20)
    together = estimated(rows, ends=(2,))[1]
    monkeypatch.setattr(covariance, "BLOCKS_AT_ONCE", 7)
    np.testing.assert_allclose(estimated(rows, ends=(2,))[1].matrix, together.matrix, rtol=1e-12)


def test_a_direction_that_is_hardly_determined_does_not_make_all_infinitely_unsure():
    """Rounding of its inverse makes the leverage of all rows along it larger than 1."""
    rng = np.random.default_rng(15)
    w = smooth_columns(rng, 1500, 8)
    rows = joint_rows(w, w @ np.ones(8) + white(rng, 1500), 100)
    exact = np.linalg.inv(w.T @ w)
    value = exact @ w.T @ rows.table[-1]
    size, turn = np.linalg.eigh(exact)
    rounded = (turn * size * np.append(np.ones(7), 30.0)) @ turn.T
    owner = np.zeros(15, dtype=int)
    known, found = (block_covariance(inverse, value, [rows], owner, np.ones(1)) for inverse in (exact, rounded))
    assert known.kind == found.kind == "pooled block"
    assert np.all(np.isfinite(found.matrix))
    np.testing.assert_allclose(found.freedom, known.freedom, rtol=1e-6)


def test_what_no_block_shows_has_the_freedom_of_one_and_no_warning():
    """A diagnosis of positions that were interpolated between 20 to 100 samples a second warned of a division by zero."""
    products, root = np.zeros((6, 2, 2)), np.eye(2)
    products[:, 0, 0] = 1.0 / 6.0
    with np.errstate(all="raise"):
        share, freedom = covariance._of_white(products, root, np.ones(5, dtype=bool))
    assert freedom[1] == 1.0
    assert freedom[0] > 3.0
    assert share[1] == 1.0
