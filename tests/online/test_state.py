"""The memory against dense least squares, and what is forgotten."""

from __future__ import annotations

import numpy as np

from scara_ident.online.state import Memory


def rows(seed: int, count: int = 40, parameters: int = 4) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal((count, parameters + 1))


def test_what_was_absorbed_in_parts_is_least_squares_of_all():
    memory = Memory.empty(4)
    assert not memory.determined
    memory = memory.absorbed(rows(0)[:2])
    assert not memory.determined and memory.factor.shape == (4, 5)
    memory = memory.absorbed(rows(0)[2:]).absorbed(rows(1))
    table = np.vstack([rows(0), rows(1)])
    assert memory.determined
    np.testing.assert_allclose(memory.value(), np.linalg.lstsq(table[:, :-1], table[:, -1], rcond=None)[0], rtol=1e-12)


def test_solving_back_goes_on_from_solving():
    memory, new = Memory.empty(4).absorbed(rows(0)), rows(1)[:, :-1]
    y = np.arange(4.0)
    np.testing.assert_allclose(new @ memory.solved_back(y), memory.solved(new).T @ y, rtol=1e-10)


def test_exponential_forgetting_weighs_what_is_old():
    memory = Memory.empty(4).absorbed(rows(0)).forgotten(0.5, rows(1), "exponential").absorbed(rows(1))
    table = np.vstack([np.sqrt(0.5) * rows(0), rows(1)])
    np.testing.assert_allclose(memory.value(), np.linalg.lstsq(table[:, :-1], table[:, -1], rcond=None)[0], rtol=1e-12)
    same = memory.forgotten(0.5, rows(1), "none")
    assert same is memory


def test_directional_forgetting_forgets_where_new_rows_tell_and_keeps_the_estimate():
    memory = Memory.empty(4).absorbed(rows(0))
    new = 10.0 * rows(1)
    new[:, 2:4] = 0.0
    after = memory.forgotten(0.5, new, "directional")
    np.testing.assert_allclose(after.value(), memory.value(), rtol=1e-10)
    before, left = (m.factor[:, :-1].T @ m.factor[:, :-1] for m in (memory, after))
    # In the metric of what is known, half is lost in the two directions that the new rows tell of, nothing in the others.
    shares = np.linalg.eigvals(np.linalg.solve(before, left)).real
    np.testing.assert_allclose(np.sort(shares), [0.5, 0.5, 1.0, 1.0], rtol=1e-9)
    full = memory.forgotten(0.5, 100.0 * rows(2), "directional").factor
    np.testing.assert_allclose(full.T @ full, 0.5 * memory.factor.T @ memory.factor, rtol=1e-9)


def test_a_motion_that_tells_nothing_forgets_nothing():
    memory = Memory.empty(4).absorbed(rows(0))
    quiet = 1e-9 * rows(1)
    kept = memory
    for _ in range(50):
        kept = kept.forgotten(0.9, quiet, "directional").absorbed(quiet)
    np.testing.assert_allclose(np.abs(kept.factor[:, :-1]), np.abs(memory.factor[:, :-1]), rtol=1e-9, atol=1e-12)
    assert Memory.empty(4).forgotten(0.9, quiet, "directional").factor.shape == (4, 5)


def test_what_is_known_never_grows_less():
    memory = Memory.empty(4).absorbed(rows(0))
    for seed in range(1, 10):
        new = 0.1 * rows(seed, 3)
        after = memory.forgotten(0.5, new, "directional").absorbed(new)
        gain = after.factor[:, :-1].T @ after.factor[:, :-1] - memory.factor[:, :-1].T @ memory.factor[:, :-1]
        assert np.linalg.eigvalsh(gain)[0] > -1e-9
        memory = after
