"""Files of the identified arm, read again by other programs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from scara_ident.errors import EstimationError, ScaraIdentError
from scara_ident.export import robots
from scara_ident.export.robots import export_mjcf, export_urdf
from scara_ident.identification.identify import Identification, identified_arm
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
    np.testing.assert_allclose(value, identified_arm(found).value[found.model.place(term)], rtol=1e-9, atol=1e-12)


def test_an_estimate_of_an_arm_that_can_exist_is_written_as_it_is(found: Identification, tmp_path: Path):
    export_urdf(found, tmp_path / "one.urdf")
    export_urdf(identified_arm(found), tmp_path / "other.urdf")
    assert (tmp_path / "one.urdf").read_bytes() == (tmp_path / "other.urdf").read_bytes()


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
    monkeypatch.setattr(robots, "identified_arm", lambda _: None)
    with pytest.raises(EstimationError, match="no arm can have the identified parameters"):
        export(found, tmp_path / "arm")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("export", [export_urdf, export_mjcf])
def test_a_link_that_cannot_exist_keeps_the_earlier_file(export, found, tmp_path: Path):
    arm = identified_arm(found)
    standard = arm.standard.copy()
    standard[10] = -1.0
    (tmp_path / "arm").write_text("earlier")
    with pytest.raises(ScaraIdentError, match="link2"):
        export(replace(arm, standard=standard), tmp_path / "arm")
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [("arm", "earlier")]
