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
from scara_ident.estimators.estimate import Estimate
from scara_ident.export.bodies import Member, share
from scara_ident.export.friction import JointFriction, friction_of
from scara_ident.export.urdf import urdf_text
from scara_ident.information import Information
from scara_ident.model import build_model
from scara_ident.robot import Robot, load_robot
from tests.export.arms import ARMS, BRANCHED_YAML, Array, joint_torque, random_motion, random_standard

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


def stripped(text: str) -> str:
    """All of a URDF but what the export may change, by rules of its own."""
    text = re.sub(r"\s*<inertial>.*?</inertial>", "", text, flags=re.DOTALL)
    text = re.sub(r"\s*<dynamics.*?/>", "", text, flags=re.DOTALL)
    # An empty link has to be opened to take an inertial.
    text = re.sub(r">\s*</link>", "></link>", re.sub(r"(<link [^>]*?)\s*/>", r"\1></link>", text))
    text = re.sub(r"\s*<!-- armature [^>]*-->", "", text)
    return re.sub(r"<rotorInertia>.*?</rotorInertia>", "", text)


@given(seed=SEEDS, like_nominal=st.booleans())
@settings(deadline=None, max_examples=12)
def test_pinocchio_gets_the_identified_torque_from_the_export(robot: Robot, seed: int, like_nominal: bool) -> None:
    if like_nominal and robot.name in ("carriage", "branched"):
        like_nominal = False  # they have links without inertial
    standard = random_standard(robot, seed, like_nominal=like_nominal)
    text, _ = urdf_text(robot, standard)
    q, v, a = random_motion(robot, seed)
    expected = joint_torque(robot, standard, q, v, a)
    found = pinocchio_torque(robot, reloaded(robot, text), q, v, a) + standard[10 * robot.n :, None] * a
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11 * np.sqrt(np.mean(expected**2)))


@given(seed=SEEDS)
@settings(deadline=None, max_examples=12)
def test_the_bodies_read_back_are_the_identified_ones(robot: Robot, seed: int) -> None:
    standard = random_standard(robot, seed)
    model = reloaded(robot, urdf_text(robot, standard)[0])
    for joint, name in enumerate(robot.joints):
        expected = standard[10 * joint : 10 * joint + 10]
        found = model.inertias[model.getJointId(name)].toDynamicParameters()
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * np.max(np.abs(expected)))


@given(seed=SEEDS, like_nominal=st.booleans())
@settings(deadline=None, max_examples=12)
def test_every_exported_link_can_exist(robot: Robot, seed: int, like_nominal: bool) -> None:
    standard = random_standard(robot, seed, like_nominal=like_nominal and robot.name not in ("carriage", "branched"))
    root = ElementTree.fromstring(urdf_text(robot, standard)[0].encode())
    for link in root.findall("link"):
        inertial = link.find("inertial")
        if inertial is None:
            continue
        mass = float(inertial.find("mass").get("value"))
        xx, xy, xz, yy, yz, zz = (
            float(inertial.find("inertia").get(key)) for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
        )
        moments = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        assert mass >= 0.0
        assert moments[2] <= moments[0] + moments[1] + 1e-12 * moments[2], link.get("name")
        assert moments[0] >= 0.0


@given(seed=SEEDS)
@settings(deadline=None, max_examples=6)
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
    damping = {name: arm.joint_map[name].dynamics.damping for name in branched.joints}
    assert damping == pytest.approx({"wrist": 50 * 0.4, "shoulder": 80 * 0.5, "branch": 400 * 0.6}, rel=1e-15)
    assert arm.joint_map["wrist"].dynamics.friction == pytest.approx(50 * 0.1, rel=1e-15)


def test_an_inserted_inertial_and_dynamics_are_laid_out_like_their_neighbours(branched: Robot) -> None:
    text, _ = urdf_text(branched, random_standard(branched, 0), JointFriction(np.ones(3), np.ones(3)))
    assert re.search(r'\n\t<link name="slide">\n\t\t<inertial>\n\t\t\t<origin .*/>\n\t\t\t<mass .*/>\n', text)
    assert '\n\t\t</inertial>\n\t</link>\n\t<link name="wrist">' in text
    assert '<!-- a screw -->\n\t\t<dynamics damping="400.0" friction="400.0"/>\n\t\t<!-- armature ' in text
    assert "<dynamics\n\t\t\tdamping = '80.0' friction=\"80.0\"/>" in text
    assert "<!-- from the data sheet -->" in text


