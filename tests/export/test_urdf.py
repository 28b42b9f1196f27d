from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
import pytest
import yourdfpy
from hypothesis import given, settings
from hypothesis import strategies as st

from scara_ident.errors import ScaraIdentError
from scara_ident.export.friction import JointFriction
from scara_ident.export.urdf import urdf_text
from scara_ident.robot.robot import Robot, load_robot
from tests.export.arms import ARMS, Array, joint_torque, random_motion, random_standard

SEEDS = st.integers(0, 2**31)


@pytest.fixture(scope="module", params=ARMS, ids=lambda make: make.__name__)
def robot(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Robot:
    make: Callable[[Path], Robot] = request.param
    return make(tmp_path_factory.mktemp(make.__name__))


@pytest.fixture
def branched(tmp_path: Path) -> Robot:
    from tests.export.arms import branched

    return branched(tmp_path)


def reloaded(robot: Robot, text: str) -> pin.Model:
    """Pinocchio's own reading of an exported text, the same joints locked where they were."""
    full = pin.buildModelFromXML(text)
    reference = pin.neutral(full)
    for name, value in robot.locked:
        reference[full.joints[full.getJointId(name)].idx_q] = value
    model = pin.buildReducedModel(full, [full.getJointId(name) for name, _ in robot.locked], reference)
    model.gravity = robot.model.gravity
    return model


def pinocchio_torque(robot: Robot, model: pin.Model, q: Array, v: Array, a: Array) -> Array:
    """Torque in the order of the robot, without armatures; a continuous joint has cosine and sine."""
    data, result = model.createData(), np.zeros_like(q)
    joints = [model.joints[model.getJointId(name)] for name in robot.joints]
    for k in range(q.shape[1]):
        full_q, full_v, full_a = pin.neutral(model), np.zeros(model.nv), np.zeros(model.nv)
        for i, joint in enumerate(joints):
            place = slice(joint.idx_q, joint.idx_q + joint.nq)
            full_q[place] = q[i, k] if joint.nq == 1 else (np.cos(q[i, k]), np.sin(q[i, k]))
            full_v[joint.idx_v], full_a[joint.idx_v] = v[i, k], a[i, k]
        torque = pin.rnea(model, data, full_q, full_v, full_a)
        result[:, k] = [torque[joint.idx_v] for joint in joints]
    return result


def number(element: ElementTree.Element, path: str, key: str) -> float:
    """An attribute of an element that has to be there."""
    found = element.find(path)
    assert found is not None, path
    return float(found.attrib[key])


def stripped(text: str) -> str:
    """All of a URDF but what the export may change, by rules of its own."""
    text = re.sub(r"\s*<inertial>.*?</inertial>", "", text, flags=re.DOTALL)
    text = re.sub(r"\s*<dynamics.*?/>", "", text, flags=re.DOTALL)
    # An empty link has to be opened to take an inertial.
    text = re.sub(r">\s*</link>", "></link>", re.sub(r"(<link [^>]*?)\s*/>", r"\1></link>", text))
    text = re.sub(r"\s*<!-- armature [^>]*-->", "", text)
    return re.sub(r"<rotorInertia>.*?</rotorInertia>", "", text)


@pytest.mark.slow
@given(seed=SEEDS, like_nominal=st.booleans())
@settings(max_examples=25)
def test_pinocchio_gets_the_identified_torque_from_the_export(robot: Robot, seed: int, like_nominal: bool) -> None:
    if like_nominal and robot.name in ("carriage", "branched"):
        like_nominal = False  # they have links without inertial
    standard = random_standard(robot, seed, like_nominal=like_nominal)
    text, _ = urdf_text(robot, standard)
    q, v, a = random_motion(robot, seed)
    expected = joint_torque(robot, standard, q, v, a)
    found = pinocchio_torque(robot, reloaded(robot, text), q, v, a) + standard[10 * robot.n :, None] * a
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11 * np.sqrt(np.mean(expected**2)))


