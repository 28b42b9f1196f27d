"""What the detector looks for is what the arm's torque would change by."""

from __future__ import annotations

import numpy as np

from scara_ident.effects.links import point_mass, tool_of
from scara_ident.motion.motion import Motion
from scara_ident.online.suspects import suspects_of
from scara_ident.robot.robot import load_robot
from tests.online.made import RATE, columns, model, signals, truth


def dense(states):
    found = []
    for own, each in zip(model().active, columns(*states), strict=True):
        wide = np.zeros((each.shape[1], len(model().columns)))
        wide[:, own] = each.T
        found.append(wide)
    return found


def test_a_payload_is_1_kg_at_the_tool():
    states, robot = signals(0.2), load_robot()
    suspects = suspects_of(model())
    tool = tool_of(robot)
    motion = Motion("m", "m", np.arange(float(states[0].shape[1])), *states, None, RATE)
    expected = np.einsum("jpt,p->jt", tool.columns(robot, motion), point_mass(tool.point))
    found = suspects.torques(dense(states), truth())[:, -1]
    assert suspects.names[-1] == ("payload_change", None, "kg")
    np.testing.assert_allclose(found, expected.ravel(), rtol=1e-9, atol=1e-12)


def test_shares_act_on_their_joint_only():
    states = signals(0.2)
    suspects, rows = suspects_of(model()), dense(states)
    found = suspects.torques(rows, truth())
    count = states[0].shape[1]
    assert suspects.names[:4] == tuple(
        (kind, f"joint{j}", "1") for kind in ("friction", "torque_scale") for j in (1, 2)
    )
    np.testing.assert_allclose(found[:count, 2], rows[0] @ truth())
    assert not np.any(found[count:, [0, 2]]) and not np.any(found[:count, [1, 3]])
    friction = [k for k, name in enumerate(model().names) if name in ("a02", "a12")]
    np.testing.assert_allclose(found[count:, 1], rows[1][:, friction] @ truth()[friction])