def test_line_ends_stay_as_they_are(branched: Robot) -> None:
    content = branched.urdf.read_bytes().replace(b"\n", b"\r\n")
    branched.urdf.write_bytes(content)
    text, _ = urdf_text(branched, random_standard(branched, 0), JointFriction(np.ones(3), np.ones(3)))
    assert text.count("\r\n") == text.count("\n") > content.count(b"\n")


def test_exporting_an_export_again_changes_nothing(robot: Robot) -> None:
    standard = random_standard(robot, 5)
    friction = JointFriction(np.full(robot.n, 0.3), np.full(robot.n, 0.2))
    text, _ = urdf_text(robot, standard, friction)
    again = robot.urdf.read_bytes()
    assert text.encode() != again
    folder = robot.urdf.parent
    if not (folder / "robot.yaml").exists():
        pytest.skip("the URDF is not in a folder of this test")
    robot.urdf.write_text(text, encoding="utf-8", newline="")
    try:
        exported = load_robot(folder / "robot.yaml")
        np.testing.assert_allclose(
            exported.standard_parameters()[: 10 * robot.n], standard[: 10 * robot.n], rtol=0, atol=1e-13
        )
        parameters = np.concatenate([exported.standard_parameters()[: 10 * robot.n], standard[10 * robot.n :]])
        assert urdf_text(exported, parameters, friction)[0] == text
    finally:
        robot.urdf.write_bytes(again)


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


def test_a_rotor_inertia_that_the_description_overrides_is_told(tmp_path: Path) -> None:
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
    before, after = (yourdfpy.URDF.load(str(robot.urdf)), ElementTree.fromstring(text.encode()))
    quill = after.find("link[@name='link3']/inertial")
    assert float(quill.find("mass").get("value")) == before.link_map["link3"].inertial.mass == 3.0
    assert float(after.find("link[@name='link2']/inertial/mass").get("value")) == pytest.approx(8.0, rel=1e-15)


def test_a_body_too_light_for_its_nominal_quill_is_shared_in_proportion() -> None:
    robot = load_robot()
    standard = robot.standard_parameters()
    standard[10:20] *= 0.2
    text, (note,) = urdf_text(robot, standard)
    assert "link2" in note and "link3" in note and "0.2 of their nominal mass" in note and "joint3 at 0" in note
    root = ElementTree.fromstring(text.encode())
    for name in ("link2", "link3"):
        now, nominal = (
            ElementTree.parse(robot.urdf).getroot().find(f"link[@name='{name}']/inertial")
            if old
            else root.find(f"link[@name='{name}']/inertial")
            for old in (False, True)
        )
        # A body with all its mass scaled alike keeps its centre and scales its moments.
        assert float(now.find("mass").get("value")) == pytest.approx(0.2 * float(nominal.find("mass").get("value")))
        assert float(now.find("inertia").get("iyy")) == pytest.approx(
            0.2 * float(nominal.find("inertia").get("iyy")), rel=1e-11
        )


def possible_body(rng: np.random.Generator, mass: float) -> Array:
    points = np.vstack([rng.normal(0.0, 0.2, (3, 8)), np.ones(8)])
    pseudo = mass / 8 * points @ points.T
    return np.asarray(pin.PseudoInertia.FromMatrix(pseudo).toDynamicParameters())


def pseudo_matrix(parameters: Array) -> Array:
    return np.asarray(pin.PseudoInertia.FromDynamicParameters(parameters).toMatrix())


