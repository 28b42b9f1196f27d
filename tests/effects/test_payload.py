"""Payloads and counterbalances: columns against Pinocchio with another body, recovery of mass and time."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import yaml

from scara_ident.effects import Member
from scara_ident.effects.links import point_mass, tool_of
from scara_ident.effects.payload import (
    BODY_COLUMN_SHARE,
    BODY_COLUMNS,
    FreePayloadChange,
    GravityCounterbalance,
    PayloadChange,
    PayloadOfRecordings,
    shown_of,
)
from scara_ident.effects.periodic import TorqueRipple
from scara_ident.model.base_parameters import BODY_PARAMETERS
from scara_ident.model.model import build_model
from scara_ident.robot.robot import Robot, load_robot
from tests.arms import PLANAR_2R, Link, example_urdf, recorded_torque, recording, rnea, sines, ur5, write_urdf
from tests.effects.intervals import RATE, arms, run, seen
from tests.effects.scenes import columns, fit, moving, scene_of
from tests.simulation.made import tree

FRICTION = ((0.1, 0.05, -0.004, 0.0, 0.02), (0.04, 0.03, 0.0, 0.0, -0.01))


def laden(robot: Robot, mass: float, point: np.ndarray) -> Robot:
    """The robot with a ball of no size at a point of its last joint's frame."""
    model = robot.model.copy()
    model.appendBodyToJoint(model.njoints - 1, pin.Inertia(mass, point, np.zeros((3, 3))), pin.SE3.Identity())
    return replace(robot, model=model)


@pytest.mark.parametrize("name", ["scara03", "ur5", "tree"])
def test_the_column_is_the_torque_of_a_ball_at_the_tool(name: str, tmp_path: Path):
    robot = {
        "scara03": load_robot,
        "ur5": lambda: load_robot(example_urdf("ur5_robot.urdf")),
        "tree": lambda: tree(tmp_path),
    }[name]()
    item = moving(robot, 1.0)
    point = tool_of(robot).point
    state = (item.q, item.v, item.a)
    added = (rnea(laden(robot, 1.5, point), *state) - rnea(robot, *state)) * robot.row_scale[:, None]
    scene = scene_of(robot)
    column = columns(PayloadChange(), scene, item, Member(None, (0.5,)))[:, 0]
    late = item.time > 0.501
    early = item.time < 0.499
    assert np.abs(1.5 * column - added)[:, late].max() < 1e-9 * np.abs(added).max()
    assert np.all(column[:, early] == 0.0)
    scene, effect = scene_of(robot, start={"other": -1.0, "m": 0.0}), PayloadOfRecordings()
    always = columns(effect, scene, item, effect.in_recordings(scene, Member(None), frozenset(["m"])))
    shown = [
        BODY_PARAMETERS.index(column.name.removeprefix("payload_")) for column in effect.columns(scene, Member(None))
    ]
    torque = np.einsum("jkn,k->jn", always, 1.5 * point_mass(point)[shown])
    assert np.abs(torque - added).max() < 1e-9 * np.abs(added).max()
    other = effect.in_recordings(scene, Member(None), frozenset(["other"]))
    assert not np.any(columns(effect, scene, item, other))


def test_a_payload_mounted_anyhow_has_the_columns_that_its_torque_shows():
    scene = scene_of(load_robot())
    free = FreePayloadChange()
    member = Member(None, (0.0,))
    names = [column.name for column in free.columns(scene, member)]
    assert names == ["payload_m", "payload_mx", "payload_my", "payload_Izz"]
    item = moving(scene.robot, 1.0)
    point = np.array([0.2, -0.1, 0.05])
    state = (item.q, item.v, item.a)
    added = (rnea(laden(scene.robot, 2.0, point), *state) - rnea(scene.robot, *state)) * 0.01
    body = 2.0 * point_mass(point)[[0, 1, 2, 9]]
    column = columns(free, scene, item, member)
    assert np.abs(np.einsum("jkn,k->jn", column, body) - added)[:, 1:].max() < 1e-9 * np.abs(added).max()
    found = free.parameters(scene, member, body, np.diag(np.full(4, 0.01)))
    assert found["mass"].value == 2.0
    assert found["mx"].value == pytest.approx(0.4)
    assert found["mx"].unit == "kg m"


def test_where_the_few_are_believed_all_columns_are_tried():
    scene = scene_of(ur5())
    few = FreePayloadChange()
    full = few.in_full()
    assert full is not None and full.in_full() is None
    member = Member(None, (0.0,))
    names, more = ([column.name for column in item.columns(scene, member)] for item in (few, full))
    assert set(names) < set(more) and len(more) == 10
    assert [column.name for column in full.columns(scene, member)[full.essential(scene, member)]] == ["payload_m"]
    item = moving(scene.robot, 1.0)
    place = [more.index(name) for name in names]
    np.testing.assert_array_equal(columns(full, scene, item, member)[:, place], columns(few, scene, item, member))


