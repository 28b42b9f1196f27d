"""The page of a diagnosis."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from scara_ident.report.diagnosis import diagnosis_dict
from scara_ident.report.html import diagnosis as page_module
from scara_ident.report.html.diagnosis import DiagnosisContext, _interval_table, _verdict
from tests.report.html.document import data_of, document


@pytest.mark.slow
def test_a_diagnosis_tells_the_story_from_effect_to_gain(diagnosed):
    found = document(diagnosed)
    shown = [name for name in found.sections if name not in ("tentative", "variation")]
    assert shown[:8] == ["gain", "story", "next", "left", "evidence", "torque-section", "candidates", "limits"]
    assert {"effect-1-view", "effect-1-own", "effect-1-time", "torque"} <= set(found.figures)
    assert "1. spring on joint1" in found.words
    assert "Explained: the model lacked spring on joint1" in found.words
    # What the model absorbs on any data stands in its own table, and not among what to do next.
    assert "or what absorbs it" not in found.words
    assert "Effects that the model absorbs on any data" in found.words


@pytest.mark.slow
def test_the_residual_before_follows_what_the_effect_adds(diagnosed):
    """On the added-variable plot the slope of the residual is 1 before and 0 after."""
    data = data_of(diagnosed)
    layers = data["figures"]["effect-1-own"]["variants"][""]["panels"][0]["layers"]
    lines = {layer["name"]: layer for layer in layers if layer["t"] == "line"}
    slopes = {}
    for name in ("residual before", "residual after"):
        pairs = [(x, y) for x, y in zip(lines[name]["x"], lines[name]["y"], strict=True) if y is not None]
        slopes[name] = np.polyfit(*np.array(pairs).T, 1)[0]
    assert slopes["residual before"] == pytest.approx(1.0, abs=0.2)
    assert slopes["residual after"] == pytest.approx(0.0, abs=0.2)


@pytest.mark.slow
def test_above_the_residual_stands_the_law_of_the_effect_and_what_is_measured_of_it(diagnosed):
    """The spring of 0.05 N m/rad is a line of that slope, although the base model had bent to stand for it."""
    data = data_of(diagnosed)
    panels = data["figures"]["effect-1-view"]["variants"][""]["panels"]
    assert [panel["label"] for panel in panels] == ["torque [N m]", "residual [N m]"]
    for name in ("the effect as found", "measured minus the rest of the model"):
        (layer,) = [layer for layer in panels[0]["layers"] if layer.get("name") == name]
        pairs = [(x, y) for x, y in zip(layer["x"], layer["y"], strict=True) if y is not None]
        assert np.polyfit(*np.array(pairs).T, 1)[0] == pytest.approx(0.05, abs=0.01)


def test_the_bars_of_the_headline_are_the_numbers_of_the_json(diagnosed, diagnosis):
    """Before and after on held-out recordings, to every digit."""
    content = diagnosis_dict(diagnosis)["validation"]
    shown = re.findall(r'data-gain="(\w+)" data-before="([^"]+)" data-after="([^"]+)"', diagnosed.read_text())
    assert [joint for joint, *_ in shown] == list(content["before"]) == ["joint1", "joint2"]
    for joint, *pair in shown:
        told = [content[when][joint] for when in ("before", "after")]
        np.testing.assert_allclose([float(value) for value in pair], told, rtol=1e-9)
    words = document(diagnosed).words
    assert words.index("held-out recordings, without and with the effects found") < words.index("Before and after")


def test_a_joints_name_stays_whole_in_the_verdict(diagnosis):
    effect = replace(diagnosis.effects[0], effect="torque_ripple", joint="shoulder_pan_joint")
    first, *_ = _verdict(replace(diagnosis, effects=(effect,)), ())
    assert "torque ripple on shoulder_pan_joint" in first


def test_intervals_are_all_listed_with_how_sure_their_ends_are():
    """The words name three at the most."""
    table = _interval_table(
        [
            {"recording": "a_1", "from": 0.0, "from_std": 0.0, "to": 2.5, "to_std": 0.02},
            {"recording": "b_1", "from": 1.25, "from_std": 0.3, "to": 9.0, "to_std": 0.0},
        ]
    )
    assert [list(row[1:]) for row in table.rows] == [["its begin", "2.50 ± 0.02"], ["1.25 ± 0.3", "its end"]]


def test_what_is_made_elsewhere_is_waited_for_after_what_to_do_next(diagnosis, monkeypatch):
    order: list[str] = []
    original = page_module.next_steps
    monkeypatch.setattr(page_module, "next_steps", lambda found: (order.append("next"), original(found))[1])
    context = DiagnosisContext(diagnosis, lambda: order.append("worth"))
    context.make_ready()
    assert order == []
    assert context.content["next"] and context.content["worth"] is None
    assert order == ["next", "worth"]
