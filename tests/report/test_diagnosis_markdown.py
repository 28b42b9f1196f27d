"""The story in Markdown."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scara_ident.diagnosis.selection.tentative import TentativeEffect
from scara_ident.estimation.run_variation import JointVariation, RunVariation
from scara_ident.identification.events import Event
from scara_ident.report.diagnosis import diagnosis_dict
from scara_ident.report.diagnosis_markdown import diagnosis_markdown


def test_the_story_has_both_tables_and_the_candidates_that_chance_does_not_explain(result):
    text = diagnosis_markdown(result)
    assert text.startswith("# Diagnosis of scara03: explained\n")
    assert "## Error on the training recordings" in text
    assert "## Error on the validation recordings" in text
    assert " % of the time, at rest, at reversals and" in text
    assert "### joint_elasticity on joint1\n" in diagnosis_markdown(result, [("joint_elasticity on joint1", "one.png")])
    content = diagnosis_dict(result)
    sure, by_chance = (
        {**content["candidates"][0], "label": name, "p_value": p} for name, p in (("x", 0.3), ("y", 1.0))
    )
    whole = diagnosis_markdown(result, content={**content, "candidates": [sure, sure]})
    assert whole.count("| x | ") == 2
    assert "no better than chance" not in whole
    folded = diagnosis_markdown(result, content={**content, "candidates": [sure, by_chance, by_chance]})
    assert "| x | " in folded
    assert "| y | " not in folded
    assert "| 2 others |  |  |  | not believed: no better than chance, see diagnosis.json |" in folded


def test_what_is_tentative_what_is_noise_and_how_runs_differ_stand_in_the_story(result):
    guess = TentativeEffect("stribeck", "joint1", "d", "helps in only 1 of 2", "slow motion", 0.0712, 3e-4)
    variation = RunVariation((JointVariation(np.ones((4, 4)), np.array([0.06, 0.0, 0.0, 0.003]), np.array([[0.0] * 3 + [late] for late in (-0.003, 0.0, 0.003)]), 0.01, np.array([0, 1, 2, 4]), np.zeros((3, 4))), None))  # fmt: skip
    changed = replace(result, tentative=(guess,), after=replace(result.after, variation=variation))
    content, text = diagnosis_dict(changed), diagnosis_markdown(changed)
    assert content["run_variation"] == {"joint1": {"friction": 0.06, "delay": 0.003}}
    assert "| stribeck | joint1 | 7.12% | 3.0e-04 | helps in only 1 of 2 | slow motion |" in text
    assert "| joint1 | friction | 0.06 | 1 |\n| joint1 | delay | 0.003 | s |" in text
    pushed = replace(result, events=(Event("A_1", 1.0, 2.0, ("joint1", "joint2"), 0.6, "push", sizes=(0.6, 16.0)),))
    assert "| A_1 | 1.00 | 2.00 | joint2, joint1 | 16 N m, 0.6 N m | push |" in diagnosis_markdown(pushed)
    for joint, row in content["evidence"].items():
        shown = "yes" if row["noise"] else "no"
        assert f"| {joint} | {shown} | {row['by'] or '-'} | {row['detection_limit']:.1%} | {row['why']} |" in text
    assert "How runs differ" not in diagnosis_markdown(replace(changed, after=replace(result.after, variation=None)))
