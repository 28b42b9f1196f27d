"""What an estimate tells."""

from __future__ import annotations

from tests.results import Results


def test_an_estimate_tells_its_parameters(results: Results):
    estimate = results.identification.estimate
    text = estimate.summary()
    assert text.startswith("scara03: complete model by wls\n")
    assert all(name in text for name in estimate.model.names)
    frame = estimate.to_frame()
    assert frame.columns == ["name", "joint", "value", "std", "urdf", "unit", "undetermined", "meaning"]
    assert frame["std"].to_list() == estimate.std.tolist()
    assert [text.get_text() for text in estimate.plot().axes[0].get_xticklabels()] == list(estimate.model.names)
