"""What is asked of every file first, and what is said where it is not there."""

from __future__ import annotations

import builtins
import importlib

import numpy as np
import pytest

from scara_ident.recording.recording import read_recording
from scara_ident.robot.robot import load_robot
from tests.made_recordings import save
from tests.recording.files.formats import (
    DEGREE,
    write_plotjuggler,
)
from tests.recording.files.made import MADE, PLOTJUGGLER, described, stacked
from tests.recording.made import refusal


def test_a_missing_channel_is_named_with_the_key_to_correct(tmp_path):
    path = write_plotjuggler(tmp_path / "log.csv", MADE)
    wrong = described(tmp_path, PLOTJUGGLER.replace("{joint}/effort", "{joint}/torque"))
    message = refusal(path, wrong)
    assert "'/joint_states/joint1/torque'" in message
    assert "recording: effort" in message
    wrong = described(tmp_path, PLOTJUGGLER.replace("{joint}/velocity", "{joint}/speed"))
    assert "recording: velocity" in refusal(path, wrong)
    wrong = described(tmp_path, PLOTJUGGLER.replace("__time", "tine"))
    assert "recording: time" in refusal(path, wrong)


def test_a_file_of_other_names_points_to_inspect(tmp_path):
    path = write_plotjuggler(tmp_path / "log.csv", MADE)
    assert f"scara-ident inspect {path}" in refusal(path, load_robot())


def test_a_unit_that_is_wrong_is_caught_by_the_audit(tmp_path):
    made = {name: values / DEGREE if name.endswith("position") else values for name, values in MADE.items()}
    path = save(tmp_path / "a.parquet", made)
    assert "degrees" in refusal(path, described(tmp_path, "{}"))
    found = read_recording(path, described(tmp_path, "{position: {unit: deg}}"))
    np.testing.assert_allclose(found.position, stacked("position"), rtol=1e-12)


@pytest.mark.parametrize(
    ("name", "module", "extra"), [("a.h5", "h5py", "hdf5"), ("a.mcap", "rosbags.highlevel", "ros")]
)
def test_a_library_that_is_not_installed_is_named_with_its_extra(tmp_path, monkeypatch, name, module, extra):
    real = importlib.import_module

    def without(wanted: str, package: str | None = None) -> object:
        if wanted.startswith(module.partition(".")[0]):
            raise ImportError(wanted)
        return real(wanted, package)

    monkeypatch.setattr("scara_ident.recording.files.files.import_module", without)
    (tmp_path / name).write_bytes(b"x")
    message = refusal(tmp_path / name, load_robot())
    assert f'pip install "scara-ident[{extra}]"' in message


def test_an_unknown_suffix_lists_the_known_ones(tmp_path):
    (tmp_path / "log.xlsx").write_bytes(b"x")
    message = refusal(tmp_path / "log.xlsx", load_robot())
    assert ".mat" in message
    assert ".mcap" in message


def test_no_reader_is_loaded_before_its_format_is_read(tmp_path, monkeypatch):
    real = builtins.__import__
    seen: list[str] = []

    def watched(name: str, *rest: object) -> object:
        seen.append(name.partition(".")[0])
        return real(name, *rest)

    path = save(tmp_path / "a.parquet", MADE)
    monkeypatch.setattr(builtins, "__import__", watched)
    read_recording(path, load_robot())
    assert not {"h5py", "rosbags"} & set(seen)
