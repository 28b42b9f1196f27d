"""The reduction to base parameters against independent ranks, published counts and invariance of torque."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from scara_ident.model.base_parameters import (
    BaseParameters,
    check_base_parameters,
    find_base_parameters,
    pseudo_inertia,
    standard_regressor,
)
from scara_ident.robot.robot import Robot, load_robot
from tests.arms import PLANAR_2R, Link, example_urdf, rnea, write_urdf

UR_WRIST = Link(axis=(0, 0, 1), xyz=(0.0, 0.1, 0.0), rpy=(1.5707963267948966, 0.0, 0.0), com=(0.01, 0.02, 0.05))


def two_fingers(folder: Path) -> Robot:
    """Two of the four fingers of a hand on a fixed base: a branched robot."""
    path = folder / "hand.yaml"
    joints = ", ".join(f"joint_{k}.0: {{}}" for k in (0, 1, 2, 12, 13, 14))
    path.write_text(f"urdf: {example_urdf('allegro_right_hand.urdf')}\njoints: {{{joints}}}\n", encoding="utf-8")
    return load_robot(path)


_ARMS: dict[str, Robot] = {}
_REDUCTIONS: dict[tuple[str, bool], BaseParameters] = {}


def arm(name: str, folder: Path) -> Robot:
    if name not in _ARMS:
        if name == "scara03":
            _ARMS[name] = load_robot()
        else:
            _ARMS[name] = two_fingers(folder) if name == "hand" else load_robot(example_urdf(f"{name}.urdf"))
    return _ARMS[name]


def reduction(name: str, folder: Path, rotor_inertia: bool = True) -> BaseParameters:
    """Return the reduction of an arm, made once for all tests."""
    if (name, rotor_inertia) not in _REDUCTIONS:
        found = find_base_parameters(arm(name, folder), rotor_inertia=rotor_inertia)
        _REDUCTIONS[name, rotor_inertia] = found
    return _REDUCTIONS[name, rotor_inertia]


ARMS = ("scara03", "double_pendulum", "ur5_robot", "ur10_robot", "panda", "hand")


def svd_rank(robot: Robot, rotor_inertia: bool) -> int:
    """Rank of Pinocchio's regressor sample by sample, armature columns put beside it; states of its own."""
    rng = np.random.default_rng(99)
    model, data = robot.model, robot.model.createData()
    rows = []
    for _ in range(max(40, 20 * robot.n)):
        q = pin.randomConfiguration(model, np.full(model.nq, -2.0), np.full(model.nq, 2.0))
        v, a = 3 * rng.uniform(-1, 1, (2, model.nv))
        columns = pin.computeJointTorqueRegressor(model, data, q, v, 5 * a).reshape(robot.n, -1)
        rows.append(np.hstack([columns, np.diag(5 * a)]) if rotor_inertia else columns.copy())
    stacked = np.vstack(rows)
    size = np.linalg.norm(stacked, axis=0)
    used = size > 1e-9 * size.max()
    singular = np.linalg.svd(stacked[:, used] / size[used], compute_uv=False)
    # The gap between what is there and rounding is wide; a threshold in it is no choice.
    rank = int(np.count_nonzero(singular > 1e-7 * singular[0]))
    assert singular[rank - 1] > 1e-5 * singular[0]
    assert rank == len(singular) or singular[rank] < 1e-12 * singular[0]
    return rank


@pytest.mark.parametrize("rotor_inertia", [True, False])
@pytest.mark.parametrize("name", ARMS)
def test_the_count_is_the_rank_of_pinocchios_regressor(tmp_path: Path, name: str, rotor_inertia: bool):
    robot, base = arm(name, tmp_path), reduction(name, tmp_path, rotor_inertia)
    assert base.count == svd_rank(robot, rotor_inertia)
    assert base.approximate == ()


@pytest.mark.parametrize(
    ("name", "rigid", "with_rotors"),
    [("scara03", 4, 5), ("double_pendulum", 6, 7), ("ur5_robot", 36, 40), ("ur10_robot", 36, 40)],
)
def test_the_count_is_the_known_one(tmp_path: Path, name: str, rigid: int, with_rotors: int):
    assert reduction(name, tmp_path, rotor_inertia=False).count == rigid
    assert reduction(name, tmp_path).count == with_rotors


