"""Words on a command line, and the files that they stand for."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest

from scara_ident.errors import RecordingError, UsageError
from scara_ident.recording.paths import distinct_names, recording_paths
from scara_ident.recording.recording import read_recording, read_recordings
from tests.made_recordings import columns, save
from tests.recording.made import csv_lines, write_text


def test_words_are_files_folders_and_globs_in_order_of_appearance_and_once(tmp_path, monkeypatch):
    made = columns(60)
    for name in ("OJD_10.parquet", "OJD_2.parquet", "OJD_1.csv", "CI_1.parquet"):
        save(tmp_path / name, made)
    (tmp_path / "robot.yaml").write_text("urdf: a.urdf\n")
    (tmp_path / ".OJD_3.parquet.77.partial").write_text("")
    (tmp_path / "deeper").mkdir()
    save(tmp_path / "deeper" / "F_1.parquet", made)
    monkeypatch.chdir(tmp_path)

    def names(*words: str | Path) -> list[str]:
        return [path.stem for path in recording_paths(words)]

    assert names(".") == ["CI_1", "OJD_1", "OJD_2", "OJD_10"]
    assert names("OJD_*") == ["OJD_1", "OJD_2", "OJD_10"]
    assert names("*") == ["deeper", "CI_1", "OJD_1", "OJD_2", "OJD_10"] or set(names("*")) == {
        "CI_1",
        "OJD_1",
        "OJD_2",
        "OJD_10",
        "F_1",
    }
    assert names("OJD_10.parquet", ".", "OJD_*.parquet", tmp_path / "deeper") == [
        "OJD_10",
        "CI_1",
        "OJD_1",
        "OJD_2",
        "F_1",
    ]
    assert names("**/F_1.parquet") == ["F_1"]
    assert names() == []
    assert recording_paths("OJD_*") == recording_paths(["OJD_*"])


def test_a_file_with_the_signs_of_a_glob_in_its_name_is_that_file(robot, tmp_path):
    save(tmp_path / "run[1]_1.parquet", columns(60))
    save(tmp_path / "run1_1.parquet", columns(70))
    (found,) = read_recordings([tmp_path / "run[1]_1.parquet"], robot)
    assert len(found.time) == 60
    text = tmp_path / "run[2]_1.csv"
    write_text(text, csv_lines(80))
    assert len(read_recording(text, robot).time) == 80


def test_words_that_name_nothing_are_bad_usage_and_places_without_recordings_an_error(tmp_path):
    with pytest.raises(UsageError, match=r"absent\.parquet"):
        recording_paths([tmp_path / "absent.parquet"])
    with pytest.raises(UsageError, match="no file matches"):
        recording_paths([str(tmp_path / "*.parquet")])
    (tmp_path / "robot.yaml").write_text("")
    with pytest.raises(RecordingError, match=r"no \.parquet or \.csv file in this folder"):
        recording_paths([tmp_path])
    with pytest.raises(RecordingError, match=r"no \.parquet or \.csv file"):
        recording_paths([str(tmp_path / "*")])


def test_a_folder_of_folders_says_the_word_that_takes_them(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for place in ("runs [1]/26", "runs [1]/27", "deep/a/b"):
        Path(place).mkdir(parents=True)
        save(Path(place) / "OJD_1.parquet", columns(60))
    for folder, count in (("runs [1]", 2), ("deep", 1)):
        with pytest.raises(RecordingError, match=r"folders inside are not searched: .* takes") as caught:
            recording_paths([folder])
        (word,) = shlex.split(str(caught.value).partition("searched: ")[2].partition(" takes")[0])
        assert len(recording_paths([word])) == count


def test_two_files_of_one_name_in_a_folder_are_refused_by_both_names(tmp_path):
    save(tmp_path / "OJD_1.parquet", columns(60))
    save(tmp_path / "OJD_1.csv", columns(60))
    with pytest.raises(RecordingError) as caught:
        recording_paths([tmp_path])
    assert str(tmp_path / "OJD_1.parquet") in str(caught.value)
    assert str(tmp_path / "OJD_1.csv") in str(caught.value)


@pytest.mark.parametrize(
    ("paths", "names"),
    [
        (["a/OJD_1.csv", "b/OJD_2.csv"], ("OJD_1", "OJD_2")),
        (["a/OJD_1.csv", "b/OJD_1.csv", "b/OJD_2.csv"], ("a/OJD_1", "b/OJD_1", "OJD_2")),
        (["a/x/OJD_1.csv", "b/x/OJD_1.csv", "b/y/OJD_1.csv"], ("a/x/OJD_1", "b/x/OJD_1", "y/OJD_1")),
        (["/OJD_1.csv", "/x/OJD_1.csv", "/y/x/OJD_1.csv"], ("OJD_1", "x/OJD_1", "y/x/OJD_1")),
    ],
)
def test_recordings_of_one_name_are_reported_by_their_folders(paths, names):
    assert distinct_names([Path(path) for path in paths]) == names
