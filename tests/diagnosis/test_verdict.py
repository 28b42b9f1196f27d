"""The verdict: nothing is called noise that was not shown to be."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from scara_ident.diagnosis.criteria import CRITERIA
from scara_ident.diagnosis.evidence.evidence import Evidence
from scara_ident.diagnosis.evidence.standing_lines import StandingLine
from scara_ident.diagnosis.held_out.gain import HeldOutGain
from scara_ident.diagnosis.held_out.validation import validated
from scara_ident.diagnosis.model_selection import select_model
from scara_ident.diagnosis.selection.search import SearchTask
from scara_ident.diagnosis.verdict import verdict_of, weighed_evidence
from scara_ident.diagnosis.work import searching
from scara_ident.progress import Work, silent
from tests.diagnosis.made import observed, virtual_runs

SHOWN = Evidence("joint1", True, "whiteness", "", 0.1)
NONE = (None, None)
DOUBTED = replace(SHOWN, joint="joint2", shown=False)


@pytest.mark.parametrize(
    ("unexplained", "effects", "shown", "verdict"),
    [
        (None, (), (SHOWN, SHOWN), "complete"),
        (None, ("one",), (SHOWN, SHOWN), "explained"),
        (None, ("one",), (SHOWN, DOUBTED), "undecided"),
        (None, (), (DOUBTED, SHOWN), "undecided"),
        ("something", (), (SHOWN, SHOWN), "unexplained"),
        ("something", ("one",), (DOUBTED, SHOWN), "unexplained"),
    ],
)
def test_verdicts(unexplained, effects, shown, verdict):
    assert verdict_of(SimpleNamespace(unexplained=unexplained), effects, shown) == verdict


@pytest.mark.slow
def test_every_witness_is_heard():
    """Noise alone; then each of those held out, and an effect there, speaks against it."""
    training = observed(virtual_runs())
    task = SearchTask(training.model, (), CRITERIA, searching(Work(silent), band_given=True))
    outcome = select_model(task, training, free=False)
    held_out = validated(outcome, training.data)
    assert [item.shown for item in weighed_evidence(outcome, held_out, (), NONE, CRITERIA)] == [True, True]
    worse = tuple(replace(rows, table=np.vstack([rows.table[:-1], 3.0 * rows.table[-1:]])) for rows in training.joints)
    louder = replace(held_out, undisturbed=replace(held_out.undisturbed, joints=worse))
    shown = weighed_evidence(outcome, louder, (), NONE, CRITERIA)
    assert not any(item.shown for item in shown)
    assert all("on the held-out recordings is" in item.why for item in shown)
    effect = SimpleNamespace(
        label="spring of joint1", joint="joint1", held_out=HeldOutGain(-0.1, 0.0, 0.01, "joint2", 0.1, 0.2)
    )
    first, second = weighed_evidence(outcome, held_out, [effect], NONE, CRITERIA)
    assert first.shown
    assert not second.shown
    assert "spring of joint1 shows on the held-out recordings" in second.why
    line = StandingLine(0, 5.0, 0.1, 0.9, True, 0.0)
    first, second = weighed_evidence(outcome, held_out, (), (line, None), CRITERIA)
    assert not first.shown
    assert "a spectral line of 0.1 N m at 5 Hz" in first.why
    assert second.shown