def test_the_panda_arm_without_its_fingers_has_the_published_43(tmp_path: Path):
    """Gaz et al. 2019 find 43 dynamic coefficients without friction and rotors."""
    path = tmp_path / "panda.yaml"
    path.write_text(f"urdf: {example_urdf('panda.urdf')}\nlocked: {{panda_finger_joint1: 0, panda_finger_joint2: 0}}\n")
    assert find_base_parameters(load_robot(path), rotor_inertia=False).count == 43


@pytest.mark.parametrize("name", ARMS)
def test_the_check_passes(tmp_path: Path, name: str):
    check = check_base_parameters(arm(name, tmp_path), reduction(name, tmp_path))
    assert check.passed
    assert check.rank == check.count


@pytest.mark.slow
def test_a_humanoid_has_as_many_base_parameters_as_its_regressor_has_rank():
    robot = load_robot(example_urdf("talos_reduced.urdf"))
    base = find_base_parameters(robot)
    assert robot.n == 32
    assert check_base_parameters(robot, base).passed
    np.testing.assert_array_equal(find_base_parameters(robot, seed=5).kept, base.kept)


def test_the_check_does_not_pass_a_wrong_reduction():
    robot = load_robot()
    base = find_base_parameters(robot)
    fewer = replace(base, kept=base.kept[:-1], grouping=base.grouping[:-1])
    assert not check_base_parameters(robot, fewer).passed
    wrong = base.grouping.copy()
    wrong[0, 10] *= 1.0 + 1e-6
    assert not check_base_parameters(robot, replace(base, grouping=wrong)).passed


@pytest.mark.parametrize("name", ["scara03", "double_pendulum", "ur5_robot", "hand"])
def test_the_set_does_not_depend_on_the_seed(tmp_path: Path, name: str):
    robot = arm(name, tmp_path)
    first = reduction(name, tmp_path)
    for seed in range(1, 21 if robot.n < 4 else 4):
        other = find_base_parameters(robot, seed=seed)
        assert_same_set(first, other)


@pytest.mark.parametrize("name", ["ur10_robot", "panda"])
def test_the_set_of_larger_arms_does_not_depend_on_the_seed(tmp_path: Path, name: str):
    robot = arm(name, tmp_path)
    for seed in (20,):
        assert_same_set(reduction(name, tmp_path), find_base_parameters(robot, seed=seed))


def assert_same_set(one: BaseParameters, other: BaseParameters) -> None:
    np.testing.assert_array_equal(one.kept, other.kept)
    assert one.absent == other.absent
    np.testing.assert_allclose(one.grouping, other.grouping, atol=1e-10)
    assert [one.expression(k) for k in range(one.count)] == [other.expression(k) for k in range(other.count)]


@pytest.mark.parametrize("name", ARMS)
def test_torque_of_base_parameters_is_pinocchios(tmp_path: Path, name: str):
    """The whole way: URDF inertias and armatures, grouped, times the kept columns, is inverse dynamics."""
    robot, base = arm(name, tmp_path), reduction(name, tmp_path)
    rng = np.random.default_rng(3)
    q, v, a = (rng.uniform(-1.5, 1.5, (robot.n, 6)) for _ in range(3))
    regressor = standard_regressor(robot, q, v, a)[:, base.kept]
    rotors = rng.uniform(0.1, 1.0, robot.n)
    pi = robot.standard_parameters()
    pi[10 * robot.n :] = rotors
    expected = rnea(robot, q, v, a) + rotors[:, None] * a
    found = np.einsum("jpk,p->jk", regressor, base.grouping @ pi)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * np.max(np.abs(expected)) * robot.n)