@given(seed=SEEDS, light=st.sampled_from([1e-3, 0.3, 3.0, 30.0]), empty=st.booleans())
@settings(deadline=None, max_examples=40)
def test_shares_add_up_and_each_can_exist(seed: int, light: float, empty: bool) -> None:
    rng = np.random.default_rng(seed)
    own = np.zeros(10) if empty else possible_body(rng, 2.0)
    members = [Member("moving", pin.SE3.Identity(), own)]
    members += [Member(f"carried{k}", pin.SE3.Random(), possible_body(rng, 1.0)) for k in range(2)]
    members.append(Member("frame", pin.SE3.Random(), np.zeros(10)))
    composite = possible_body(rng, light)
    parts, note = share(composite, members)
    placed = [
        member.placement.homogeneous @ pseudo_matrix(part) @ member.placement.homogeneous.T
        for member, part in zip(members, parts, strict=True)
    ]
    np.testing.assert_allclose(np.sum(placed, axis=0), pseudo_matrix(composite), rtol=0, atol=1e-13 * (light + 4.0))
    for part in parts:
        assert np.linalg.eigvalsh(pseudo_matrix(part))[0] >= -1e-13 * (light + 1.0)
    assert not np.any(parts[-1])
    if note is None:
        assert all(np.array_equal(part, m.parameters) for part, m in zip(parts[1:], members[1:], strict=True))


def test_the_shape_of_the_shares_does_not_depend_on_the_frame() -> None:
    rng = np.random.default_rng(4)
    bodies = [possible_body(rng, mass) for mass in (2.0, 1.0)]
    composite = possible_body(rng, 0.4)
    turn = pin.SE3.Random()

    def turned(parameters: Array) -> Array:
        matrix = turn.homogeneous @ pseudo_matrix(parameters) @ turn.homogeneous.T
        return np.asarray(pin.PseudoInertia.FromMatrix((matrix + matrix.T) / 2).toDynamicParameters())

    here = share(composite, [Member(f"{k}", pin.SE3.Identity(), body) for k, body in enumerate(bodies)])[0]
    there = share(turned(composite), [Member(f"{k}", pin.SE3.Identity(), turned(b)) for k, b in enumerate(bodies)])[0]
    for one, other in zip(here, there, strict=True):
        np.testing.assert_allclose(turned(one), other, atol=1e-12)


def test_a_point_mass_beside_a_nominal_tool_is_the_moving_link_s_alone_when_the_nominal_is_flat() -> None:
    thin = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])  # two points: a body without volume
    members = [Member("moving", pin.SE3.Identity(), thin), Member("tool", pin.SE3(np.eye(3), np.ones(3)), thin)]
    parts, note = share(0.5 * thin, members)
    np.testing.assert_array_equal(parts[0], 0.5 * thin)
    assert not np.any(parts[1])
    assert note is not None and "moving holds all of it and tool none" in note


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


@pytest.mark.parametrize(
    ("index", "value", "words"),
    [
        (10, -1.0, "link2: its mass is -1 kg"),
        (19, -1.0, "link2: its pseudo-inertia has the eigenvalue"),
        (21, -1.0, "joint2: its armature is -1; no real rotor"),
        (3, np.nan, "link1: its inertial parameters are not all finite"),
        (20, np.nan, "joint1: its armature is nan"),
    ],
)
def test_an_arm_that_cannot_exist_is_refused_by_name(index: int, value: float, words: str) -> None:
    robot = load_robot()
    standard = robot.standard_parameters()
    standard[index] = value
    with pytest.raises(ScaraIdentError, match=f"^{re.escape(words)}") as caught:
        urdf_text(robot, standard)
    assert "\n" not in str(caught.value)


def test_a_moment_without_mass_is_refused() -> None:
    robot = load_robot()
    standard = robot.standard_parameters()
    standard[10], standard[11] = 0.0, 1e-3
    with pytest.raises(ScaraIdentError, match="link2: it has a first moment of mass but no mass"):
        urdf_text(robot, standard)


def test_a_product_of_inertia_of_the_wrong_sign_is_refused() -> None:
    """Two points have it one way round only; the moments alone would not tell."""
    robot = load_robot()
    points = np.array([[0.3, 0.2, 0.1], [-0.3, -0.2, -0.1], [0.01, 0, 0], [0, 0.01, 0], [0, 0, 0.01]])
    body = sum((pin.Inertia(1.0, point, np.zeros((3, 3))) for point in points), pin.Inertia.Zero())
    standard = np.concatenate([body.toDynamicParameters(), robot.standard_parameters()[10:]])
    urdf_text(robot, standard)
    standard[5] *= -1.0
    with pytest.raises(ScaraIdentError, match="link1: its pseudo-inertia"):
        urdf_text(robot, standard)


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


