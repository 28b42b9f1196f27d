"""How far apart answers are: against dense least squares, and against what the diagnosis says itself."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from scara_ident.diagnosis.testing.candidate_tests import examine
from scara_ident.diagnosis.testing.selection_step import fitted_model
from scara_ident.errors import ScaraIdentError
from scara_ident.estimation.information import Information, merge
from scara_ident.inquiry.answerability import _View, inquire, inquiry_of
from scara_ident.inquiry.questions import Question, questions
from scara_ident.inquiry.shape import KNOTS
from scara_ident.robot.robot import load_robot
from tests.inquiry.asked import PAIR, open_diagnosis, small_runs


def left_of(spanning: np.ndarray, column: np.ndarray) -> float:
    """Squared norm of what is left of a column, by dense least squares."""
    return float(np.sum((column - spanning @ np.linalg.lstsq(spanning, column)[0]) ** 2))


def test_confounders_are_apart_by_what_neither_does_for_the_other():
    found = open_diagnosis()
    asked = questions(found)[:1]
    inquiry = replace(inquire(found, asked), known=None)
    spring, tilt = asked[0].suspects
    p = len(inquiry.scene.model.columns)
    wide = len(tilt.value) + len(tilt.candidate.effect.nonlinear)
    rng = np.random.default_rng(3)
    rows = [rng.normal(size=(80, p + len(spring.value) + wide)) for _ in range(2)]
    infos = [Information.empty(part.shape[1]).absorb(part, np.zeros(80)) for part in rows]
    table = np.vstack(rows)
    model, a, b = np.split(table, [p, p + len(spring.value)], axis=1)
    of_a = left_of(np.column_stack([model, b]), a @ spring.value)
    of_b = left_of(np.column_stack([model, a]), b[:, : len(tilt.value)] @ tilt.value)
    # What is known and further rows count alike, and the worse direction counts.
    sigma = replace(inquiry, known=infos[0]).sigmas(merge(infos))
    assert sigma[0] == pytest.approx(np.sqrt(min(of_a, of_b)), rel=1e-9)


def left_matrix(spanning, columns):
    left = columns - spanning @ np.linalg.lstsq(spanning, columns)[0]
    return left.T @ left


def test_an_effect_is_apart_from_none_by_what_the_model_leaves_of_it_and_a_parameter_by_its_std():
    found = open_diagnosis()
    tilt = questions(found)[0].suspects[1]
    name = found.before.model.names[0]
    asked = [Question("below_limit", "tilt or none", (tilt,)), Question("parameter", name, parameter=name, size=2.0)]
    inquiry = replace(inquire(found, asked), known=None)
    p, own = len(inquiry.scene.model.columns), 1
    width = p + own + len(tilt.value) + len(tilt.candidate.effect.nonlinear)
    rows = np.random.default_rng(4).normal(size=(90, width))
    sigma = inquiry.sigmas(Information.empty(width).absorb(rows, np.zeros(90)))
    model, b = rows[:, : p + own], rows[:, p + own : p + own + len(tilt.value)]
    assert sigma[0] == pytest.approx(np.sqrt(left_of(model, b @ tilt.value)), rel=1e-9)
    assert sigma[1] == pytest.approx(2.0 / np.sqrt(np.linalg.inv(model.T @ model)[0, 0]), rel=1e-9)
    # What is known says which coefficients would just have been seen; the mean variance over all of them counts.
    known = np.random.default_rng(5).normal(size=(40, width))
    inquiry = replace(inquiry, known=Information.empty(width).absorb(known, np.zeros(40)))
    before, after = inquiry.sigmas()[0], inquiry.sigmas(inquiry.known.absorb(rows, np.zeros(90)))[0]
    place = slice(p + own, p + own + len(tilt.value))
    first, both = (left_matrix(each[:, : p + own], each[:, place]) for each in (known, np.vstack([known, rows])))
    assert before**2 == pytest.approx(tilt.value @ first @ tilt.value, rel=1e-9)
    worse = np.trace(np.linalg.solve(both, first)) / len(first)
    assert after**2 == pytest.approx(before**2 / worse, rel=1e-9)


def test_of_several_that_may_be_there_the_usual_one_counts():
    found = open_diagnosis()
    pair = questions(found)[0].suspects
    faint = replace(pair[1], label="faint", value=tuple(1e-6 * x for x in pair[1].value))
    each = [Question("below_limit", item.label, (item,)) for item in (*pair, faint)]
    one, other, least, all_ = inquire(found, [*each, Question("below_limit", "all", (*pair, faint))]).sigmas()
    assert least < 1e-3 * one and all_ == pytest.approx(np.median([one, other, least]))


def test_a_remainder_is_as_sure_as_the_knots_of_a_free_curve():
    found = open_diagnosis()
    name = "position of joint2"
    asked = [Question("unexplained", "what is left", joint="joint2", signals=(name,), size=0.2)]
    inquiry = replace(inquire(found, asked), known=None)
    p, knots = len(inquiry.scene.model.columns), KNOTS
    width = p + 1 + knots
    rows = np.random.default_rng(5).normal(size=(90, width))
    sigma = inquiry.sigmas(Information.empty(width).absorb(rows, np.zeros(90)))
    model, hats = rows[:, : p + 1], rows[:, p + 1 :]
    left = hats - model @ np.linalg.lstsq(model, hats)[0]
    # A knot is known beforehand to be no larger than three times the rms.
    variance = np.diag(np.linalg.inv(left.T @ left + np.eye(knots) / 0.6**2))
    assert sigma[0] == pytest.approx(0.2 / np.sqrt(np.mean(variance)), rel=1e-9)
    # Where nothing reaches a knot, nothing more is known of it.
    assert inquiry.sigmas(Information.empty(width).absorb(0.0 * rows, np.zeros(90)))[0] == pytest.approx(1.0 / 3.0)


def test_the_separation_so_far_is_that_of_the_tests_of_the_diagnosis():
    found = open_diagnosis()
    spring = questions(found)[0].suspects[0]
    step = found.search.step
    (own,) = step.columns.rows(step.scene, [spring.candidate])
    torque = {joint: (np.array(spring.value) @ rows)[None] for joint, rows in own.items()}
    base = fitted_model(step.observations, [], found.after.weights, 4)
    std = np.sqrt(examine(base, [torque])[0].covariance[0, 0])
    sigma = inquire(found, [Question("below_limit", "spring or none", (spring,))]).sigmas()[0]
    # There the scatter of a dozen blocks is that of one direction, here of the median of many.
    assert 0.5 / std < sigma < 2.0 / std


def test_a_file_and_the_recordings_give_the_same_inquiry():
    from scara_ident.report.diagnosis import diagnosis_dict

    found = open_diagnosis()
    content = diagnosis_dict(found)
    again = inquiry_of(content, load_robot(), small_runs())
    texts = [item.text for item in questions(found)]
    assert [item.text for item in again.questions] == texts
    sigma = dict(zip((item.text for item in again.questions), again.sigmas(), strict=True))
    first = next(item for item in content["next"] if item["question"] == texts[0])
    assert sigma[texts[0]] == pytest.approx(first["sigma_before"], rel=1e-6)
    # Without the recordings what the file says of them counts, and of more rows the least that both tell together.
    alone = inquiry_of(content, load_robot())
    said = {item["question"]: item["sigma_before"] for item in content["next"] if item.get("kind")}
    assert alone.sigmas() == pytest.approx([said[text] for text in texts]) and said[PAIR] > 0.0
    both = alone.sigmas(again.known)
    assert both[texts.index(PAIR)] == pytest.approx(np.sqrt(2.0) * said[PAIR], rel=1e-6)
    with pytest.raises(ScaraIdentError, match="but the robot is scara03"):
        inquiry_of({**content, "robot": "ur5"}, load_robot())
    with pytest.raises(ScaraIdentError, match="no questions in it"):
        inquiry_of({"robot": "scara03"}, load_robot())


def test_a_suspect_of_which_nothing_would_have_been_seen_is_not_reported(monkeypatch: pytest.MonkeyPatch):
    """Of a run in which one joint of six moves: a mean over no directions, which is no number."""
    monkeypatch.setattr(_View, "left", lambda *_: np.ones((4, 2)))
    view = _View(SimpleNamespace(just_seen={"it": np.zeros((2, 0))}), np.zeros((0, 0)), np.zeros((0, 0)))
    assert view._from_none(SimpleNamespace(label="it")) == 0.0
