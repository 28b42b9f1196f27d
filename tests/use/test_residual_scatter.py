"""How much the residual scatters, against noise whose law is known."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.use.external_torque import FEATURES, Observed
from scara_ident.use.residual_scatter import residual_scatter
from tests.use.residuals import residual

HALF = np.linalg.cholesky([[1.0, 0.6], [0.6, 1.0]])


def correlated(seed: int) -> Observed:
    """Two joints of correlated noise."""
    return residual(seed, lambda rng, shape: HALF @ rng.standard_normal(shape), 600.0)


@pytest.mark.parametrize(("state", "size"), [(3, (3.0, 0.1)), (4, (1.0, 0.1))])
def test_second_moments_are_those_of_the_state(state: int, size: tuple[float, float]):
    scatter = residual_scatter([correlated(0), correlated(1)])
    features = np.zeros((2, len(FEATURES)))
    features[:, state] = 1.0
    covariance = scatter.covariance(features)
    assert np.sqrt(np.diag(covariance)) == pytest.approx(size, rel=0.1)
    assert covariance[0, 1] / np.sqrt(covariance[0, 0] * covariance[1, 1]) == pytest.approx(0.6, abs=0.05)
    np.testing.assert_allclose(covariance, covariance.T)


def test_in_a_state_that_was_not_seen_it_is_not_zero():
    scatter = residual_scatter([correlated(0)])
    assert np.all(np.diag(scatter.covariance(np.zeros((2, len(FEATURES))))) > 0.0)
