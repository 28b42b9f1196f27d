"""Standard deviations from few draws are widened as Student's t asks."""

from __future__ import annotations

import pytest

from scara_ident.estimation.student_t import widening


@pytest.mark.parametrize(("freedom", "wider"), [(1, 6.353), (2, 2.151), (8, 1.153), (10**6, 0.98)])
def test_few_draws_are_widened_as_students_t_asks(freedom: float, wider: float):
    assert widening(freedom) == pytest.approx(wider, abs=1e-3)
