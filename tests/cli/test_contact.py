"""The command contact."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scara_ident.recording.recording import read_recording, write_recording
from scara_ident.robot.robot import load_robot
from tests.report.html.document import data_of, document
from tests.use.conftest import identified, result_file

__all__ = ["identified", "result_file"]


@pytest.fixture
def pushed(folder: Path, tmp_path: Path) -> Path:
    """The second run with a push from 5 to 6 s on both joints."""
    run = read_recording(folder / "OJD_2.parquet", load_robot())
    assert run.effort is not None
    inside = (run.time >= 5.0) & (run.time <= 6.0)
    path = tmp_path / "pushed.csv"
    write_recording(replace(run, effort=run.effort + np.array([[0.5], [0.2]]) * inside), path)
    return path


@pytest.mark.slow
def test_a_push_is_found_and_written(command, steps, folder: Path, result_file: Path, pushed: Path, tmp_path: Path):
    words = ["contact", pushed, result_file, "--free", folder / "OJD_1.parquet", "--free", folder / "OJD_2.parquet"]
    done = command(*words, "--output", tmp_path / "out")
    assert steps == [
        "reading the model and recordings", "taking thresholds", "looking for contact", "writing", "drawing contact.png",
        "drawing report.html",
    ]  # fmt: skip
    assert done.status == 0
    assert "1 contact in 12 s of motion" in done.out
    content = json.loads((tmp_path / "out" / "contacts.json").read_text())
    (contact,) = content["contacts"]
    assert contact["joints"][0] in ("joint1", "joint2")
    assert 5.0 <= contact["from"] < 5.2
    # It takes from the effort what it adds to the arm.
    assert np.all(np.array(contact["external_torque"]) < 0.0)
    page, data = document(tmp_path / "out" / "report.html"), data_of(tmp_path / "out" / "report.html")
    assert (page.wrong, page.open) == ([], [])
    assert sorted(data["figures"]) == sorted(page.figures) == ["external"]
    assert (tmp_path / "out" / "contact.png").stat().st_size > 10_000


@pytest.mark.slow
def test_json_alone_and_nothing_where_nothing_is(command, folder: Path, result_file: Path):
    done = command("contact", folder / "OJD_2.parquet", result_file, "--free", folder, "--json", "--rate", "10")
    assert (done.status, json.loads(done.out)["contacts"]) == (0, [])


def test_what_is_missing_is_one_line(command, folder: Path, result_file: Path):
    assert command("contact", folder / "OJD_2.parquet", result_file).status == 2
    assert command("contact", folder / "OJD_2.parquet", result_file, "--free", folder / "none.csv").status == 2


@pytest.mark.slow
def test_where_what_is_watched_is_in_the_thresholds_that_is_said(command, folder: Path, result_file: Path):
    """Its own contacts raised them, none was found, and nothing was said."""
    said = "given as free of contact; a contact in it would"
    words = ["contact", folder / "OJD_2.parquet", result_file, "--free", folder / "OJD_1.parquet", "--free"]
    answer = command(*words, folder / "OJD_2.parquet")
    assert answer.status == 0
    assert said in " ".join((answer.out + answer.err).split())
    other = command(*words, folder / "CI_1.csv")
    assert other.status == 0
    assert said not in " ".join((other.out + other.err).split())