@pytest.mark.slow
@given(seed=SEEDS)
@settings(max_examples=25)
def test_the_bodies_read_back_are_the_identified_ones(robot: Robot, seed: int) -> None:
    standard = random_standard(robot, seed)
    model = reloaded(robot, urdf_text(robot, standard)[0])
    for joint, name in enumerate(robot.joints):
        expected = standard[10 * joint : 10 * joint + 10]
        found = model.inertias[model.getJointId(name)].toDynamicParameters()
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * np.max(np.abs(expected)))


@pytest.mark.slow
@given(seed=SEEDS, like_nominal=st.booleans())
@settings(max_examples=25)
def test_every_exported_link_can_exist(robot: Robot, seed: int, like_nominal: bool) -> None:
    standard = random_standard(robot, seed, like_nominal=like_nominal and robot.name not in ("carriage", "branched"))
    root = ElementTree.fromstring(urdf_text(robot, standard)[0].encode())
    for link in root.findall("link"):
        inertial = link.find("inertial")
        if inertial is None:
            continue
        mass = number(inertial, "mass", "value")
        xx, xy, xz, yy, yz, zz = (
            number(inertial, "inertia", key) for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
        )
        moments = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        assert mass >= 0.0
        assert moments[2] <= moments[0] + moments[1] + 1e-12 * moments[2], link.get("name")
        assert moments[0] >= 0.0


@given(seed=SEEDS)
@settings(max_examples=12)
def test_only_inertials_and_joint_dynamics_change(robot: Robot, seed: int) -> None:
    friction = JointFriction(np.full(robot.n, 0.3), np.full(robot.n, 0.2))
    before = robot.urdf.read_bytes().decode()
    after, _ = urdf_text(robot, random_standard(robot, seed), friction)
    assert stripped(after) == stripped(before)
    assert after != before


def test_the_arm_s_own_parameters_give_its_own_file(robot: Robot) -> None:
    text, _ = urdf_text(robot, robot.standard_parameters())
    before = robot.urdf.read_bytes().decode()
    if robot.name == "branched":  # a rotor inertia of robot.yaml has no place but a comment
        before = before.replace(
            'effort="20" velocity="3"/>', 'effort="20" velocity="3"/>\n\t\t<!-- armature 0.05 kg m^2 at the joint -->'
        )
    assert text == before


def test_yourdfpy_reads_the_export_with_the_same_numbers(branched: Robot) -> None:
    standard = random_standard(branched, 3)
    friction = JointFriction(np.array([0.1, 0.2, 0.3]), np.array([0.4, 0.5, 0.6]))
    text, _ = urdf_text(branched, standard, friction)
    path = branched.urdf.with_name("out.urdf")
    path.write_text(text, encoding="utf-8")
    arm = yourdfpy.URDF.load(str(path), load_meshes=False, build_scene_graph=False)
    inertial = arm.link_map["slide"].inertial  # had none
    body = standard[20:30]
    assert inertial.mass == pytest.approx(body[0], rel=1e-15)
    np.testing.assert_allclose(inertial.origin[:3, 3], body[1:4] / body[0], rtol=1e-14)
    damping = {name: float(arm.joint_map[name].dynamics.damping) for name in branched.joints}
    assert damping == pytest.approx({"wrist": 50 * 0.4, "shoulder": 80 * 0.5, "branch": 400 * 0.6}, rel=1e-15)
    assert float(arm.joint_map["wrist"].dynamics.friction) == pytest.approx(50 * 0.1, rel=1e-15)


def test_an_inserted_inertial_and_dynamics_are_laid_out_like_their_neighbours(branched: Robot) -> None:
    text, _ = urdf_text(branched, random_standard(branched, 0), JointFriction(np.ones(3), np.ones(3)))
    assert re.search(r'\n\t<link name="slide">\n\t\t<inertial>\n\t\t\t<origin .*/>\n\t\t\t<mass .*/>\n', text)
    assert '\n\t\t</inertial>\n\t</link>\n\t<link name="hand">' in text
    assert '<!-- a screw -->\n\t\t<dynamics damping="400.0" friction="400.0"/>\n\t\t<!-- armature ' in text
    assert "<dynamics\n\t\t\tdamping = '80.0' friction=\"80.0\"/>" in text
    assert "<!-- from the data sheet -->" in text


