from __future__ import annotations

import numpy as np

from scara_ident.model.regressor.vectors import ZERO, cross, dot, floats, plus, scaled, vector


def test_vectors_of_numbers_do_what_numpy_does() -> None:
    x, y = np.random.default_rng(0).normal(size=(2, 3))
    assert dot(floats(x), floats(y)) == x[0] * y[0] + x[1] * y[1] + x[2] * y[2]
    np.testing.assert_allclose(cross(floats(x), floats(y)), np.cross(x, y), rtol=1e-14)
    np.testing.assert_array_equal(plus(floats(x), floats(y)), x + y)
    np.testing.assert_array_equal(scaled(floats(x), 2.0), 2.0 * x)
    assert plus(ZERO, vector(iter((1.0, 2.0, 3.0)))) == (1.0, 2.0, 3.0)
