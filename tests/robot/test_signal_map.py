"""The key ``recording`` of a robot description: every unit by its definition, every fault in a line."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from scara_ident.errors import RobotError
from scara_ident.robot.robot import Robot, load_robot
from scara_ident.robot.signal_map import contract_channels, recording_entry
from tests.arms import Link, write_urdf

LINKS = (Link(), Link(kind="prismatic"))


def described(folder: Path, recording: str, joints: str = "{j1: {effort_gain: 2}, j2: {effort_gain: 2}}") -> Robot:
    write_urdf(folder / "arm.urdf", LINKS, (-50.0, 400.0))
    text = f"urdf: arm.urdf\neffort_side: motor\njoints: {joints}\nrecording: {recording}\n"
    (folder / "robot.yaml").write_text(text, encoding="utf-8")
    return load_robot(folder / "robot.yaml")


def test_without_the_key_the_columns_are_the_contracts(tmp_path):
    write_urdf(tmp_path / "arm.urdf", LINKS)
    assert load_robot(tmp_path / "arm.urdf").channels is None
    channels = contract_channels(("j1", "j2"))
    assert channels.time.column == "time"
    assert [channel.column for channel in channels.effort] == ["j1.effort", "j2.effort"]
    assert described(tmp_path, "{}").channels == channels


@pytest.mark.parametrize(
    ("recording", "signal", "joint", "number", "expected"),
    [
        ("{time: {column: t, unit: ms}}", "time", 0, 250.0, 0.25),
        ("{time: {column: t, unit: us}}", "time", 0, 250.0, 250e-6),
        ("{time: {column: t, unit: µs}}", "time", 0, 250.0, 250e-6),
        ("{time: {column: t, unit: ns}}", "time", 0, 250.0, 250e-9),
        ("{position: {unit: {j1: deg}}}", "position", 0, 90.0, np.pi / 2),
        ("{position: {unit: {j1: turn}}}", "position", 0, 0.25, np.pi / 2),
        ("{position: {unit: {j2: mm}}}", "position", 1, 90.0, 0.09),
        ("{position: {unit: {j2: um}}}", "position", 1, 90.0, 90e-6),
        ("{position: {unit: {j2: mm}}}", "position", 0, 0.5, 0.5),
        ("{position: {unit: {j1: count}, counts_per_turn: {j1: 4096}}}", "position", 0, 1024.0, np.pi / 2),
        # At the motor both joints turn; the gears have -50 turns a turn and 400 rad a metre.
        ("{position: {unit: turn, side: motor}}", "position", 0, 12.5, -np.pi / 2),
        ("{position: {unit: rad, side: motor}}", "position", 1, 100.0, 0.25),
        ("{position: {unit: count, side: motor, counts_per_turn: 1000}}", "position", 0, 12500.0, -np.pi / 2),
        ("{position: {unit: {j1: deg}, scale: {j1: -1}, offset: {j1: 90}}}", "position", 0, 60.0, np.pi / 6),
        ("{velocity: {unit: rpm, side: motor}}", "velocity", 0, 3000.0, -2 * np.pi),
        ("{velocity: {unit: {j1: deg/s, j2: mm/s}}}", "velocity", 1, 40.0, 0.04),
        ("{acceleration: {unit: {j1: deg/s^2}}}", "acceleration", 0, 180.0, np.pi),
        ("{effort: {unit: {j1: Nm}}}", "effort", 0, 3.0, 3.0),
        ("{effort: {unit: {j1: mN m}}}", "effort", 0, 3.0, 3e-3),
        ("{effort: {unit: {j1: N cm}}}", "effort", 0, 3.0, 3e-2),
        ("{effort: {unit: {j2: kN}}}", "effort", 1, 3.0, 3e3),
        ("{effort: {unit: A}}", "effort", 0, 3.0, 3.0),
        ("{effort: {unit: mA}}", "effort", 1, 3.0, 3e-3),
        ("{effort: {unit: permille}}", "effort", 1, 250.0, 0.25),
        ("{temperature: {unit: K}}", "temperature", 0, 300.0, 26.85),
    ],
)
def test_a_number_in_its_unit_is_this_much_in_si(tmp_path, recording, signal, joint, number, expected):
    channels = described(tmp_path, recording).channels
    assert channels is not None
    channel = channels.time if signal == "time" else channels.of(signal)[joint]
    np.testing.assert_allclose(channel.si(np.array([number])), [expected], rtol=1e-12)


@pytest.mark.parametrize(
    ("place", "columns"),
    [
        ("column: '{joint}.pos'", ["j1.pos", "j2.pos"]),
        ("column: '/js/{joint}/position'", ["/js/j1/position", "/js/j2/position"]),
        ("column: 'q[{index}]'", ["q[0]", "q[1]"]),
        ("column: 'q{number}'", ["q1", "q2"]),
        ("columns: {j2: b, j1: a}", ["a", "b"]),
    ],
)
def test_columns_are_named_by_a_pattern_or_one_by_one(tmp_path, place, columns):
    channels = described(tmp_path, f"{{position: {{{place}}}}}").channels
    assert channels is not None
    assert [channel.column for channel in channels.position] == columns
    assert channels.declared == ("position",)


@pytest.mark.parametrize(
    ("recording", "key", "said"),
    [
        ("{positions: {}}", "recording.positions", "expected one of topic, time, position"),
        ("{time: {col: t}}", "recording.time.col", "expected one of column, unit"),
        ("{effort: {side: motor}}", "recording.effort.side", "expected one of column, columns, unit"),
        ("{position: {pattern: x}}", "recording.position.pattern", "counts_per_turn"),
        ("[a]", "recording", "dictionary"),
        ("{time: {column: 3}}", "recording.time.column", "expected a name"),
        ("{time: {rate: 0}}", "recording.time.rate", "expected a number above 0"),
        ("{time: {rate: fast}}", "recording.time.rate", "expected a number"),
        ("{time: {rate: 100, column: t}}", "recording.time", "not both"),
        ("{time: {rate: 100, unit: ms}}", "recording.time", "not both"),
        ("{time: {unit: min}}", "recording.time.unit", "expected one of s, ms, us, ns"),
        ("{position: {unit: degrees}}", "recording.position.unit", "one of rad, deg, turn, count"),
        ("{position: {unit: deg}}", "recording.position.unit", "j2, which translates; one of m, mm, um"),
        ("{position: {unit: {j2: deg}}}", "recording.position.unit.j2", "j2, which translates"),
        ("{position: {unit: mm, side: motor}}", "recording.position.unit", "at the motor"),
        ("{position: {unit: [deg]}}", "recording.position.unit", "expected a name"),
        ("{position: {unit: {j3: deg}}}", "recording.position.unit.j3", "they are j1, j2"),
        ("{position: {columns: {j1: a}}}", "recording.position.columns.j2", "missing"),
        ("{position: {columns: {j1: a, j2: b, elbow: c}}}", "recording.position.columns.elbow", "they are j1, j2"),
        ("{position: {columns: {j1: a, j2: a}}}", "recording.position", "'a' is the position of j1 and"),
        ("{position: {column: q}}", "recording.position.column", "one column for 2 joints"),
        ("{position: {column: 'q{index}', columns: {j1: a}}}", "recording.position", "not both"),
        ("{position: {side: left}}", "recording.position.side", "'motor' or 'joint'"),
        ("{position: {scale: 0}}", "recording.position.scale", "other than 0"),
        ("{position: {offset: {j1: big}}}", "recording.position.offset", "j1: expected a number"),
        ("{position: {unit: count, side: motor}}", "recording.position.counts_per_turn", "missing for j1"),
        ("{position: {counts_per_turn: -4}}", "recording.position.counts_per_turn", "above 0"),
        ("{position: {counts_per_turn: 4}}", "recording.position.counts_per_turn", "unit is rad"),
        ("{topic: 3}", "recording.topic", "expected a name"),
    ],
)
def test_a_fault_in_the_mapping_is_one_line_with_its_key(tmp_path, recording, key, said):
    with pytest.raises(RobotError) as caught:
        described(tmp_path, recording)
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith(f"{tmp_path / 'robot.yaml'}: {key}: ")
    assert said in message
    assert len(message) < 400


def test_a_rate_stands_for_a_clock(tmp_path):
    channels = described(tmp_path, "{time: {rate: 100}}").channels
    assert channels is not None
    assert channels.rate == 100.0
    assert described(tmp_path, "{time: {column: t}}").channels.rate is None


def test_a_current_without_its_gain_is_refused(tmp_path):
    with pytest.raises(RobotError, match=r"recording\.effort\.unit: A is no torque; give j2 its effort_gain"):
        described(tmp_path, "{effort: {unit: A}}", "{j1: {effort_gain: 14.87}, j2: {}}")


@pytest.mark.slow
@pytest.mark.parametrize(("unit", "gain", "whole"), [("%", 0.01, "1"), ("permille", 0.002, "2")])
def test_a_gain_for_one_per_cent_is_refused_with_that_for_a_hundred(tmp_path, unit, gain, whole):
    # The URDF's limit is 50 N m at the joint, and 1 N m at the motor of the first.
    joints = f"{{j1: {{effort_gain: {gain}}}, j2: {{effort_gain: 1}}}}"
    with pytest.raises(
        RobotError, match=rf"joints\.j1\.effort_gain: .*write the torque at 100 %: {whole} if"
    ) as caught:
        described(tmp_path, f"{{effort: {{unit: '{unit}'}}}}", joints)
    assert "\n" not in str(caught.value)
    for told in ("1.5", "1", "0.0001"):
        described(tmp_path, f"{{effort: {{unit: '{unit}'}}}}", joints.replace(str(gain), told, 1))


@pytest.mark.parametrize(
    "recording",
    [
        "{}",
        "{topic: /states, time: {column: t, unit: ms}, position: {column: 'q_{number}'}}",
        "{time: {rate: 250}, temperature: {unit: K}, link_position: {columns: {j1: arm_side}}}",
        "{position: {unit: count, side: motor, counts_per_turn: {j1: 4096, j2: 1000}, offset: 7}, velocity: {scale: -1}}",
        "{effort: {columns: {j1: column_3, j2: column_4}, unit: mA, scale: {j2: -1}}, acceleration: {unit: {j2: mm/s^2}}}",
    ],
)
def test_a_mapping_written_again_gives_the_same_channels(tmp_path, recording):
    robot = described(tmp_path, recording)
    again = json.dumps(recording_entry(robot.channels, robot.joints))
    assert described(tmp_path, again).channels == robot.channels
