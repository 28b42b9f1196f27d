"""Small matrices at every sample, against a general solver."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.effects.matrices import MIN_EIGENVALUE, definite, inverse, times


def test_matrices_times_their_inverses_leave_vectors_as_they_are():
    rows = np.random.default_rng(1).standard_normal((4, 2, 50))
    root = np.random.default_rng(2).standard_normal((2, 2, 80))
    matrices = np.einsum("abn,cbn->acn", root, root) + 0.1 * np.eye(2)[..., None]
    assert times(inverse(matrices), times(matrices, rows)) == pytest.approx(rows)


@pytest.mark.parametrize("m", [1, 2, 3, 4])
def test_inverses_are_those_of_a_general_solver(m: int):
    rows = np.random.default_rng(m).standard_normal((m, m, 50)) + 3.0 * np.eye(m)[..., None]
    expected = np.moveaxis(np.linalg.inv(np.moveaxis(rows, 2, 0)), 0, 2)
    np.testing.assert_allclose(inverse(rows), expected, rtol=0, atol=1e-12 * np.abs(expected).max())


def test_eigenvalues_are_asked_of_those_mass_matrices_alone_that_are_nearly_singular(monkeypatch):
    """Of three elastic joints all at every sample took half of the time of a candidate."""
    rng = np.random.default_rng(5)
    root = rng.standard_normal((3, 3, 400))
    inertia = np.einsum("abn,cbn->acn", root, root) + 0.05 * np.eye(3)[..., None]
    size = np.sqrt(np.einsum("iin->in", inertia))
    least = np.linalg.eigvalsh(np.moveaxis(inertia / (size[:, None] * size), 2, 0))[:, 0]
    asked, solve = [], np.linalg.eigvalsh
    monkeypatch.setattr(np.linalg, "eigvalsh", lambda matrices: asked.append(len(matrices)) or solve(matrices))
    found = definite(inertia)
    assert asked == [np.count_nonzero(least <= MIN_EIGENVALUE)] and 0 < asked[0] < 100
    scaled = np.moveaxis(found / (size[:, None] * size), 2, 0)
    assert solve(scaled)[:, 0].min() > 0.99 * MIN_EIGENVALUE
    good = least > MIN_EIGENVALUE
    np.testing.assert_array_equal(found[..., good], inertia[..., good])
