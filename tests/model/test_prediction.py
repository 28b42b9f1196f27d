"""The torque of one state and of many is the regressor times the parameters, on every kind of arm."""

from __future__ import annotations

import copy
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from scara_ident.effects import EffectTerm, Member
from scara_ident.effects.gear import TransmissionLoss
from scara_ident.effects.payload import PayloadChange
from scara_ident.effects.periodic import TorqueRipple
from scara_ident.effects.position import Spring
from scara_ident.effects.presliding import Presliding
from scara_ident.effects.signals import ModelledEffect
from scara_ident.errors import UsageError
from scara_ident.model.model import TorqueModel, build_model
from scara_ident.model.prediction import Prediction, states
from scara_ident.model.terms.rigid_body import CHUNK
from scara_ident.robot.robot import Robot, load_robot
from tests.arms import ur5
from tests.effects.scenes import scene_of
from tests.export.arms import ARMS

Array = NDArray[np.float64]


def drawn(model: TorqueModel, count: int, seed: int = 1) -> tuple[Array, Array]:
    """Parameters, and q, v and a of states, shape (3, N, n)."""
    rng = np.random.default_rng(seed)
    return rng.standard_normal(len(model.columns)), 3.0 * rng.standard_normal((3, count, model.robot.n))


def expected(model: TorqueModel, value: Array, q: Array, v: Array, a: Array) -> Array:
    return np.einsum("jpn,p->nj", model.regressor(states(q.T, v.T, a.T)), value)


@pytest.mark.parametrize("arm", ARMS, ids=lambda arm: arm.__name__)
@pytest.mark.parametrize("name", ["complete", "reduced", "basic"])
def test_torque_is_the_regressor_times_the_parameters(arm: Callable[[Path], Robot], name: str, tmp_path: Path):
    model = build_model(arm(tmp_path), name)
    value, (q, v, a) = drawn(model, 30)
    v[::7] = 0.0
    torque = expected(model, value, q, v, a)
    found = Prediction(model, value)
    np.testing.assert_allclose(found(q, v, a), torque, rtol=1e-12, atol=1e-10)
    alone = np.array([found(*state) for state in zip(q, v, a, strict=True)])
    np.testing.assert_allclose(alone, torque, rtol=1e-12, atol=1e-10)
    assert found.left_out == ()


def test_long_arrays_lists_and_copies_are_the_same():
    model = build_model(load_robot())
    value, (q, v, a) = drawn(model, CHUNK + 5)
    found = Prediction(model, value)
    torque = found(q, v, a)
    np.testing.assert_allclose(torque[-3:], expected(model, value, q[-3:], v[-3:], a[-3:]), rtol=1e-12, atol=1e-10)
    assert found(q[0].tolist(), v[0].tolist(), a[0].tolist()).tolist() == found(q[0], v[0], a[0]).tolist()
    assert copy.deepcopy(found)(q[0], v[0], a[0]).tolist() == found(q[0], v[0], a[0]).tolist()
    assert found(q[:0], v[:0], a[:0]).shape == (0, 2)


def test_threads_do_not_write_into_each_others_states():
    model = build_model(ur5())
    value, (q, v, a) = drawn(model, 400)
    found = Prediction(model, value)
    one_by_one = [found(*state).tolist() for state in zip(q, v, a, strict=True)]
    with ThreadPoolExecutor(4) as pool:
        assert [row.tolist() for row in pool.map(found, q, v, a)] == one_by_one


def test_other_shapes_are_refused_in_one_line():
    found = Prediction(build_model(load_robot()), np.ones(15))
    for q, v in (([0.0], [0.0]), ([0.0, 0.0], [0.0]), ([[[0.0, 0.0]]], [[[0.0, 0.0]]])):
        with pytest.raises(UsageError, match=r"expected \(2,\) or \(N, 2\) for the joints joint1, joint2"):
            found(q, v, q)


def test_an_effect_of_the_state_is_in_it_and_one_with_a_memory_is_named():
    robot = load_robot()
    scene = scene_of(robot)
    base = scene.model
    terms = (EffectTerm(Presliding(), Member(0, (0.01,)), scene), EffectTerm(Spring(), Member(1), scene))
    model = TorqueModel("more", robot, (*base.terms, *terms))
    value, (q, v, a) = drawn(model, 20)
    found = Prediction(model, value)
    assert found.left_out == ("presliding of joint1",)
    torque = expected(base, value[:15], q, v, a)
    torque[:, 1] += value[16] * robot.drive_sign[1] * q[:, 1]
    np.testing.assert_allclose(found(q, v, a), torque, rtol=1e-12, atol=1e-10)
    np.testing.assert_allclose(found(q[3], v[3], a[3]), torque[3], rtol=1e-12, atol=1e-10)


@pytest.mark.parametrize("speed", [0.01, 1.0, 10.0])
def test_a_torque_per_motor_turn_is_in_it_at_any_speed(speed: float):
    robot = load_robot()
    scene = scene_of(robot)
    model = TorqueModel("more", robot, (*scene.model.terms, EffectTerm(TorqueRipple(), Member(0, (2.0,)), scene)))
    value = np.concatenate([scene.value, [0.03, 0.04]])
    found = Prediction(model, value)
    assert found.left_out == ()
    q = np.array([np.linspace(0.3, 0.3 + 2.0 * np.pi / robot.reduction[0], 40, endpoint=False), np.zeros(40)]).T
    v = np.array([np.full(40, speed), np.zeros(40)]).T
    turn = 2.0 * robot.reduction[0] * q[:, 0]
    ripple = found(q, v, 0.0 * q)[:, 0] - Prediction(scene.model, scene.value)(q, v, 0.0 * q)[:, 0]
    np.testing.assert_allclose(ripple, 0.03 * np.sin(turn) + 0.04 * np.cos(turn), atol=1e-12)
    alone = found(q[7], v[7], 0.0 * q[7])
    np.testing.assert_allclose(alone, found(q, v, 0.0 * q)[7], atol=1e-12)


def test_a_loss_beside_a_body_carried_in_some_recordings_is_predicted_without_it():
    robot = load_robot()
    scene, payload, member = scene_of(robot), PayloadChange(), Member(None, (1.0,))
    body = ModelledEffect(payload, member, (2.0,))
    loaded = replace(scene, link_torques=(body,))
    terms = [EffectTerm(TransmissionLoss(), Member(1, (0.1,)), loaded), EffectTerm(payload, member, loaded)]
    wide = TorqueModel("wide", robot, (*scene.model.terms, *terms))
    predict = Prediction(wide, np.concatenate([scene.value, [0.1, 2.0]]))
    assert predict.left_out == ("payload_change",)
    # Seconds apart, most of them later than the body came in the recordings.
    q, v, a = np.random.default_rng(0).uniform(-1.0, 1.0, (3, 20, robot.n))
    alone = EffectTerm(TransmissionLoss(), Member(1, (0.1,)), scene)
    empty = TorqueModel("empty", robot, (*scene.model.terms, alone))
    expected = Prediction(empty, np.concatenate([scene.value, [0.1]]))(q, v, a)
    np.testing.assert_allclose(predict(q, v, a), expected, rtol=0, atol=1e-12)
    np.testing.assert_allclose([predict(*state) for state in zip(q, v, a, strict=True)], expected, rtol=0, atol=1e-12)
