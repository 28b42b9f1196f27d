"""What a recording tells."""

from __future__ import annotations

from tests.results import Results


def test_a_recording_tells_its_size_and_signals(results: Results):
    run = results.runs[0].recording
    assert "OJD_1" in run.summary()
    assert run.to_frame()["joint1.effort"].to_list() == run.effort[0].tolist()
    assert [axes.get_ylabel() for axes in run.plot().axes] == ["position [rad or m]", "effort [N m or N]"]
