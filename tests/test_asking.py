"""The loop in a folder: what it writes, that nothing new changes nothing, and that a run that was killed is gone on with."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from scara_ident import asking
from scara_ident.asking import (
    Asked,
    Settings,
    ask,
    key_of,
    progress_in_words,
    read_asked,
    still_open,
    unanswered_words,
    worth_recording,
)
from scara_ident.errors import ScaraIdentError
from scara_ident.excitation import Effort, limits_of
from scara_ident.excitation.promise import ExpectedAnswer, Shown
from scara_ident.inquiry.answerability import inquire
from scara_ident.inquiry.questions import Question, questions
from scara_ident.recording.recording import write_recording
from scara_ident.robot.robot import load_robot
from tests.excitation.designs import hurry
from tests.inquiry.asked import PAIR, open_diagnosis, small_runs

# All of the limits: so short a motion of so short a search tells too little within less.
QUICK = Settings(
    load_robot(),
    duration=4.0,
    effort=Effort(starts=1, rounds=0, processes=1),
    limits=limits_of(load_robot(), share=1.0),
)


class KilledError(Exception):
    """Stands for the end of the process."""


def contents(folder: Path) -> dict[str, tuple[bytes, int]]:
    return {
        path.relative_to(folder).as_posix(): (path.read_bytes(), path.stat().st_mtime_ns)
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Recordings, and a diagnosis of them that was made once."""
    (tmp_path / "recordings").mkdir()
    for item in small_runs():
        write_recording(item, tmp_path / "recordings" / f"{item.name}.parquet")
    monkeypatch.setattr(asking, "diagnose", lambda *_, **__: open_diagnosis())
    monkeypatch.setattr(asking, "diagnosis_report", lambda path, _: path.write_text("a report", encoding="utf-8"))
    return tmp_path


def test_what_the_diagnosis_came_to_is_reported_in_a_line(tmp_path: Path):
    content = {"verdict": "undecided", "model": "basic", "next": [], "effects": []}
    for effects, said in (
        ([], "no effect found"),
        (
            [{"effect": "spring", "joint": "joint1"}, {"effect": "base_tilt", "joint": None}],
            "found spring on joint1, base_tilt",
        ),
    ):
        (tmp_path / "diagnosis.json").write_text(json.dumps({**content, "effects": effects}))
        assert (
            progress_in_words(tmp_path) == f"So far: undecided, {said}; the full report is {tmp_path / 'report.html'}."
        )


@pytest.mark.slow
def test_a_killed_run_is_gone_on_with_and_a_second_one_touches_nothing(
    folder: Path, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
):
    def killed(*_: object, **__: object) -> None:
        raise KilledError

    hurry(monkeypatch)
    for name in ("write_json", "design_excitation", "write_joint_trajectory", "_promised"):
        with monkeypatch.context() as patch:
            patch.setattr(asking, name, killed)
            with pytest.raises(KilledError):
                ask(folder, QUICK)
    # What a process that could not clean up leaves.
    (folder / "next" / ".scara-ident-left").mkdir(parents=True)
    with monkeypatch.context() as patch:
        # Its recordings were diagnosed before it was killed.
        patch.setattr(asking, "diagnose", killed)
        found = ask(folder, QUICK)
    assert found.state == "record" and PAIR in found.words and found.asked[0] == PAIR
    once = contents(folder)
    named = {f"next/{name}" for name in asking.FILES} | {"diagnosis.json", "report.html", "ask.json"}
    assert set(once) == named | {f"recordings/{item.name}.parquet" for item in small_runs()}
    assert ask(folder, QUICK) == found == read_asked(folder)
    assert contents(folder) == once
    tells = json.loads((folder / "next" / "excitation.json").read_text())["tells"]
    assert tells[0]["question"] == PAIR and tells[0]["sigma_after"] > tells[0]["sigma_before"]
    promised = {item["question"]: item["sigma_after"] for item in tells}
    steps = json.loads((folder / "diagnosis.json").read_text())["next"]
    assert PAIR in promised and [item["sigma_after"] for item in steps] == [promised.get(x["question"]) for x in steps]
    # Without a stop in between it comes to the same.
    (folder / "ask.json").unlink()
    ask(folder, QUICK)
    again = contents(folder)
    assert (
        again["next/trajectory.csv"][0] == once["next/trajectory.csv"][0]
        and again["ask.json"][0] == once["ask.json"][0]
        and again["diagnosis.json"][0] == once["diagnosis.json"][0]
    )


def test_a_question_that_recordings_did_not_answer_is_not_asked_for_ever():
    first, *_ = questions(open_diagnosis())
    general = Question("parameter", "value of a", parameter="a", size=1.0)
    hidden = Question("below_limit", "what these recordings hardly show", first.suspects)
    inquiry = replace(inquire(open_diagnosis(), []), questions=(first, hidden, general))
    assert first in still_open(inquiry, "explained", {PAIR: 1})
    assert first not in still_open(inquiry, "explained", {PAIR: 2})
    assert (key_of(first), key_of(hidden), key_of(general)) == (PAIR, "below_limit", "parameter")
    once = {"parameter": 1, "below_limit": 1}
    assert still_open(inquiry, "explained", once) == [first]
    assert still_open(inquiry, "undecided", once) == [first, hidden, general]


