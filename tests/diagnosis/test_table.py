"""The table holds the rows of the evidence, block by block."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from scara_ident.diagnosis.candidates import Bank, Candidate
from scara_ident.diagnosis.table import PARTS, tabulate, tabulate_candidates
from scara_ident.effects import Member
from scara_ident.effects.friction import Stribeck
from scara_ident.effects.position import Spring
from scara_ident.estimation.information import merge
from scara_ident.estimation.observations import gather_all
from scara_ident.model.model import TorqueModel
from tests.diagnosis.made import BANDS, complete, exact_runs, fitted, scene_of


@pytest.fixture(scope="module")
def model() -> TorqueModel:
    return complete()


@pytest.fixture(scope="module")
def table(model: TorqueModel):
    return tabulate(model, exact_runs(), BANDS)


def test_its_rows_are_those_of_the_evidence(model: TorqueModel, table):
    evidence = gather_all(model, exact_runs(), BANDS)
    for j in range(2):
        rows = table.rows[table.joint == j]
        factor = merge(item.joint(j) for item in evidence)
        wanted = np.column_stack([factor.regressor_factor, factor.projected_torque])
        assert_allclose((rows.T @ rows)[:-1], (wanted.T @ wanted)[:-1], atol=1e-9 * np.max(np.abs(rows.T @ rows)))


def test_blocks_follow_each_other_and_know_recording_and_fold(table):
    assert table.fold_names == ("A", "B")
    assert table.starts[0] == 0
    assert np.all(np.diff(table.starts) > 0)
    assert_array_equal(np.unique(table.recording), range(4))
    assert np.all(np.diff(table.recording) >= 0)
    assert_array_equal(table.fold, table.recording // 2)


def test_the_whole_factor_is_that_of_all_rows(table):
    assert_allclose(table.whole.T @ table.whole, table.rows.T @ table.rows, rtol=0, atol=1e-9 * np.sum(table.rows**2))


def test_weights_multiply_the_rows_of_their_joint(table):
    heavy = table.weighted(np.array([2.0, 3.0]))
    size = np.array([2.0, 3.0])[table.joint]
    assert_allclose(heavy.torque, size * table.torque)
    assert_allclose(heavy.columns, size[:, None] * table.columns)


def test_weights_of_the_fit_make_joints_equal(model: TorqueModel, table):
    estimate = fitted(model, exact_runs())
    rows = table.weighted(estimate.weights)
    residual = rows.torque - rows.columns @ estimate.value
    power = [np.mean(residual[rows.joint == j] ** 2) for j in range(2)]
    assert power[0] == pytest.approx(power[1], rel=0.02)
    plain = table.torque - table.columns @ estimate.value
    assert np.mean(plain[table.joint == 0] ** 2) > 3.0 * np.mean(plain[table.joint == 1] ** 2)


def test_parts_of_the_only_trajectory_are_its_folds(model: TorqueModel):
    table = tabulate(model, exact_runs()[:1], BANDS)
    assert table.fold_names == tuple(f"part {k}" for k in range(1, PARTS + 1))
    assert_array_equal(np.unique(table.fold), range(PARTS))
    assert np.all(np.diff(table.fold) >= 0)
    assert np.all(np.bincount(table.fold) >= 1)


def test_columns_of_candidates_stand_on_the_same_rows(model: TorqueModel, table):
    scene = scene_of(model, exact_runs())
    candidates = [Candidate(Spring(), Member(0)), Candidate(Stribeck(), Member(1, (0.2,)))]
    columns, places = tabulate_candidates(scene, candidates, exact_runs(), BANDS)
    assert places == (slice(0, 1), slice(1, 2))
    assert len(columns) == len(table.torque)
    assert not np.any(columns[table.joint == 1, 0])
    assert not np.any(columns[table.joint == 0, 1])
    assert np.all(np.any(columns != 0.0, axis=0))
    both = tabulate(
        TorqueModel("both", model.robot, (*model.terms, Bank(scene, tuple(candidates)))), exact_runs(), BANDS
    )
    assert_allclose(table.beside(columns).columns, both.columns, atol=1e-12)
