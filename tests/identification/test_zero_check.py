"""Positions that count from elsewhere by quarter turns: told with the line that mends them, and nowhere else."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from scara_ident.diagnosis import diagnose
from scara_ident.errors import RecordingError
from scara_ident.identification.channel_check import channel_faults
from scara_ident.identification.channel_fault import ChannelFault
from scara_ident.identification.identify import identify
from scara_ident.recording.recording import read_recordings, write_recording
from scara_ident.robot.robot import load_robot
from tests.arms import example_urdf
from tests.identification.turned_arm import arm, runs, seen, standing


def told(faults: tuple[ChannelFault, ...]) -> list[dict[str, int]]:
    return [{joint[-1]: own.quarters for joint, own in fault.readings.items()} for fault in faults]


@pytest.mark.slow
@pytest.mark.parametrize("quarters", [(0, 2, 0, 0), (0, -1, 1, 0)])
def test_zeros_by_quarter_turns_are_reported(quarters: tuple[int, ...]) -> None:
    robot = arm()
    faults = channel_faults(seen(robot, runs(robot, quarters)))
    assert told(faults) == [{str(k + 2): turn for k, turn in enumerate(quarters) if turn}]
    assert faults[0].alternatives == () and faults[0].mended < 0.2 * faults[0].error


def test_what_leaves_as_much_is_named() -> None:
    """Half a turn of one joint is the next axis turned round, if both intersect: no motion tells them apart."""
    robot = arm()
    (fault,) = channel_faults(seen(robot, runs(robot, (0, 0, 2, 0))))
    assert told((fault,)) == [{"4": 2}]
    assert fault.alternatives == ("effort and position of j2s6s200_joint_5 of opposite sign",)
    assert "(it does so too with effort and position of" in str(fault)


def test_a_joint_that_is_not_explained_at_all_shows_a_zero_where_other_joints_hide_it() -> None:
    """A measured wrist was left 1.3 of its torque, the other five joints 0.1 to 0.5 in either reading: a counterweight was found."""
    robot, springs = arm(), np.array([2.0, 2.0, 0.5, 0.2])
    (fault,) = channel_faults(seen(robot, runs(robot, (0, 0, 2, 0), 0.6, springs)))
    assert told((fault,)) == [{"4": 2}]
    assert fault.error > 0.7 and fault.mended < 0.3
    assert channel_faults(seen(robot, runs(robot, (0, 0, 0, 0), 0.6, springs))) == ()


def test_a_zero_nearly_a_quarter_turn_away_is_reported_as_one() -> None:
    """The effect joint_zero finds the rest, with the line for it."""
    robot = arm()
    near = [
        replace(run, position=run.position + np.array([[0.0], [0.07], [0.0], [0.0]]))
        for run in runs(robot, (0, 1, 0, 0))
    ]
    assert told(channel_faults(seen(robot, near))) == [{"3": 1}]


def test_no_zero_is_reported_where_all_are_right_or_parameters_take_it_up() -> None:
    robot = arm()
    for quarters in ((0, 0, 0, 0), (0, 0, 0, 1), (0, 0, 0, 2)):
        assert channel_faults(seen(robot, runs(robot, quarters))) == ()


@pytest.mark.slow
def test_no_zero_is_reported_of_other_faults() -> None:
    robot = arm()
    spring = runs(robot, (0,) * 4, added=np.array([8.0, 8.0, 0.0, 0.0]))
    assert channel_faults(seen(robot, spring)) == ()
    wrong = [replace(run, effort=run.effort * np.array([[1.0], [-1.0], [1.0], [1.0]])) for run in runs(robot, (0,) * 4)]
    (fault,) = channel_faults(seen(robot, wrong))
    assert (fault.signal, fault.joints, fault.zeros) == ("effort", ("j2s6s200_joint_3",), ())


@pytest.mark.slow
@pytest.mark.parametrize("gravity", [(0.0, 0.0, 9.81), (9.81, 0.0, 0.0)])
def test_an_arm_that_is_mounted_otherwise_has_no_zero_of_its_own(gravity: tuple[float, ...]) -> None:
    """Half a turn of the shoulder leaves as much as gravity the other way round."""
    robot = arm(1, 2, 3, 4)
    assert channel_faults(seen(robot, runs(standing(robot, gravity), (0,) * 4))) == ()


@pytest.mark.slow
def test_the_line_that_is_reported_mends_it(tmp_path: Path) -> None:
    """In degrees, beside an offset that is there already."""
    robot = arm()
    files = []
    for run in runs(robot, (0, 0, 1, 0)):
        files.append(tmp_path / f"{run.name}.csv")
        write_recording(replace(run, position=np.degrees(run.position) - 10.0), files[-1])

    def described(**more: float) -> Path:
        path = tmp_path / "robot.yaml"
        offset = {joint: 10.0 + more.get(joint, 0.0) for joint in robot.joints}
        position = {"column": "{joint}.position", "unit": "deg", "offset": offset}
        content = {
            "urdf": str(example_urdf("kinova.urdf")),
            "effort_side": "joint",
            "joints": {joint: {} for joint in robot.joints},
            "recording": {"position": position},
        }
        path.write_text(yaml.safe_dump(content), encoding="utf-8")
        return path

    wrong = load_robot(described())
    line = r"offset: \{j2s6s200_joint_4: 1.57080\} in rad, or the same angle in the unit there"
    with pytest.raises(RecordingError, match=line) as caught:
        diagnose(wrong, read_recordings(files, wrong), model="basic")
    assert "\n" not in str(caught.value)
    channels = identify(wrong, read_recordings(files, wrong)).channels
    assert any("counts from a zero that differs" in str(fault) for fault in channels)
    right = load_robot(described(j2s6s200_joint_4=90.0))
    mended = read_recordings(files, right)
    assert not diagnose(right, mended, model="basic").effects
    assert identify(right, mended, model="basic").channels == ()