def test_the_scara03_has_the_papers_parameters_written_out():
    base = find_base_parameters(load_robot())
    written = [base.expression(k) for k in range(base.count)]
    assert written == ["I1zz + 0.1089 m2 + 10000 Jm1", "mx2", "my2", "I2zz", "10000 Jm2"]
    assert base.units == ("kg m^2", "kg m", "kg m", "kg m^2", "kg m^2")
    assert {base.standard_names[k] for k in base.only_in_sums()} == {"I1zz", "m2", "Ia1"}
    assert {base.standard_names[k] for k in base.absent} >= {"m1", "mx1", "mz2", "I2xx"}


def test_a_joint_driven_without_a_gear_cannot_tell_its_rotor_from_its_link(tmp_path: Path):
    base = find_base_parameters(load_robot(write_urdf(tmp_path / "arm.urdf", (Link(axis=(0, 1, 0)),))))
    assert [base.expression(k) for k in range(base.count)] == ["mx1", "mz1", "I1yy + Jm1"]


def test_a_coefficient_of_minus_one_is_written_as_a_sign():
    rows = np.array([[0.0, -1.0, 1.0], [2.5, 0.0, 0.0]])
    made = BaseParameters(("a", "b", "c"), ("kg",) * 3, np.array([2, 0]), rows, (), (), np.zeros(3))
    assert made.expression(0) == "c - b"


def test_every_standard_parameter_is_accounted_for(tmp_path: Path):
    base = reduction("ur5_robot", tmp_path)
    entering = set(np.flatnonzero(np.any(base.grouping != 0.0, axis=0)))
    assert entering | set(base.absent) == set(range(66))
    assert not entering & set(base.absent)
    assert set(base.only_in_sums()) <= entering