def test_only_a_motion_that_makes_surer_is_recorded():
    one = Question("parameter", "a", parameter="a", size=1.0)
    told = [ExpectedAnswer(one, 1.0, 8.0), ExpectedAnswer(one, 1.0, 4.0), ExpectedAnswer(one, 7.0, 8.0)]
    assert worth_recording(told) == told[:1]
    first, *_ = questions(open_diagnosis())
    hidden = replace(first, kind="below_limit")
    faint = tuple(Shown(item, 0.5, {}) for item in hidden.suspects)
    told = [ExpectedAnswer(hidden, 1.0, 8.0, faint), ExpectedAnswer(hidden, 1.0, 8.0, faint[:1])]
    assert worth_recording(told) == told[1:]


def test_where_no_motion_tells_it_says_the_experiment_of_what_stays_hidden(
    folder: Path, monkeypatch: pytest.MonkeyPatch
):
    first = questions(open_diagnosis())[0]
    general = replace(first, kind="below_limit", text="what these hardly show", experiment="record another motion")
    faint = ExpectedAnswer(general, 1.0, 8.0, tuple(Shown(item, 0.5, {}) for item in general.suspects))
    design = type("Design", (), {"tells": (faint,)})()
    monkeypatch.setattr(asking, "design_excitation", lambda *_, **__: design)
    found = ask(folder, QUICK)
    assert found.state == "unanswered"
    assert found.words == (
        f"No motion of {QUICK.duration:g} s within the limits answers the open questions. "
        f"These experiments would: what these hardly show: {faint.remedy}."
    )
    assert general.suspects[0].candidate.effect.experiment in faint.remedy
    assert general.experiment not in faint.remedy


def test_where_a_longer_motion_tells_it_says_how_long_and_does_not_send_for_what_was_designed():
    first = questions(open_diagnosis())[0]
    one, other = (Question("parameter", f"value of {name}", parameter=name, size=1.0) for name in "ab")
    # The square of the standard errors grows with the time: (25 - 1) / (9 - 1) = 3 times as long.
    told = [ExpectedAnswer(one, 1.0, 3.0), ExpectedAnswer(other, 0.2, 0.8), ExpectedAnswer(first, 1.0, 1.0)]
    assert unanswered_words(told, 15.0) == (
        "No motion of 15 s within the limits answers the open questions. "
        "A longer one is expected to answer: value of a with --duration 45. "
        "One 10 times as long would not determine: value of b. "
        f"These experiments would: {first.text}: {first.experiment}."
    )


def test_where_nothing_is_open_it_says_so_and_no_motion_is_left(folder: Path, monkeypatch: pytest.MonkeyPatch):
    (folder / "next").mkdir()
    (folder / "next" / "trajectory.csv").write_text("an old one", encoding="utf-8")
    monkeypatch.setattr(asking, "still_open", lambda *_: [])
    assert ask(folder, QUICK).state == "settled"
    assert not (folder / "next" / "trajectory.csv").exists()


def test_a_recording_that_cannot_be_used_is_reported_each_time(folder: Path, monkeypatch: pytest.MonkeyPatch):
    """It was left out, and only the notes of the diagnosis said so."""
    (folder / "recordings" / "junk_1.csv").write_text("a,b\n1,2\n", encoding="utf-8")
    monkeypatch.setattr(asking, "still_open", lambda *_: [])
    first, again = ask(folder, QUICK), ask(folder, QUICK)
    assert first.left_out == again.left_out
    (note,) = first.left_out
    assert "junk_1.csv" in note
    assert note.endswith("left out")


def test_what_was_asked_counts_when_something_was_recorded_not_when_limits_are_others(
    folder: Path, monkeypatch: pytest.MonkeyPatch
):
    def designed(folder: Path, settings: Settings, recordings: object, asked: Asked, work: object) -> Asked:
        return asking._note(folder, replace(asked, state="settled", asked=(PAIR,)))

    monkeypatch.setattr(asking, "_designed", designed)
    assert ask(folder, QUICK).times == {}
    assert ask(folder, replace(QUICK, duration=5.0)).times == {}
    write_recording(replace(small_runs()[0], name="more_1"), folder / "recordings" / "more_1.parquet")
    assert ask(folder, replace(QUICK, duration=5.0)).times == {PAIR: 1}


def test_a_note_that_is_none_is_said(tmp_path: Path):
    (tmp_path / "ask.json").write_text("[]", encoding="utf-8")
    with pytest.raises(ScaraIdentError, match="remove it to begin again"):
        read_asked(tmp_path)
    assert read_asked(tmp_path / "nowhere") is None
    assert Asked("x").state is None


def test_other_limits_are_another_question():
    part = replace(QUICK, limits=limits_of(QUICK.robot, share=0.9))
    assert len({each.hash([]) for each in (QUICK, part, replace(part, limits=limits_of(QUICK.robot, floor=0.0)))}) == 3
    assert part.hash([]) == replace(part, limits=limits_of(load_robot(), share=0.9)).hash([])
