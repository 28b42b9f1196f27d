"""Torque and residual over time are those of the estimate."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.motion.low_pass import low_pass
from scara_ident.report.traces import kept, traces
from tests.report.simulated import made, resting, run


@pytest.mark.slow
@pytest.mark.parametrize("bands", [(15.0, 15.0), (8.0, 20.0), (6.0, None), (None, None)])
@pytest.mark.parametrize("still", [False, True])
def test_the_residual_that_is_drawn_has_the_rms_that_is_printed(bands, still):
    """On the rows of the estimate: no sample within the ends or at rest, and of the others one per step of the band."""
    recordings = [resting("R_1", 1), run("CI_1", 3, start=4.0, still=still)]
    result = made(recordings, bands=bands)
    for found, item in zip(traces(result.training, result.estimate.value), result.training.each, strict=True):
        for j, error in enumerate(result.estimate.errors(item)):
            left = kept(found, [trace.residual[j] for trace in found], j)
            if error is None:
                assert len(left) == 0
                continue
            assert np.sqrt(np.mean(left**2)) == pytest.approx(error.rms, rel=1e-9)
            raw = np.concatenate([trace.raw_residual[j][trace.used[j]] for trace in found])
            assert np.sqrt(np.mean(raw**2)) == pytest.approx(error.rms_unfiltered, rel=1e-9)


def test_the_residual_is_that_of_the_model_faded_out_towards_rest_within_the_band():
    result = made([resting("R_1", 1)], bands=[15.0, 15.0])
    ((trace,),) = traces(result.training, result.estimate.value)
    (part,) = result.training.data.stretches
    regressor = result.model.regressor(part.motion)
    for j, torque in enumerate(part.torque):
        expected = low_pass(part.fade[j] * (torque - result.estimate.value @ regressor[j]), part.rate, 15.0)
        # The filter at the rows leaves out what is beyond eight times the band, some 1e-8.
        np.testing.assert_allclose(trace.residual[j], expected, atol=1e-8 * np.max(np.abs(torque)))
        # Near rest the fade makes it another than the difference of the torques that are drawn.
        difference = trace.measured[j] - trace.predicted[j]
        assert np.max(np.abs(trace.residual[j] - difference)[trace.used[j]]) > 1e-3 * np.max(np.abs(difference))