def test_the_order_of_the_joints_in_the_description_permutes_the_set_only(tmp_path: Path):
    links = (*PLANAR_2R, UR_WRIST)
    write_urdf(tmp_path / "arm.urdf", links)
    found = []
    for joints in (("j1", "j2", "j3"), ("j3", "j1", "j2")):
        path = tmp_path / "robot.yaml"
        path.write_text(f"urdf: arm.urdf\njoints: {{{', '.join(f'{joint}: {{}}' for joint in joints)}}}\n")
        robot = load_robot(path)
        base = find_base_parameters(robot)
        assert check_base_parameters(robot, base).passed
        # (joint, parameter within the body, or 10 for the armature)
        names = [(joints[k // 10], int(k % 10)) if k < 30 else (joints[k - 30], 10) for k in base.kept]
        found.append(sorted(names))
    assert found[0] == found[1]


@pytest.mark.parametrize("factor", [1e-3, 1e3])
def test_the_unit_of_length_does_not_change_the_set(tmp_path: Path, factor: float):
    links = (*PLANAR_2R, UR_WRIST, Link(kind="prismatic", axis=(1, 0, 0), xyz=(0.1, 0.05, 0.2)))
    scaled = tuple(
        replace(
            link,
            xyz=tuple(factor * x for x in link.xyz),
            com=tuple(factor * x for x in link.com),
            inertia=tuple(factor**2 * x for x in link.inertia),
        )
        for link in links
    )
    one, other = (load_robot(write_urdf(tmp_path / f"{k}.urdf", made)) for k, made in enumerate((links, scaled)))
    stretched = replace(
        other,
        lower=np.where(other.prismatic, factor, 1.0) * other.lower,
        upper=np.where(other.prismatic, factor, 1.0) * other.upper,
    )
    base, changed = find_base_parameters(one), find_base_parameters(stretched)
    np.testing.assert_array_equal(base.kept, changed.kept)
    assert base.absent == changed.absent
    power = np.array([*([0, 1, 1, 1, 2, 2, 2, 2, 2, 2] * 4), 2, 2, 2, 0], dtype=float)
    expected = base.grouping * factor ** (power[base.kept][:, None] - power)
    np.testing.assert_allclose(changed.grouping, expected, rtol=1e-6, atol=1e-9 * np.max(np.abs(expected)))
    assert check_base_parameters(stretched, changed).passed


def test_an_angle_with_few_digits_is_said_and_gains_no_parameters(tmp_path: Path):
    counts, approximate = [], []
    for angle in (np.pi / 2, 1.5708):
        wrist = replace(UR_WRIST, rpy=(angle, 0.0, 0.0))
        links = (*PLANAR_2R, wrist, replace(wrist, xyz=(0.0, 0.0, 0.2)))
        base = find_base_parameters(load_robot(write_urdf(tmp_path / "arm.urdf", links)))
        counts.append(base.count)
        approximate.append(base.approximate)
    assert counts[0] == counts[1]
    assert approximate[0] == ()
    assert approximate[1]
    assert all(0 < share < 2e-5 for _, share in approximate[1])


def test_an_angle_with_few_digits_leaves_no_rotor_in_other_sums():
    """The xArm7's right angles have few digits; a column met exactly keeps its terms, however small."""
    base = find_base_parameters(load_robot("xarm7"))
    written = {name: base.expression(k) for k, name in enumerate(base.names)}
    assert "Ia2" in {base.standard_names[k] for k, _ in base.approximate}
    assert {name for name, text in written.items() if "Jm2" in text} == {"I2zz"}
    assert written["my3"] == "my3 - mz4 + 3.67321e-06 mz5"
    # What the sums leave of the torque is no more than the column itself had outside them.
    assert check_base_parameters(load_robot("xarm7"), base).torque_error < 1e-5


def test_single_joints_have_what_moves_them(tmp_path: Path):
    for link, lead in ((Link(), "I1zz"), (Link(kind="prismatic"), "m1")):
        robot = load_robot(write_urdf(tmp_path / "arm.urdf", (link,)))
        base = find_base_parameters(robot, rotor_inertia=False)
        # A vertical slide feels its weight, a vertical axis no gravity.
        assert base.names == (lead,)
        assert check_base_parameters(robot, base).passed


DIRECTIONS = st.sampled_from([(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.6, 0.0, 0.8), (0.0, -1.0, 0.0)])
OFFSETS = st.tuples(*[st.sampled_from([0.0, 0.1, -0.35, 0.5])] * 3)
ANGLES = st.tuples(*[st.sampled_from([0.0, 0.5 * np.pi, -0.7])] * 3)


@st.composite
def trees(draw: st.DrawFn) -> tuple[Link, ...]:
    count = draw(st.integers(1, 4))
    return tuple(
        Link(
            kind=draw(st.sampled_from(["revolute", "revolute", "continuous", "prismatic"])),
            axis=draw(DIRECTIONS),
            xyz=draw(OFFSETS),
            rpy=draw(ANGLES),
            parent=draw(st.integers(-2, i - 1).filter(lambda k: k != -1)) if i else -2,
        )
        for i in range(count)
    )


@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(trees(), st.booleans())
def test_any_tree_has_as_many_base_parameters_as_its_regressor_has_rank(
    tmp_path: Path, links: tuple[Link, ...], rotor_inertia: bool
):
    robot = load_robot(write_urdf(tmp_path / "tree.urdf", links))
    base = find_base_parameters(robot, rotor_inertia=rotor_inertia)
    assert base.count == svd_rank(robot, rotor_inertia)
    assert_same_set(base, find_base_parameters(robot, rotor_inertia=rotor_inertia, seed=5))
    check = check_base_parameters(robot, base)
    assert check.torque_error < 1e-10
    assert check.null_error < 1e-10


def test_the_pseudo_inertia_is_the_second_moment_of_a_body_of_points():
    rng = np.random.default_rng(0)
    mass, points = rng.uniform(0.1, 1.0, 12), rng.standard_normal((12, 3))
    inertia = sum(m * (x @ x * np.eye(3) - np.outer(x, x)) for m, x in zip(mass, points, strict=True))
    parameters = np.array(
        [mass.sum(), *(mass @ points), inertia[0, 0], inertia[0, 1], inertia[1, 1], *inertia[2, :2], inertia[2, 2]]
    )
    homogeneous = np.column_stack([points, np.ones(12)])
    np.testing.assert_allclose(pseudo_inertia(parameters), homogeneous.T @ (mass[:, None] * homogeneous), rtol=1e-12)
