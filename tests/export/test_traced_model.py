"""Models as recorded arithmetic, against the models themselves: every effect that follows from the state."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scara_ident.effects import EffectTerm, Member, available_effects
from scara_ident.effects.effect import Effect
from scara_ident.effects.payload import PayloadOfRecordings
from scara_ident.effects.position import Spring
from scara_ident.effects.signals import ModelledEffect
from scara_ident.export.traced_model import TracedArray, trace_model, traced
from scara_ident.model.model import TorqueModel
from scara_ident.model.regressor.tracing import Scalar, Trace, compile_program
from tests.effects.test_position import lift
from tests.export.arms import scara, ur5
from tests.export.identified import identified, model_torque, states

OF_STATE = [effect for effect in available_effects() if effect.of_state]


def evaluated(model, values: tuple[Scalar, ...], motion) -> np.ndarray:
    program = compile_program(model.trace, list(enumerate(values)))
    inputs = np.concatenate([motion.q, motion.v, motion.a])
    out = np.zeros((len(values), motion.samples))
    program.evaluate(inputs, out, np.zeros((program.buffers, motion.samples)))
    return out


@pytest.mark.slow
@pytest.mark.parametrize("effect", OF_STATE, ids=lambda effect: f"{type(effect).__name__} {getattr(effect, 'way', '')}")
def test_every_effect_of_the_state_is_recorded_as_it_is(effect: Effect, tmp_path: Path) -> None:
    tried = 0
    for make in (scara, ur5, lift):
        robot = make(tmp_path)
        found = identified(robot, (effect.name,), samples=60)
        if not any(term.name == effect.name for term in found.model.terms):
            continue
        tried += 1
        model, motion = trace_model(found.model, found.value), states(robot, 5, 20)
        expected = model_torque(found, found.value, motion)
        torque = evaluated(model, model.torque, motion)
        # The model differentiates an encoder's error by differences.
        np.testing.assert_allclose(torque, expected, rtol=0, atol=1e-12 * np.max(np.abs(expected)))
    assert tried


def test_a_loss_is_recorded_as_that_of_an_arm_that_carries_nothing_and_has_its_spring(tmp_path: Path) -> None:
    robot = ur5(tmp_path)
    found = identified(robot, ("transmission_loss", "spring"), samples=60)
    payload, group = PayloadOfRecordings(frozenset(["empty"])), Member(None, partner=1)
    scene, motion = found.model.terms[-1].scene, states(robot, 5, 20)
    body = ModelledEffect(payload, group, (2.0,) * len(payload.columns(scene, group)))
    spring = ModelledEffect(Spring(), Member(5), (0.5,))
    alone, both = (replace(found, model=with_link_torques(found.model, item)) for item in ((spring,), (spring, body)))
    expected = model_torque(alone, alone.value, motion)
    model = trace_model(both.model, both.value)
    np.testing.assert_allclose(
        evaluated(model, model.torque, motion), expected, rtol=0, atol=1e-12 * np.max(np.abs(expected))
    )
    others = (model_torque(other, other.value, motion) for other in (found, both))
    assert all(np.max(np.abs(other - expected)) > 1e-6 * np.max(np.abs(expected)) for other in others)


def with_link_torques(model: TorqueModel, torques: tuple[ModelledEffect, ...]) -> TorqueModel:
    """The model whose gears transmit them."""
    terms = (
        replace(term, scene=replace(term.scene, link_torques=torques)) if isinstance(term, EffectTerm) else term
        for term in model.terms
    )
    return replace(model, terms=tuple(terms))


def test_mass_bias_and_friction_make_the_torque(models) -> None:
    for arm in ("scara", "panda"):
        found = models[arm, True]
        robot = found.robot
        model, motion = trace_model(found.model, found.value), states(robot, 6, 10)
        flat = tuple(entry for row in model.mass for entry in row)
        mass = evaluated(model, flat, motion).reshape(robot.n, robot.n, -1)
        parts = np.einsum("jkn,kn->jn", mass, motion.a) + evaluated(model, model.bias, motion)
        torque = evaluated(model, model.torque, motion)
        assert np.max(np.abs(parts + evaluated(model, model.friction, motion) - torque)) < 1e-13 * np.max(
            np.abs(torque)
        )
        at_joint = mass / robot.row_scale[:, None, None]
        np.testing.assert_allclose(at_joint, at_joint.transpose(1, 0, 2), rtol=1e-12, atol=1e-12)
        assert np.all(np.linalg.eigvalsh(np.moveaxis(at_joint, 2, 0)) > 0.0)


def test_what_does_not_follow_from_the_state_is_refused_by_name(tmp_path: Path) -> None:
    found = identified(scara(tmp_path), ("vibration", "warm_up", "spring"), samples=60)
    with pytest.raises(ValueError, match="warm_up: it does not follow from position, velocity and acceleration"):
        trace_model(found.model, found.value)
    value = found.value.copy()
    (warm_up,) = (term for term in found.model.terms if term.name == "warm_up")
    value[found.model.place(warm_up)] = 0.0
    trace_model(found.model, value)


def test_code_for_numbers_records_what_it_does() -> None:
    def code(x: np.ndarray) -> np.ndarray:
        columns = np.zeros_like(x)
        columns[0] = np.sign(x[1]) * np.exp(-((x[0] / 0.3) ** 2)) + 0.5 * np.abs(x[2])
        columns[1] = np.square(x[0]) - np.array([2.0]) * np.cos(x[1])
        np.sign(x[0], out=columns[2])
        columns[2] *= x[2] * x[2]
        return np.array([[1.0, 2.0, 0.0], [0.0, 1.0, -1.0]]) @ columns

    trace = Trace()
    recorded = code(traced([[trace.variable(k)] for k in range(3)]))
    assert isinstance(recorded, TracedArray)
    program = compile_program(trace, list(enumerate(recorded[:, 0].tolist())))
    inputs = np.random.default_rng(0).normal(size=(3, 20))
    inputs[:, 0] = 0.0
    out = np.zeros((2, 20))
    program.evaluate(inputs, out, np.zeros((program.buffers, 20)))
    np.testing.assert_allclose(out, code(inputs), rtol=1e-14, atol=1e-15)


def test_expressions_lie_below_infinity_and_below_nothing_else() -> None:
    x = traced([Trace().variable(0), 2.0])
    assert np.all(np.asarray(x < np.inf))
    with pytest.raises(TypeError, match="not known while it is recorded"):
        _ = x < 3.0
    np.testing.assert_array_equal(np.asarray(np.sin(traced([0.5, -0.5])), dtype=float), np.sin([0.5, -0.5]))