def made(robot: Robot, seed: int, name: str, mass: float, since: float = 0.0):
    rng = np.random.default_rng(seed)
    time = np.arange(6000) / 500.0
    q, v, a = sines(rng, time, 2, size=0.9, lowest=0.3)
    u = recorded_torque(robot, q, v, a, FRICTION)
    after = recorded_torque(laden(robot, mass, tool_of(robot).point), q, v, a, FRICTION)
    u = np.where(time < since, u, after)
    return recording(robot, name, time, q, u + 0.02 * rng.standard_normal(u.shape))


def test_mass_and_time_are_recovered():
    robot = load_robot()
    data = [made(robot, k, f"t{k}_1", 1.2, since=5.3) for k in range(2)]
    effect = PayloadChange()
    rest = {}
    for time in (5.0, 5.3, 5.6):
        scene, value, covariance = fit(build_model(robot), data, effect, Member(None, (time,)), rounds=1)
        rest[time] = value[0]
        if time == 5.3:
            found = effect.parameters(scene, Member(None, (time,)), value, covariance)["mass"]
            assert found.value == pytest.approx(1.2, abs=4.0 * found.std)
            assert found.std < 0.02
    # At the right time the mass is largest: before and after, part of it is not there.
    assert max(rest, key=lambda time: rest[time]) == 5.3


def test_the_instants_cover_the_run_and_a_shift_of_less_than_a_sample_changes_the_column():
    scene = scene_of(load_robot())
    times = [member.nonlinear[0] for member in PayloadChange().members(scene)]
    assert np.diff([0.0, *times, scene.duration]).max() < 1.2
    item = moving(scene.robot, 1.0)
    near = [columns(PayloadChange(), scene, item, Member(None, (t,))) for t in (0.4, 0.4003)]
    assert np.any(near[0] != near[1])


@pytest.mark.parametrize("family", [PayloadChange(), FreePayloadChange()])
def test_an_instant_while_the_arm_rests_is_known_as_badly_as_it_rests_long(tmp_path: Path, family: PayloadChange):
    """5.91 +- 0.01 s of a payload taken up at 6 s, between two moves."""
    robots = arms(tmp_path)
    moves = run(robots, 0, {})
    at, rest = np.searchsorted(moves.time, 5.0), 300
    time = moves.time[0] + np.arange(len(moves.time) + rest) / RATE
    position, effort = (
        np.insert(item, at, np.repeat(item[:, at : at + 1], rest, axis=1).T, axis=1)
        for item in (moves.position, moves.effort)
    )
    scene, _ = seen(robots[0], [replace(moves, time=time, position=position, effort=effort)])
    (moving, resting) = (replace(family.members(scene)[0], nonlinear=(instant,)) for instant in (2.0, 5.5))
    assert family.gap(scene, moving)[0] < 0.1
    assert family.gap(scene, resting)[0] == pytest.approx(rest / RATE, abs=0.3)


def test_the_payload_of_some_recordings_is_recovered():
    robot = load_robot()
    data = [made(robot, k, f"t_{k}", 0.8 * (k in (1, 3))) for k in range(4)]
    start = {item.name: float(item.time[0]) for item in data}
    scene, effect = scene_of(robot, start=start), PayloadOfRecordings()
    member = effect.in_recordings(scene, Member(None), frozenset(["t_1", "t_3"]))
    assert effect.description(scene, member) == "a payload in t_1, t_3 and not in the others"
    scene, value, covariance = fit(build_model(robot), data, effect, member, rounds=1)
    found = effect.parameters(scene, member, value, covariance)
    assert found["mass"].value == pytest.approx(0.8, abs=4.0 * found["mass"].std)
    # Without mass there is no body, whatever else of it seems to differ.
    assert [column.name for column in effect.columns(scene, member)[effect.essential(scene, member)]] == ["payload_m"]
    # A mass mounted anyhow is less sure than one at the tool.
    assert found["mass"].std < 0.05
    point = tool_of(robot).point
    for name, true in (("com_x", point[0]), ("com_y", point[1])):
        assert found[name].value == pytest.approx(true, abs=4.0 * found[name].std)
        assert found[name].std < 0.02
    # Where its place is known the mass is all there is to estimate.
    known = PayloadOfRecordings(at_tool=True)
    scene, mass, spread = fit(build_model(robot), data, known, member, rounds=1)
    assert known.parameters(scene, member, mass, spread)["mass"].value == pytest.approx(
        0.8, abs=4.0 * spread[0, 0] ** 0.5
    )
    assert spread[0, 0] ** 0.5 < 0.02
    assert "negative" in str(effect.inadmissible(scene, member, -value, np.sqrt(np.diag(covariance))))


