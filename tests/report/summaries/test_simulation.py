"""What a simulation tells."""

from __future__ import annotations

from tests.results import Results


def test_a_simulation_tells_what_was_hidden(results: Results):
    run = results.runs[0]
    assert "effects: Spring(joint='joint1'" in run.summary()
    assert "seed 0, repetition 1" in run.summary()
    assert run.to_frame().shape == run.recording.to_frame().shape
