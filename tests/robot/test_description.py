"""Every bad robot.yaml gives one line that names the file and the key."""

from __future__ import annotations

import os
from itertools import pairwise
from pathlib import Path

import pytest

from scara_ident.errors import RobotError
from scara_ident.robot.description import read_description
from scara_ident.robot.robot import load_robot


def described(folder: Path, text: str) -> Path:
    path = folder / "robot.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def refusal(path: Path) -> str:
    with pytest.raises(RobotError) as caught:
        read_description(path)
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith(str(path))
    assert len(message) < 400
    return message.removeprefix(str(path))


def test_a_full_description_is_read(tmp_path: Path):
    text = (
        "urdf: sub/arm.urdf\neffort_side: motor\njoints:\n  joint1: {reduction: -100}\n"
        "  joint2: {effort_gain: 2.5, rotor_inertia: 1e-3}\n  joint4:\n"
        "locked: {joint3: 0.25}\ngravity: [0, 0, -1.62]\n"
    )
    found = read_description(described(tmp_path, text))
    assert found.urdf == (tmp_path / "sub" / "arm.urdf").resolve()
    assert found.effort_side == "motor"
    assert found.joints is not None
    assert list(found.joints) == ["joint1", "joint2", "joint4"]
    assert found.joints["joint1"].reduction == -100.0
    assert found.joints["joint2"].effort_gain == 2.5
    # YAML 1.1 takes 1e-3 for a word; it is the number that was meant.
    assert found.joints["joint2"].rotor_inertia == 1e-3
    assert found.joints["joint4"] is None
    assert found.locked == {"joint3": 0.25}
    assert found.gravity == (0.0, 0.0, -1.62)


def test_everything_but_the_urdf_is_optional(tmp_path: Path):
    for text in ("urdf: arm.urdf\n", "urdf: arm.urdf\neffort_side:\njoints:\nlocked:\ngravity:\n"):
        found = read_description(described(tmp_path, text))
        assert (found.effort_side, found.joints, found.locked, found.gravity) == (None, None, {}, None)


@pytest.mark.parametrize(
    ("text", "key", "expected"),
    [
        ("urdf: a.urdf\ngravitty: [0, 0, -9.81]\n", "gravitty", "gravity"),
        ("urdf: a.urdf\njoints: {j1: {reductoin: 100}}\n", "joints.j1.reductoin", "reduction"),
        ("urdf: a.urdf\njoints: {j1: {reduction: 0}}\n", "joints.j1.reduction", "other than 0"),
        ("urdf: a.urdf\njoints: {j1: {effort_gain: 0.0}}\n", "joints.j1.effort_gain", "other than 0"),
        ("urdf: a.urdf\njoints: {j1: {reduction: many}}\n", "joints.j1.reduction", "number"),
        ("urdf: a.urdf\njoints: {j1: {reduction: yes}}\n", "joints.j1.reduction", "number"),
        ("urdf: a.urdf\njoints: {j1: {reduction: .inf}}\n", "joints.j1.reduction", "finite"),
        ("urdf: a.urdf\njoints: {j1: {effort_gain: .nan}}\n", "joints.j1.effort_gain", "finite"),
        ("urdf: a.urdf\njoints: {j1: {rotor_inertia: -1}}\n", "joints.j1.rotor_inertia", "greater than or equal to 0"),
        ("urdf: a.urdf\njoints: {j1: {jerk_limit: 0}}\n", "joints.j1.jerk_limit", "greater than 0"),
        ("urdf: a.urdf\njoints: {j1: 100}\n", "joints.j1", "100"),
        ("urdf: a.urdf\njoints: [j1, j2]\n", "joints", "dictionary"),
        ("urdf: a.urdf\nlocked: {j3: .nan}\n", "locked.j3", "finite"),
        ("urdf: a.urdf\nlocked: {j3: low}\n", "locked.j3", "number"),
        (
            "urdf: a.urdf\ngravity: 9.81\n",
            "gravity",
            "expected three numbers in m/s^2, such as [0, 0, -9.81]; found 9.81",
        ),
        (
            "urdf: a.urdf\ngravity: [0, 0]\n",
            "gravity",
            "expected three numbers in m/s^2, such as [0, 0, -9.81]; found [0, 0]",
        ),
        ("urdf: a.urdf\ngravity: [0, 0, -9.81, 0]\n", "gravity", "expected three numbers in m/s^2"),
        ("urdf:\n", "urdf", "expected the path of a URDF, or the name of a robot of example-robot-data; found None"),
        ("urdf: ''\n", "urdf", "expected the path of a URDF"),
        ("urdf: a.urdf\ngravity: [0, 0, .inf]\n", "gravity.2", "finite"),
        ("urdf: a.urdf\neffort_side: motors\n", "effort_side", "'motor' or 'joint'"),
        ("effort_side: motor\n", "urdf", "missing; expected the path of a URDF, or the name of a robot"),
        ("urdf: [a, b]\n", "urdf", "path"),
    ],
)
def test_a_bad_key_is_named_with_what_was_expected(tmp_path: Path, text: str, key: str, expected: str):
    message = refusal(described(tmp_path, text))
    assert message.startswith(f": {key}:")
    assert expected in message


