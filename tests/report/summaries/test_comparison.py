"""What a comparison tells."""

from __future__ import annotations

import pytest

from tests.results import Results


@pytest.mark.slow
def test_a_comparison_tells_every_error(results: Results):
    found = results.comparison
    frame = found.to_frame()
    assert frame.shape == (8, 5)
    assert frame["rms"].to_list()[1] == found.errors[0, 0, 1]
    assert "joint2: rms error (what noise explains), parameters from" in found.summary()
    assert len(found.plot().axes) == 2