def test_relative_meshes_are_told(branched: Robot) -> None:
    _, notes = urdf_text(branched, random_standard(branched, 0))
    assert notes[0] == "names of meshes are relative to the folder of the original branched.urdf"


def estimate_of(robot: Robot, name: str, values: dict[str, float], undetermined: tuple[str, ...] = ()) -> Estimate:
    model = build_model(robot, name)
    p = len(model.names)
    value = np.array([values.get(key, 0.0) for key in model.names])
    unknown = np.array([key in undetermined for key in model.names])
    return Estimate(model, "ols", value, np.eye(p), unknown, Information.empty(p), np.ones(robot.n), "nominal")


def test_friction_is_read_from_an_estimate_by_name() -> None:
    values = {"a01": 0.1, "a11": 0.2, "a02": 0.3, "a12": 0.4, "a21": 9.0, "a32": 9.0, "p_o1": 9.0, "P_d1": 9.0}
    friction = friction_of(estimate_of(load_robot(), "complete", values))
    assert friction is not None
    np.testing.assert_array_equal(friction.coulomb, [0.1, 0.3])
    np.testing.assert_array_equal(friction.viscous, [0.2, 0.4])
    assert friction.left_out == ("a21", "a31", "a22", "a32", "p_o1", "p_o2")
    basic = friction_of(estimate_of(load_robot(), "basic", values))
    assert basic is not None and basic.left_out == ("p_o1", "p_o2")


def test_friction_that_the_data_leave_open_stays_the_file_s() -> None:
    robot = load_robot()
    friction = friction_of(estimate_of(robot, "basic", {"a01": 0.1, "a12": 0.4}, undetermined=("a02", "a11")))
    text, notes = urdf_text(robot, robot.standard_parameters(), friction)
    assert re.findall(r"<dynamics.*/>", text) == ['<dynamics friction="10.0"/>', '<dynamics damping="40.0"/>']
    assert "joint1: viscous friction is not known and was not written" in notes


def test_friction_below_zero_is_not_written_and_told() -> None:
    robot = load_robot()
    text, notes = urdf_text(
        robot, robot.standard_parameters(), JointFriction(np.array([0.1, 0.1]), np.array([0.01, -0.02]))
    )
    assert '<dynamics damping="0.0" friction="10.0"/>' in text
    assert notes == ("joint2: viscous friction is -0.02; below zero it would drive the joint, so 0 was written",)


def test_friction_brakes_at_a_gear_that_reverses_as_the_model_has_it(branched: Robot) -> None:
    """The torque of the model's own friction columns, carried to the joint, is that of the exported file."""
    from scara_ident.motion import Motion
    from scara_ident.terms import Friction

    assert "reduction: -50" in BRANCHED_YAML
    term = Friction(branched, (0, 1))
    rng = np.random.default_rng(0)
    coulomb, viscous = rng.uniform(0.1, 1.0, (2, 3))
    text, _ = urdf_text(branched, branched.standard_parameters(), JointFriction(coulomb, viscous))
    joints = {joint.get("name"): joint.find("dynamics") for joint in ElementTree.fromstring(text).findall("joint")}
    _, v, a = random_motion(branched, 0)
    motion = Motion("run_1", "run", np.arange(v.shape[1]) * 0.01, v, v, a, None, 100.0)
    recorded = np.einsum("jpn,p->jn", term.regressor(motion), np.column_stack([coulomb, viscous]).ravel())
    for j, name in enumerate(branched.joints):
        damping, friction = (float(joints[name].get(key)) for key in ("damping", "friction"))
        at_joint = recorded[j] * branched.reduction[j]
        np.testing.assert_allclose(damping * v[j] + friction * np.sign(v[j]), at_joint, rtol=1e-13)