@pytest.mark.parametrize(("inertia", "said"), [(0.048, "no removed body"), (0.15, "carry less than the others")])
def test_a_negative_mass_with_moments_of_no_body_is_not_said_to_be_carried_less(inertia: float, said: str):
    """An Airbot's loaded run: -0.46 kg with a first moment of 0.24 kg m, 0.5 m off, and a moment of inertia of 0.048 kg m^2."""
    robot, effect = load_robot(example_urdf("ur5_robot.urdf")), PayloadOfRecordings()
    scene = scene_of(robot, start={"A_1": 0.0, "B_1": 0.0})
    member = effect.in_recordings(scene, Member(None), frozenset(["B_1"]))
    body = {"payload_m": -0.462, "payload_mz": 0.243, "payload_Ixx": -inertia, "payload_Iyy": -inertia}
    size = {"payload_m": 0.058, "payload_mz": 0.017, "payload_Ixx": 0.005, "payload_Iyy": 0.005}
    names = [column.name for column in effect.columns(scene, member)]
    assert {*body} <= {*names}
    value, std = (np.array([each.get(name, 0.001) for name in names]) for each in (body, size))
    assert said in str(effect.inadmissible(scene, member, value, std))


def test_no_arm_carries_more_than_it_weighs():
    scene = scene_of(load_robot())
    std = np.array([0.1])
    assert "more than" in str(PayloadChange().inadmissible(scene, Member(None, (1.0,)), np.array([80.0]), std))
    assert PayloadChange().inadmissible(scene, Member(None, (1.0,)), np.array([-2.0]), std) is None
    body, spread = np.array([1.0, 0.3, 0.0, -0.1]), np.full(4, 0.01)
    assert "opposite" in str(FreePayloadChange().inadmissible(scene, Member(None, (1.0,)), body, spread))


def test_a_counterbalance_is_tried_where_gravity_acts(tmp_path: Path):
    assert GravityCounterbalance().members(scene_of(load_robot())) == ()
    scene = scene_of(load_robot(write_urdf(tmp_path / "arm.urdf", PLANAR_2R)))
    effect = GravityCounterbalance()
    assert [member.joint for member in effect.members(scene)] == [0, 1]
    item = moving(scene.robot, 1.0)
    column = columns(effect, scene, item, Member(1))
    assert column[1, 0] == pytest.approx(np.sin(item.q[1]))
    value = np.array([3.0 * np.cos(0.4), 3.0 * np.sin(0.4)])
    found = effect.parameters(scene, Member(1), value, np.diag([0.01, 0.01]))
    assert found["torque"].value == pytest.approx(3.0)
    assert found["phase"].value == pytest.approx(0.4)
    assert found["torque"].std == pytest.approx(0.1)
    assert found["phase"].std == pytest.approx(0.1 / 3.0)
    assert column[1].T @ value == pytest.approx(3.0 * np.sin(item.q[1] + 0.4))
    # So that its words name the other as well.
    ripple = columns(TorqueRipple(), scene, item, Member(1, (1.0 / float(scene.robot.reduction[1]),)))
    np.testing.assert_allclose(column, ripple, atol=1e-9)
    assert "a ripple once per its turn" in effect.description(scene, Member(1))


def test_a_counterbalance_without_a_gear_has_a_ripple_of_its_columns(tmp_path: Path):
    scene = scene_of(load_robot(write_urdf(tmp_path / "arm.urdf", PLANAR_2R)))
    ((ripple, member),) = GravityCounterbalance().same_columns(scene, Member(1))
    item = moving(scene.robot, 1.0)
    np.testing.assert_allclose(
        columns(ripple, scene, item, member), columns(GravityCounterbalance(), scene, item, Member(1)), atol=1e-12
    )
    geared = scene_of(replace(scene.robot, reduction=np.array([100.0, -100.0])))
    assert GravityCounterbalance().same_columns(geared, Member(1)) == ()


@pytest.mark.parametrize("metre", [0.02, 50.0])
def test_what_a_torque_tells_of_a_payload_does_not_depend_on_the_unit_of_length(tmp_path: Path, metre: float):
    """The same arm with lengths in another unit; forces and gravity with them."""
    found = []
    for unit in (1.0, metre):
        links = [
            Link(com=(0.2 * unit, 0.0, 0.0), xyz=(0.0, 0.0, 0.3 * unit)),
            Link(com=(0.1 * unit, 0.0, 0.0), xyz=(0.4 * unit, 0.0, 0.0)),
            Link("prismatic", com=(0.0, 0.0, 0.0), xyz=(0.3 * unit, 0.0, 0.0)),
        ]
        path = write_urdf(tmp_path / f"{unit}.urdf", links)
        path.write_text(path.read_text().replace('lower="-3" upper="3"', f'lower="0" upper="{0.2 * unit}"'))
        description = {"urdf": str(path), "effort_side": "joint", "joints": {"j1": {}, "j2": {}, "j3": {}}}
        text = yaml.safe_dump(description | {"gravity": [0.0, 0.0, -9.81 * unit]}, sort_keys=False)
        (tmp_path / "robot.yaml").write_text(text)
        robot = load_robot(tmp_path / "robot.yaml")
        found.append((shown_of(robot), shown_of(robot, BODY_COLUMNS, BODY_COLUMN_SHARE)))
    assert found[0] == found[1]
