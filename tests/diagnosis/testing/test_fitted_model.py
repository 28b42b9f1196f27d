"""A fitted model and the products of candidates beside it, against dense rows with the model projected out."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from scara_ident.diagnosis.testing.fitted_model import FittedModel, products_of
from tests.diagnosis.made import dense_rows, uneven_blocks


def by_block(values: np.ndarray, place: np.ndarray, blocks: int) -> np.ndarray:
    return np.array([np.sum(values[place == b], axis=0) for b in range(blocks)])


def outer(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    return one[:, :, None] * other[:, None, :]


def basis_of(model: FittedModel) -> np.ndarray:
    return np.concatenate([model.basis(joint) for joint in range(len(model.joints))], axis=1).T


@pytest.mark.parametrize("seed", range(3))
def test_its_basis_is_orthonormal_and_spans_what_its_columns_do(seed: int):
    model, candidates = uneven_blocks(seed)
    own = dense_rows(model, candidates[0])[0][:, : model.parameters]
    basis = basis_of(model)
    # One column is the sum of two others.
    assert basis.shape[1] == model.parameters - 1
    assert_allclose(basis.T @ basis, np.eye(basis.shape[1]), rtol=0, atol=1e-12)
    assert_allclose(basis @ (basis.T @ own), own, rtol=0, atol=1e-10 * np.max(np.abs(own)))
    assert_allclose(own @ model.root, basis, rtol=0, atol=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_its_residual_and_products_are_those_of_dense_rows(seed: int):
    model, candidates = uneven_blocks(seed)
    rows, place = dense_rows(model, candidates[0])
    blocks, basis, own, torque = len(model.owner), basis_of(model), rows[:, : model.parameters], rows[:, -1]
    left = torque - own @ np.linalg.lstsq(own, torque, rcond=1e-12)[0]
    assert_allclose(np.concatenate(model.residual), left, rtol=0, atol=1e-10 * np.max(np.abs(torque)))
    assert_allclose(model.projected, basis.T @ torque, rtol=1e-10)
    assert_allclose(model.squares, by_block(left**2, place, blocks), rtol=1e-9, atol=1e-12)
    assert_allclose(model.basis_products, by_block(outer(basis, basis), place, blocks), rtol=0, atol=1e-12)
    assert_allclose(model.basis_scores, by_block(basis * left[:, None], place, blocks), rtol=0, atol=1e-9)
    assert model.folds == 4


@pytest.mark.parametrize("chosen", [(0,), (1,), (2, 4, 5), (3,), (6, 6)])
def test_products_of_candidates_are_those_of_what_lies_outside_the_model(chosen: tuple[int, ...]):
    model, candidates = uneven_blocks(1)
    found = products_of(model, [candidates[k] for k in chosen])
    basis, blocks = basis_of(model), len(model.owner)
    for place_of, k in enumerate(chosen):
        rows, place = dense_rows(model, candidates[k])
        columns = rows[:, model.parameters : -1]
        beside = columns - basis @ (basis.T @ columns)
        size = np.sum(columns**2, axis=0)
        unit = np.sqrt(np.outer(size, size))
        assert_allclose(found.sizes[place_of], size, rtol=1e-10)
        assert_allclose(found.sums[place_of], columns.T @ basis, rtol=0, atol=1e-12 * np.sqrt(np.max(size)))
        wanted = by_block(outer(beside, beside), place, blocks)
        assert_allclose(found.columns[place_of] / unit, wanted / unit, rtol=0, atol=1e-13)
        scores = by_block(beside * np.concatenate(model.residual)[:, None], place, blocks)
        assert_allclose(found.scores[place_of] / np.sqrt(size), scores / np.sqrt(size), rtol=0, atol=1e-10)


def test_rows_of_neighbours_are_those_of_all_and_take_no_memory():
    model, _ = uneven_blocks(1)
    count = len(model.joints)
    columns, left = model.rows_of(tuple(range(count)))
    assert_allclose(np.einsum("bmr,bm->br", columns, left), model.basis_scores, rtol=0, atol=1e-12)
    assert_allclose(np.sum(left**2, axis=1), model.squares, rtol=1e-12)
    for joints in ((0,), (1, 2), (0, 2)):
        some, errors = model.rows_of(joints)
        parts = [model.rows_of((j,)) for j in joints]
        assert_array_equal(some, np.concatenate([part for part, _ in parts], axis=1))
        assert_array_equal(errors, np.concatenate([error for _, error in parts], axis=1))
        assert np.shares_memory(some, columns) == (joints != (0, 2))


def test_a_block_without_a_row_of_a_joint_adds_nothing():
    model, candidates = uneven_blocks(2)
    found = products_of(model, [candidates[0]])
    empty = np.diff(model.joints[0].starts) == 0
    assert np.any(empty)
    assert not np.any(model.rows_of((0,))[0][empty])
    # The candidate acts on the first joint only: what is left of it elsewhere is the model's answer to it.
    _, place = dense_rows(model, candidates[0])
    answer = basis_of(model) @ found.sums[0].T
    wanted = by_block(answer[:, 0] ** 2, place, len(model.owner))[empty]
    assert_allclose(found.columns[0, empty, 0, 0], wanted, rtol=1e-9, atol=1e-12 * found.sizes[0, 0])


@pytest.mark.parametrize("shared", [True, False])
def test_few_signals_are_solved_for_as_many_are_multiplied_by_the_inverse(shared: bool):
    model, _ = uneven_blocks(1)
    blocks, r = len(model.owner), model.root.shape[1]
    if shared:
        # What a block leaves to the others then has no small direction.
        model.__dict__["basis_products"] = 0.5 * model.basis_products / np.max(model.basis_products)
    signals = np.random.default_rng(3).standard_normal((1, blocks, 1, r))
    few = model.reaching(signals)
    assert "released" not in model.__dict__
    model.ready_for(r)
    wanted = np.einsum("gbkr,brs->gbks", signals, model.released)
    assert_allclose(few, wanted, rtol=0, atol=1e-12 * np.max(np.abs(wanted)))
    assert_allclose(model.reaching(signals), wanted, rtol=0, atol=1e-12 * np.max(np.abs(wanted)))


def test_with_other_folds_nothing_is_made_again():
    model, candidates = uneven_blocks(0)
    found = products_of(model, candidates[:1])
    other = model.with_folds(model.fold // 2)
    assert other.folds == 2
    assert model.folds == 4
    kept = [name for name in vars(model) if name not in ("fold",)]
    assert "root" in kept
    assert all(getattr(other, name) is getattr(model, name) for name in kept)
    again = products_of(other, candidates[:1])
    assert_allclose(again.scores, found.scores, rtol=0, atol=0)
