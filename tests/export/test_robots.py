"""Files of the identified arm, read again by other programs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from scara_ident.errors import EstimationError
from scara_ident.export import exported, robots
from scara_ident.export.exported import export_model
from scara_ident.export.forms import possible_standard
from scara_ident.export.identified_model import identified_model
from scara_ident.export.result import read_identified
from scara_ident.export.robots import export_mjcf, export_urdf, robot_files
from scara_ident.files import write_json
from scara_ident.identification.identify import Identification
from scara_ident.report.identification import identification_dict
from scara_ident.robot.description import JointDescription, RobotDescription
from scara_ident.robot.robot import Robot, build_robot
from tests.report.simulated import made, run


@pytest.fixture(scope="module")
def found() -> Identification:
    return made([run("OJD_1", 1), run("OJD_2", 2)])


def read_back(urdf: Path) -> Robot:
    joints = {"joint1": JointDescription(), "joint2": JointDescription()}
    return build_robot(RobotDescription(urdf=urdf, effort_side="motor", joints=joints), urdf)


def test_the_urdf_is_an_arm_with_the_identified_base_parameters(found: Identification, tmp_path: Path):
    export_urdf(found, tmp_path / "arm.urdf")
    term = found.model.rigid_body
    parameters = read_back(tmp_path / "arm.urdf").standard_parameters()
    value = (term.base.grouping @ parameters)[term.kept]
    np.testing.assert_allclose(value, found.estimate.value[found.model.place(term)], rtol=1e-9, atol=1e-12)


def test_the_files_are_those_of_the_export_of_the_result_file(found: Identification, tmp_path: Path):
    files, notes = robot_files(identified_model(found))
    assert list(files) == ["scara03_identified.urdf", "scara03_identified.xml"]
    assert "URDF: without a21, a31, a22, a32: the format cannot hold it" in notes
    assert any(note.startswith("MJCF: fitted again to the same recordings: a01, a11") for note in notes)
    write_json(tmp_path / "identification.json", identification_dict(found))
    read = read_identified(tmp_path / "identification.json")
    for to, (name, text) in zip(("urdf", "mjcf"), files.items(), strict=True):
        assert export_model(read, to).files[name] == text
    export_urdf(found, tmp_path / "arm.urdf")
    assert (tmp_path / "arm.urdf").read_text() == files["scara03_identified.urdf"]


def test_mujoco_and_the_urdf_have_one_mass_matrix(found: Identification, tmp_path: Path):
    export_urdf(found, tmp_path / "arm.urdf")
    export_mjcf(found, tmp_path / "arm.xml")
    robot = read_back(tmp_path / "arm.urdf")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "arm.xml"))
    data = mujoco.MjData(model)
    model.dof_frictionloss[:] = 0.0
    mass = np.zeros((2, 2))
    # Nothing hangs: from rest, the torque of a unit acceleration is a column of the mass matrix.
    for joint in range(2):
        data.qpos[:2], data.qvel[:], data.qacc[:] = [0.4, -1.1], 0.0, 0.0
        data.qacc[joint] = 1.0
        mujoco.mj_inverse(model, data)
        mass[:, joint] = data.qfrc_inverse[:2]
    links = pin.crba(robot.model, robot.model.createData(), np.array([0.4, -1.1]))
    links = np.triu(links) + np.triu(links, 1).T
    np.testing.assert_allclose(mass, links + np.diag(robot.standard_parameters()[20:]), rtol=1e-6)


@pytest.mark.parametrize("export", [export_urdf, export_mjcf])
def test_no_file_is_written_of_an_arm_that_cannot_exist(export, found, tmp_path: Path, monkeypatch):
    def none(_: object) -> None:
        raise EstimationError("no arm is found")

    monkeypatch.setattr(exported, "possible_standard", none)
    with pytest.raises(EstimationError, match="no arm is found"):
        export(found, tmp_path / "arm")
    assert list(tmp_path.iterdir()) == []
    monkeypatch.setattr(robots, "possible_standard", none)
    assert robot_files(identified_model(found)) == ({}, ("no URDF and no MJCF is written: no arm is found",))


def test_a_link_that_cannot_exist_is_named_and_the_other_file_reported(found):
    model = identified_model(found)
    standard = possible_standard(model)[0].copy()
    standard[10] = -1.0
    files, notes = robot_files(replace(model, standard=standard))
    assert files == {}
    assert [note.partition(":")[0] for note in notes] == ["no URDF is written", "no MJCF is written"]
    assert all("link2" in note for note in notes)
