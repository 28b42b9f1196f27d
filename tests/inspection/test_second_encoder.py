"""Encoders behind the gears are told from filtered copies, commands and dead channels."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.inspection.inspection import inspect_file
from scara_ident.recording.files.parquet_csv import write_columns
from scara_ident.recording.recording import read_recording
from scara_ident.robot.robot import embedded_urdf, load_robot

TIME = np.arange(2000) / 500.0
MOTOR = 40.0 * np.sin(2.0 * TIME), 30.0 * np.sin(3.1 * TIME)
EFFORT = np.cos(2.0 * TIME), np.cos(3.1 * TIME)
LAG = 0.05


def columns(other: str, *, follow: tuple[bool, bool] = (True, True)) -> dict[str, np.ndarray]:
    made = {"time": TIME}
    for k in range(2):
        made |= {f"mot_pos_deg[{k}]": MOTOR[k], f"torque_nm[{k}]": EFFORT[k]}
        made[f"{other}[{k}]"] = MOTOR[k] + 0.3 - LAG * EFFORT[k] if follow[k] else np.zeros(len(TIME))
    return made


def inspected(tmp_path, made):
    write_columns(tmp_path / "run_1.parquet", made)
    return inspect_file(tmp_path / "run_1.parquet", urdf=embedded_urdf(), folder=tmp_path)


def test_a_position_named_the_links_that_follows_the_motors_is_a_second_encoder(tmp_path):
    found = inspected(tmp_path, columns("se_pos_deg"))
    assert found.mapping["link_position"] == {"column": "se_pos_deg[{index}]", "unit": "deg"}
    assert any("se_pos_deg[{index}] taken as a second encoder" in note for note in found.notes)


def test_a_joint_whose_column_does_not_move_has_none_and_the_written_description_reads_so(tmp_path):
    found = inspected(tmp_path, columns("link_pos_deg", follow=(True, False)))
    assert found.mapping["link_position"]["columns"] == {"joint1": "link_pos_deg[0]"}
    assert found.description is not None
    (tmp_path / "robot.yaml").write_text(found.description.replace("# effort_side: motor", "effort_side: motor"))
    link = read_recording(tmp_path / "run_1.parquet", load_robot(tmp_path / "robot.yaml")).link_position
    assert link is not None
    np.testing.assert_allclose(np.degrees(link[0]), MOTOR[0] + 0.3 - LAG * EFFORT[0], atol=1e-9)
    assert np.isnan(link[1]).all()


@pytest.mark.parametrize("other", ["link_pos_cmd_deg", "filtered_pos_deg"])
def test_a_command_and_a_copy_without_such_a_name_are_none(tmp_path, other):
    assert "link_position" not in inspected(tmp_path, columns(other)).mapping


def test_a_position_that_goes_its_own_way_is_none(tmp_path):
    made = columns("link_pos_deg")
    for k in range(2):
        made[f"link_pos_deg[{k}]"] = 1.1 * MOTOR[k]
    assert "link_position" not in inspected(tmp_path, made).mapping
