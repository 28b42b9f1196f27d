"""Normal equations of a body in some cells, against dense least squares over the rows."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.effects.last_link_cells import MOST_CELLS, Cells, cells_of, duration_of
from scara_ident.effects.recording_groups import rows_of_last_link
from scara_ident.effects.signals import Scene
from scara_ident.model.offsets import offset_columns
from tests.effects.intervals import CYCLES, arms, runs, seen

SHOWN, WEIGHTS = (0, 1, 3), np.array([3.0, 7.0])


@pytest.fixture(scope="module")
def known(tmp_path_factory: pytest.TempPathFactory) -> tuple[Scene, Cells, list[np.ndarray]]:
    robots = arms(tmp_path_factory.mktemp("arm"))
    scene, _ = seen(robots[0], runs(robots, CYCLES))
    cells = cells_of(scene, SHOWN, list(scene.start), WEIGHTS)
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
            for joint, (time, rows) in enumerate(rows_of_last_link(scene, motion, columns, SHOWN)):
                active = scene.model.active[joint]
                table = np.zeros((p + len(cells.each) * n, len(time)))
                table[active] = rows[: len(active)]
                table[p + run * n + joint] = 1.0
                since = time - scene.start[item.name] + 0.25 / scene.band
                share = np.clip(len(state) * since / duration_of(scene, item.name), 0, len(state) - 1)
                size = WEIGHTS[joint] ** 0.5
                base.append(size * table)
                body.append(size * rows[len(active) : -1] * state[share.astype(int)])
                torque.append(size * rows[-1])
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
    right, squares = cells.scores(states, size)
    assert sum(float(np.sum(item)) for item in right) == pytest.approx(float(left @ made), rel=1e-6)
    assert sum(float(np.sum(item)) for item in squares) == pytest.approx(float(made @ made), rel=1e-9)


def test_there_are_only_so_many_cells_and_offsets_are_of_each_recording(known: tuple[Scene, Cells, list[np.ndarray]]):
    scene, cells, _ = known
    assert sum(len(item.bounds) - 1 for item in cells.each) <= MOST_CELLS
    for column in offset_columns(scene.model):
        # What each recording has of its own the base model has no more.
        assert column is None or cells.aim[column] == pytest.approx(0.0, abs=1e-9 * np.max(np.abs(cells.aim)))
