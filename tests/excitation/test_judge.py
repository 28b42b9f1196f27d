"""What a motion is worth: a glance says nearly what the whole judgement says."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from scara_ident.excitation.curves import make_basis
from scara_ident.excitation.judge import GLANCE_RATE, Judge
from scara_ident.excitation.limits import limits_of
from scara_ident.inquiry.answerability import Inquiry, inquire, known_rows
from scara_ident.inquiry.questions import Question, questions
from tests.inquiry.asked import open_diagnosis


@lru_cache
def below_the_limit() -> Inquiry:
    """Of a spring and a tilt, neither in the model, and each of a size that recordings hardly show."""
    found = open_diagnosis()
    suspects = questions(found)[0].suspects
    faint = tuple(replace(item, value=tuple(0.05 * x for x in item.value)) for item in suspects)
    inquiry = replace(inquire(found, [Question("below_limit", "which", faint)]), in_model=())
    return replace(inquiry, known=known_rows(inquiry, inquiry.columns))


def judge_of(inquiry: Inquiry) -> Judge:
    return Judge(inquiry, make_basis(6.0, 6), np.zeros(2))


def drawn(count: int) -> list[np.ndarray]:
    """Motions of all speeds up to the limits."""
    random, basis = np.random.default_rng(3), make_basis(6.0, 6)
    speed = limits_of(open_diagnosis().before.model.robot).velocity[:, None]
    rows = basis.rows(np.linspace(0.0, 6.0, 400), 1)
    found = []
    for share in np.geomspace(0.05, 1.0, count):
        x = random.normal(size=(2, basis.size))
        found.append((share * speed * x / np.max(np.abs(x @ rows.T), axis=1, keepdims=True))[None])
    return found


@pytest.mark.slow
def test_a_glance_at_motions_says_which_is_better_as_the_whole_judgement_does():
    judge = judge_of(below_the_limit())
    looked, judged = (np.array([work(x) for x in drawn(12)]) for work in (judge.glance, judge.cost))
    assert np.ptp(judged) > 1.5
    assert np.corrcoef(looked, judged)[0, 1] > 0.995
    # The best at a glance is all but the best.
    assert judged[np.argmin(looked)] < np.min(judged) + 0.1


def test_a_glance_sees_as_much_of_what_turns_fast_within_a_wide_band():
    inquiry = below_the_limit()
    assert judge_of(replace(inquiry, bands=(10.0, 10.0)))._glance_rate == GLANCE_RATE
    assert judge_of(replace(inquiry, bands=(10.0, 60.0)))._glance_rate == pytest.approx(300.0)
    assert judge_of(replace(inquiry, bands=(10.0, None)))._glance_rate == 500.0


def test_a_glance_leaves_out_what_the_recordings_say_little_for():
    inquiry = below_the_limit()
    (question,) = inquiry.questions
    spring, tilt = question.suspects
    for odds, kept in ((1.0, 2), (30.0, 1)):
        asked = replace(question, suspects=(replace(spring, odds=odds), tilt))
        judge = judge_of(replace(inquiry, questions=(asked, Question("parameter", "one", parameter="a01", size=1.0))))
        looked = judge._likely.inquiry
        assert [item.label for item in looked.suspects] == [item.label for item in (spring, tilt)[:kept]]
        assert [item.kind for item in looked.questions] == ["below_limit"] * kept + ["parameter"]
        assert looked.known.parameters == len(inquiry.scene.model.columns) + sum(
            len(item.value) for item in looked.suspects
        )
