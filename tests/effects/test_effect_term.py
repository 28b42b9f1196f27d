"""A member of a family in a torque model: its columns there are the family's, and its torque in a state is theirs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.effects import EffectTerm, Member, Signals
from scara_ident.effects.gear import TransmissionLoss
from scara_ident.effects.measurement import TimeDelay
from scara_ident.effects.payload import PayloadOfRecordings
from scara_ident.effects.position import Spring
from scara_ident.effects.signals import ModelledEffect
from scara_ident.errors import ScaraIdentError
from scara_ident.robot.robot import load_robot
from tests.effects.scenes import moving, scene_of
from tests.effects.test_effect import Hook


def test_columns_that_no_coefficient_names_are_an_error_in_a_model_too():
    class Torn(Hook):
        def signal_columns(self, signals, member):
            return [signals.time, signals.time]

    scene, item = scene_of(load_robot()), moving(load_robot(), 0.02)
    with pytest.raises(ScaraIdentError, match="effect hook: 1 coefficients, but 2 columns"):
        EffectTerm(Torn(), Member(0, (0.1,)), scene).fill(
            item, [np.empty((1, item.samples)), np.empty((0, item.samples))]
        )


def test_its_columns_are_those_of_the_family():
    scene, item = scene_of(load_robot()), moving(load_robot(), 0.02)
    term = EffectTerm(Spring(), Member(1), scene)
    rows = [np.empty((np.count_nonzero(row), item.samples)) for row in term.pattern]
    term.fill(item, rows)
    dense = term.regressor(item)
    np.testing.assert_array_equal(dense, Spring().regressor(Signals(scene, item), Member(1)))
    for joint, own in enumerate(rows):
        np.testing.assert_array_equal(own, dense[joint][term.pattern[joint]])
    assert (term.name, term.joint) == ("spring", "joint2")


def test_the_torque_in_a_state_is_that_of_its_columns_and_none_where_it_takes_more_than_a_state():
    scene, item = scene_of(load_robot()), moving(load_robot(), 0.02)
    term = EffectTerm(Spring(), Member(1), scene)
    torque = term.state_torque(np.array([0.05]))
    assert torque is not None
    found = np.array([torque(*(signal[:, k] for signal in (item.q, item.v, item.a))) for k in range(item.samples)]).T
    np.testing.assert_allclose(found, np.einsum("jkt,k->jt", term.regressor(item), [0.05]), rtol=0, atol=1e-15)
    assert EffectTerm(TimeDelay(), TimeDelay().members(scene)[0], scene).state_torque(np.array([0.01])) is None


def test_a_loss_in_a_state_is_that_of_what_a_state_tells_and_not_of_what_is_carried_at_times():
    scene, item = scene_of(load_robot()), moving(load_robot(), 0.02)
    spring = ModelledEffect(Spring(), Member(1), (0.05,))
    payload = PayloadOfRecordings()
    group = payload.in_recordings(scene, Member(None), frozenset(["m"]))
    body = ModelledEffect(payload, group, tuple(np.full(len(payload.columns(scene, group)), 0.1).tolist()))
    loss = EffectTerm(TransmissionLoss(), Member(1, (0.1,)), replace(scene, link_torques=(spring, body)))
    assert loss.in_state.scene.link_torques == (spring,)
    assert loss.in_state.in_state is loss.in_state
    known = EffectTerm(TransmissionLoss(), Member(1, (0.1,)), replace(scene, link_torques=(spring,)))
    assert known.in_state is known
    torque = loss.state_torque(np.array([0.1]))
    assert torque is not None
    found = np.array([torque(*(signal[:, k] for signal in (item.q, item.v, item.a))) for k in range(item.samples)]).T
    np.testing.assert_allclose(found, 0.1 * known.regressor(item)[:, 0], rtol=0, atol=1e-15)
    assert np.max(np.abs(loss.regressor(item) - known.regressor(item))) > 0.0
