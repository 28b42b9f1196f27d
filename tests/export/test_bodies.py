from __future__ import annotations

import re

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scara_ident.errors import ScaraIdentError
from scara_ident.export.bodies import Member, body_about_com, body_parameters, check_standard, share
from scara_ident.robot.robot import load_robot
from tests.export.arms import Array

SEEDS = st.integers(0, 2**31)


def possible_body(rng: np.random.Generator, mass: float) -> Array:
    points = np.vstack([rng.normal(0.0, 0.2, (3, 8)), np.ones(8)])
    pseudo = mass / 8 * points @ points.T
    return np.asarray(pin.PseudoInertia.FromMatrix(pseudo).toDynamicParameters())


def pseudo_matrix(parameters: Array) -> Array:
    return np.asarray(pin.PseudoInertia.FromDynamicParameters(parameters).toMatrix())


@given(seed=SEEDS, light=st.sampled_from([1e-3, 0.3, 3.0, 30.0]), empty=st.booleans())
@settings(max_examples=40)
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


@given(seed=SEEDS)
@settings(max_examples=20)
def test_a_body_that_was_stretched_has_its_links_stretched_alike(seed: int) -> None:
    """A stretch without rotation is the shortest way from one mass distribution to another, so it is found."""
    rng = np.random.default_rng(seed)
    bodies = [possible_body(rng, mass) for mass in (1.0, 2.0)]
    shape = rng.normal(size=(3, 3))
    stretch = np.eye(4)
    stretch[:3, :3] = 0.2 * np.eye(3) + 0.1 * shape @ shape.T
    stretch[:3, 3] = rng.normal(size=3)
    stretched = [0.1 * stretch @ pseudo_matrix(body) @ stretch.T for body in bodies]
    composite = pin.PseudoInertia.FromMatrix(sum(stretched)).toDynamicParameters()
    members = [Member(f"{k}", pin.SE3.Identity(), body) for k, body in enumerate(bodies)]
    parts, note = share(composite, members)
    assert note is not None and "0.1 of their nominal mass" in note
    for part, expected in zip(parts, stretched, strict=True):
        np.testing.assert_allclose(pseudo_matrix(part), expected, rtol=0, atol=1e-9 * np.max(np.abs(expected)))


def test_a_point_mass_beside_a_nominal_tool_is_the_moving_link_s_alone_when_the_nominal_is_flat() -> None:
    thin = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])  # two points: a body without volume
    members = [Member("moving", pin.SE3.Identity(), thin), Member("tool", pin.SE3(np.eye(3), np.ones(3)), thin)]
    parts, note = share(0.5 * thin, members)
    np.testing.assert_array_equal(parts[0], 0.5 * thin)
    assert not np.any(parts[1])
    assert note is not None and "moving holds all of it and tool none" in note


@given(seed=SEEDS)
@settings(max_examples=20)
def test_a_body_about_its_centre_of_mass_is_pinocchio_s_inertia(seed: int) -> None:
    parameters = possible_body(np.random.default_rng(seed), 2.0)
    body, reference = body_about_com(parameters), pin.Inertia.FromDynamicParameters(parameters)
    assert body.mass == reference.mass
    np.testing.assert_allclose(body.com, reference.lever, atol=1e-15)
    np.testing.assert_allclose(body.inertia, reference.inertia, atol=1e-14)
    np.testing.assert_allclose(body_parameters(body), parameters, atol=1e-14)


def test_what_a_solver_leaves_below_zero_is_let_pass_and_cut_off() -> None:
    robot = load_robot()
    standard = robot.standard_parameters()
    standard[20] = -1e-12
    # A plate of 2 kg, thinner than nothing by what a solver is allowed.
    plate = pin.Inertia(2.0, np.array([0.1, 0.0, 0.0]), np.diag([0.02, 0.01, 0.03 + 2e-9]))
    standard[10:20] = plate.toDynamicParameters()
    assert np.linalg.eigvalsh(pseudo_matrix(standard[10:20]))[0] < -5e-10
    bodies, armature = check_standard(robot, standard)
    np.testing.assert_array_equal(armature, [0.0, standard[21]])
    np.testing.assert_array_equal(bodies.ravel(), standard[:20])
    standard[14:20] += 4e-9 * np.array([0, 0, 0, 0, 0, 1.0])
    with pytest.raises(ScaraIdentError, match="link2: its pseudo-inertia"):
        check_standard(robot, standard)


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
        check_standard(robot, standard)
    assert "\n" not in str(caught.value)


def test_a_moment_without_mass_is_refused() -> None:
    robot = load_robot()
    standard = robot.standard_parameters()
    standard[10], standard[11] = 0.0, 1e-3
    with pytest.raises(ScaraIdentError, match="link2: it has a first moment of mass but no mass"):
        check_standard(robot, standard)


def test_a_product_of_inertia_of_the_wrong_sign_is_refused() -> None:
    """Two points have it one way round only; the moments alone would not tell."""
    robot = load_robot()
    points = np.array([[0.3, 0.2, 0.1], [-0.3, -0.2, -0.1], [0.01, 0, 0], [0, 0.01, 0], [0, 0, 0.01]])
    body = sum((pin.Inertia(1.0, point, np.zeros((3, 3))) for point in points), pin.Inertia.Zero())
    standard = np.concatenate([body.toDynamicParameters(), robot.standard_parameters()[10:]])
    check_standard(robot, standard)
    standard[5] *= -1.0
    with pytest.raises(ScaraIdentError, match="link1: its pseudo-inertia"):
        check_standard(robot, standard)
