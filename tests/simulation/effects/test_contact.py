"""A push against Pinocchio, in closed loop."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from scara_ident.errors import ScaraIdentError
from scara_ident.robot.robot import Robot
from scara_ident.simulation import ideal, parse_effect, simulate, virtual_arm
from scara_ident.simulation.spatial import configuration
from tests.arms import ur5
from tests.simulation.effects.runs import Array
from tests.simulation.made import left_over, scara, swing


def pushed(robot: Robot, link: str, q: Array, force: Array) -> Array:
    """Return ``J^T f`` at a link's origin on the effort side, shape (n, N)."""
    model, data = robot.model, robot.model.createData()
    back = np.argsort(robot.order)
    place = model.getFrameId(link)
    torque = []
    for x, f in zip(q.T, force.T, strict=True):
        full = configuration(model, x[back])
        jacobian = pin.computeFrameJacobian(model, data, full, place, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        torque.append((jacobian[:3].T @ f)[robot.order])
    return np.array(torque).T * robot.row_scale[:, None]


@pytest.mark.parametrize("link", ["tool0", "forearm_link"])
def test_the_drives_give_what_the_transposed_jacobian_asks_for(link: str) -> None:
    arm = ideal(virtual_arm(ur5()))
    effect = parse_effect(f"push:force=20,from=0.4,duration=0.5,direction=0/3/4,link={link}")
    motion = swing(arm.robot, 1.2, amplitude=0.2)
    result = simulate(arm, motion, effects=[effect])
    t, true = result.recording.time, result.true
    part = np.clip(np.minimum(t - 0.4, 0.9 - t) / 0.02, 0.0, 1.0)
    force = 20.0 * np.array([[0.0], [0.6], [0.8]]) * (0.5 - 0.5 * np.cos(np.pi * part))
    expected = -pushed(arm.robot, link, true.position, force)
    extra = left_over(arm, true)
    moving = np.isfinite(extra)
    np.testing.assert_allclose(extra[moving], expected[moving], atol=1e-9)
    # The loop is closed: the arm gives way and the controller brings it back.
    plain = simulate(arm, motion).true
    moved = np.abs(true.position - plain.position).max(axis=0)
    assert np.all(moved[t <= 0.4] == 0.0)
    assert moved.max() > 1e-3
    inner = (t > 0.42) & (t < 0.88)
    assert np.abs(true.effort - plain.effort)[:, inner].max() > 5.0
    assert np.all(expected[:, ~((t > 0.4) & (t < 0.9))] == 0.0)


def test_without_a_link_it_is_at_the_tool() -> None:
    arm = scara()
    words = "push:force=10,from=0.1,duration=0.2,direction=1/0.5/0"
    default, named = (
        simulate(arm, swing(arm.robot, 0.5), effects=[parse_effect(words + more)]).recording.effort
        for more in ("", f",link={arm.robot.links[-1]},point={'/'.join(str(x) for x in arm.tool)}")
    )
    np.testing.assert_allclose(default, named, atol=1e-12)


def test_steps_of_half_the_length_give_the_same_motion() -> None:
    arm = ideal(virtual_arm(ur5()))
    effect = parse_effect("push:force=30,from=0.0505,duration=0.3,edge=0.01,direction=0/1/1")
    runs = [simulate(arm, swing(arm.robot, 0.5, 0.2), effects=[effect], substeps=k) for k in (4, 8, 64)]
    way = np.abs(runs[2].true.position - simulate(arm, swing(arm.robot, 0.5, 0.2), substeps=64).true.position).max()
    errors = [np.abs(run.true.position - runs[2].true.position).max() / way for run in runs[:2]]
    assert errors[0] < 1e-4
    assert errors[1] < errors[0]


def test_it_is_in_the_recording_that_is_named_only() -> None:
    arm = virtual_arm()
    effect = parse_effect("push:from=0.1,duration=0.2,recording=swing_2")
    motion = swing(arm.robot, 0.5)
    one, two = (simulate(arm, motion, effects=[effect], repetition=k) for k in (1, 2))
    plain = [simulate(arm, motion, repetition=k).recording.effort for k in (1, 2)]
    assert (one.effects, two.effects[0].as_dict()["recording"]) == ((), "swing_2")
    np.testing.assert_array_equal(one.recording.effort, plain[0])
    assert np.abs(two.recording.effort - plain[1]).max() > 0.01


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("push:link=hand", "no link 'hand'; it has"),
        ("push:link=base_link", "no identified joint moves"),
        ("push:direction=0/0/0", "direction is zero"),
        ("push:from=-1", "from is -1; expected 0 or more s"),
        ("push:duration=0", "expected 0.001 or more s"),
    ],
)
def test_a_push_that_cannot_be_is_one_line(text: str, said: str) -> None:
    arm = replace(virtual_arm(ur5()))
    with pytest.raises(ScaraIdentError, match=said) as caught:
        simulate(arm, swing(arm.robot, 0.1, 0.1), effects=[parse_effect(text)])
    assert "\n" not in str(caught.value)
