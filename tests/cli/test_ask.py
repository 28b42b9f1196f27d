"""``scara-ident ask``: the first step of the loop, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from scara_ident import asking

QUICK = ("--starts", "1", "--duration", "4", "--model", "basic")


@pytest.mark.slow
def test_an_empty_folder_asks_for_a_first_motion(command, steps, tmp_path: Path):
    (tmp_path / "arm").mkdir()
    (tmp_path / "arm" / "run_1.csv").write_text("time\n")
    result = command("ask", tmp_path / "arm", *QUICK, "--tool-speed", "0.5")
    assert "run_1.csv is beside recordings/ and is not read" in result.out
    assert steps[0] == "designing: search 1" and steps[-1].endswith(" done")
    assert result.status == 0 and "There are no recordings yet" in result.out
    assert "Collisions were not checked" in result.out + result.err
    assert (tmp_path / "arm" / "next" / "trajectory.csv").is_file()
    limit = json.loads((tmp_path / "arm" / "next" / "excitation.json").read_text())["limits"]["tool.speed"]
    assert limit["bound"] == 0.5 and limit["share"] <= 1.0
    assert json.loads((tmp_path / "arm" / "ask.json").read_text())["state"] == "record"


def test_what_was_found_is_said_before_what_to_record(command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Of a gear's loss that was found it said that no motion would tell more, and nothing else."""
    (tmp_path / "recordings").mkdir()
    (tmp_path / "recordings" / "run_1.csv").write_text("time\n")
    done = asking.Asked("", "settled", "Nothing is open.")
    monkeypatch.setattr(asking, "ask", lambda *_: done)
    assert command("ask", tmp_path).out.strip() == "Nothing is open."
    found = [{"effect": "spring", "joint": "joint1"}]
    content = {"verdict": "explained", "model": "basic", "next": [], "effects": found}
    (tmp_path / "diagnosis.json").write_text(json.dumps(content))
    said = " ".join(command("ask", tmp_path).out.split())
    assert said.startswith("So far: explained, found spring on joint1; the full report is ") and said.endswith(
        "Nothing is open."
    )


def test_a_folder_that_is_not_there_is_not_made(command, tmp_path: Path):
    for more in ((), ("--virtual",)):
        result = command("ask", tmp_path / "arn", *QUICK, *more)
        assert result.status == 2 and "arn: no such folder; create it" in result.err
    assert list(tmp_path.iterdir()) == []


def test_a_file_in_the_place_of_the_recordings_is_said(command, tmp_path: Path):
    (tmp_path / "recordings").write_text("none")
    result = command("ask", tmp_path, *QUICK)
    assert result.status == 2 and "recordings: is a file" in result.err
    assert [path.name for path in tmp_path.iterdir()] == ["recordings"]


def test_effects_are_those_of_the_virtual_arm(command, tmp_path: Path):
    assert "--virtual" in command("ask", tmp_path, "--effect", "spring").err
