"""The embedded arm: it loads everywhere, it is a real body, and it has the paper's inertial parameters."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree

import numpy as np
import pinocchio as pin
import pytest
import yourdfpy
from hypothesis import example, given, settings
from hypothesis import strategies as st

from scara_ident.paper import LINK_LENGTH, REDUCTION, table5_parameters
from tests.shared import ROOT

URDF = ROOT / "urdf" / "scara03.urdf"
JOINTS = ("joint1", "joint2", "joint3")
MOVING = ("link1", "link2", "link3")


@pytest.fixture(scope="module")
def model() -> pin.Model:
    return pin.buildModelFromUrdf(str(URDF))


@pytest.fixture(scope="module")
def description() -> yourdfpy.URDF:
    return yourdfpy.URDF.load(str(URDF))


def rotor_inertias() -> list[float]:
    actuators = ElementTree.parse(URDF).getroot().findall("transmission/actuator")
    return [float(actuator.findtext("rotorInertia", "")) for actuator in actuators]


def test_it_is_named_scara03_and_has_three_joints(model: pin.Model, description: yourdfpy.URDF) -> None:
    assert model.name == description.robot.name == "scara03"
    assert tuple(model.names)[1:] == tuple(description.actuated_joint_names) == JOINTS
    assert [model.joints[i].shortname() for i in (1, 2, 3)] == ["JointModelRZ", "JointModelRZ", "JointModelPZ"]


def test_yourdfpy_finds_nothing_to_complain_about(description: yourdfpy.URDF) -> None:
    assert description.validate()


@settings(max_examples=50)
@given(st.tuples(st.floats(-0.61, 3.75), st.floats(-2.18, 2.18), st.floats(-0.15, 0.0)))
@example((1.5457207815996857e-11, 1.0, 0.0))
def test_pinocchio_and_yourdfpy_agree_on_forward_kinematics(
    model: pin.Model, description: yourdfpy.URDF, q: tuple[float, float, float]
) -> None:
    data = model.createData()
    pin.framesForwardKinematics(model, data, np.array(q))
    # From far away: yourdfpy's scene graph skips a move of less than 1e-8 from the configuration before.
    description.update_cfg({name: value + 1.0 for name, value in zip(JOINTS, q, strict=True)})
    description.update_cfg(dict(zip(JOINTS, q, strict=True)))
    for link in MOVING:
        ours = data.oMf[model.getFrameId(link)].homogeneous
        np.testing.assert_allclose(description.get_transform(link), ours, rtol=0, atol=1e-12)


def test_the_tool_reaches_where_two_links_of_033_m_put_it(model: pin.Model) -> None:
    q = np.array([0.3, -1.1, -0.1])
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    expected = LINK_LENGTH * np.array([np.cos(0.3) + np.cos(-0.8), np.sin(0.3) + np.sin(-0.8)])
    np.testing.assert_allclose(data.oMf[model.getFrameId("link3")].translation[:2], expected, atol=1e-14)


def test_limits_are_the_published_ones(model: pin.Model) -> None:
    degrees = np.rad2deg([model.lowerPositionLimit[:2], model.upperPositionLimit[:2]])
    np.testing.assert_allclose(degrees, [[-35.0, -125.0], [215.0, 125.0]], rtol=1e-14)
    np.testing.assert_array_equal(model.upperVelocityLimit[:2], [3.77, 3.77])
    np.testing.assert_array_equal(model.upperEffortLimit[:2], [200.0, 200.0])
    assert model.lowerPositionLimit[2] == -0.15
    assert model.upperPositionLimit[2] == 0.0


def test_each_revolute_joint_has_a_transmission_of_reduction_100(description: yourdfpy.URDF) -> None:
    transmissions = ElementTree.parse(URDF).getroot().findall("transmission")
    assert [joint.get("name") for t in transmissions for joint in t.findall("joint")] == ["joint1", "joint2"]
    assert [t.findtext("actuator/mechanicalReduction") for t in transmissions] == ["100", "100"]
    assert [t.findtext("type") for t in transmissions] == ["transmission_interface/SimpleTransmission"] * 2
    # yourdfpy 0.0.60 has classes for transmissions but its loader never fills them, and would lose the text of
    # mechanicalReduction; a version that does read them must read these.
    read = [(t.joints[0].name, t.actuators[0].mechanical_reduction) for t in description.robot.transmission]
    assert read in ([], [("joint1", 100.0), ("joint2", 100.0)])


@pytest.mark.parametrize("joint", [1, 2, 3])
def test_every_link_is_a_possible_body(model: pin.Model, joint: int) -> None:
    body = model.inertias[joint]
    moments = np.linalg.eigvalsh(body.inertia)
    assert body.mass > 0.0
    assert moments[2] < moments[0] + moments[1]
    pseudo = pin.PseudoInertia.FromInertia(body).toMatrix()
    assert np.linalg.eigvalsh(pseudo)[0] > 1e-4


@pytest.mark.parametrize("link", MOVING)
def test_every_link_has_its_mass_inside_its_shape(description: yourdfpy.URDF, link: str) -> None:
    """Second moments about the middle of the bounding box cannot exceed those of mass on its faces."""
    corners = []
    for visual in description.link_map[link].visuals:
        shape = visual.geometry
        half = np.array(
            shape.box.size / 2
            if shape.box is not None
            else [shape.cylinder.radius, shape.cylinder.radius, shape.cylinder.length / 2]
        )
        centre = visual.origin[:3, 3]
        corners += [centre - half, centre + half]
    low, high = np.min(corners, axis=0), np.max(corners, axis=0)
    inertial = description.link_map[link].inertial
    com = inertial.origin[:3, 3]
    assert np.all((low < com) & (com < high))
    second = np.trace(inertial.inertia) / 2 * np.eye(3) - inertial.inertia
    spread = np.diag(second) / inertial.mass + (com - (low + high) / 2) ** 2
    assert np.all(spread < ((high - low) / 2) ** 2)


def test_with_the_rotors_it_has_the_OJD_column_of_table_5(model: pin.Model) -> None:
    arm = pin.buildReducedModel(model, [model.getJointId("joint3")], pin.neutral(model))
    link1, link2 = (arm.inertias[i].toDynamicParameters() for i in (1, 2))
    jm1, jm2 = rotor_inertias()
    expected = table5_parameters("OJD")[:5]
    found = [
        link1[9] + link2[0] * LINK_LENGTH**2 + jm1 * REDUCTION[0] ** 2,
        link2[1],
        link2[2],
        link2[9],
        jm2 * REDUCTION[1] ** 2,
    ]
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-15)


def test_the_locked_quill_does_not_change_the_inertial_parameters_with_its_height(model: pin.Model) -> None:
    found = [
        pin.buildReducedModel(model, [3], np.array([0.0, 0.0, height])).inertias[2].toDynamicParameters()
        for height in (0.0, -0.15)
    ]
    np.testing.assert_allclose(found[0][[0, 1, 2, 9]], found[1][[0, 1, 2, 9]], rtol=1e-14)


def test_every_part_has_a_coloured_shape(description: yourdfpy.URDF) -> None:
    colours = {material.name for material in description.robot.materials if material.color is not None}
    for link in ("base_link", *MOVING):
        visuals = description.link_map[link].visuals
        assert visuals
        assert all(visual.material.name in colours for visual in visuals)
