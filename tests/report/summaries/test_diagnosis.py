"""What a diagnosis tells."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.effects import Parameter
from scara_ident.report.summaries.diagnosis import tables
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
    assert np.isnan([stiffness["low"], stiffness["high"]]).all()
    assert found.plot().axes


def test_the_frame_has_the_ends_of_an_interval(results: Results):
    (effect,) = results.diagnosis.effects
    skewed = Parameter(3845.0, 1504.0, "N m/rad", symmetric_power=-1.0)
    found = replace(results.diagnosis, effects=(replace(effect, parameters={"stiffness": skewed}),))
    (row,) = found.to_frame().rows(named=True)
    assert (row["low"], row["high"]) == skewed.interval


def test_it_predicts_with_the_effect(results: Results):
    found = results.diagnosis
    assert found.not_predicted == ()
    q, v, a = np.zeros((3, 2))
    moved = found.predict([1.0, 0.0], v, a) - found.predict(q, v, a)
    assert moved == pytest.approx([found.to_frame()["value"][0], 0.0], abs=1e-3)


def test_candidates_no_better_than_chance_are_counted_and_not_named():
    errors = {"before": {"joint1": 0.2}, "after": {"joint1": 0.1}}
    tried = [
        {"label": f"effect {k}", "gain": 0.1, "p_value": p, "why": "because"}
        for k, p in enumerate((1e-9, 0.3, 1.0, 1.0))
    ]
    held = {"training": errors, "validation": errors, "candidates": tried, "left_out": {"training": {"joint1": 0.12}}}
    held["torque_units"] = {"joint1": "N m"}
    assert tables(held)[0].title == "rms error within the band [N m]"
    assert "12 % of the time, at rest," in str(tables(held)[0].caption)

    def labels(content: dict, *, everything: bool = False) -> list[str]:
        return list(tables(content, all_candidates=everything)[1].columns[0].cells)

    assert labels(held) == ["effect 0", "effect 1", "2 others"]
    assert labels({**held, "candidates": tried[2:]}) == ["2 others"]
    assert labels({**held, "candidates": tried[1:3]}) == ["effect 1", "1 other"]
    assert labels(held, everything=True) == [f"effect {k}" for k in range(4)]
    many = {**held, "candidates": 12 * tried[:1]}
    assert labels(many) == [*(8 * ["effect 0"]), "4 others"]
