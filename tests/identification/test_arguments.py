"""Functions that learn from recordings take files too, and say what they take."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from scara_ident.diagnosis import diagnose
from scara_ident.errors import ArgumentError, RecordingError
from scara_ident.excitation import design_excitation
from scara_ident.identification.arguments import model_of, recordings_of
from scara_ident.identification.compare import compare
from scara_ident.identification.identify import identify
from scara_ident.recording.apart import read_usable
from scara_ident.recording.recording import Recording, read_recording, read_recordings
from scara_ident.robot.robot import Robot, load_robot
from tests.made_recordings import columns, save

MADE = columns(400)


@pytest.fixture
def robot() -> Robot:
    return load_robot()


@pytest.fixture
def run(tmp_path: Path, robot: Robot) -> Recording:
    return read_recording(save(tmp_path / "run_1.parquet", MADE), robot)


def test_recordings_files_and_folders_are_taken(robot: Robot, run: Recording, tmp_path: Path):
    for given in (run, [run], run.path, str(tmp_path), [tmp_path / "run_1.parquet"], (item for item in [run])):
        assert [item.name for item in recordings_of(given, robot)] == ["run_1"]
    assert recordings_of((), robot) == ()


def test_recordings_of_one_name_are_named_with_their_folders(robot: Robot, tmp_path: Path):
    for folder in ("monday", "tuesday"):
        (tmp_path / folder).mkdir()
        save(tmp_path / folder / "run_1.parquet", MADE)
    save(tmp_path / "tuesday" / "run_2.parquet", MADE)
    given = [tmp_path / "monday", tmp_path / "tuesday"]
    expected = [("monday/run_1", "run", 1), ("tuesday/run_1", "run", 1), ("run_2", "run", 2)]
    for found in (recordings_of(given, robot), read_recordings(given, robot), read_usable(given, robot)[0]):
        assert [(item.name, item.trajectory, item.repetition) for item in found] == expected


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (None, "expected recordings, or files or folders of them; found NoneType"),
        (7, "found int"),
        ([np.zeros((3, 2))], "found ndarray; read_arrays"),
        (pl.DataFrame({"time": [0.0]}), "found DataFrame; read_frame"),
        ([pl.DataFrame({"time": [0.0]})], "found DataFrame; read_frame"),
    ],
)
@pytest.mark.parametrize("function", [identify, diagnose, compare])
def test_other_things_are_a_type_error_in_a_line(robot: Robot, function, given, said: str):
    with pytest.raises(TypeError, match=said) as caught:
        function(robot, given)
    assert isinstance(caught.value, ArgumentError)


def test_arguments_in_the_wrong_place_are_named(robot: Robot, run: Recording):
    with pytest.raises(ArgumentError, match="robot: expected a Robot, as load_robot gives; found list"):
        identify([run], robot)
    with pytest.raises(ArgumentError, match="validation: expected recordings"):
        identify(robot, [run], validation=[3])
    with pytest.raises(ArgumentError, match="bands: expected one for each of joint1, joint2; found float"):
        identify(robot, [run], bands=5.0)
    with pytest.raises(ArgumentError, match=r"found a word: give effects_named\('spring'\)"):
        diagnose(robot, [run], catalogue="spring")
    with pytest.raises(ArgumentError, match="expected a TorqueModel, as build_model gives; found str"):
        design_excitation("panda")
    with pytest.raises(ArgumentError, match=r"expected that of a robot.yaml or a URDF, or a robot's name; found dict"):
        load_robot({"urdf": "arm.urdf"})
    with pytest.raises(
        ArgumentError, match="model: expected a name or a TorqueModel, as build_model gives; found NoneType"
    ):
        model_of(None, robot)
    with pytest.raises(
        RecordingError, match=r"run_1.parquet: a recording of a, b; the robot's joints are joint1, joint2"
    ):
        recordings_of(replace(run, joints=("a", "b")), robot)