def test_line_ends_stay_as_they_are(branched: Robot) -> None:
    content = branched.urdf.read_bytes().replace(b"\n", b"\r\n")
    branched.urdf.write_bytes(content)
    text, _ = urdf_text(branched, random_standard(branched, 0), JointFriction(np.ones(3), np.ones(3)))
    assert text.count("\r\n") == text.count("\n") > content.count(b"\n")


def described_like(robot: Robot, text: str, folder: Path) -> Robot:
    """A robot of another URDF with the description of this one."""
    folder.joinpath("exported.urdf").write_bytes(text.encode())
    lines = ["urdf: exported.urdf", f"effort_side: {robot.effort_side}", "joints:"]
    lines += [f"  {name}: {{reduction: {value}}}" for name, value in zip(robot.joints, robot.reduction, strict=True)]
    lines += [f"locked: {dict(robot.locked)}", f"gravity: {robot.model.gravity.linear.tolist()}"]
    folder.joinpath("robot.yaml").write_text("\n".join(lines))
    return load_robot(folder / "robot.yaml")


def test_exporting_an_export_again_changes_nothing(robot: Robot, tmp_path: Path) -> None:
    standard = random_standard(robot, 5)
    friction = JointFriction(np.full(robot.n, 0.3), np.full(robot.n, 0.2))
    text, _ = urdf_text(robot, standard, friction)
    exported = described_like(robot, text, tmp_path)
    bodies = exported.standard_parameters()[: 10 * robot.n]
    np.testing.assert_allclose(bodies, standard[: 10 * robot.n], rtol=0, atol=1e-12)
    parameters = np.concatenate([bodies, standard[10 * robot.n :]])
    assert urdf_text(exported, parameters, friction)[0] == text


def test_the_scara_s_rotors_read_back_from_their_transmissions(tmp_path: Path) -> None:
    robot = load_robot()
    standard = random_standard(robot, 1, like_nominal=True)
    text, notes = urdf_text(robot, standard)
    assert notes == ()
    (tmp_path / "arm.urdf").write_text(text, encoding="utf-8")
    (tmp_path / "robot.yaml").write_text("urdf: arm.urdf\neffort_side: motor\njoints: {joint1: {}, joint2: {}}\n")
    exported = load_robot(tmp_path / "robot.yaml")
    np.testing.assert_allclose(exported.standard_parameters(), standard, rtol=0, atol=1e-13)


def test_rotor_inertias_without_a_place_are_in_a_comment_and_a_note(branched: Robot) -> None:
    standard = random_standard(branched, 1)
    standard[30:] = 0.05, 0.0, 8.0
    text, notes = urdf_text(branched, standard)
    assert text.count("armature") == 2
    assert "<!-- armature 8.0 kg at the joint -->" in text
    (note,) = (note for note in notes if "rotor_inertia" in note)
    assert "wrist: 2e-05" in note
    assert "branch: 5e-05" in note
    assert "shoulder" not in note
    standard[30] = 1.0 / 7.0
    (note,) = (note for note in urdf_text(branched, standard)[1] if "rotor_inertia" in note)
    # 1/7 kg m^2 at the joint behind 50 turns a turn.
    assert "wrist: 5.714e-05" in note