@pytest.mark.parametrize("text", ["- urdf: a.urdf\n", "just words\n", "", "42\n"])
def test_what_is_no_mapping_is_refused(tmp_path: Path, text: str):
    assert "expected a mapping with the key urdf" in refusal(described(tmp_path, text))


def test_keys_that_are_no_words_are_refused(tmp_path: Path):
    refusal(described(tmp_path, "urdf: a.urdf\n1: 2\n"))
    assert ": joints.1" in refusal(described(tmp_path, "urdf: a.urdf\njoints: {1: {}}\n"))


def test_a_fault_of_syntax_is_named_with_its_line(tmp_path: Path):
    message = refusal(described(tmp_path, "urdf: a.urdf\njoints: {j1: {reduction: 100}\n"))
    assert message.startswith(", line ")
    assert "not YAML" in message


def test_yaml_tags_run_no_code(tmp_path: Path):
    assert "not YAML" in refusal(described(tmp_path, "urdf: !!python/object/apply:os.getcwd []\n"))


def test_files_that_are_no_text_are_refused(tmp_path: Path):
    path = tmp_path / "robot.yaml"
    path.write_bytes(bytes(range(256)))
    assert "not a text file" in refusal(path)
    path.write_bytes(b"urdf: a\x00\x01b\n")
    assert "not YAML" in refusal(path)


@pytest.mark.parametrize("encoding", ["latin-1", "cp1252"])
def test_a_letter_of_another_encoding_is_named_with_its_line(tmp_path: Path, encoding: str):
    """A robot.yaml with an umlaut in a comment, saved in Windows-1252, was said to be no text file."""
    path = tmp_path / "robot.yaml"
    path.write_bytes("urdf: a.urdf\n# Größe\n".encode(encoding))
    assert refusal(path) == (
        ", line 2: a letter that is not in UTF-8, 'ö' if it is in Windows-1252; save the file in UTF-8"
    )
    path.write_bytes("urdf: a.urdf\n# Größe\n".encode("utf-16"))
    assert refusal(path) == ": not a text file in UTF-8; expected a robot.yaml"


def test_a_folder_and_a_missing_file_are_refused(tmp_path: Path):
    assert "is a folder" in refusal(tmp_path)
    assert "no such robot description" in refusal(tmp_path / "robot.yaml")


@pytest.mark.parametrize("laughs", [True, False])
def test_aliases_that_unfold_without_end_are_refused_before(tmp_path, laughs):
    letters = "abcdefghijkl"
    lines = [f"{b}: &{b} [{', '.join([f'*{a}'] * 9)}]" for a, b in pairwise(letters)]
    path = tmp_path / "robot.yaml"
    path.write_text("\n".join(["urdf: x.urdf", "a: &a [x, x, x]", *lines]) if laughs else "urdf: &a [*a]")
    with pytest.raises(RobotError, match=r"robot\.yaml: aliases \(\*name\) of aliases"):
        read_description(path)


def test_one_alias_is_a_value_like_any_other(tmp_path):
    path = tmp_path / "robot.yaml"
    path.write_text("urdf: x.urdf\njoints:\n  a: &gear {reduction: 100}\n  b: *gear\n")
    joints = read_description(path).joints
    assert joints is not None
    assert joints["b"] == joints["a"]


@pytest.mark.parametrize("name", ["robot.yaml", "robot.urdf"])
def test_a_pipe_is_no_robot(tmp_path, name):
    os.mkfifo(tmp_path / name)
    with pytest.raises(RobotError, match="is a named pipe, not a file"):
        load_robot(tmp_path / name)
