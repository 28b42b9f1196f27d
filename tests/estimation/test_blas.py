"""Products and solutions of tall tables, against NumPy's."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.estimation.blas import add_products, solve_rows


@pytest.mark.parametrize("columns, rows", [(1, 1), (1, 9), (4, 3), (9, 200)])
def test_rows_are_solved_and_their_products_added(columns: int, rows: int) -> None:
    rng = np.random.default_rng(columns + rows)
    upper = np.asfortranarray(np.triu(rng.uniform(1.0, 2.0, (columns, columns))))
    table = rng.standard_normal((columns, rows))
    expected = np.linalg.solve(upper.T, table)
    solve_rows(upper, table)
    assert table == pytest.approx(expected, rel=1e-9, abs=1e-9)
    gram = np.asfortranarray(np.full((columns, columns), 7.0))
    add_products(table, gram)
    assert np.triu(gram) == pytest.approx(np.triu(7.0 + expected @ expected.T), rel=1e-9, abs=1e-9)
    # Only the upper half is written.
    assert np.all(np.tril(gram, -1) == np.tril(np.full((columns, columns), 7.0), -1))
