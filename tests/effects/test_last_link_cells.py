"""Normal equations of a body in some cells, against dense least squares over the rows."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.effects.last_link_cells import MAX_CELLS, Cells, cells_of, duration_of
from scara_ident.effects.recording_groups import rows_of_last_link
from scara_ident.effects.signals import Scene
from scara_ident.model.offsets import offset_columns
from tests.effects.intervals import CYCLES, arms, runs, seen

SHOWN = (0, 1, 3)


@pytest.fixture(scope="module")
def known(tmp_path_factory: pytest.TempPathFactory) -> tuple[Scene, Cells, list[np.ndarray]]:
    robots = arms(tmp_path_factory.mktemp("arm"))
    scene, _ = seen(robots[0], runs(robots, CYCLES))
    cells = cells_of(scene, SHOWN)
    rng = np.random.default_rng(1)
    return scene, cells, [rng.uniform(0.0, 1.0, len(item.bounds) - 1).round() for item in cells.each]


def dense(scene: Scene, cells: Cells, states: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return all weighted rows: base model and offsets of each recording, the body where it acts, and the torque."""
    p, k, n = len(scene.value), len(SHOWN), scene.robot.n
    base, body, torque = [], [], []
    for run, (item, state) in enumerate(zip(cells.each, states, strict=True)):
        for motion, columns in scene.columns.items():
            if motion.name != item.name:
                continue
            time, sure, table = rows_of_last_link(scene, motion, columns, SHOWN)
            since = time - scene.start[item.name] + 0.25 / scene.band
            share = np.clip(len(state) * since / duration_of(scene, item.name), 0, len(state) - 1)
            acts = state[share.astype(int)]
            for joint, (rows, here) in enumerate(zip(table, sure, strict=True)):
                own = np.zeros((p + len(cells.each) * n, np.count_nonzero(here)))
                own[:p] = rows[:p, here]
                own[p + run * n + joint] = 1.0
                size = cells.weights[joint] ** 0.5
                base.append(size * own)
                body.append(size * rows[p:-1, here] * acts[here])
                torque.append(size * rows[-1, here])
    assert body[0].shape[0] == k
    return np.concatenate(base, axis=-1), np.concatenate(body, axis=-1), np.concatenate(torque)


def test_the_normal_equations_are_those_of_all_rows(known: tuple[Scene, Cells, list[np.ndarray]]):
    base, body, torque = dense(*known)
    # Of the base model and offsets what is left of the others.
    apart = np.concatenate([body, torque[None]])
    apart = apart - apart @ np.linalg.pinv(base) @ base
    squares, right, _ = known[1].normal(known[2])
    assert np.allclose(squares, apart[:-1] @ apart[:-1].T, rtol=1e-6)
    assert np.allclose(right, apart[:-1] @ apart[-1], rtol=1e-6, atol=1e-6 * np.max(np.abs(right)))


def test_scores_are_products_with_what_all_else_leaves(known: tuple[Scene, Cells, list[np.ndarray]]):
    scene, cells, states = known
    base, body, torque = dense(scene, cells, states)
    whole, *_ = dense(scene, cells, [np.ones_like(state) for state in states])[1:]
    size = np.array([0.4, 0.1, -0.05])
    found = np.linalg.lstsq(base.T, torque - size @ body, rcond=None)[0]
    left, made = torque - found @ base, size @ whole
    right, squares = cells.scores(states, cells.normal(states)[2], size)
    assert sum(float(np.sum(item)) for item in right) == pytest.approx(float(left @ made), rel=1e-6)
    assert sum(float(np.sum(item)) for item in squares) == pytest.approx(float(made @ made), rel=1e-9)


def test_many_bodies_at_once_are_as_each_alone(known: tuple[Scene, Cells, list[np.ndarray]]):
    _, cells, states = known
    rng = np.random.default_rng(2)
    several = [rng.uniform(0.0, 1.0, (4, len(state))).round() for state in states]
    bodies = rng.standard_normal((4, len(SHOWN)))
    together = cells.normal(several)
    seen, made = cells.scores(several, together[2], bodies)
    for k, body in enumerate(bodies):
        own = [item[k] for item in several]
        alone = cells.normal(own)
        for one, other in zip(alone, together, strict=True):
            assert np.allclose(one, other[k], rtol=1e-9, atol=1e-9 * np.max(np.abs(one)))
        for one, other in zip(cells.scores(own, alone[2], body), (seen, made), strict=True):
            for each, item in zip(one, other, strict=True):
                assert np.allclose(each, item[k], rtol=1e-9, atol=1e-9 * np.max(np.abs(each)))


def test_weights_are_one_over_what_least_squares_leaves(known: tuple[Scene, Cells, list[np.ndarray]]):
    """The estimate is that of all rows, and not of the means alone: a little more is left of these."""
    scene, cells, states = known
    base, _, torque = dense(scene, cells, states)
    left = torque - np.linalg.lstsq(base.T, torque, rcond=None)[0] @ base
    assert 0.8 * len(left) < np.sum(left**2) < 1.0001 * len(left)


def test_there_are_only_so_many_cells_and_offsets_are_of_each_recording(known: tuple[Scene, Cells, list[np.ndarray]]):
    scene, cells, _ = known
    assert sum(len(item.bounds) - 1 for item in cells.each) <= MAX_CELLS
    for column in offset_columns(scene.model):
        # What each recording has of its own the base model has no more.
        assert column is None or cells.aim[column] == pytest.approx(0.0, abs=1e-9 * np.max(np.abs(cells.aim)))
