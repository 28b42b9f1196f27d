"""What a design tells."""

from __future__ import annotations

from tests.results import Results


def test_a_design_tells_its_limits_and_motion(results: Results):
    design = results.design
    text = design.summary()
    assert all(each.name in text for each in design.reached)
    frame = design.to_frame()
    assert frame.columns[:4] == ["time", "joint1.position", "joint1.velocity", "joint1.acceleration"]
    assert frame["time"].to_list()[-1] == 5.0
    assert design.plot().axes