def test_a_rotor_inertia_that_the_description_overrides_is_reported(tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_bytes(load_robot().urdf.read_bytes())
    path = tmp_path / "robot.yaml"
    path.write_text("urdf: arm.urdf\neffort_side: motor\njoints:\n  joint1: {rotor_inertia: 0.002}\n  joint2: {}\n")
    robot = load_robot(path)
    standard = robot.standard_parameters()
    standard[20] = 30.0
    text, notes = urdf_text(robot, standard)
    assert "<rotorInertia>0.003</rotorInertia>" in text
    assert notes == ("joint1: the robot description overrides <rotorInertia>; set its rotor_inertia to 0.003 kg m^2",)


def test_the_quill_keeps_its_nominal_inertia_when_the_rest_can_exist() -> None:
    robot = load_robot()
    standard = robot.standard_parameters()
    standard[10:20] += pin.Inertia(0.5, np.array([0.1, 0.0, 0.05]), 0.01 * np.eye(3)).toDynamicParameters()
    text, notes = urdf_text(robot, standard)
    assert notes == ()
    root = ElementTree.fromstring(text.encode())
    assert number(root, "link[@name='link3']/inertial/mass", "value") == 3.0
    assert number(root, "link[@name='link2']/inertial/mass", "value") == pytest.approx(8.0, rel=1e-15)


def test_a_body_too_light_for_its_nominal_quill_is_shared_in_proportion() -> None:
    robot = load_robot()
    standard = robot.standard_parameters()
    standard[10:20] *= 0.2
    text, (note,) = urdf_text(robot, standard)
    assert "link2" in note and "link3" in note and "0.2 of their nominal mass" in note and "joint3 at 0" in note
    now, nominal = ElementTree.fromstring(text.encode()), ElementTree.parse(robot.urdf).getroot()
    for name in ("link2", "link3"):
        # A body with all its mass scaled alike keeps its centre and scales its moments.
        for tag, key in (("mass", "value"), ("inertia", "iyy"), ("inertia", "izz")):
            path = f"link[@name='{name}']/inertial/{tag}"
            assert number(now, path, key) == pytest.approx(0.2 * number(nominal, path, key), rel=1e-11)


def test_a_carried_link_that_gives_its_mass_away_loses_its_inertial(tmp_path: Path) -> None:
    path = tmp_path / "rod.urdf"
    inertia = '<inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/>'
    path.write_text(
        '<robot name="rod"><link name="base"/>'
        f'<link name="rod"><inertial><mass value="1"/>{inertia}</inertial></link>\n'
        f'<link name="tip">\n <inertial><mass value="1"/>{inertia}</inertial>\n</link>'
        '<joint name="hinge" type="continuous"><parent link="base"/><child link="rod"/><axis xyz="0 0 1"/></joint>'
        '<joint name="weld" type="fixed"><parent link="rod"/><child link="tip"/><origin xyz="1 0 0"/></joint></robot>'
    )
    robot = load_robot(path)
    standard = np.array([0.5, 0.1, 0, 0, 0.1, 0, 0.1, 0, 0, 0.1, 0.0])
    text, (note,) = urdf_text(robot, standard)
    assert '<link name="tip">\n</link>' in text
    assert "tip none" in note
    found = pin.buildModelFromXML(text).inertias[1].toDynamicParameters()
    np.testing.assert_allclose(found, standard[:10], atol=1e-16)


def test_a_file_that_is_gone_is_one_line(branched: Robot) -> None:
    branched.urdf.unlink()
    with pytest.raises(ScaraIdentError, match=r"branched\.urdf: cannot be read: No such file or directory$"):
        urdf_text(branched, branched.standard_parameters())


def test_another_encoding_becomes_utf8(branched: Robot) -> None:
    text = branched.urdf.read_text().replace("version='1.0'", "version='1.0' encoding='ISO-8859-1'")
    branched.urdf.write_bytes(text.replace("data sheet", "Fußnote").encode("latin-1"))
    exported, notes = urdf_text(branched, random_standard(branched, 0))
    assert exported.startswith("<?xml version='1.0' encoding='utf-8'?>")
    assert "Fußnote" in exported
    assert "branched.urdf was in another encoding; this is UTF-8" in notes


def test_relative_meshes_are_reported(branched: Robot) -> None:
    _, notes = urdf_text(branched, random_standard(branched, 0))
    assert notes[0] == "names of meshes are relative to the folder of the original branched.urdf"
