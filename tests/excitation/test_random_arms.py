"""Designs for arms and limits drawn at random, checked by Pinocchio and NumPy on a finer grid."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from scara_ident.excitation import BlockLogDet, Condition, Effort, LogDet, design_excitation, limits_of
from scara_ident.excitation.tool import tool_of
from scara_ident.excitation.watched_pairs import clearance_of
from scara_ident.model.model import build_model
from scara_ident.robot.robot import Robot, load_robot
from tests.arms import Link, rnea, write_urdf

pytestmark = pytest.mark.slow

RADIUS, FLOOR, MARGIN = 0.05, -0.9, 0.03
BALL = f'<sphere radius="{RADIUS}"/>'
CRITERIA = {"logdet": LogDet(), "cond": Condition(), "block": BlockLogDet((0, 1))}


def random_arm(random: np.random.Generator, reductions: bool, folder: Path) -> Robot:
    """Return two or three joints with balls; the first may slide, the others turn about axes out of line with it."""
    axes = np.eye(3)[random.permutation(3)]
    links = [
        Link(
            kind="prismatic" if k == 0 and random.random() < 0.3 else "revolute",
            axis=tuple(axes[k]),
            xyz=tuple(random.uniform(-0.4, 0.4, 3)),
            rpy=tuple(random.uniform(-1.0, 1.0, 3)),
            mass=float(random.uniform(0.5, 5.0)),
            com=tuple(random.uniform(-0.2, 0.2, 3)),
            inertia=tuple(random.uniform(0.02, 0.03, 3)),
            shape=BALL,
        )
        for k in range(int(random.integers(2, 4)))
    ]
    ratios = [float(x) for x in random.choice([-20.0, 30.0, 1.0], len(links))] if reductions else []
    return load_robot(write_urdf(folder / "arm.urdf", links, ratios))


def min_height(robot: Robot, q: np.ndarray) -> float:
    """Least height of the balls over all samples."""
    model, data, back = robot.model, robot.model.createData(), np.argsort(robot.order)
    coms = [inertia.lever for inertia in model.inertias][1:]
    heights = []
    for posture in q[back].T:
        pin.forwardKinematics(model, data, posture)
        heights.append(min(placement.act(com)[2] for placement, com in zip(list(data.oMi)[1:], coms, strict=True)))
    return min(heights) - RADIUS


def tool_by_pinocchio(robot: Robot, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Speed and acceleration of the tool at every sample, without gravity."""
    model, data = robot.model, robot.model.createData()
    frame = model.getFrameId(tool_of(robot).name, pin.FrameType.BODY)
    found = []
    back = np.argsort(robot.order)
    for k in range(q.shape[1]):
        full = pin.integrate(model, pin.neutral(model), q[back, k])
        pin.forwardKinematics(model, data, full, v[back, k], a[back, k])
        pin.updateFramePlacements(model, data)
        world = pin.LOCAL_WORLD_ALIGNED
        found.append(
            (
                np.linalg.norm(pin.getFrameVelocity(model, data, frame, world).linear),
                np.linalg.norm(pin.getFrameClassicalAcceleration(model, data, frame, world).linear),
            )
        )
    speed, push = np.array(found).T
    return speed, push


@given(
    seed=st.integers(0, 2**31),
    criterion=st.sampled_from(sorted(CRITERIA)),
    family=st.sampled_from(["fourier", "spline"]),
    share=st.floats(0.3, 1.0),
    acceleration=st.floats(3.0, 30.0),
    reductions=st.booleans(),
)
# Without looking for a smaller counterexample, which would take minutes.
@settings(max_examples=6, phases=(Phase.explicit, Phase.generate))
def test_every_design_keeps_its_limits_on_a_finer_grid_and_promises_what_numpy_says(
    seed, criterion, family, share, acceleration, reductions
):
    with tempfile.TemporaryDirectory() as folder:
        keep_limits(
            random_arm(np.random.default_rng(seed), reductions, Path(folder)),
            seed,
            criterion,
            family,
            share,
            acceleration,
        )


def keep_limits(robot, seed, criterion, family, share, acceleration):
    # Without offset, which the weight of a slide is.
    model = build_model(robot, "reduced")
    # Enough torque to hold the arm with room to move.
    torques = {name: float(limit) * 20.0 for name, limit in zip(robot.joints, robot.torque_limit, strict=True)}
    joints = range(robot.n)
    limits = limits_of(
        robot,
        share=share,
        torques=torques,
        accelerations={robot.joints[j]: 8.0 + j for j in joints},
        jerks={robot.joints[j]: 90.0 + j for j in joints if j != 1},
        tool_acceleration=acceleration,
        tool_speed=2.0,
        clearance=MARGIN,
    )
    # Under the tool nothing is asked, so that every arm has a motion.
    watched = clearance_of(robot, limits.lower, limits.upper, margin=MARGIN, floor=FLOOR)
    limits = replace(limits, clearance=watched)
    made = design_excitation(
        model,
        duration=4.0,
        harmonics=4,
        samples=100,
        family=family,
        criterion=CRITERIA[criterion],
        limits=limits,
        effort=Effort(starts=1, rounds=0, seed=seed, processes=1),
    )
    trajectory = made.trajectories[0]

    h = model.regressor(trajectory.motion(100)).transpose(2, 0, 1).reshape(-1, len(model.names))
    scale = np.linalg.norm(h, axis=0)
    log_det = np.linalg.slogdet((h / scale).T @ (h / scale))[1] + 2.0 * np.sum(np.log(scale))
    assert made.log_det == pytest.approx(log_det, abs=1e-6)
    assert np.sqrt(made.condition) == pytest.approx(np.linalg.cond(h), rel=1e-6)

    q, v, a = trajectory.at(np.linspace(0.0, 4.0, 10 * made.verified))
    assert np.all(q >= limits.lower[:, None]) and np.all(q <= limits.upper[:, None])
    assert np.all(np.abs(v) <= limits.velocity[:, None])
    jerk = trajectory.coefficients @ trajectory.basis.rows(np.linspace(0.0, 4.0, 10 * made.verified), 3).T
    assert np.all(np.abs(a) <= limits.acceleration[:, None]) and np.all(np.abs(jerk) <= limits.jerk[:, None])
    some = np.unique(np.concatenate([np.arange(0, q.shape[1], 61), np.argmax(np.abs(a), axis=1)]))
    rotor = (robot.reduction**2 * robot.rotor_inertia)[:, None] * a[:, some]
    torque = (rnea(robot, q[:, some], v[:, some], a[:, some]) + rotor) * robot.row_scale[:, None]
    assert np.all(np.abs(torque) <= limits.torque[:, None])
    speed, push = tool_by_pinocchio(robot, q[:, some], v[:, some], a[:, some])
    assert np.max(push) <= acceleration
    if "floor" in watched.groups:
        assert min_height(robot, q[:, some]) >= FLOOR + MARGIN
    assert np.max(speed) <= 2.0
    # More motion always tells more in all; a condition or a block may have its best within the limits.
    if criterion == "logdet":
        assert any(each.active for each in made.reached)
    assert np.max(np.abs(v[:, [0, -1]])) < 1e-9 and np.max(np.abs(a[:, [0, -1]])) < 1e-8
