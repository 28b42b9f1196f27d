"""What a diagnosis tells."""

from __future__ import annotations

import numpy as np
import pytest

from tests.results import Results


def test_a_diagnosis_tells_the_effect_and_its_parameters(results: Results):
    found = results.diagnosis
    text = found.summary()
    assert f"scara03: {found.verdict}" in text
    assert "Found spring on joint1" in text
    frame = found.to_frame()
    assert frame["effect"].to_list() == ["spring", "spring"]
    stiffness, _ = frame.rows(named=True)
    assert stiffness["value"] == found.effects[0].parameters["stiffness"].value
    assert found.plot().axes


def test_it_predicts_with_the_effect(results: Results):
    found = results.diagnosis
    assert found.not_predicted == ()
    q, v, a = np.zeros((3, 2))
    moved = found.predict([1.0, 0.0], v, a) - found.predict(q, v, a)
    assert moved == pytest.approx([found.to_frame()["value"][0], 0.0], abs=1e-3)
